"""Runs the examples, and checks their results, mostly by independent means: the oracle's equations and the poles of eq. (11)."""

from __future__ import annotations

import importlib
import re
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from built import ROOT
from lagrange import linear_model, table_1
from reference import at_rest, follow

from prw import cli
from tools import examples

#: Eigenvalues of eq. (11) with Table 1, 1/s. Of each complex pair, only the one with a positive imaginary part is listed.
POLES = np.array([-174.87270665, -174.36733032, -18.94465405 + 32.14568305j, -9.68285129 + 34.67786598j])


@pytest.mark.parametrize("name", examples.EXAMPLES)
def test_it_is_short_and_has_a_purpose(name: str) -> None:
    lines = (ROOT / "examples" / f"{name}.py").read_text().splitlines()
    assert len(lines) < 120
    assert lines[2].startswith("You learn ")
    assert any(line.startswith("    make examples") for line in lines[:12])


def test_the_page_has_its_purpose_and_figures() -> None:
    page = (ROOT / "docs" / "examples.md").read_text(encoding="utf-8")
    for name in examples.EXAMPLES:
        purpose = (ROOT / "examples" / f"{name}.py").read_text(encoding="utf-8").split('"""')[1].split("\n\n    ")[0]
        assert f"## {purpose}" in page, f"{name}: `make docs` updates the page"
        assert f"](../examples/{name}.py)" in page
        for figure in re.findall(r"\]\((examples/\w+\.png)\)", page):
            assert (ROOT / "docs" / figure).is_file()


def test_the_page_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    for name, value in {"EXAMPLES": ("lqr",), "PAGE": tmp_path / "page.md", "FIGURES": tmp_path}.items():
        monkeypatch.setattr(examples, name, value)
    assert cli.run("tools", "", {"examples": examples}, ["examples"]) == 0
    section = (tmp_path / "page.md").read_text(encoding="utf-8").split(examples.HEAD)[1].strip()
    page = (ROOT / "docs" / "examples.md").read_text(encoding="utf-8")
    assert section.split("[lqr.py]")[0] in page and (tmp_path / "lqr.png").is_file()


@pytest.fixture(scope="module")
def lqr() -> Any:
    return importlib.import_module("lqr")


def test_lqr_follows_closer_than_pi(lqr: Any) -> None:
    figure, errors = lqr.main()
    rms = {name: np.sqrt(np.mean(error**2, axis=0)) for name, error in errors.items()}
    assert (20 * rms["LQR"] < rms["PI"]).all()
    assert (np.rad2deg(rms["LQR"]) < 0.1).all()
    assert len(figure.axes) == 2


def test_lqr_wants_the_motors_where_the_wrist_follows(lqr: Any) -> None:
    """Without feedback, the exact solution follows the reference as well as the motors' steps allow."""
    time = lqr.STEP * np.arange(2000)
    angle = np.deg2rad([30, 50]) * np.sin(np.pi * np.outer(time, [0.9, 0.6])) ** 2
    goal = lqr.wanted(angle)
    at, _ = follow(linear_model(table_1()), time, goal[:, 6:8], goal[:, 8:])
    assert np.rad2deg(np.abs(np.column_stack([at["pitch"], at["roll"]]) - angle)).max() < 0.05
    assert np.rad2deg(np.abs(goal[:, 6:8] - goal[:, 2:4])).max() > 1, "the twist"


def test_lqr_and_filter_are_stable_and_have_the_poles_of_the_wrist(lqr: Any) -> None:
    A, B, C, feedback, gain = lqr.design()
    found = np.log(np.linalg.eigvals(A[:6, :6])) / lqr.STEP
    upper = found[found.imag >= 0]
    assert np.sort_complex(upper) == pytest.approx(np.sort_complex(POLES), rel=1e-7)
    for closed in (A - B @ feedback, A - A @ gain @ C):
        assert np.abs(np.linalg.eigvals(closed)).max() < 1


@pytest.fixture(scope="module")
def quiet() -> Any:
    return importlib.import_module("quiet_motion")


def vibration(quiet: Any, rates: np.ndarray, **changed: float) -> float:
    """Returns the largest error of pitch and roll after the move, deg, in the exact solution of the Lagrange equations.

    changed: parameters that differ from Table 1."""
    still = np.zeros((round(quiet.AFTER / quiet.STEP) + 1, 2))
    slope = np.vstack([rates, still])
    theta = np.vstack([np.zeros(2), np.cumsum(quiet.STEP * slope[:-1], axis=0)])
    time = quiet.STEP * np.arange(len(theta))
    at, _ = follow(linear_model({**table_1(), **changed}), time, theta, slope)
    goal = {"pitch": np.deg2rad(20), "roll": np.deg2rad(30)}
    return max(float(np.rad2deg(np.abs(at[name][len(rates) :] - goal[name]).max())) for name in goal)


def test_smoothest_motion_leaves_no_vibration(quiet: Any) -> None:
    _, left = quiet.main()
    smoothest, quintic = quiet.smoothest(), quiet.minimum_jerk()
    assert vibration(quiet, smoothest) < 1e-6
    assert vibration(quiet, quintic) > 1
    assert np.abs(smoothest).max() <= quiet.RATE
    assert left["smoothest"] < 1e-6
    assert left["quintic"] == pytest.approx(vibration(quiet, quintic), rel=1e-6)
    softer = vibration(quiet, smoothest, k2=0.9 * table_1()["k2"])
    assert left["smoothest, k2 10 % less"] == pytest.approx(softer, rel=1e-3)
    assert softer < 0.2 * left["quintic"]


@pytest.fixture(scope="module")
def tolerances() -> Any:
    return importlib.import_module("tolerances")


def test_wrists_with_tolerances_follow_the_equations(tolerances: Any) -> None:
    time, drawn, errors = tolerances.errors(runs=5)
    _, wrist, rates = tolerances.motion()
    motors = np.array([[1, 4 / 7], [1, -4 / 7]])
    for run in range(5):
        model = linear_model({**table_1(), **{name: values[run] for name, values in drawn.items()}})
        at, _ = follow(model, time, wrist @ motors.T, rates @ motors.T, at_rest(np.zeros(2)))
        for k, name in enumerate(("pitch", "roll")):
            np.testing.assert_allclose(errors[name][run], at[name] - wrist[:, k], rtol=0, atol=1e-12)


def test_blame_is_the_variance_due_to_one_parameter(tolerances: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    _, shares = tolerances.main(runs=2000)
    everything = dict(tolerances.TOLERANCES)

    def variances() -> dict[str, float]:
        _, _, errors = tolerances.errors(runs=2000)
        return {axis: np.abs(error).max(axis=1).var() for axis, error in errors.items()}

    total = variances()
    for name in everything:
        others = {other: everything[other] if other == name else 0.0 for other in everything}
        monkeypatch.setattr(tolerances, "TOLERANCES", others)
        for axis, variance in variances().items():
            assert shares[axis][name] == pytest.approx(variance / total[axis], abs=0.1), (axis, name)


def test_tuned_gains_settle_faster_on_most_wrists() -> None:
    gains = importlib.import_module("gains")
    figure, found = gains.main(wrists=6)
    most = {name: np.percentile(times, 95) for name, times in found.items()}
    assert 0.3 < most["tuned"] <= most["as shipped"] < 0.8
    assert len(figure.axes) == 3


def test_identify_finds_the_parameters_of_the_simulated_rig(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = importlib.import_module("identify").main(tmp_path)
    truth = {
        name: text.split()[0]
        for name, text in (
            part.split(" ", 1) for part in capsys.readouterr().out.splitlines()[0].split(": ")[1].split(", ")
        )
    }
    assert (tmp_path / "report.html").stat().st_size > 10_000
    for name in ("k1", "k2"):
        estimate = found.parameters[name]
        assert abs(estimate.value - float(truth[name])) < 4 * estimate.standard_error


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nosuch.csv"], "nosuch.csv: cannot be read"),
        (["m.csv", "--seed", "-1"], "--seed -1: must be an integer of at least 0"),
        (["m.csv", "--noise", "-1"], "--noise -1: must be an integer of at least 0"),
        (["m.csv", "--friction", "-1"], "--friction: -1.0 is not a finite number of at least 0"),
        (["m.csv", "--measure", "yaw"], "--measure: yaw is not known"),
    ],
)
def test_the_rig_rejects(arguments: list[str], message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["pretend_rig.py", arguments[0], "run.csv", *arguments[1:]])
    with pytest.raises(SystemExit, match=f"^pretend_rig.py: {message}"):
        runpy.run_path(str(ROOT / "examples" / "pretend_rig.py"), run_name="__main__")


def test_each_gain_of_the_task_meets_the_same_episodes() -> None:
    """With equal gains, the returns are equal. The returns of the page are of 256 episodes each."""
    task = importlib.import_module("task")
    figure, returns = task.main(count=64)
    assert max(returns, key=lambda gain: returns[gain].mean()) == 8.0 and len(figure.axes) == 4
    total, away = task.play(task.VectorEnv(task.TASK, 8), np.full(8, 8.0), [*range(4)] * 2)
    np.testing.assert_array_equal(total[:4], total[4:])
    assert np.abs(away[-1]).max() < 1


def test_planned_motion_reaches_the_goal_and_stays(capsys: pytest.CaptureFixture[str]) -> None:
    planner = importlib.import_module("predictive_control")
    figure, errors = planner.main(rollouts=256, length=1.0)
    since = planner.STEP * np.arange(100) % planner.EACH > 0.25
    assert np.abs(errors["planned"][since]).max() < 1.0 < np.abs(errors["straight"][since]).max()
    assert np.abs(errors["program"][since]).max() < 0.005
    assert "decisions per second, 256 rollouts" in capsys.readouterr().out
    assert len(figure.axes) == 2
