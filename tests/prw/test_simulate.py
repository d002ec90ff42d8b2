"""The command `prw simulate`: its files, and one line on standard error for each mistake."""

from __future__ import annotations

import csv
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from built import ROOT, built
from instance import assert_close
from lagrange import OUTPUTS, linear_model, table_1
from reference import backward_slope, follow

from prw import simulate
from prw.recording import read_motion as read

EXAMPLES = ROOT / "examples"
#: A valid recording.
GOOD = "time,theta1,theta2\n0,0.1,0.2\n0.001,0.1,0.2\n0.002,0.1,0.2\n"
#: Largest file size in bytes: enough for the unpacked FMU, but too small for the table.
LIMIT = 4_000_000
ROWS = 40_000


def table(path: Any) -> Any:
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return dict(zip(rows[0], np.array(rows[1:], dtype=float).T))


def is_png(path: Any) -> Any:
    return path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_fig4(prw: Any, tmp_path: Path) -> None:
    result = prw("simulate")
    assert result.returncode == 0 and result.stderr == ""
    assert "out/fig4.csv" in result.stdout and "next" in result.stdout
    columns = table(tmp_path / "out" / "fig4.csv")
    assert list(columns) == ["time", "theta1", "theta2", "omega1", "omega2", *OUTPUTS]
    t = columns["time"]
    assert len(t) == 2001 and t[-1] == 2.0
    np.testing.assert_allclose(columns["omega1"], np.sin(10 * np.pi * t), atol=1e-15)
    np.testing.assert_array_equal(columns["omega2"], -columns["omega1"])
    np.testing.assert_allclose(columns["theta1"], (1 - np.cos(10 * np.pi * t)) / (10 * np.pi), atol=1e-15)
    assert np.max(np.abs(columns["pitch"])) <= 1e-14
    assert is_png(tmp_path / "out" / "fig4.png")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["fig4.csv", "fig4.png"]


@pytest.mark.parametrize("name", ["point_to_point", "point_to_point_polled"])
def test_examples(prw: Any, tmp_path: Path, name: Any) -> None:
    motion = read(EXAMPLES / f"{name}.csv")
    result = prw("simulate", "--input", EXAMPLES / f"{name}.csv", "--out", "here")
    assert result.returncode == 0 and result.stderr == ""
    assert ("record omega1 and omega2" in result.stdout) == (motion.omega is None)
    assert is_png(tmp_path / "here" / f"{name}.png")
    columns = table(tmp_path / "here" / f"{name}.csv")
    np.testing.assert_array_equal(columns["time"], motion.time)
    np.testing.assert_array_equal(columns["theta2"], motion.theta[:, 1])
    assert ("omega1" in columns) == (motion.omega is not None)
    slope = backward_slope(motion.time, motion.theta) if motion.omega is None else motion.omega
    expected, _ = follow(linear_model(table_1()), motion.time, motion.theta, slope)
    # The FMU and the oracle have different rounding errors.
    assert_close(columns, expected, 1e-10)
    for output in ("tau1", "tau2", "pitch_rate"):
        assert abs(columns[output][0]) < 1e-12, f"{output} is not zero at the start"


def test_measured_columns_are_compared(prw: Any, tmp_path: Path) -> None:
    """The recording is the solution of the equations with an offset and an alternating error of known sizes, and with empty cells."""
    motion = read(EXAMPLES / "point_to_point.csv")
    expected, _ = follow(linear_model(table_1()), motion.time, motion.theta, motion.omega)
    error = np.where(np.arange(len(motion.time)) % 2, 1.0, -1.0)
    tau1, pitch = expected["tau1"] + 0.5 + 0.02 * error, np.rad2deg(expected["pitch"]) - 2
    assert motion.omega is not None
    columns = np.column_stack([motion.time, motion.theta, motion.omega, tau1, pitch])
    rows = [",".join(f"{value:.17g}" for value in row) for row in columns]
    rows[4:9] = [row.rpartition(",")[0] + "," for row in rows[4:9]]
    header = "time,theta1,theta2,omega1,omega2,tau1,pitch [deg],site"
    (tmp_path / "run.csv").write_text("\n".join([header, *(f"{row},9" for row in rows)]))
    result = prw("simulate", "run.csv")
    assert result.returncode == 0 and "columns ignored: site\n" in result.stdout, result
    share = 0.02 / np.ptp(tau1)
    assert (
        f"differences tau1 +0.5 N.m on average; without that 0.02 N.m rms, {share:.2%} of the measured range\n"
        in result.stdout
    )
    assert re.search(r"\n {12}pitch -2 deg on average; without that \S+e-\d+ deg rms, 0\.00% of the", result.stdout)
    # The other outputs were not measured.
    assert result.stdout.count("on average") == 2
    run = simulate(tmp_path / "run.csv", fmu=built("prw_testbed.fmu"))
    np.testing.assert_array_equal(np.isnan(run.differences["pitch"]).nonzero()[0], np.arange(4, 9))
    measured = {axis.get_title(loc="left"): [line.get_ydata() for line in axis.lines[2:]] for axis in run.plot().axes}
    (torques,), (angles,) = (
        [np.asarray(line, dtype=np.float64) for line in measured.pop(title)]
        for title in ("Sensor torques", "Pitch and roll angles")
    )
    assert not any(measured.values())
    np.testing.assert_allclose(torques, tau1, rtol=1e-12)
    np.testing.assert_allclose(angles, np.delete(pitch, np.arange(4, 9)), rtol=1e-12)


def test_other_parameters(prw: Any, tmp_path: Path) -> None:
    """Parameters have their own units in the file that identification writes, and SI units in --set, which has precedence."""
    entries = {
        "k1": {"value": 2.0, "unit": "N.m/deg"},
        "c3": {"value": 0.2, "unit": "N.m.s/rad"},
        "N": {"value": 9, "unit": "1"},
        "k2": 77.0,
    }
    (tmp_path / "mine.json").write_text(json.dumps(entries))
    (tmp_path / "report.json").write_text(json.dumps({"fmu": {}, "parameters": entries}))
    (tmp_path / "good.csv").write_text(GOOD.replace("0.002,0.1", "0.002,0.12") + "0.01,0.12,0.2\n")
    found = {}
    for name, arguments in {
        "file": ["--parameters", "mine.json"],
        "report": ["--parameters", "report.json"],
        "set": ["--set", f"k1={360 / np.pi!r},c3=0.2", "--set", "N=9", "--set", "k2=77"],
        "both": ["--parameters", "mine.json", "--set", "k2=50"],
        "none": [],
    }.items():
        result = prw("simulate", "good.csv", "--out", name, *arguments)
        assert result.returncode == 0 and ("k2 " in result.stdout) == (name != "none"), result
        found[name] = table(tmp_path / name / "good.csv")["tau1"][-1]
    assert found["file"] == found["report"] == pytest.approx(found["set"], rel=1e-11)
    assert len({found[name] for name in ("file", "both", "none")}) == 3
    for entry, message in [
        ({"k9": 1.0}, "--parameters: k9 is not known; there are J2"),
        (
            {"k1": {"value": 1.0, "unit": "N.m/rev"}},
            'mine.json: k1 can be given in N.m/rad or N.m/deg, not in "N.m/rev"',
        ),
        ({"k1": {"unit": "N.m/rad"}}, "mine.json: k1 is None, not a number"),
        ({"k1": {"value": 1.0, "unit": "1"}}, 'mine.json: k1 can be given in N.m/rad or N.m/deg, not in "1"'),
        ({"fmu": {}, "identified": False, "parameters": entries}, "mine.json: reports that the data did not determine"),
        ([1.0], "--parameters: mine.json is not a JSON file with values by name"),
        (
            {"k1": {"value": 1.0, "units": "N.m/deg"}},
            "mine.json: k1 has the member 'units'; write value, unit, meaning",
        ),
        ({"k1": True}, "mine.json: k1 is True, not a number"),
        ('{"k1": 1.0, "k1": 2.0}', "mine.json: k1 is given twice"),
        ({"parameters": {"k1": 1.0}, "k2": 2.0}, 'mine.json: k2 is outside of "parameters"; move it there'),
        ({"fmu": {}, "parameters": {"k1": 1.0}, "k2": 2.0}, "mine.json: k2 is outside"),
        ('{"k1": 1.0,\n"k2"}', "by name (Expecting ':' delimiter in line 2, column 5)"),
    ]:
        (tmp_path / "mine.json").write_text(entry if isinstance(entry, str) else json.dumps(entry))
        result = prw("simulate", "--parameters", "mine.json")
        assert result.returncode == 1 and message in result.stderr and result.stderr.count("\n") == 1
    for arguments, message in [
        (["--set", "k9=1"], "--set: k9 is not known; there are J2"),
        (["--set", "k1=stiff"], "--set k1=stiff: 'stiff' is not a number"),
        (["--set", "k1=true"], "--set: k1 is True, not a number"),
        (["--parameters", "absent.json"], "--parameters: absent.json cannot be read (No such file"),
        (["good.csv", "--input", "good.csv"], "give one recording"),
    ]:
        result = prw("simulate", *arguments)
        assert result.returncode == 1 and message in result.stderr and result.stderr.count("\n") == 1, result
    for arguments, hint in [(["--k1", "100"], "; a parameter is set by --set k1=100\n"), (["--fum", "my.fmu"], "")]:
        result = prw("simulate", *arguments)
        assert result.returncode == 2 and result.stderr.endswith(
            f"unrecognized arguments: {arguments[0]}{hint or chr(10)}"
        )


def test_without_matplotlib(tmp_path: Path, fmu: Path) -> Any:
    """The table is written, and one line names the package that the figure needs."""
    program = "import sys; sys.modules['matplotlib'] = None; from prw.cli import main; sys.exit(main(sys.argv[1:]))"

    def run(*arguments: Any) -> Any:
        line = [sys.executable, "-c", program, *arguments, "--fmu", str(fmu)]
        return subprocess.run(line, capture_output=True, text=True, cwd=tmp_path)

    result = run("simulate")
    assert result.returncode == 0 and result.stderr == "", result.stderr
    assert "no figure   matplotlib missing; install with: make study" in result.stdout
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["fig4.csv"] and "next        look at out" in result.stdout
    result = run("check", "out/fig4.csv", "--experiment", "closed_loop")
    assert result.returncode == 1 and "for a figure of both, matplotlib missing; install" in result.stderr
    result = run("simulate", "--animate", "fig4.gif", "--out", "other")
    assert result.returncode == 1 and "prw simulate: matplotlib missing; install" in result.stderr
    assert result.stderr.count("\n") == 1 and not (tmp_path / "other").exists()


def test_no_hint_leads_to_a_clone(prw: Any) -> None:
    """Users of the wheel have no make, no cargo and no examples."""
    commands = ["simulate", "check", "linearize", "identify", "excite", "sweep"]
    for arguments in (["simulate"], *([command, "--help"] for command in commands)):
        reported = prw(*arguments).stdout
        assert "next  " in reported or "usage" in reported
        assert not re.search(r"\bmake (demo|fmu|study)|cargo|README|examples/", reported), reported
    assert re.fullmatch(r"prw \d+\.\d+\.\d+\n", prw("--version", with_fmu=False).stdout)


def test_the_script_writes_the_example_recordings(tmp_path: Path) -> None:
    script = tmp_path / "make_recordings.py"
    script.write_bytes((EXAMPLES / "make_recordings.py").read_bytes())
    subprocess.run([sys.executable, str(script)], check=True)
    for path in sorted(EXAMPLES.glob("*.csv")):
        assert (tmp_path / path.name).read_bytes() == path.read_bytes()


def test_other_errors(prw: Any, tmp_path: Path) -> None:
    (tmp_path / "good.csv").write_text(GOOD)
    (tmp_path / "no.fmu").write_text("not a zip")
    (tmp_path / "taken").write_text("a file where a directory should be")
    for arguments, message in [
        (["--input", "absent.csv"], "absent.csv: cannot be read (No such file or directory)"),
        (["--input", "."], "cannot be read (Is a directory)"),
        (["--input", "good.csv", "--fmu", "absent.fmu"], "absent.fmu: no such FMU\n"),
        (["--input", "good.csv", "--fmu", "no.fmu"], "no.fmu: cannot be loaded"),
        (["--radians"], "--degrees and --radians belong to a recording"),
        (["--units", "theta1=deg"], "--units: belongs to a recording; name its file"),
        (["--names", "theta1=Foo"], "--names: belongs to a recording"),
        (["--skip-lines", "3"], "--skip-lines: belongs to a recording"),
        (["--encoding", "foo"], "--encoding: belongs to a recording"),
        (["good.csv", "--skip-lines", "-1"], "--skip-lines -1: must be an integer of at least 0"),
        (
            ["good.csv", "--units", "omega1=rpm"],
            "good.csv: no column omega1, whose unit is given; there are time, theta1",
        ),
    ]:
        result = prw("simulate", *arguments, with_fmu=False)
        assert result.returncode == 1 and message in result.stderr, result.stderr
        assert result.stderr.count("\n") == 1 and result.stdout == ""
    (tmp_path / "huge.csv").write_text("time,theta1,theta2\n0,0,0\n1e-3,1e308,0\n2e-3,-1e308,0\n")
    result = prw("simulate", "--input", "huge.csv", "--radians")
    assert result.returncode == 1 and "the FMU stopped at 0.001 s: " in result.stderr
    assert result.stderr.count("\n") == 1 and not (tmp_path / "out").exists()
    result = prw("simulate", "--input", "good.csv", "--out", "taken")
    assert result.returncode == 1 and "taken" in result.stderr and result.stderr.count("\n") == 1


def test_the_recording_is_never_overwritten(prw: Any, tmp_path: Path) -> None:
    (tmp_path / "good.csv").write_text(GOOD)
    result = prw("simulate", "--input", "good.csv", "--out", ".")
    assert result.returncode == 1 and "would be overwritten" in result.stderr
    assert (tmp_path / "good.csv").read_text() == GOOD


def test_results_have_usual_permissions(prw: Any, tmp_path: Path) -> None:
    (tmp_path / "good.csv").write_text(GOOD)
    assert prw("simulate", "--input", "good.csv").returncode == 0
    mask = os.umask(0)
    os.umask(mask)
    assert (tmp_path / "out" / "good.csv").stat().st_mode & 0o777 == 0o666 & ~mask


@pytest.mark.parametrize("ended", [False, True], ids=["disk full", "killed"])
def test_the_old_result_stays(tmp_path: Path, fmu: Path, ended: Any) -> None:
    """If the new result cannot be written completely, the old one is kept."""
    resource = pytest.importorskip("resource", reason="POSIX has limits on the size of files")
    recording = "".join(f"{k / 1000},{k / 7e6!r},{k / 3e6!r}\n" for k in range(ROWS))
    (tmp_path / "long.csv").write_text("time,theta1,theta2\n" + recording)
    old = tmp_path / "out" / "long.csv"
    old.parent.mkdir()
    old.write_text("old")

    # SIGXFSZ, the signal for a file that is too large, ends a process unless it is ignored. Python ignores it by default.
    handler = "signal.signal(signal.SIGXFSZ, signal.SIG_DFL); " if ended else ""
    start = f"import signal, sys, prw.cli; {handler}sys.exit(prw.cli.main(sys.argv[1:]))"
    command = [sys.executable, "-c", start, "simulate", "--input", "long.csv", "--fmu", str(fmu)]
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, LIMIT))  # noqa: E731
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, preexec_fn=limit, timeout=120)

    assert old.read_text() == "old"
    left = [path.name for path in old.parent.iterdir() if path != old]
    if ended:
        assert result.returncode == -signal.SIGXFSZ
        assert left and all(name.startswith(".long-") for name in left)
        (tmp_path / "long.csv").write_text("time,theta1,theta2\n0,0,0\n0.01,0,0\n")
        again = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
        names = {path.name for path in old.parent.iterdir()}
        assert again.returncode == 0 and not names.intersection(left), (again.stderr, names)
    else:
        assert result.returncode == 1 and left == []
        assert "long.csv: cannot be written" in result.stderr and result.stderr.count("\n") == 1


@pytest.mark.skipif(os.name != "posix", reason="shells of POSIX close streams")
@pytest.mark.parametrize(
    ("streams", "status", "message"),
    [
        (">/dev/full", 1, "prw simulate: the output cannot be written (No space left on device)\n"),
        (">&-", 0, ""),
        ("2>&-", 0, ""),
        ("<&- >&- 2>&-", 0, ""),
        ("nothing.csv 2>/dev/full", 1, ""),
        ("nothing.csv 2>&-", 1, ""),
    ],
)
def test_standard_streams_that_cannot_be_used(
    tmp_path: Path, fmu: Path, streams: str, status: int, message: str
) -> None:
    if "/dev/full" in streams and not os.path.exists("/dev/full"):
        pytest.skip("needs /dev/full")
    (tmp_path / "short.csv").write_text("time,theta1,theta2\n0,0,0\n0.01,0,0\n")
    file = "" if "nothing" in streams else "short.csv"
    command = f'exec "{sys.executable}" -m prw simulate --fmu "{fmu}" {file} {streams}'
    done = subprocess.run(["sh", "-c", command], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (status, message)
    assert (tmp_path / "out" / "short.csv").exists() == bool(file)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems reject these names")
@pytest.mark.parametrize("name", [b"two\nlines.csv", b"not UTF-8 \xff.csv"])
def test_names_of_files_may_have_any_bytes(prw: Any, tmp_path: Path, name: bytes) -> None:
    path = os.fsdecode(name)
    (tmp_path / path).write_text("time,theta1,theta2\n0,0,0\n0.01,0,0\n")
    done = prw("simulate", path)
    assert done.returncode == 0 and (tmp_path / "out" / path).exists()
    assert all(re.match("[a-z ]{12}", line) for line in done.stdout.splitlines()), done.stdout


def test_times_are_limited(prw: Any, tmp_path: Path) -> None:
    (tmp_path / "huge.csv").write_text("time,theta1,theta2\n0,0,0\n1e308,0,0\n")
    done = prw("simulate", "huge.csv")
    assert done.returncode == 1 and "time reaches 1e+308 s; it must be between" in done.stderr
