"""Errors, for example invalid arguments, FMUs that cannot be loaded, and interrupted runs; also units and values of all types."""

from __future__ import annotations

import platform
import re
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import fmpy
import fmu_run
import numpy as np
import pytest
from c_models import repacked

TIME = np.linspace(0.0, 1.0, 11)


@pytest.fixture
def fmu(testbed):
    with fmu_run.Fmu(testbed) as opened:
        yield opened


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"inputs": {"thet1": 0.0}}, 'has no variable "thet1"; did you mean "theta1"?'),
        ({"inputs": {"theta1": np.zeros(4)}}, "theta1 has the shape (4,); it must be (11,), (runs, 11) or one value"),
        ({"inputs": {"theta1": np.zeros((2, 2, 11))}}, "theta1 has the shape (2, 2, 11)"),
        ({"inputs": {"theta1": ["a"] * 11}}, "theta1: the values are not numbers"),
        (
            {"start": {"k1": [[1.0]]}},
            "the start value of k1 has the shape (1, 1); it must be one number for all runs or instances, or (n,) with one number "
            "for each",
        ),
        ({"start": {"k1": "stiff"}}, 'k1 is a number, its start value cannot be "stiff"'),
        ({"start": {"k1": [1, 2]}, "inputs": {"theta1": np.zeros((3, 11))}}, "theta1 is given for 3 runs, k1 for 2"),
        ({"start": {"k1": []}}, "k1 has no values; give one for each run"),
        ({"inputs": {"theta1": (TIME, 1.0, "deg")}}, "theta1 has 11 times, but one value; give a value for each time"),
        (
            {"inputs": {"theta1": ([0.0, 0.0, 0.0], [0.0, 1.0, 2.0])}},
            "theta1 has the time 0 three times; a jump has it twice",
        ),
        ({"measures": ["pek"]}, 'there is no measure "pek"; there are min, max, peak, time_of_peak, mean, rms, end'),
        ({"every": 0}, "every must be at least 1, it is 0"),
        ({"threads": 0}, "threads must be at least 1, it is 0"),
        ({"threads": -2}, "threads must be at least 1, it is -2"),
        ({"threads": 1.5}, "threads must be an integer, it is 1.5"),
        ({"time": [[0.0, 1.0]]}, "time must have one dimension"),
        ({"time": [0.0, 0.1, np.nan]}, "time[2] is NaN; times must be finite"),
    ],
)
def test_invalid_arguments(fmu, arguments, message):
    with pytest.raises(ValueError) as raised:
        fmu.run(**{"time": TIME, "outputs": ["roll"], **arguments})
    assert message in str(raised.value)


def test_rejected_runs_do_not_affect_the_others(fmu):
    stiffness = np.array([100.0, -1.0, 100.0, np.nan, 100.0])
    runs = fmu.run(TIME, inputs={"theta1": TIME}, start={"k1": stiffness}, outputs=["roll"], every=1, measures=["peak"])
    assert runs.errors.keys() == {1, 3}
    assert runs.errors[1].endswith("k1 must not be below 1e-300, it is -1")
    assert runs.ok.tolist() == [True, False, True, False, True]
    assert np.isnan(runs["roll"][1]).all() and np.isnan(runs["roll", "peak"][3])
    np.testing.assert_array_equal(runs["roll"][0], runs["roll"][4])
    with pytest.raises(fmu_run.FmuError, match=r"run 1: .*k1 must not be below 1e-300.* \(2 of 5 runs failed\)"):
        runs.check()
    # If an input is rejected during the run, the message begins with the time.
    angle = np.where(TIME > 0.45, np.inf, 0.0)
    one = fmu.run(TIME, inputs={"theta1": angle}, outputs=["roll"])
    assert re.match(r"at 0\.5 s: .*theta1", one.errors[0]), one.errors
    # At the last time, all outputs are read before the input is rejected.
    angle = np.where(TIME > 0.95, np.inf, 0.0)
    one = fmu.run(TIME, inputs={"theta1": angle}, outputs=["roll"], read_before_set=True)
    assert re.match(r"at 1 s: .*theta1", one.errors[0]) and np.isfinite(one["roll"]).all()


# FMPy contains libraries for other systems, which linkers wrote. The Rust tests write headers themselves.
FMPY = Path(fmpy.__file__).parent
FOREIGN_LIBRARIES = {
    "Windows on x86_64": "logging/win64/logging.dll",
    "Windows on x86": "logging/win32/logging.dll",
    "macOS on x86_64 and aarch64": "logging/darwin64/logging.dylib",
}


@pytest.mark.parametrize("made_for", FOREIGN_LIBRARIES)
def test_a_library_of_another_machine(tmp_path, testbed, made_for):
    def change(name, content):
        return (FMPY / FOREIGN_LIBRARIES[made_for]).read_bytes() if name.startswith("binaries/") else content

    path = repacked(testbed, tmp_path / "foreign.fmu", change)
    this = f"{platform.system()} on {platform.machine()}"
    with pytest.raises(fmu_run.FmuError) as raised:
        fmu_run.Fmu(path)
    assert str(raised.value).endswith(f"its library cannot be loaded: it is for {made_for}, and this is {this}")


def test_an_execution_tool(tmp_path, faulty_fmu):
    def change(name, content):
        return content.replace(b"<CoSimulation ", b'<CoSimulation needsExecutionTool="true" ')

    path = repacked(faulty_fmu, tmp_path / "tool.fmu", change)
    with pytest.raises(fmu_run.FmuError, match=r"needsExecutionTool.*execution_tool=True"):
        fmu_run.Fmu(path)
    with fmu_run.Fmu(path, execution_tool=True) as fmu:
        assert fmu.run(TIME, outputs=["y"]).ok.all()


def test_a_closed_fmu(testbed):
    fmu = fmu_run.Fmu(testbed)
    fmu.close()
    fmu.close()
    with pytest.raises(fmu_run.FmuError, match="the FMU is closed"):
        fmu.run(TIME, outputs=["roll"])
    assert repr(fmu).endswith("variables, closed>")


def test_start_values_with_units(fmu):
    time, outputs = TIME, ["tau1", "theta3"]
    own = fmu.run(
        time,
        start={"k1": np.array([1.5, 2.0]) * 180 / np.pi, "theta3_start": np.pi / 6, "start_at_rest": 0},
        outputs=outputs,
    )
    other = fmu.run(
        time, start={"k1": ([1.5, 2.0], "N.m/deg"), "theta3_start": (30.0, "deg"), "start_at_rest": 0}, outputs=outputs
    )
    for name in outputs:
        np.testing.assert_allclose(other[name], own[name], rtol=1e-12)
    turned = fmu.run(time, inputs={"theta1": (np.linspace(0, 30, 11), "deg"), "theta2": (3.0, "deg")}, outputs=["roll"])
    radians = fmu.run(
        time, inputs={"theta1": np.linspace(0, 30, 11) * np.pi / 180, "theta2": 3.0 * np.pi / 180}, outputs=["roll"]
    )
    np.testing.assert_allclose(turned["roll"], radians["roll"], rtol=1e-12, atol=1e-15)
    with pytest.raises(ValueError, match='theta1 can be given in rad or deg, not in "grad"'):
        fmu.run(time, inputs={"theta1": (0.0, "grad")}, outputs=["roll"])
    held = fmu.instances(2, start={"theta3_start": (30.0, "deg"), "start_at_rest": "false"})
    np.testing.assert_allclose(held.get("theta3"), np.pi / 6, rtol=1e-15)
    with pytest.raises(ValueError, match="M has no unit, its values cannot be in kg"):
        fmu.run(time, start={"M": (3, "kg")}, outputs=outputs)


def test_other_types(faulty_fmu):
    with fmu_run.Fmu(faulty_fmu) as fmu:
        assert fmu.variables["label"].type == "String" and fmu.variables["count"].start == "3"
        assert fmu.variables["slope"].unit == "m/s" and fmu.variables["count"].unit is None
        counts = np.arange(11) - 5
        runs = fmu.run(
            TIME,
            inputs={"count": counts, "flag": counts > 0},
            start={"label": "seven77", "slope": 2},
            outputs=["y", "count", "flag"],
        ).check()
        labels = fmu.run(TIME, start={"label": ["one", "three"], "behaviour": ["Good", "SilentError"]}, outputs=["y"])
        assert list(labels["y"][:, 0]) == [3.0, 5.0] and list(labels.errors) == [1]
        one = fmu.instances(start={"label": "held", "behaviour": "Good", "flag": "true"})
        assert one.texts("label") == ["held"] and list(one.get(("behaviour", "flag"))[0]) == [0.0, 1.0]
        for call, message in [
            (lambda: one.get(["label", "y"]), "label is not a number"),
            (lambda: one.texts("y"), "y is a number, not a string"),
            (lambda: one.set("slope", None), "None is not a number"),
            (lambda: fmu.run(TIME, outputs=["y"], inputs={"slope": None}), "slope: None is not a number"),
            (lambda: fmu.run(TIME, outputs=["y"], start={"slope": None}), "slope: None is not a number"),
        ]:
            with pytest.raises(ValueError, match=message):
                call()
    np.testing.assert_array_equal(runs["count"][0], counts)
    np.testing.assert_array_equal(runs["flag"][0], counts > 0)
    np.testing.assert_allclose(runs["y"][0], 7 + 2 * TIME, atol=1e-15)


LONG_RUN_SCRIPT = """
import signal, sys, numpy as np, fmu_run
# Shells start commands in the background with Ctrl-C ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
with fmu_run.Fmu(sys.argv[1]) as fmu:
    time = np.arange(int(sys.argv[2])) * 1e-3
    short = len(time) < 1000000
    waiting = True

    def report(done, runs):
        # Prints a line when runs are in progress: short ones when some have ended.
        global waiting
        if waiting and (done > 0 or not short):
            waiting = False
            print("running", flush=True)

    try:
        fmu.run(time, start={"k1": np.full(100000, 90.0)}, outputs=["roll"], measures=["peak"], progress=report)
    except KeyboardInterrupt as interrupt:
        runs = interrupt.runs
        finished = np.isfinite(runs["roll", "peak"])
        assert list(runs.errors) == np.flatnonzero(~finished).tolist() and set(runs.errors.values()) == {"cancelled"}
        assert finished.any() == short and not finished.all()
        print("interrupted", flush=True)
"""


DAEMON_SCRIPT = """
import sys, threading, time, numpy as np, fmu_run
fmu = fmu_run.Fmu(sys.argv[1])
run = lambda: fmu.run(np.arange(100_000_000) * 1e-3, outputs=["roll"], measures=["peak"])
threading.Thread(target=run, daemon=True).start()
time.sleep(0.5)
"""


def test_a_daemon_thread_ends_with_python(testbed):
    done = subprocess.run([sys.executable, "-c", DAEMON_SCRIPT, testbed], capture_output=True, text=True, timeout=20)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.parametrize("times", [10_000, 100_000_000], ids=["short runs", "in a run"])
def test_ctrl_c_stops_runs(testbed, times):
    """Ctrl-C stops runs that would take minutes."""
    command = [sys.executable, "-c", LONG_RUN_SCRIPT, testbed, str(times)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline() == "running\n"
            process.send_signal(signal.SIGINT)
            assert process.communicate(timeout=20)[0] == "interrupted\n"
        finally:
            process.kill()
    assert process.returncode == 0


def test_progress(testbed):
    reports = []
    time = np.linspace(0, 20, 20001)
    with fmu_run.Fmu(testbed) as fmu:
        start = {"k1": np.full(400, 90.0)}
        fmu.run(
            time,
            start=start,
            outputs=["roll"],
            measures=["peak"],
            progress=lambda done, all_: reports.append((done, all_)),
        )
        assert reports and all(all_ == 400 for _, all_ in reports) and reports == sorted(reports)

        def stop(done, runs):
            raise RuntimeError("enough")

        with pytest.raises(RuntimeError, match="enough"):
            fmu.run(time, start=start, outputs=["roll"], measures=["peak"], progress=stop)
        # Further runs are possible.
        assert fmu.run(TIME, outputs=["roll"]).count == 1


def test_the_interface_type_must_exist(faulty_fmu):
    with fmu_run.Fmu(faulty_fmu) as fmu, pytest.raises(fmu_run.FmuError, match="has no Model Exchange"):
        fmu.run([0.0, 1.0], outputs=["y"], interface="model_exchange")


def test_arguments_of_wrong_types_are_named(fmu, testbed):
    """Passes wrong values to the arguments of many functions. Each message names the argument or the variable, and no instance fails."""
    one, continuous = fmu.instances(3), fmu.instances(2, interface="model-exchange")
    system = {"source": {"wrist": fmu}, "connections": {}, "order": "jacobi"}
    nothing = object()
    for call, argument, wrong in [
        (fmu.run, "time", [None, "noon", nothing, [[0.0], [0.0, 1.0]]]),
        (fmu.run, "outputs", [3, None, [3], b"roll", nothing]),
        (fmu.run, "inputs", [3, ["theta1"], "theta1", {3: 0.0}, {"theta1": nothing}, {"theta1": [[0.0], [0.0, 1.0]]}]),
        (fmu.run, "input_derivatives", [3, ["theta1"], {None: 0.0}]),
        (fmu.run, "start", [3, ["k1"], "k1", {3: 1.0}]),
        (fmu.run, "every", ["2", 1.5, True, [1]]),
        (fmu.run, "measures", [3, [3], nothing]),
        (fmu.run, "threads", ["2", 1.5, False, [1]]),
        (fmu.run, "read_before_set", ["no", None, 2, 0.5]),
        (fmu.run, "progress", [3, "bar", True]),
        (fmu.converted, "values", [None, "x", nothing]),
        (fmu.converted, "unit", [None, 3]),
        (fmu.converted, "name", [None, 3]),
        (fmu.instances, "count", ["2", 1.5, None, True]),
        (fmu.instances, "interface", [3, None, "both"]),
        (fmu.instances, "start", [3, ["k1"], {3: 1.0}]),
        (fmu.instances, "start_time", ["now", None, np.nan, True]),
        (fmu.instances, "stop_time", ["now", np.inf, [1.0]]),
        (fmu.instances, "threads", ["2", 1.5]),
        (fmu_run.Fmu, "path", [3, None, nothing]),
        (fmu_run.Fmu, "execution_tool", ["yes", None]),
        (fmu_run.System, "source", [3, None, {"wrist": 3}, {3: fmu}]),
        (fmu_run.System, "connections", [3, [1, 2], {"wrist.roll": 3}, np.array([1, 2])]),
        (fmu_run.System, "order", [3, None, "random"]),
        (one.set, "variables", [3, None, [3]]),
        (one.set, "values", [None, "x", [[1.0], [1.0, 2.0]], np.zeros(2)]),
        (one.set, "mask", [3, [1, 0, 1], np.array([0, 2]), np.array([1, 0, 1]), "yes", [True]]),
        (one.get, "variables", [3, None, [None]]),
        (one.get, "out", [3, [0.0], np.zeros(2), np.zeros(3, dtype=int)]),
        (one.texts, "variable", [3, None, ["roll"]]),
        (one.step, "size", ["1", [1e-3], True]),
        (one.advance, "set", [3, None]),
        (one.advance, "values", [None, "x", np.zeros((3, 3))]),
        (one.advance, "size", ["1", None]),
        (one.advance, "get", [3, None]),
        (one.advance, "out", [3, np.zeros(2)]),
        (one.reset, "mask", [3, [1, 0, 1]]),
        (one.reset, "start", [3, ["k1"], {None: 1.0}]),
        (one.restore, "states", [3, None, [3]]),
        (one.serialize, "states", [3, None, b"state"]),
        (one.deserialize, "states", [3, None, [3], b"state", "state"]),
        (one.directional_derivative, "unknowns", [3, None]),
        (one.directional_derivative, "knowns", [3, None]),
        (one.directional_derivative, "seed", [None, "x", np.zeros((2, 2))]),
        (continuous.set_time, "time", [None, "noon", np.zeros(3)]),
        (continuous.set_continuous_states, "states", [None, "x", np.zeros(5)]),
        (continuous.get_derivatives, "out", [3, np.zeros((2, 5))]),
        (continuous.handle_events, "values", [3j, "x", np.zeros(3)]),
    ]:
        valid = {
            fmu.run: {"time": TIME, "outputs": ["roll"]},
            fmu.converted: {"name": "k1", "values": 1.0, "unit": "N.m/deg"},
            fmu_run.Fmu: {"path": testbed},
            fmu_run.System: system,
            one.set: {"variables": "theta1", "values": 0.0},
            one.advance: {"set": "theta1", "values": 0.0, "size": 1e-3, "get": "roll"},
            one.get: {"variables": "roll"},
            one.directional_derivative: {"unknowns": "roll", "knowns": "theta1", "seed": 1.0},
            continuous.handle_events: {"variables": "theta1", "values": 0.0},
        }.get(call, {})
        for value in wrong:
            with pytest.raises(ValueError) as raised:
                call(**{**valid, argument: value})
            named = [argument, *(value if isinstance(value, dict) else ())]
            assert any(str(name) in str(raised.value) for name in named), (argument, value, raised.value)
            assert "\n" not in str(raised.value)
    assert one.errors == continuous.errors == {}, "an invalid argument must not make an instance fail"


@pytest.mark.parametrize("flag", [True, 1, [0, 1], "true", np.array([True])])
def test_an_input_without_effect_is_a_warning_once(testbed, flag, tmp_path):
    given = {"outputs": ["roll"], "inputs": {"theta1": 0.1, "omega1": 0.2}}
    time = [0.0, 0.1]
    with fmu_run.Fmu(testbed) as fmu, warnings.catch_warnings():
        warnings.simplefilter("error")
        fmu.run(time, **given, start={"use_omega": flag})
        fmu.run(time, **given, interface="model-exchange")

        def without(name, content):
            is_description = name == "modelDescription.xml"
            return re.sub(b"(?s)<CoSimulation.*?(/>|</CoSimulation>)", b"", content) if is_description else content

        with fmu_run.Fmu(repacked(Path(testbed), tmp_path / "exchange.fmu", without)) as exchange:
            exchange.run(time, **given)
        message = "omega1 has no effect, because use_omega is false; add 'use_omega': True to start"
        with pytest.raises(UserWarning, match=message):
            fmu.run(time, **given, start={"use_omega": False})
        fmu.run(time, **given)
    with (
        fmu_run.System({"wrist": testbed}, {}) as system,
        pytest.warns(UserWarning, match="wrist.omega1 .*wrist.use_omega"),
    ):
        system.run(time, outputs=["wrist.roll"], inputs={"wrist.omega1": 1.0})
