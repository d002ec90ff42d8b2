"""Results of systems of testbed and controller are bit-identical to instances that the test connects."""

from __future__ import annotations

import re
import zipfile
from itertools import product

import fmu_run
import numpy as np
import pytest
from built import built

SENSED = ("pitch", "roll", "pitch_rate", "roll_rate", "tau1", "tau2")
MOVED = ("theta1", "theta2", "omega1", "omega2")
CONNECTIONS = {f"testbed.{name}": f"controller.{name}" for name in SENSED}
CONNECTIONS |= {f"controller.{name}": f"testbed.{name}" for name in MOVED}
GOAL = {"controller.pitch_ref": 0.3, "controller.roll_ref": -0.4}
SHOWN = ("testbed.pitch", "testbed.tau1", "testbed.tau2", "controller.theta1", "controller.tau1")
ORDERS = ("dependencies", "jacobi")


@pytest.fixture(params=[("", ""), ("", "fmi3"), ("fmi3", "")], ids=["2.0", "2.0 and 3.0", "3.0 and 2.0"])
def fmus(request):
    """Controller and testbed, for equal or different FMI versions."""
    names = [
        f"{directory}/{name}".strip("/")
        for directory, name in zip(request.param, ("prw_controller.fmu", "prw_testbed.fmu"))
    ]
    with fmu_run.Fmu(built(names[0])) as controller, fmu_run.Fmu(built(names[1])) as testbed:
        yield {"controller": controller, "testbed": testbed}


def by_hand(fmus, order: str, steps: int, k1: float) -> np.ndarray:
    """Returns the variables SHOWN at each communication point. The test connects one instance of each FMU."""
    start = {name.split(".")[1]: value for name, value in GOAL.items()}
    law, wrist = fmus["controller"].instances(start=start), fmus["testbed"].instances(start={"k1": k1})
    rows = []
    sensed, moved = wrist.get(SENSED), law.get(MOVED)
    for _ in range(steps):
        if order == "dependencies":
            # The controller's outputs do not depend directly on its inputs, but the torques depend on them, so they are passed on first.
            wrist.set(MOVED, law.get(MOVED))
            law.set(SENSED, wrist.get(SENSED))
        by_name = {"testbed": wrist, "controller": law}
        rows.append([by_name[name.split(".")[0]].get(name.split(".")[1])[0] for name in SHOWN])
        if order == "jacobi":
            wrist.set(MOVED, moved)
            law.set(SENSED, sensed)
        law.step(1e-3)
        wrist.step(1e-3)
        sensed, moved = wrist.get(SENSED), law.get(MOVED)
    return np.array(rows)


@pytest.mark.parametrize("order", ORDERS)
def test_a_system_equals_connected_instances(fmus, order) -> None:
    stiffness = [80.0, 120.0]
    expected = [by_hand(fmus, order, 150, k1) for k1 in stiffness]
    loop = fmu_run.System(fmus, CONNECTIONS, order=order)
    pairs = loop.instances(2, start=GOAL | {"testbed.k1": stiffness}, threads=2)
    for k in range(150):
        assert np.array_equal(pairs.get(SHOWN), [run[k] for run in expected]), k
        pairs.step(1e-3)
    # These times are exact in binary, so runs and instances have the same times.
    time = np.arange(100) / 1024
    runs = loop.run(time, start=GOAL | {"testbed.k1": stiffness}, outputs=SHOWN, measures=["end"], every=1)
    again = loop.instances(2, start=GOAL | {"testbed.k1": stiffness})
    for k in range(len(time)):
        assert np.array_equal(again.get(SHOWN).T, [runs[name][:, k] for name in SHOWN])
        again.step(1 / 1024)
    assert np.array_equal(runs["testbed.pitch", "end"], runs["testbed.pitch"][:, -1])


@pytest.mark.parametrize("order", ORDERS)
def test_states_of_all_components_are_saved(fmus, order) -> None:
    loop = fmu_run.System(fmus, CONNECTIONS, order=order)
    pairs = loop.instances(3, start=GOAL | {"testbed.k1": [70.0, 90.0, 110.0]})

    def continued() -> np.ndarray:
        rows = []
        for _ in range(30):
            pairs.step(1e-3)
            rows.append(pairs.get(SHOWN))
        return np.array(rows)

    for _ in range(40):
        pairs.step(1e-3)
    saved = pairs.save()
    first = continued()
    texts = pairs.serialize(saved)
    pairs.restore(saved)
    assert np.array_equal(pairs.time, np.full(3, pairs.time[0])) and np.array_equal(continued(), first)
    pairs.reset()
    pairs.restore(pairs.deserialize(texts))
    assert np.array_equal(continued(), first)
    with pytest.raises(fmu_run.FmuError, match=re.escape("the bytes are not a state of this system")):
        pairs.deserialize([text[:-9] for text in texts])
    pairs.restore(saved, mask=[False, True, False])
    assert len(set(pairs.time)) == 2


def test_torques_are_passed_on_after_the_motors_are_set(fmus) -> None:
    stages = fmu_run.System(fmus, CONNECTIONS).stages
    assert [{pair for pair in stage if ".tau" in pair[0]} for stage in stages] == [
        set(),
        {(f"testbed.tau{i}", f"controller.tau{i}") for i in (1, 2)},
    ]
    assert sorted(sum(stages, [])) == sorted(CONNECTIONS.items())
    assert len(fmu_run.System(fmus, CONNECTIONS, order="jacobi").stages) == 1


@pytest.mark.parametrize(
    "connections, order, message",
    [
        ({"testbed.pitch": "controller.tau1"}, "jacobi", "testbed.pitch cannot feed controller.tau1: the output is in rad, the input in N.m"),
        ({"testbed.pitch": ["controller.pitch", "controller.pitch"]}, "jacobi", "controller.pitch is fed twice"),
        ({}, "gauss", "order must be 'dependencies' or 'jacobi', it is 'gauss'"),
    ],
)  # fmt: skip
def test_invalid_connections(connections, order, message) -> None:
    fmus = {name: fmu_run.Fmu(built(f"prw_{name}.fmu")) for name in ("controller", "testbed")}
    with pytest.raises(ValueError, match=re.escape(message)):
        fmu_run.System(fmus, connections, order=order)


def test_a_connector_and_its_variable_are_not_set_together() -> None:
    both = {"pitch_ref": 0.1, "controller.pitch_ref": 0.2}
    loop = fmu_run.System(built("prw_closed_loop.ssp"))
    pairs = loop.instances()
    for call in (
        lambda: loop.run([0.0, 1e-3], start=both, outputs=["pitch"]),
        lambda: loop.run([0.0, 1e-3], inputs=both, outputs=["pitch"]),
        lambda: pairs.set(list(both), [0.1, 0.2]),
    ):
        with pytest.raises(
            ValueError, match="pitch_ref and controller.pitch_ref among the .* are the same variable; give one of them"
        ):
            call()
    one, other = pairs.get(list(both))[0]
    assert one == other == np.deg2rad(30.0)


def test_connected_inputs_cannot_be_set() -> None:
    with fmu_run.Fmu(built("prw_controller.fmu")) as controller, fmu_run.Fmu(built("prw_testbed.fmu")) as testbed:
        loop = fmu_run.System({"controller": controller, "testbed": testbed}, CONNECTIONS)
        pair = loop.instances()
        with pytest.raises(ValueError, match="testbed.theta1 is fed by controller.theta1, it cannot be set"):
            pair.set("testbed.theta1", 1.0)
        with pytest.raises(ValueError, match="of one FMU and not of a system"):
            pair.directional_derivative("testbed.tau1", "controller.roll_ref", 1.0)
        with pytest.raises(fmu_run.FmuError, match="system is a system; systems run in Co-Simulation only"):
            loop.instances(interface="model-exchange")
        # The error message of an FMU contains the name of its component.
        runs = loop.run([0, 1e-3], start={"testbed.k1": [-1.0, 90.0]}, outputs=["testbed.roll"])
        assert list(runs.errors) == [0] and "testbed: " in runs.errors[0] and "k1" in runs.errors[0]


def rewritten(directory, change) -> str:
    """Returns a copy of the closed loop's SSP with a changed system structure."""
    source, to = built("prw_closed_loop.ssp"), directory / "changed.ssp"
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(to, "w") as new:
        for name in old.namelist():
            text = old.read(name)
            new.writestr(name, change(text.decode()) if name == "SystemStructure.ssd" else text)
    return str(to)


@pytest.mark.parametrize("order", ORDERS)
def test_an_ssp_is_the_same_system(order, tmp_path) -> None:
    ssp = fmu_run.System(built("prw_closed_loop.ssp"), order=order)
    with fmu_run.Fmu(built("prw_controller.fmu")) as controller, fmu_run.Fmu(built("prw_testbed.fmu")) as testbed:
        connected = fmu_run.System({"controller": controller, "testbed": testbed}, CONNECTIONS, order=order)
        goal = {
            "controller.pitch_ref": np.deg2rad(30.0),
            "controller.roll_ref": np.deg2rad(60.0),
            "testbed.use_omega": "true",
        }
        time = np.linspace(0.0, 0.5, 501)
        expected = connected.run(time, start=goal, outputs=["testbed.pitch", "testbed.roll"])
    paths = {name: built(f"prw_{name}.fmu") for name in ("controller", "testbed")}
    pairs = fmu_run.System(paths, CONNECTIONS.items(), order=order)
    assert [sorted(stage) for stage in pairs.stages] == [sorted(stage) for stage in ssp.stages]
    # In an SSP the system names its connectors, for example `pitch`, and start values come from the file.
    found = ssp.run(time, outputs=["pitch", "roll"])
    assert all(np.array_equal(found[name], expected[f"testbed.{name}"]) for name in ("pitch", "roll"))
    assert ssp.stop_time == 1.0 and ssp.variables["pitch_ref"].unit == "rad" and ssp.name == "prw_closed_loop"
    # The start values that are shown, and from which sensitivities step, are those of the file.
    shown = [ssp.variables[name].start for name in ("pitch_ref", "controller.pitch_ref", "testbed.use_omega")]
    assert [float(shown[0]), float(shown[1]), shown[2]] == [*[np.deg2rad(30.0)] * 2, "true"]
    slope = ssp.sensitivities(time, outputs=["pitch"], parameters="pitch_ref")["pitch", "pitch_ref"]
    # The motion to another angle takes another time, so the slope is not the motion divided by the angle.
    low, high = (
        ssp.run(time, start={"pitch_ref": np.deg2rad(angle)}, outputs=["pitch"])["pitch"][0] for angle in (29.99, 30.01)
    )
    np.testing.assert_allclose(slope.ravel(), (high - low) / np.deg2rad(0.02), atol=0.02)
    other = ssp.run(time, start={"pitch_ref": (10.0, "deg")}, inputs={"roll_ref": 0.0}, outputs=["pitch", "roll"])
    assert abs(np.rad2deg(other["pitch"][0, -1]) - 10.0) < 0.2 and np.abs(other["roll"][0, -1]) < 1e-3

    # Moves the controller into a nested system.
    def nested(text: str) -> str:
        begin, end = text.index('<ssd:Component name="controller"'), text.index('<ssd:Component name="testbed"')
        connectors = re.search(r"<ssd:Connectors>.*?</ssd:Connectors>", text[begin:end], re.S)
        assert connectors
        inner = (
            "".join(
                f'<ssd:Connection startElement="{a}" startConnector="{name}" endElement="{b}" endConnector="{name}"/>'
                for name, kind in re.findall(r'name="(\w+)" kind="(\w+)"', connectors[0])
                for a, b in [("", "controller") if kind == "input" else ("controller", "")]
            )
            .replace('startElement="" ', "")
            .replace('endElement="" ', "")
        )
        component = f'<ssd:System name="laws">{connectors[0]}<ssd:Elements>{text[begin:end]}</ssd:Elements>'
        rest = text[end:].replace('Element="controller"', 'Element="laws"')
        return text[:begin] + component + f"<ssd:Connections>{inner}</ssd:Connections></ssd:System>" + rest

    deep = fmu_run.System(rewritten(tmp_path, nested), order=order)
    again = deep.run(time, outputs=["pitch", "laws.controller.theta1"])
    assert np.array_equal(again["pitch"], found["pitch"]) and np.ptp(again["laws.controller.theta1"]) > 0.1


def test_unsupported_ssps(tmp_path) -> None:
    with pytest.raises(fmu_run.FmuError, match="component testbed: there is no readable resources/other.fmu in it"):
        fmu_run.System(rewritten(tmp_path, lambda text: text.replace("/prw_testbed.fmu", "/other.fmu")))
    with pytest.raises(ValueError, match="an SSP has its own connections"):
        fmu_run.System(built("prw_closed_loop.ssp"), {})


def test_values_that_are_not_used_are_warnings(tmp_path) -> None:
    def without(text: str) -> str:
        return re.sub(r"<ssd:Connection startConnector=\"roll_ref\"[^>]*/>", "", text)

    with pytest.warns(UserWarning, match="the value of roll_ref is not used, because it leads to no variable"):
        fmu_run.System(rewritten(tmp_path, without)).close()


def test_one_input_of_the_system_feeds_several(tmp_path) -> None:
    def both(text: str) -> str:
        return text.replace('startConnector="roll_ref"', 'startConnector="pitch_ref"')

    with pytest.warns(UserWarning, match="the value of roll_ref is not used"):
        system = fmu_run.System(rewritten(tmp_path, both))
    with system as loop:
        one = loop.instances()
        one.set("pitch_ref", 0.25)
        assert list(one.get(["controller.pitch_ref", "controller.roll_ref"])[0]) == [0.25, 0.25]
        runs = loop.run([0.0, 0.1], start={"pitch_ref": [0.1, 0.2]}, outputs=["controller.roll_ref", "pitch_ref"])
        for name, run in product(("controller.roll_ref", "pitch_ref"), (0, 1)):
            assert runs[name][run, 0] == (0.1, 0.2)[run]
