"""The functions of the package prw, and their errors."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
from built import ROOT
from lagrange import OUTPUTS, linear_model, table_1
from reference import follow

import prw
from prw.files import write_table

MOTION = ROOT / "examples" / "point_to_point.csv"


def python(program: str, directory: Path) -> str:
    """Runs a program in a separate Python process. Returns its output."""
    result = subprocess.run([sys.executable, "-c", program], cwd=directory, capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    assert result.stderr == ""
    return result.stdout


def test_import_loads_nothing(tmp_path: Path) -> None:
    heavy = ("numpy", "matplotlib", "scipy", "fmpy", "pyarrow", "fmu_run")
    assert python(f"import sys, prw; print([name for name in {heavy} if name in sys.modules])", tmp_path) == "[]\n"
    used = (
        "prw.simulate(); import sys; print([n for n in ('matplotlib', 'scipy', 'fmpy', 'pyarrow') if n in sys.modules])"
    )
    assert python(f"import prw; {used}", tmp_path) == "[]\n"


def test_all_names_are_there(tmp_path: Path) -> None:
    """Importing all modules replaces no function of the package by a module with the same name."""
    program = (
        "import prw, pkgutil, importlib\n"
        "for module in pkgutil.walk_packages(prw.__path__, 'prw.'):\n"
        "    if not module.name.endswith('__main__'): importlib.import_module(module.name)\n"
        "print([name for name in prw.__all__ if not callable(getattr(prw, name))], set(prw.__all__) <= set(dir(prw)))"
    )
    assert python(program, tmp_path) == "['motion'] True\n"
    with pytest.raises(AttributeError, match="No prw attribute simulation_of"):
        prw.simulation_of  # type: ignore[attr-defined]  # noqa: B018


def test_the_default_is_fig4(testbed: Path) -> None:
    run = prw.simulate(fmu=testbed)
    motion = prw.motion.fig4()
    expected, _ = follow(linear_model(table_1()), motion.time, motion.theta, motion.omega)
    assert tuple(run) == OUTPUTS
    assert run.time.shape == run["roll"].shape == (2001,) and run.motion.name == "fig4"
    for name in ("roll", "tau1"):
        np.testing.assert_allclose(run[name], expected[name], atol=1e-11 * np.abs(expected[name]).max())
    assert {name: run.parameters[name] for name in table_1()} == pytest.approx(table_1(), rel=1e-15)


def test_a_file_a_recording_a_motion(testbed: Path) -> None:
    recording = prw.read(MOTION)
    own = prw.Motion(recording.time, recording.theta, recording.omega)
    runs = [prw.simulate(source, {"k1": 80.0}, fmu=testbed) for source in (MOTION, str(MOTION), recording, own)]
    assert [run.motion.name for run in runs] == [*["point_to_point"] * 3, "motion"]
    assert all(run.parameters["k1"] == 80.0 for run in runs)
    expected, _ = follow(linear_model({**table_1(), "k1": 80.0}), own.time, own.theta, own.omega)
    for run in runs:
        np.testing.assert_allclose(run["tau2"], expected["tau2"], atol=1e-10 * np.abs(expected["tau2"]).max())


def test_other_outputs(testbed: Path) -> None:
    run = prw.simulate(outputs=["theta5", "omega6"], fmu=testbed)
    assert list(run) == ["theta5", "omega6"] and len(run) == 2
    with pytest.raises(KeyError, match="roll is not in this run, which has theta5, omega6"):
        run["roll"]
    assert len(run.plot().axes) == 1


def test_nothing_is_printed_or_written(tmp_path: Path) -> None:
    program = "import prw; run = prw.simulate(); run.plot(); prw.linearize(); prw.sweep({'k1': [100.0]})"
    assert python(program, tmp_path) == ""
    assert list(tmp_path.iterdir()) == []


def test_a_run_is_written_converted_and_drawn(testbed: Path, tmp_path: Path) -> None:
    run = prw.simulate(MOTION, fmu=testbed)
    run.to_csv(tmp_path / "run.csv")
    back = prw.read(tmp_path / "run.csv")
    np.testing.assert_array_equal(back.theta, run.motion.theta)
    np.testing.assert_allclose(back["tau1"], run["tau1"], rtol=1e-11, atol=1e-15)
    frame = run.to_pandas()
    assert frame.index.name == "time" and list(frame) == ["theta1", "theta2", "omega1", "omega2", *run]
    np.testing.assert_array_equal(frame["roll"], run["roll"])
    figure = run.plot("Moves")
    assert figure.get_suptitle() == "Moves" and len(figure.axes) == 4
    assert figure._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]
    assert "<td>tau1</td><td>N.m</td>" in run._repr_html_() and "tau1" in repr(run)


def test_numbers_are_read_back_unchanged(tmp_path: Path) -> None:
    """Tests short and long numbers, neighbours of powers of ten and two, and numbers with an exponent."""
    draws, path = np.random.default_rng(2), tmp_path / "motion.csv"
    powers = np.concatenate([10.0 ** np.arange(-6, 20), 2.0 ** np.arange(-16, 60)])
    near = np.concatenate(
        [powers, np.nextafter(powers, 0), np.nextafter(powers, np.inf), [5e-324, 1.7976931348623157e308]]
    )
    numbers = np.concatenate([near, -near, np.exp(draws.uniform(-300, 300, 9_000)), [0.0, 7.0, 70.0]])
    motion = prw.Motion(1e-3 * np.arange(len(numbers), dtype=np.float64), np.column_stack([numbers, numbers[::-1]]))
    write_table(path, motion.columns)
    lines = path.read_text().splitlines()
    assert lines[0] == "time,theta1,theta2" and lines[-1].startswith(f"{(len(numbers) - 1) * 1e-3!r},70.0,")
    found = [[float(cell) for cell in line.split(",")] for line in lines[1:]]
    assert np.array_equal(found, np.column_stack([motion.time, motion.theta]))


def test_where_the_fmu_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """PRW_FMU comes first, then the FMU in an installed package, then the FMU in the clone. The working directory does not matter."""
    own, here = tmp_path / "site" / "prw", tmp_path / "work" / "target" / "fmu"
    shutil.copytree(Path(prw.__path__[0]), own, ignore=shutil.ignore_patterns("__pycache__"))
    here.mkdir(parents=True)
    shutil.copy(prw.default_fmu(), here)
    program = (
        f"import sys; sys.path.insert(0, {str(own.parent)!r}); import prw; print(prw.default_fmu()); prw.simulate()"
    )
    line = [sys.executable, "-c", program]
    without = subprocess.run(line, cwd=tmp_path / "work", capture_output=True, text=True)
    assert (
        "there is no FMU: none is named by fmu= (--fmu in the shell), PRW_FMU is not set, there is no" in without.stderr
    )
    assert (
        f"{own / 'fmu' / 'prw_testbed.fmu'}, and no" in without.stderr
        and "`make fmu` builds in a clone" in without.stderr
    )
    (own / "clone.txt").write_text(str(ROOT))
    from_clone = program + "; prw.animate(prw.simulate(), 'wrist.html')"
    assert python(from_clone, tmp_path / "work") == f"{prw.default_fmu()}\n", (
        "a package that was installed from a clone must find the FMU of the clone"
    )
    assert (tmp_path / "work" / "wrist.html").stat().st_size > 50_000
    (own / "fmu").mkdir()
    shutil.copy(prw.default_fmu(), own / "fmu")
    assert python(program, tmp_path / "work") == f"{own / 'fmu' / 'prw_testbed.fmu'}\n"
    assert prw.default_fmu() == ROOT / "target" / "fmu" / "prw_testbed.fmu"
    monkeypatch.setenv("PRW_FMU", str(here / "prw_testbed.fmu"))
    assert python(program, tmp_path / "work") == f"{here / 'prw_testbed.fmu'}\n"
    monkeypatch.setenv("PRW_FMU", "absent.fmu")
    with pytest.raises(prw.UserError, match=r"absent.fmu: no such FMU, which the environment variable PRW_FMU names"):
        prw.simulate()


@pytest.mark.parametrize("rates", [False, True])
def test_coarse_sampling_is_reported(testbed: Path, rates: bool) -> None:
    """The error that is reported for a coarsely sampled sine of 3 Hz is 0.9 to 1.4 times the true error: the difference from the
    same sine sampled at 20 kHz."""

    def motion(rate: int, with_rates: bool) -> prw.Motion:
        time = np.arange(rate + 1) / rate
        angle, omega = 0.3 * (1 - np.cos(6 * np.pi * time)), 1.8 * np.pi * np.sin(6 * np.pi * time)
        return prw.Motion(time, np.outer(angle, [1, -1]), np.outer(omega, [1, -1]) if with_rates else None)

    true_values = prw.simulate(motion(20_000, True), fmu=testbed)["tau1"]
    for rate in (100, 200):
        with pytest.warns(UserWarning, match=rf"tau1 may be off by .* sampled at {rate} Hz; at about .* Hz") as noted:
            run = prw.simulate(motion(rate, rates), fmu=testbed)
        assert ("give the motors' rates" in str(noted[0].message)) != rates and run.notes[-1] in repr(run)
        error = np.abs(run["tau1"] - true_values[:: 20_000 // rate]).max() / np.abs(true_values).max()
        assert 0.9 * error < run.sampling_errors["tau1"] < 1.4 * error
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fine = prw.simulate(motion(1000, rates), fmu=testbed)
    assert fine.sampling_errors["tau1"] < 0.003 and fine.doubt == ""


@pytest.mark.parametrize("rates", [False, True])
@pytest.mark.parametrize("phase", [0.0, 0.8, 4.0])
def test_a_recording_that_begins_in_motion(testbed: Path, rates: bool, phase: float) -> None:
    """The reported error covers the difference from a recording of the same sines that begins 10 s earlier, and the reported time is
    the time for which it matters. After that, the sampling error is the true one, which is below 1 %."""

    def motion(begin: float, rate: int, with_rates: bool) -> prw.Motion:
        time = np.arange(round((2 - begin) * rate) + 1) / rate + begin
        angles = [0.3 * np.sin(12 * time + phase), 0.15 * np.sin(15 * time + phase / 2)]
        omega = [3.6 * np.cos(12 * time + phase), 2.25 * np.cos(15 * time + phase / 2)]
        return prw.Motion(time, np.transpose(angles), np.transpose(omega) if with_rates else None)

    with pytest.warns(UserWarning, match=r"begins in motion \(theta\d turns at .*leave out these results") as noted:
        run = prw.simulate(motion(0.0, 1000, rates).columns, fmu=testbed)
    assert len(noted) == 1 and run.notes[-1] == str(noted[0].message) and run.beginning is not None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        longer = prw.simulate(motion(-10.0, 4000, True), fmu=testbed)
    errors = [np.abs(run[name] - longer[name][40_000::4]) / np.abs(run[name]).max() for name in run]
    assert np.max(errors) < run.beginning.error < 2 * np.max(errors)
    assert np.max(np.array(errors)[:, run.time > run.beginning.lasts]) < 0.01 and run.beginning.lasts < 0.6
    assert max(run.sampling_errors.values()) < 0.01


def test_noise_and_steps_of_encoders_are_not_motion(fmu: Path) -> None:
    """A recording begins in motion only if its angles change by more than their noise."""
    time, random = np.arange(501) / 1000, np.random.default_rng(1)
    moved = 0.3 * np.maximum(time - 0.1, 0) ** 2
    for resolution, noise in [(1e-3, 0.0), (1e-3, 1e-3), (0.0, 1e-4)]:
        for _ in range(5):
            angle = moved + noise * random.standard_normal(len(time))
            angle = np.round(angle / resolution) * resolution if resolution else angle
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                assert prw.simulate(prw.Motion(time, np.outer(angle, [1, -1])), fmu=fmu).beginning is None


def test_the_rates_of_coarse_sampling() -> None:
    """Rates are written without exponents, and the proposed rate is above the given rate even if 1 % is barely exceeded."""
    motion = prw.Motion(np.arange(1001) / 1000, np.zeros((1001, 2)))
    for error, proposed in [(0.0101, "1100"), (0.0121, "1100"), (0.04, "2000"), (0.0401, "2100"), (1.0, "10000")]:
        doubt = prw.Run(motion, {}, {}, {"tau1": error}).doubt
        assert f"sampled at 1000 Hz; at about {proposed} Hz, the error would be 1%" in doubt


def test_two_times(testbed: Path) -> None:
    """Two or three rows are enough for a simulation; two are too few for an estimate of the sampling error."""
    run = prw.simulate({"time": [0.0, 1e-3], "theta1": [0.0, 1e-4], "theta2": [0.0, -1e-4]}, fmu=testbed)
    assert len(run["roll"]) == 2 and run.sampling_errors == {} and run.doubt == ""
    assert (
        len(
            prw.simulate({"time": [0.0, 1e-3, 2e-3], "theta1": 0.0 * np.ones(3), "theta2": np.zeros(3)}, fmu=testbed)[
                "roll"
            ]
        )
        == 3
    )


def test_wrong_motions() -> None:
    time, theta = [0.0, 1.0], [[0.0, 0.0], [1.0, 1.0]]
    for arguments, message in [
        ((None, theta), "motion: time is None; it must be an array"),
        (([0.0], [[0.0, 0.0]]), r"time has the shape \(1,\); it must be \(n,\), with at least two times"),
        ((time, [0.0, 1.0]), r"theta has the shape \(2,\); it must be \(2, 2\), a column each motor"),
        ((time, theta, [[0.0, 0.0]]), r"omega has the shape \(1, 2\)"),
        (([1.0, 1.0], theta), "time must increase"),
        (([0.0, float("nan")], theta), "time must increase"),
        ((["now", "then"], theta), "time: does not consist of numbers"),
        ((["0", "1_0"], theta), "time: does not consist of numbers; convert strings and Booleans first"),
        ((time, [[False, 0.0], [1.0, 1.0]]), "theta: does not consist of numbers; convert strings and Booleans first"),
        ((time, np.array(theta) + 1j), "theta: has complex numbers; choose their real part or magnitude"),
    ]:
        with pytest.raises(prw.UserError, match=message):
            prw.Motion(*arguments)  # type: ignore[arg-type]


def test_wrong_simulations(testbed: Path, tmp_path: Path) -> None:
    for arguments, message in [
        ({"parameters": {"k9": 1.0}}, "parameters: k9 is not known; there are J2, J3, H3"),
        ({"parameters": {"k1": -1.0}}, "the FMU stopped: k1 must be above 0, it is -1"),
        ({"parameters": {"N": 7.5}}, "N.* 7.5"),
        ({"parameters": {"k1": np.array([1.0, 2.0])}}, r"k1 is array\(\[1., 2.\]\), not a number; prw.sweep takes"),
        ({"parameters": {"k1": "stiff"}}, "k1 is 'stiff', not a number"),
        ({"parameters": {"k1": ("stiff", "N.m/deg")}}, r"k1 is \('stiff', 'N.m/deg'\); write finite numbers"),
        ({"parameters": {"k1": (None, "N.m/deg")}}, r"k1 is \(None, 'N.m/deg'\); write finite numbers"),
        ({"parameters": {"k1": ([[1.0], [1.0, 2.0]], "N.m/deg")}}, r"k1 is \(\[\[1.0\], .* write finite numbers"),
        ({"parameters": {"k1": None}}, "k1 is None, not a number"),
        ({"outputs": ["yaw"]}, "outputs: yaw is not known; there are theta1"),
        ({"outputs": 5}, "outputs: 5 is neither a name nor a sequence of names"),
        ({"fmu": tmp_path / "absent.fmu"}, "absent.fmu: no such FMU$"),
        ({"motion": tmp_path / "absent.csv"}, "absent.csv: cannot be read"),
    ]:
        with pytest.raises(prw.UserError, match=message) as caught:
            prw.simulate(**{"fmu": testbed, **dict(arguments)})  # type: ignore[call-overload]
        assert "\n" not in str(caught.value)


def test_sweep_draws(testbed: Path) -> None:
    """The draws have the given distributions, and do not depend on the number of threads."""
    table = prw.sweep(random={"k1": 0.1, "c3": (0.5, 0.2)}, runs=300, seed=4, motion=MOTION, fmu=testbed)
    assert table == prw.sweep(
        random={"k1": 0.1, "c3": (0.5, 0.2)}, runs=300, seed=4, motion=MOTION, fmu=testbed, threads=1
    )
    for name, middle, relative in (("k1", table_1()["k1"], 0.1), ("c3", 0.5, 0.2)):
        logarithms = np.log(np.array(table.column(name)) / middle)
        assert abs(logarithms.mean()) < relative / 5 and logarithms.std() == pytest.approx(relative, rel=0.2)


def test_wrong_sweeps(testbed: Path) -> None:
    for arguments, message in [
        ({}, "nothing varies; give values of a parameter"),
        ({"grid": {"k9": [1.0]}}, "k9 is not known; there are J2"),
        ({"grid": {"k1": []}}, r"k1 must have one or more finite numbers as values, not \[\]"),
        (
            {"grid": {"k1": [1.0]}, "random": {"k1": 0.1}},
            "k1 is in more than one of grid, random and parameters; choose one",
        ),
        (
            {"random": {"k1": (100.0, 0.1)}, "parameters": {"k1": 50.0}},
            "k1 is in more than one of grid, random and parameters; choose one",
        ),
        ({"grid": [("k1", [1.0])]}, "grid: .* is not a mapping from parameters to values"),
        ({"grid": pandas.DataFrame({"k1": [1.0]})}, "grid: .* is not a mapping from parameters to values"),
        ({"grid": {"k1": ["100", "1_00"]}}, "k1 must have one or more finite numbers as values, not"),
        ({"grid": {"k1": [True, 100.0]}}, "k1 must have one or more finite numbers as values, not"),
        ({"grid": {"k1": np.array([1j])}}, "k1 must have one or more finite numbers as values, not"),
        ({"grid": {"k1": np.ma.array([1.0], mask=[True])}}, "k1 must have one or more finite numbers as values, not"),
        (
            {"grid": {"k1": (["1.9"], "N.m/deg")}},
            r"grid: k1 is \(\['1.9'\], 'N.m/deg'\); write finite numbers",
        ),
        ({"random": {"k1": True}}, "random: k1 True is not a finite number above 0"),
        ({"random": {"k1": ("uniform", False, True)}}, r"random: k1 .* write \(.uniform., low, high\)"),
        ({"random": {"k1": ()}}, r"random: k1 \(\): write a fraction as in 0.1, or \(value, fraction\)"),
        ({"random": {"k1": ("lognormal",)}}, r"random: k1 \(\): write a fraction as in 0.1"),
        ({"random": {"k1": 0.1}, "runs": True}, "runs True: must be an integer of at least 1"),
        ({"grid": {"k1": None}}, "k1 must have one or more finite numbers as values, not None"),
        ({"random": {"k1": -0.1}}, "random: k1 -0.1 is not a finite number above 0"),
        ({"random": {"k1": None}}, "random: k1 None is not a finite number above 0"),
        ({"random": {"k1": 10}}, "random: k1 has a standard deviation of 1000%; 100 % is the most"),
        ({"random": {"k1": 0.1}, "runs": 0}, "runs 0: must be an integer of at least 1"),
        ({"random": {"k1": 0.1}, "runs": 2.5}, "runs 2.5: must be an integer of at least 1"),
        ({"random": {"k1": 0.1}, "threads": 0}, "threads 0: must be an integer of at least 1"),
        ({"random": {"k1": 0.1}, "seed": -1}, "seed -1: must be an integer of at least 0"),
        ({"random": {"k1": 0.1}, "seed": 1.5}, "seed 1.5: must be an integer of at least 0"),
        ({"grid": {"k1": [1.0]}, "runs": 5}, "runs 5: is for random draws; give a distribution"),
        ({"table": {"k1": [1.0]}, "seed": 0}, "seed 0: is for random draws; give a distribution"),
        ({"grid": {"k1": [1.0]}, "threads": 1, "scheduler": "tcp://a:1"}, "threads: is for this machine, not for a"),
        (
            {"table": {"k1": [True, False]}},
            "table: k1: does not consist of numbers; convert strings and Booleans first",
        ),
        ({"grid": {"k1": np.ones(4000), "k2": np.ones(4000)}}, "16000000 runs are more than the limit of 10000000"),
    ]:
        with pytest.raises(prw.UserError, match=message):
            prw.sweep(fmu=testbed, **arguments)  # type: ignore[arg-type]


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch, testbed: Path) -> None:
    run = prw.simulate(fmu=testbed)
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    # In a clone, `make study` installs what the commands need.
    for call, package, remedy in [
        (run.plot, "matplotlib", "make study"),
        (run.to_pandas, "pandas", "pip install pandas"),
        (prw.sweep, "pyarrow, scipy", "make study"),
    ]:
        with pytest.raises(prw.UserError, match=f"{package} missing; install with: {remedy}") as caught:
            call()
        assert isinstance(caught.value, ValueError) and isinstance(caught.value, ImportError)


def test_the_command_linearize(testbed: Path, tmp_path: Path) -> None:
    def command(*arguments: str) -> subprocess.CompletedProcess[str]:
        line = [sys.executable, "-m", "prw", "linearize", "--fmu", str(testbed), *arguments]
        return subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, timeout=120)

    result = command("--set", "k1=90")
    assert result.returncode == 0 and "states      theta3, theta4" in result.stdout, result.stderr
    written = json.loads((tmp_path / "out" / "linear.json").read_text())
    np.testing.assert_array_equal(written["A"], prw.linearize({"k1": 90.0}, fmu=testbed).A)
    assert written["outputs"][0] == "tau1" and written["units"]["tau1"] == "N.m"
    for wrong, message in (
        ("k1=1_00", "--set k1=1_00: '1_00' is not a number"),
        ("k1", "--set k1: write NAME=VALUE"),
        ("k2=1,k1=1,5", "--set k2=1,k1=1,5: write NAME=VALUE; a comma begins the next one, so decimals need a point"),
        ("k1=stiff", "--set k1=stiff: 'stiff' is not a number"),
    ):
        result = command("--set", wrong)
        assert result.returncode == 1 and message in result.stderr and result.stderr.count("\n") == 1


def blocks(page: str) -> list[tuple[str, str]]:
    """Returns the language and the text of each block of code of a page."""
    return re.findall(r"^```(\w+)\n(.*?)^```", (ROOT / page).read_text(encoding="utf-8"), flags=re.S | re.M)


@pytest.mark.parametrize("page", ["README.md", "python/prw/README.md"])
def test_the_programs_in_the_readmes(
    page: str, fmu: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The programs run unchanged in the repository root, and print what the page shows after them. They name the FMU for FMI 2.0."""
    found = blocks(page)
    monkeypatch.chdir(ROOT)
    names: dict[str, Any] = {}
    compared = 0
    for (language, program), (following, output) in zip(found, [*found[1:], ("", "")]):
        if language == "python":
            exec(compile(program, page, "exec"), names)
            printed = capsys.readouterr().out
            assert printed == (output if following == "text" else "")
            compared += bool(printed)
    assert compared == (2 if page == "README.md" else 1) and names["found"].fits
    if page == "README.md":
        assert names["run"].parameters["k1"] == pytest.approx(1.8 * 180 / np.pi) and names["model"].A.shape == (6, 6)
        assert names["table"].num_rows == 100 and prw.simulate(fmu=fmu).parameters["k1"] == pytest.approx(
            120.9, abs=0.05
        )


def test_the_output_of_the_demo_in_the_readme(testbed: Path, tmp_path: Path) -> None:
    shown = next(text for language, text in blocks("README.md") if language == "text")
    command = [sys.executable, "-m", "prw", "simulate", "--fmu", str(testbed)]
    printed = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True, timeout=120).stdout
    # The last line names the command as it was called.
    assert shown.splitlines()[:-1] == printed.splitlines()[:-1]
