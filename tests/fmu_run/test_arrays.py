"""A model with arrays, whose elements are scalars in FMI 2.0. Results of the FMUs for FMI 2.0 and 3.0 are bit-identical, also in FMPy."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import fmpy
import fmu_run
import numpy as np
import pytest
from built import ROOT
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp

PIECES = range(1, 9)
TEMPERATURES = [f"T[{piece}]" for piece in PIECES]
#: Variables of all types that can be read as numbers.
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
    """The FMUs of crates/fmu-test-kit/src/models/rod.rs, for FMI 2.0 and FMI 3.0."""
    directory = tmp_path_factory.mktemp("rods")
    # `make test` has built the program with the Rust tests. Built with --package, crates would have other features, so that cargo
    # would compile them again.
    if "PROGRAMS" not in os.environ:
        build = ["cargo", "build", "--quiet", "--locked", "--workspace", "--example", "rod"]
        subprocess.run(build, cwd=ROOT, check=True)
    examples = ROOT / "target/debug/examples"
    subprocess.run([examples / "rod", examples / "librod.so", directory], cwd=ROOT, check=True)
    return directory / "rod2.fmu", directory / "rod3.fmu"


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
    assert (runs[0]["hot[8]"][:, 1] == 1).all(), "the last piece starts at 40, which must be hot"
    assert not np.array_equal(runs[0]["T[3]"][0], runs[0]["T[3]"][1]), "the capacity must have an effect"


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


def heated(rod: Path, switches: list[tuple[float, int, int]], **options) -> np.ndarray:
    """Returns FMPy's results in Model Exchange. switches: times, each with the values of both switches."""
    kinds = [("time", float), ("switches[1]", np.int32), ("switches[2]", np.int32)]
    return fmpy.simulate_fmu(
        str(rod),
        fmi_type="ModelExchange",
        stop_time=2.0,
        input=np.array(switches, dtype=kinds),
        output=[*TEMPERATURES, "hot[4]"],
        **options,
    )


def exact(time: np.ndarray, parts: list[tuple[float, float, list[float]]]) -> np.ndarray:
    """Returns the temperatures (8, times), integrated with a relative tolerance of 1e-11. parts: begin, end and the powers of both
    heaters."""
    capacities, temperatures, found = 2.0 + 0.125 * np.arange(8), 20.0 + np.arange(8.0), []

    def rates(_: float, at: np.ndarray, heat: np.ndarray) -> np.ndarray:
        # The far end loses no heat.
        return (0.5 * (np.append(20.0, at[:-1]) - at + np.append(np.diff(at), 0.0)) + heat) / capacities

    for begin, end, power in parts:
        heat = np.repeat(power, 4)
        solved = solve_ivp(rates, (begin, end), temperatures, "DOP853", rtol=1e-11, args=(heat,), dense_output=True)
        inside = time[(time >= begin) & (time < end) | (time == 2.0) & (end == 2.0)]
        found.append(solved.sol(inside))
        temperatures = solved.y[:, -1]
    return np.hstack(found)


def test_discrete_inputs_that_fmpy_sets_in_continuous_time_mode(rods) -> None:
    """While CVode looks for roots of the indicators, FMPy sets all inputs, also the discrete ones."""
    result = heated(rods[0], [(0.0, 3, 0), (2.0, 3, 0)], solver="CVode", output_interval=0.1, relative_tolerance=1e-9)
    found = np.array([result[name] for name in TEMPERATURES])
    np.testing.assert_allclose(found, exact(result["time"], [(0.0, 2.0, [10.0, 0.0])]), rtol=1e-6)
    assert len(np.unique(result["hot[4]"])) == 2, "hot[4] must change, because an indicator changes its sign"


def test_a_switch_in_fmpy(rods) -> None:
    """Uses FMPy's Euler method, because it ends a step at the event. CVode steps beyond the event, and FMPy then sets the new value
    outside of Event Mode."""
    switches = [(0.0, 3, 0), (0.6, 3, 0), (0.6, 0, 3), (2.0, 0, 3)]
    result = heated(rods[0], switches, solver="Euler", output_interval=1e-3)
    time = result["time"]
    kept = np.append(np.diff(time) > 1e-9, True) & (np.abs(time - 0.6) > 1e-9)
    found = np.array([result[name][kept] for name in TEMPERATURES])
    expected = exact(time[kept], [(0.0, 0.6, [10.0, 0.0]), (0.6, 2.0, [0.0, 5.0])])
    np.testing.assert_allclose(found, expected, rtol=2e-4)
    assert len(np.unique(result["hot[4]"])) == 2, "hot[4] must change, because an indicator changes its sign"


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
    # With respect to T[2], the derivative of der(T[2]) is -2 times the conductance between neighbours, 0.5, divided by the capacity
    # of piece 2; the derivative of der(T[3]) is the conductance divided by the capacity of piece 3. `wall` has no effect on them.
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


def test_whole_arrays_in_runs(rods) -> None:
    """Runs with whole arrays equal runs with their elements, although the FMU for FMI 2.0 has only elements, and the FMU for FMI 3.0
    only arrays."""
    time = np.linspace(0.0, 1.0, 11)
    limits, power = np.array([[10.0, 20.5], [11.0, 21.0]]), np.stack([3 + np.sin(time), np.cos(time)], axis=1)
    capacities = np.stack([np.linspace(1.0, 2.0, 8), np.linspace(2.0, 4.0, 8), np.full(8, 3.0)])
    elements = {
        **{f"limits[{i + 1},{j + 1}]": limits[i, j] for i in range(2) for j in range(2)},
        **{f"capacities[{k + 1}]": capacities[:, k] for k in range(8)},
        **{f"T[{k + 1}]": 30.0 for k in range(8)},
        "labels[1]": "one",
        "labels[2]": "two",
    }
    names = [*TEMPERATURES, "limits[1,1]", "limits[1,2]", "limits[2,1]", "limits[2,2]"]

    def use(fmu):
        whole = fmu.run(
            time,
            inputs={"power": power},
            start={"limits": limits, "capacities": capacities, "T": 30.0, "labels": ["one", "two"]},
            outputs=["T", "mean", "limits"],
            every=2,
            measures=["peak", "end"],
        ).check()
        by_element = fmu.run(
            time,
            inputs={"power[1]": power[:, 0], "power[2]": power[:, 1]},
            start=elements,
            outputs=["mean", *names],
            every=2,
            measures=["peak", "end"],
        ).check()
        assert whole["T"].shape == (3, 6, 8) and whole["limits"].shape == (3, 6, 2, 2)
        assert (
            whole["T", "peak"].shape == (3, 8)
            and whole["mean"].shape == (3, 6)
            and list(whole) == ["T", "mean", "limits"]
        )
        assert np.array_equal(whole["mean"], by_element["mean"])
        for key, one in [("T", TEMPERATURES), ("limits", names[8:])]:
            expected = np.stack([by_element[name] for name in one], axis=-1)
            assert np.array_equal(whole[key], expected.reshape(whole[key].shape))
            peaks = np.stack([by_element[name, "peak"] for name in one], axis=-1)
            assert np.array_equal(whole[key, "peak"], peaks.reshape(whole[key, "peak"].shape))
            assert all(np.array_equal(whole[name], by_element[name]) for name in one)
        assert np.array_equal(whole["limits"][1, 0], limits)
        assert whole.start["limits"].shape == (3, 2, 2) and np.array_equal(whole.start["capacities"], capacities)
        frame, dataset = whole.to_pandas(), whole.to_xarray()
        assert np.array_equal(frame["T[3]"], by_element["T[3]"].ravel()) and "T[8]_end" in frame
        assert dataset["limits"].dims == ("run", "time", "limits_0", "limits_1")
        assert dataset["T_end"].dims == ("run", "T_0") and dataset["capacities"].dims == ("run", "capacities_0")
        return whole

    for one, other in zip(*(runs.values() for runs in both(rods, use)), strict=True):
        assert np.array_equal(one, other)


def test_events_have_their_own_values_after_arrays_of_strings(rods) -> None:
    def use(fmu):
        def run(outputs):
            arguments = {
                "interface": "model-exchange",
                "start": {"T[8]": 29.99},
                "events": True,
                "measures": ["end"],
                "every": 1,
            }
            return fmu.run(np.linspace(0.0, 2.0, 5), outputs=outputs, **arguments).check()

        runs, alone = run(["labels", "mean", "reports", "T", "hot"]), run(["mean", "T", "hot"])
        assert runs["reports"].shape == (1, 5, 2) and runs["reports"][0, 0, 0] == "the near half is well"
        assert runs["labels"][0, -1].tolist() == ["the near half", "the far half"]
        for name in ("mean", "T", "hot"):
            assert np.array_equal(runs[name], alone[name]) and np.array_equal(runs[name, "end"], alone[name, "end"])
        assert runs.events == alone.events and runs.events[0].before != runs.events[0].after
        return runs.events

    both(rods, use)


def test_whole_arrays_of_inputs_for_each_run(rods) -> None:
    time = np.linspace(0.0, 1.0, 5)
    power = np.random.default_rng(2).uniform(0.0, 9.0, (3, 5, 2))

    def use(fmu):
        found = [
            fmu.run(time, inputs={"power": given}, outputs=["T"])["T"] for given in (power, power[1], power[1, 0], 4.0)
        ]
        elements = {"power[1]": power[:, :, 0], "power[2]": power[:, :, 1]}
        expected = fmu.run(time, inputs=elements, outputs=TEMPERATURES)
        assert np.array_equal(found[0], np.stack([expected[name] for name in TEMPERATURES], axis=-1))
        assert np.array_equal(found[1][0], found[0][1]) and not np.array_equal(found[2], found[3])
        for inputs, start, message in [
            (
                {"power": power[:, :, :1]},
                {},
                r"power has the shape \(3, 5, 1\); it must be \(5, 2\), \(runs, 5, 2\), \(2,\) or one value",
            ),
            ({"power": np.zeros(5)}, {}, r"power has the shape \(5,\)"),
            (
                {},
                {"limits": np.eye(3)},
                r"limits has the shape \(3, 3\); it must be \(2, 2\), \(n, 2, 2\) with an array for each run or instance,",
            ),
            ({}, {"limits": [1.0, 2.0]}, r"limits has the shape \(2,\)"),
            ({}, {"limits": np.ones((3, 2, 2)), "capacities": np.ones((2, 8))}, "is given for 3 runs, .* for 2"),
            ({}, {"limit": np.eye(2)}, r'no variable "limit"; did you mean "limits'),
        ]:
            with pytest.raises(ValueError, match=message):
                fmu.run(time, inputs=inputs, start=start, outputs=["T"])
        return found

    for one, other in zip(*both(rods, use), strict=True):
        assert np.array_equal(one, other)


def test_whole_arrays_of_instances(rods) -> None:
    def use(fmu):
        starts, limits = np.arange(24.0).reshape(3, 8), np.array([[10.0, 20.0], [11.0, 21.0]])
        rod = fmu.instances(3, start={"T": starts, "limits": limits})
        found = [rod.get("T"), rod.get("limits"), rod.get(["T", "mean"])]
        assert np.array_equal(found[0], starts) and np.array_equal(found[1], [limits] * 3)
        assert found[2].shape == (3, 9) and np.array_equal(found[2][:, :8], starts)
        rod.set("power", [1.0, 2.0])
        rod.set("power", [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], mask=[True, False, True])
        found.append(rod.get("power"))
        found.append(rod.advance("power", np.ones((3, 2)), 0.1, "T"))
        found.append(rod.directional_derivative("T", "power", [1.0, 0.0]))
        rod.reset(start={"T": 5.0})
        found.append(rod.get("T"))
        assert np.array_equal(found[3], [[1.0, 2.0], [1.0, 2.0], [5.0, 6.0]])
        assert found[4].shape == found[5].shape == (3, 8) and (found[6] == 5.0).all()
        with pytest.raises(ValueError, match=r"values has the shape \(3,\); it must be \(3, 2\), \(2,\) or a number"):
            rod.set("power", np.zeros(3))
        return found

    for one, other in zip(*both(rods, use), strict=True):
        assert np.array_equal(one, other)
