"""Motors that are driven by torque: examples/torque_driven.py in Co-Simulation, and the models for OpenModelica, compared with the
machine of tests/oracle/machine.py, whose equations come from energies only."""

from __future__ import annotations

import html
import importlib
import re
from typing import Any

import machine
import numpy as np
import pytest
from built import ROOT, built, text_of
from lagrange import table_1

from tools.documentation.sources import TESTBED, read_description, read_table

MODELS = ROOT / "examples/openmodelica"
MODEL = (MODELS / "TorqueDriven.mo").read_text(encoding="utf-8")
TIME = np.linspace(0.0, 1.0, 1001)


@pytest.fixture(scope="module")
def moved() -> machine.Trajectory:
    """The move to a pitch of 30 and a roll of 60 degrees."""
    found = machine.simulate(TIME, table_1())
    assert np.rad2deg([found.pitch[-1], found.roll[-1]]) == pytest.approx([30, 60], abs=0.01)
    # A motor that drives the wrist feels a negative torque.
    assert found.tau[:50, 0].max() <= 0 < np.abs(found.tau[:, 0]).max()
    return found


@pytest.fixture(scope="module")
def example() -> Any:
    return importlib.import_module("torque_driven")


def errors(example: Any, h: float, extrapolated: bool) -> np.ndarray:
    """Returns the largest errors of tau1, tau2, pitch and roll in the first 0.25 s of the move, in the units of the FMU."""
    built("prw_testbed.fmu")
    time, found = example.simulate(h, extrapolated, example.move, 0.25)
    exact = machine.simulate(time, table_1())
    expected = (exact.tau[:, 0], exact.tau[:, 1], exact.pitch, exact.roll)
    return np.array([np.abs(found[name] - y).max() for name, y in zip(("tau1", "tau2", "pitch", "roll"), expected)])


def test_co_simulation_converges_to_the_machine(example, monkeypatch):
    """The error is first order in the communication step with held torques, and second order with extrapolated ones."""
    monkeypatch.chdir(ROOT)
    for extrapolated, expected in ((False, 1), (True, 2)):
        coarse, fine = errors(example, 1e-3, extrapolated), errors(example, 0.5e-3, extrapolated)
        assert np.log2(coarse / fine) == pytest.approx(expected, abs=0.2)
    assert np.all(fine < [1e-4, 1e-4, 1e-5, 1e-5]), fine


def test_the_document_has_the_errors_that_the_example_prints(example, monkeypatch):
    """The references of the motors jump. An independent solution confirms the errors for two communication steps."""
    monkeypatch.chdir(ROOT)
    figure, found = example.main()
    stated = {h: [f"{share:.1f} %" if share < 100 else "unstable" for share in shares] for h, shares in found.items()}
    rows = read_table(ROOT / "docs/compatibility.md", "Motors driven by torque").rows
    assert rows == [[f"{1e3 * h:g} ms", *shares] for h, shares in stated.items()]
    assert len(figure.axes) == 2
    fine = example.FINEST * np.arange(round(0.4 / example.FINEST) + 1)
    exact = machine.simulate(fine, table_1(), references=example.jump, breaks=()).tau[:, 0]
    for h in (2e-3, 0.25e-3):
        for extrapolated, share in zip((False, True), found[h]):
            _, coupled = example.simulate(h, extrapolated, example.jump, 0.1)
            error = np.abs(coupled["tau1"] - exact[: round(0.1 / example.FINEST) + 1 : round(h / example.FINEST)]).max()
            assert 100 * error / np.abs(exact).max() == pytest.approx(share, rel=0.1, abs=0.01)


def compiled(text: str) -> dict[str, np.ndarray]:
    """Simulates the model `Machine` of a Modelica text, and returns all variables at TIME."""
    modelica = pytest.importorskip("rumoca")
    testbed = (ROOT / "tests/closed_loop/testbed.mo").read_text(encoding="utf-8")
    # The other machine is cut out, because it needs the Modelica Standard Library.
    text = re.sub(r"  model DriveOfLibrary.*  end MachineOfLibrary;\n", "", text, flags=re.S)
    model = modelica.Session().loads(text + testbed, model="TorqueDriven.Machine", filename="in_memory/machine.mo")
    config = modelica.SimConfig(solver="bdf", rtol=1e-10, atol=1e-12, dt=1e-3)
    run = model.simulate(t=(0.0, 1.0), config=config)
    time = np.array(run.time)
    kept = np.append(True, np.diff(time) > 1e-9)  # The end of the move is an event, which has two rows.
    np.testing.assert_allclose(time[kept], TIME, rtol=0, atol=1e-12)
    return dict(zip(run.names, run.to_numpy()[:, kept]))


def test_the_model_for_openmodelica(moved):
    """A Modelica compiler simulates the text, in which the testbed's equations in Modelica replace the FMU."""
    found = compiled(MODEL)
    for k in (0, 1):
        drive = f"drive{k + 1}"
        np.testing.assert_allclose(found[f"{drive}.theta"], moved.theta[:, k], rtol=0, atol=1e-9)
        np.testing.assert_allclose(found[f"{drive}.omega"], moved.omega[:, k], rtol=0, atol=1e-8)
        np.testing.assert_allclose(found[f"{drive}.current"], moved.current[:, k], rtol=0, atol=1e-7)
        np.testing.assert_allclose(found[f"testbed.tau{k + 1}"], moved.tau[:, k], rtol=0, atol=1e-7)
    np.testing.assert_allclose(found["testbed.roll"], moved.roll, rtol=0, atol=1e-9)


def test_the_other_sign_of_the_torque_is_another_machine(moved):
    equation = "tanh(omega / motor.creep) + tau;"
    assert equation in MODEL
    try:
        found = compiled(MODEL.replace(equation, equation.replace("+ tau", "- tau")))
    except Exception as error:
        assert type(error).__name__ == "SimulationError", error
    else:
        assert np.abs(found["drive1.theta"] - moved.theta[:, 0]).max() > 0.01


@pytest.mark.parametrize("name", ["TorqueDriven.mo", "ClosedLoop.mo"])
def test_a_compiler_of_modelica_accepts_the_text(name):
    modelica = pytest.importorskip("rumoca")
    text = (MODELS / name).read_text(encoding="utf-8")
    assert not modelica.validate_source(text, filename=name)
    assert modelica.validate_source(text.replace("equation", "equations", 1), filename=name), "a wrong text is accepted"


def test_the_models_use_the_names_of_the_fmu():
    known = {variable.name for variable in read_description(ROOT / TESTBED).modelVariables}
    used = set(re.findall(r"\btestbed\.(\w+)", MODEL))
    assert used == {"theta1", "theta2", "omega1", "omega2", "tau1", "tau2"} <= known
    script = (MODELS / "torque_driven.mos").read_text(encoding="utf-8")
    for model in re.findall(r"simulate\(TorqueDriven\.(\w+),", script):
        assert f"  model {model} " in MODEL
    assert 'loadFile("../TorqueDriven.mo")' in script
    assert 'importFMU("../../../target/fmu/prw_testbed.fmu", workdir = cd() + "/testbed", fullPath = true)' in script


def test_the_page_in_the_fmu_shows_lines_of_the_model():
    page = text_of(built("prw_testbed.fmu"))
    (shown,) = re.findall(r'<pre data-model="TorqueDriven" tabindex="0"><code>(.*?)</code></pre>', page, flags=re.S)
    lines = [line for line in html.unescape(shown).splitlines() if line]
    assert len(lines) > 3 and set(lines) <= set(MODEL.splitlines())
    # The adaptor of the library has the opposite sign.
    assert "<code>f = -tau1</code>" in page and "    wrist.f = -tau;" in MODEL
    assert "use_pder2 = false" in page and "(use_pder2 = false)" in MODEL
