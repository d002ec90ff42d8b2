"""A model with arrays, which are scalars in FMI 2.0. One program runs both FMUs; results are bit-identical and equal FMPy's."""

from __future__ import annotations

import subprocess
from pathlib import Path

import fmpy
import fmu_run
import numpy as np
import pytest
from built import ROOT
from fmpy.validation import validate_fmu

PIECES = range(1, 9)
TEMPERATURES = [f"T[{piece}]" for piece in PIECES]
#: One output of each type that can be read as a number.
OUTPUTS = [
    "mean",
    "means[2]",
    *TEMPERATURES,
    "hot[1]",
    "hot[8]",
    "der(T[3])",
    "limits[2,1]",
    "switches[1]",
    "counted[2]",
]


@pytest.fixture(scope="session")
def rods(tmp_path_factory) -> tuple[Path, Path]:
    """The FMUs of crates/fmu-export/tests/models/rod.rs, for FMI 2.0 and FMI 3.0."""
    folder = tmp_path_factory.mktemp("rods")
    # Built in the whole workspace, like the Rust tests. With --package, cargo would compile crates again with other features.
    build = ["cargo", "build", "--quiet", "--locked", "--workspace", "--example", "rod"]
    subprocess.run(build, cwd=ROOT, check=True)
    examples = ROOT / "target/debug/examples"
    subprocess.run([examples / "rod", examples / "librod.so", folder], cwd=ROOT, check=True)
    return folder / "rod2.fmu", folder / "rod3.fmu"


def both(rods, run):
    """Returns the results of `run` for each FMU."""
    found = []
    for path in rods:
        with fmu_run.Fmu(path) as fmu:
            found.append(run(fmu))
    return found


def test_variables_are_elements(rods) -> None:
    of_fmi2, of_fmi3 = both(rods, lambda fmu: dict(fmu.variables))
    assert [name for name in of_fmi3 if name in of_fmi2] == list(of_fmi2)
    assert set(of_fmi3) - set(of_fmi2) == {"time", *(f"eventIndicator[{piece}]" for piece in PIECES)}
    for name, variable in of_fmi2.items():
        assert (variable.start, variable.unit, variable.min) == (
            of_fmi3[name].start,
            of_fmi3[name].unit,
            of_fmi3[name].min,
        ), name
    assert (of_fmi3["capacities[8]"].start, of_fmi3["labels[2]"].start) == ("2.875", "the far half")


def test_runs_are_bit_identical(rods) -> None:
    time = np.linspace(0.0, 2.0, 21)
    start = {"capacities[3]": [1.0, 4.0], "limits[2,1]": 11.0, "limits[1,2]": 20.5, "T[8]": 40.0, "labels[1]": "one"}
    inputs = {"power[2]": 3 + np.sin(time), "switches[2]": np.where(time > 1, 3.0, 0.0)}
    runs = both(rods, lambda fmu: fmu.run(time, inputs=inputs, start=start, outputs=OUTPUTS))
    for name in OUTPUTS:
        assert np.array_equal(runs[0][name], runs[1][name]), name
    assert (runs[0]["limits[2,1]"] == 11).all() and (runs[0]["switches[1]"] == 3).all()
    assert (runs[0]["hot[8]"][:, 1] == 1).all(), "starts at 40"
    assert not np.array_equal(runs[0]["T[3]"][0], runs[0]["T[3]"][1]), "the capacity has an effect"


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_runs_equal_fmpy(rods, kind) -> None:
    results = [
        fmpy.simulate_fmu(
            str(rod), fmi_type=kind, solver="Euler", step_size=0.01, stop_time=1.0, output_interval=0.1, output=output
        )
        for rod, output in zip(rods, [TEMPERATURES, ["T"]])
    ]
    of_fmi2 = np.transpose([results[0][name] for name in TEMPERATURES])
    assert np.array_equal(of_fmi2, results[1]["T"]) and len(of_fmi2) >= 11
    if kind == "CoSimulation":
        for runs in both(rods, lambda fmu: fmu.run(results[0]["time"], outputs=TEMPERATURES)):
            assert np.array_equal(np.transpose([runs[name][0] for name in TEMPERATURES]), of_fmi2)


def test_fmpy_reports_no_problem(rods) -> None:
    for rod in rods:
        assert fmpy.read_model_description(str(rod), validate=True) and validate_fmu(str(rod)) == []


def test_elements_of_stateful_instances(rods) -> None:
    def use(fmu):
        rod = fmu.instances(2, start={"T[2]": [1.0, 2.0], "T[5]": 3.0, "counted[2]": 7, "labels[2]": "zwei"})
        found = [rod.get(TEMPERATURES), rod.get("counted[1]"), rod.get("counted[2]")]
        rod.set(["power[2]", "switches[2]"], [[5.0, 3.0], [6.0, 3.0]])
        found += [rod.get(["power[1]", "power[2]", "switches[1]", "switches[2]"])]
        states = rod.save()
        rod.step(0.1)
        found.append(rod.get(TEMPERATURES))
        found.append(rod.get_output_derivatives(["T[3]", "mean"]))
        found.append(rod.directional_derivative(["der(T[2])", "der(T[3])", "mean"], ["T[2]", "wall"], [1.0, 0.5]))
        rod.restore(states)
        rod.set("switches[1]", 0.0)
        found.append(rod.get(["T[1]", "switches[1]", "switches[2]"]))
        found.append(rod.texts("labels[1]") + rod.texts("reports[2]"))
        return found

    of_fmi2, of_fmi3 = both(rods, use)
    for one, other in zip(of_fmi2, of_fmi3, strict=True):
        assert np.array_equal(one, other)
    assert of_fmi3[0][1].tolist() == [20.0, 2.0, 22.0, 23.0, 3.0, 25.0, 26.0, 27.0]
    assert of_fmi3[3].tolist() == [[10.0, 5.0, 3.0, 3.0], [10.0, 6.0, 3.0, 3.0]]
    assert of_fmi3[-1][:2] == ["the near half"] * 2 and of_fmi3[-1][2].startswith("zwei is ")
    # der(T[2]) depends on T[2] by -2 times, der(T[3]) by +1 times the conductance between neighbours divided by the capacity.
    assert np.allclose(of_fmi3[6], [[-1.0 / 2.125, 0.5 / 2.25, 1 / 8]] * 2)


def test_states_and_indicators(rods) -> None:
    def use(fmu):
        rod = fmu.instances(interface="model-exchange")
        found = [rod.get_continuous_states(), rod.get_derivatives(), rod.get_event_indicators(), rod.get_nominals()]
        rod.set_time(0.1)
        rod.set_continuous_states(np.arange(8.0))
        return [*found, rod.get(TEMPERATURES), rod.get_derivatives(), rod.get([f"der(T[{k}])" for k in PIECES])]

    of_fmi2, of_fmi3 = both(rods, use)
    for one, other in zip(of_fmi2, of_fmi3, strict=True):
        assert np.array_equal(one, other) and one.shape == (1, 8)
    assert of_fmi3[4][0].tolist() == list(range(8)) and np.array_equal(of_fmi3[5], of_fmi3[6])
