"""The command `prw simulate`: what it writes, and one clear line for everything that can be wrong with a recording."""

from __future__ import annotations

import csv
import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from built import ROOT
from instance import assert_close
from lagrange import OUTPUTS
from reference import backward_slope, follow

from prw.errors import UserError
from prw.recording import read as read_all
from prw.recording import read_motion as read

EXAMPLES = ROOT / "examples"
GOOD = "time,theta1,theta2\n0,0.1,0.2\n0.001,0.1,0.2\n0.002,0.1,0.2\n"


def table(path):
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return dict(zip(rows[0], np.array(rows[1:], dtype=float).T))


def is_png(path):
    return path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_fig4(prw, tmp_path):
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
def test_examples(prw, tmp_path, model, name):
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
    expected, _ = follow(model, motion.time, motion.theta, slope)
    # The table has twelve digits.
    assert_close(columns, expected, 1e-10)
    for output in ("tau1", "tau2", "pitch_rate"):
        assert abs(columns[output][0]) < 1e-12, "starts with a bang"


def test_other_parameters(prw, tmp_path, model):
    """In units of the FMU's choice in the file that identification writes, in SI by --set, which is stronger."""
    entries = {"k1": {"value": 2.0, "unit": "N.m/deg"}, "c3": {"value": 0.2, "unit": "N.m.s/rad"}, "N": 9, "k2": 77.0}
    (tmp_path / "mine.json").write_text(json.dumps(entries))
    (tmp_path / "report.json").write_text(json.dumps({"fmu": {}, "parameters": entries}))
    (tmp_path / "good.csv").write_text(GOOD.replace("0.002,0.1", "0.002,0.3") + "0.01,0.3,0.2\n")
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
    for entry, complaint in [
        ({"k9": 1.0}, "--parameters: k9 is not known; there are J2"),
        (
            {"k1": {"value": 1.0, "unit": "N.m/rev"}},
            'mine.json: k1 can be given in N.m/rad or N.m/deg, not in "N.m/rev"',
        ),
        ({"k1": {"unit": "N.m/rad"}}, "mine.json: k1 is None, not a number"),
        ([1.0], "--parameters: mine.json is no JSON file with values by name"),
    ]:
        (tmp_path / "mine.json").write_text(json.dumps(entry))
        result = prw("simulate", "--parameters", "mine.json")
        assert result.returncode == 1 and complaint in result.stderr and result.stderr.count("\n") == 1
    for arguments, complaint in [
        (["--set", "k9=1"], "--set: k9 is not known; there are J2"),
        (["--set", "k1=stiff"], "--set k1=stiff: 'stiff' is not a number"),
        (["--parameters", "absent.json"], "--parameters: absent.json cannot be read (No such file"),
        (["good.csv", "--input", "good.csv"], "give one recording"),
    ]:
        result = prw("simulate", *arguments)
        assert result.returncode == 1 and complaint in result.stderr and result.stderr.count("\n") == 1, result


def test_without_matplotlib(tmp_path, fmu):
    """The table is written all the same, and one line says what brings the figure."""
    program = "import sys; sys.modules['matplotlib'] = None; from prw.cli import main; sys.exit(main(sys.argv[1:]))"

    def run(*arguments):
        line = [sys.executable, "-c", program, *arguments, "--fmu", str(fmu)]
        return subprocess.run(line, capture_output=True, text=True, cwd=tmp_path)

    result = run("simulate")
    assert result.returncode == 0 and result.stderr == "", result.stderr
    assert "no figure   matplotlib missing; install with: pip install matplotlib" in result.stdout
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["fig4.csv"] and "next        look at out" in result.stdout
    result = run("check", "out/fig4.csv", "--experiment", "closed_loop")
    assert result.returncode == 1 and "for a figure of both, matplotlib missing; install" in result.stderr
    result = run("simulate", "--animate", "fig4.gif", "--out", "other")
    assert result.returncode == 1 and "prw simulate: matplotlib missing; install" in result.stderr
    assert result.stderr.count("\n") == 1 and not (tmp_path / "other").exists()


def test_no_hint_leads_to_a_clone(prw):
    """Who has the wheel has no make, no cargo and no examples."""
    commands = ["simulate", "check", "linearize", "identify", "excite", "sweep"]
    for arguments in (["simulate"], *([command, "--help"] for command in commands)):
        said = prw(*arguments).stdout
        assert "next  " in said or "usage" in said
        assert not re.search(r"\bmake (demo|fmu|study)|cargo|README|examples/", said), said
    assert re.fullmatch(r"prw \d+\.\d+\.\d+\n", prw("--version", with_fmu=False).stdout)


def test_examples_are_what_their_script_writes(tmp_path):
    script = tmp_path / "make_recordings.py"
    script.write_bytes((EXAMPLES / "make_recordings.py").read_bytes())
    subprocess.run([sys.executable, str(script)], check=True)
    for path in sorted(EXAMPLES.glob("*.csv")):
        assert (tmp_path / path.name).read_bytes() == path.read_bytes()


BAD = {
    "empty": (b"", "the file is empty"),
    "blank": (b"\n\n", "the file is empty"),
    "header only": (b"time,theta1,theta2\n", "row 1: no rows below the header"),
    "one row": (b"time,theta1,theta2\n0,1,1\n", "row 2: only one row below the header"),
    "missing column": (
        b"time,theta1,omega1\n0,1,1\n1,1,1\n",
        "row 1: column theta2 is missing; the header has time, theta1, omega1",
    ),
    "no header": (b"0,1,1\n1,1,1\n", "row 1: column time is missing"),
    "half the rates": (
        b"time,theta1,theta2,omega2\n0,1,1,1\n1,1,1,1\n",
        "row 1: column omega1 is missing; give both omega1 and omega2, or neither",
    ),
    "spaces": (b"time theta1 theta2\n0 1 1\n1 1 1\n", "separate columns by comma, semicolon or tab"),
    "wrong unit": (b"time,theta1 [m],theta2\n0,1,1\n1,1,1\n", "row 1, column theta1: theta1 cannot be in 'm'"),
    "duplicate column": (b"time,theta1,theta2,theta1\n0,1,1,1\n1,1,1,1\n", "row 1, column theta1: appears twice"),
    "short row": (b"time,theta1,theta2\n0,1,1\n1,1\n2,1,1\n", "row 3: 2 cells, but the header has 3"),
    "long row": (b"time,theta1,theta2\n0,1,1\n1,1,1,1\n", "row 3: 4 cells, but the header has 3"),
    "word": (b"time,theta1,theta2\n0,1,1\n1,1,fast\n", "row 3, column theta2: 'fast' is not a number"),
    "underscore": (b"time,theta1,theta2\n0,1,1\n1,1_0,1\n", "row 3, column theta1: '1_0' is not a number"),
    "empty cell": (b"time,theta1,theta2\n0,1,1\n1,,1\n", "row 3, column theta1: empty cell"),
    "nan": (b"time,theta1,theta2\n0,1,1\n1,NaN,1\n", "row 3, column theta1: NaN is not finite"),
    "infinite time": (b"time,theta1,theta2\n0,1,1\ninf,1,1\n", "row 3, column time: inf is not finite"),
    "time backwards": (
        b"time,theta1,theta2\n0,1,1\n2,1,1\n\n1.5,1,1\n",
        "row 5, column time: 1.5 runs backwards (after 2.0)",
    ),
    "time repeated": (
        b"time,theta1,theta2\n0,1,1\n0,1,1\n",
        "row 3, column time: 0 is the time of the row before again",
    ),
    "latin-1": ("time,theta1,theta2,größe\n0,1,1,1\n".encode("latin-1"), "row 1: not UTF-8 text"),
    "latin-1 later": ("time,theta1,theta2,x\n0,1,1,1\n1,1,1,ß\n".encode("latin-1"), "row 3: not UTF-8 text"),
    "utf-16 without its mark": ("time,theta1,ö\n0,1,1\n".encode("utf-16-le"), "row 1: not UTF-8 text"),
    "nul": (b"time,theta1,theta2\n0,1,1\n1,\0,1\n", "row 3"),
    "decimal comma": (b"time\ttheta1\ttheta2\n0\t1\t1\n0,1\t1\t1\n", "row 3, column time: '0,1' is not a number"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_recordings(prw, tmp_path, case):
    content, complaint = BAD[case]
    (tmp_path / "bad.csv").write_bytes(content)
    result = prw("simulate", "--input", "bad.csv")
    assert result.returncode == 1
    assert result.stderr.startswith("prw simulate: bad.csv")
    assert complaint in result.stderr
    assert result.stderr.count("\n") == 1 and result.stdout == ""
    assert not (tmp_path / "out").exists()


def test_units_in_the_header(tmp_path):
    file = tmp_path / "run.csv"
    file.write_text(
        "time [ms],theta1 [deg],theta2 [deg],omega1_rpm,omega2_rpm,tau1 [N.m]\n0,180,90,30,0,1\n5,180,90,30,0,1\n"
    )
    motion = read(file)
    np.testing.assert_allclose(motion.time, [0, 5e-3], rtol=1e-15)
    np.testing.assert_allclose(motion.theta, [[np.pi, np.pi / 2]] * 2, rtol=1e-15)
    np.testing.assert_allclose(motion.omega, [[np.pi, 0]] * 2, rtol=1e-15)
    assert "columns ignored: tau1 [N.m]" in motion.notes


@pytest.mark.parametrize(
    ("rows", "note"),
    [
        (
            "0,3.1,0\n0.01,3.14,0\n0.02,-3.13,0\n0.03,-3.1,0\n",
            "theta1 jumps by 6.27 rad after 0.01 s; angles must run on",
        ),
        ("0,0,0\n10,0.1,0\n20,0.2,0\n", "a sample every 10 s; if time is in ms, call its column time [ms]"),
    ],
)
def test_slips_are_noted(tmp_path, rows, note):
    file = tmp_path / "run.csv"
    file.write_text("time,theta1,theta2\n" + rows)
    assert any(note in found for found in read(file).notes), read(file).notes


def test_other_complaints(prw, tmp_path):
    (tmp_path / "good.csv").write_text(GOOD)
    (tmp_path / "no.fmu").write_text("not a zip")
    (tmp_path / "taken").write_text("a file where a directory should be")
    for arguments, complaint in [
        (["--input", "absent.csv"], "absent.csv: cannot be read (No such file or directory)"),
        (["--input", "."], "cannot be read (Is a directory)"),
        (["--input", "good.csv", "--fmu", "absent.fmu"], "absent.fmu: no such FMU\n"),
        (["--input", "good.csv", "--fmu", "no.fmu"], "no.fmu: cannot be loaded"),
        (["--degrees"], "--degrees belongs to a recording"),
    ]:
        result = prw("simulate", *arguments, with_fmu=False)
        assert result.returncode == 1 and complaint in result.stderr, result.stderr
        assert result.stderr.count("\n") == 1 and result.stdout == ""
    (tmp_path / "huge.csv").write_text("time,theta1,theta2\n0,0,0\n1e-3,1e308,0\n2e-3,-1e308,0\n")
    result = prw("simulate", "--input", "huge.csv")
    assert result.returncode == 1 and "the FMU stopped at 0.001 s: " in result.stderr
    assert result.stderr.count("\n") == 1 and not (tmp_path / "out").exists()
    result = prw("simulate", "--input", "good.csv", "--out", "taken")
    assert result.returncode == 1 and "taken" in result.stderr and result.stderr.count("\n") == 1


def test_the_recording_is_never_overwritten(prw, tmp_path):
    (tmp_path / "good.csv").write_text(GOOD)
    result = prw("simulate", "--input", "good.csv", "--out", ".")
    assert result.returncode == 1 and "would be overwritten" in result.stderr
    assert (tmp_path / "good.csv").read_text() == GOOD


@pytest.mark.parametrize(
    "content",
    [
        b"\xef\xbb\xbf" + GOOD.encode(),
        GOOD.replace("\n", "\r\n").encode(),
        GOOD.replace(",", ";").encode(),
        GOOD.replace(",", ";").replace(".", ",").encode(),
        GOOD.replace(",", "\t").encode(),
        GOOD.replace(",", " , ").encode(),
        b'"time","theta1","theta2"\n0,"0.1",0.2\n0.001,0.1,0.2\n0.002,0.1,0.2',
        b"\n" + GOOD.encode() + b"\n\n",
        b"note,theta2,time,theta1\nstart,0.2,0,0.1\n,0.2,0.001,0.1\n,0.2,0.002,0.1\n",
    ],
    ids=["bom", "crlf", "semicolons", "decimal commas", "tabs", "spaces", "quotes", "blank lines", "other columns"],
)
def test_spellings_of_one_recording(tmp_path, content):
    path = tmp_path / "good.csv"
    path.write_bytes(content)
    motion = read(path)
    np.testing.assert_array_equal(motion.time, [0, 0.001, 0.002])
    np.testing.assert_array_equal(motion.theta, [[0.1, 0.2]] * 3)
    assert any("columns ignored: note" in note for note in motion.notes) == (b"note" in content)


@pytest.mark.parametrize("delimiter, end", [(",", "\n"), (";", "\r\n"), ("\t", "\n")])
def test_many_rows_at_a_time_are_the_rows(tmp_path, monkeypatch, delimiter, end):
    """To the bit what Python makes of each cell, empty or not, in columns of text too; and with the same complaints."""
    draws = np.random.default_rng(6)
    numbers = draws.standard_normal((500, 5)) * 10.0 ** draws.integers(-310, 300, (500, 5))
    cells = [[repr(k * 1e-3), "up", *map(repr, row.tolist())] for k, row in enumerate(numbers)]
    for row in cells[::3]:
        row[5:] = ["", "nan"]
    if delimiter == ";":
        cells = [[cell.replace(".", ",") for cell in row] for row in cells]
    header = ["time", "state", "theta1", "theta2", "x", "tau1", "pitch"]
    path = tmp_path / "run.csv"

    def write():
        path.write_bytes(end.join(delimiter.join(row) for row in [header, *cells, []]).encode())

    write()
    monkeypatch.setattr("prw.table.BLOCK", 1000)
    monkeypatch.setattr("prw.table._rows", None)  # is not asked
    recording = read_all(path)
    expected = np.array([[float(cell.replace(",", ".") or "nan") for cell in row[2:]] for row in cells])
    np.testing.assert_array_equal(recording["theta1"], expected[:, 0])
    np.testing.assert_array_equal(recording["tau1"], expected[:, 3])
    np.testing.assert_array_equal(recording["pitch"], expected[:, 4])
    monkeypatch.undo()
    for column, cell, complaint in [
        (2, "", "row 402, column theta1: empty cell"),
        (2, "1_0", "row 402, column theta1: '1_0' is not a number"),
        (3, "inf", "row 402, column theta2: inf is not finite"),
        (0, "0", "row 402, column time: 0 runs backwards"),
        (1, f"up{delimiter}", "row 402: 8 cells, but the header has 7"),
    ]:
        before, cells[400][column] = cells[400][column], cell
        write()
        with pytest.raises(UserError, match=re.escape(complaint)):
            read_all(path)
        cells[400][column] = before


def test_degrees(tmp_path):
    path = tmp_path / "degrees.csv"
    path.write_text("time,theta1,theta2,omega1,omega2\n0,40,-10,0,0\n0.1,43,-10,60,0\n")
    motion = read(path, degrees=True)
    np.testing.assert_allclose(motion.theta, np.deg2rad([[40, -10], [43, -10]]), rtol=1e-15)
    np.testing.assert_allclose(motion.omega, np.deg2rad([[0, 0], [60, 0]]), rtol=1e-15)
    assert motion.notes == []
    assert any("if it is in degrees, call it theta1 [deg]" in note for note in read(path).notes)


def test_rates_that_are_not_the_angles_rates_are_noted(tmp_path):
    path = tmp_path / "units.csv"
    t = np.arange(0, 1, 0.01)
    theta, omega = 1 - np.cos(3 * t), 3 * np.sin(3 * t)
    np.savetxt(
        path,
        np.column_stack([t, theta, theta, np.rad2deg(omega), omega]),
        delimiter=",",
        header="time,theta1,theta2,omega1,omega2",
        comments="",
    )
    notes = read(path).notes
    assert len(notes) == 1 and "omega1 adds up to 57.3 times the motion of theta1" in notes[0]


def test_a_recording_that_starts_in_motion_is_noted(tmp_path):
    path = tmp_path / "moving.csv"
    path.write_text("time,theta1,theta2,omega1,omega2\n0,0,0,1,0\n0.1,0.1,0,1,0\n")
    assert read(path).notes == [
        "the motors turn already in the first row; the testbed starts at rest and has to catch up"
    ]


def test_results_have_usual_permissions(prw, tmp_path):
    (tmp_path / "good.csv").write_text(GOOD)
    assert prw("simulate", "--input", "good.csv").returncode == 0
    mask = os.umask(0)
    os.umask(mask)
    assert (tmp_path / "out" / "good.csv").stat().st_mode & 0o777 == 0o666 & ~mask
