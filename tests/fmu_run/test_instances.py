"""Results of instances are bit-identical to `Fmu.run`. Also tests their errors."""

from __future__ import annotations

import subprocess
import sys
import threading

import fmu_run
import numpy as np
import pytest
from test_runs import motion

MOTORS = ("theta1", "theta2")
OUTPUTS = ("tau1", "tau2", "pitch", "M")


def angles(time: np.ndarray, count: int) -> np.ndarray:
    """Returns angles (times, count, 2) rad: for each instance the same motion with another amplitude."""
    _, moves = motion(len(time))
    scale = np.linspace(0.5, 1.5, count)
    return np.stack([np.multiply.outer(moves[name], scale) for name in MOTORS], axis=2)


@pytest.mark.parametrize("threads", [1, 3])
def test_instances_equal_runs(testbed, threads) -> None:
    time, _ = motion(60)
    count, stiffness = 7, np.linspace(60.0, 130.0, 7)
    moves = angles(time, count)
    with fmu_run.Fmu(testbed) as fmu:
        inputs = {name: np.ascontiguousarray(moves[:, :, k].T) for k, name in enumerate(MOTORS)}
        runs = fmu.run(time, inputs=inputs, start={"k1": stiffness}, outputs=OUTPUTS)
        start = {"k1": stiffness} | {name: moves[0, :, k] for k, name in enumerate(MOTORS)}
        wrists = fmu.instances(count, start=start, start_time=time[0], stop_time=time[-1], threads=threads)
        read = np.empty((count, len(OUTPUTS)))
        for k, now in enumerate(time):
            wrists.set(MOTORS, moves[k])
            assert wrists.get(OUTPUTS, out=read) is read
            assert np.array_equal(read.T, [runs[name][:, k] for name in OUTPUTS])
            if k + 1 < len(time):
                wrists.step(to=time[k + 1])
        assert np.array_equal(wrists.time, np.full(count, time[-1]))
        assert np.array_equal(wrists.get("tau1"), read[:, 0]) and wrists.errors == {}


def test_advance_equals_three_calls(testbed) -> None:
    with fmu_run.Fmu(testbed) as fmu:
        one, three = fmu.instances(5, threads=2), fmu.instances(5)
        moves = angles(np.arange(40) * 1e-3, 5)
        for move in moves:
            read = one.advance(MOTORS, move, 1e-3, OUTPUTS)
            three.set(MOTORS, move)
            three.step(1e-3)
            assert np.array_equal(read, three.get(OUTPUTS))


def test_derivatives_of_inputs_and_outputs(fmu) -> None:
    """With linear inputs and their derivatives, an instance equals a run. Output derivatives agree with difference quotients."""
    time = np.arange(30) * 1e-3
    with fmu_run.Fmu(fmu) as loaded:
        slopes = {"theta1": 3.0, "theta2": -2.0}
        runs = loaded.run(
            time,
            inputs={name: slope * time for name, slope in slopes.items()},
            input_derivatives={name: np.full(30, slope) for name, slope in slopes.items()},
            outputs=["tau1"],
        )
        wrist = loaded.instances(stop_time=time[-1] + 1.0)
        for k, now in enumerate(time):
            wrist.set(MOTORS, [slope * now for slope in slopes.values()])
            wrist.set_input_derivatives(MOTORS, list(slopes.values()))
            assert wrist.get("tau1") == runs["tau1"][0, k]
            if k + 1 < len(time):
                wrist.step(to=time[k + 1])
        reported, before = wrist.get_output_derivatives(("pitch", "roll"))[0], wrist.get(("pitch", "roll"))[0]
        wrist.step(1e-7)
        found = (wrist.get(("pitch", "roll"))[0] - before) / 1e-7
        assert np.allclose(reported, found, rtol=1e-4)
        with pytest.raises(ValueError, match="only Real"):
            wrist.get_output_derivatives("M")


def test_masks_reset_and_restore(testbed) -> None:
    with fmu_run.Fmu(testbed) as fmu:
        wrists = fmu.instances(4, start={"k1": [50.0, 60.0, 70.0, 80.0], "theta1": 0.1})
        fresh = wrists.get(OUTPUTS)
        wrists.set("theta1", 0.2)
        wrists.step(1e-3)
        saved, then = wrists.save(), wrists.get(OUTPUTS)
        wrists.set("theta1", [0.3, 0.4, 0.5, 0.6], mask=[True, False, True, False])
        wrists.step(1e-3)
        later = wrists.get(OUTPUTS)
        wrists.restore(saved, mask=np.array([False, True, True, False]))
        wrists.reset(mask=[True, False, False, False])
        now = wrists.get(OUTPUTS)
        assert np.array_equal(now, [fresh[0], then[1], then[2], later[3]])
        assert np.array_equal(wrists.time, [0.0, 1e-3, 1e-3, 2e-3])
        wrists.reset(start={"k1": 90.0})
        assert np.array_equal(wrists.get("k1"), np.full(4, 90.0)) and np.array_equal(
            wrists.get("theta1"), np.full(4, 0.1)
        )


def test_states_as_bytes_in_another_process(testbed) -> None:
    program = f"""
import sys, numpy as np, fmu_run
fmu = fmu_run.Fmu({str(testbed)!r})
one = fmu.instances(2)
one.restore(one.deserialize([bytes.fromhex(line) for line in sys.stdin.read().split()]))
one.step(1e-3)
sys.stdout.write(one.get({OUTPUTS!r}).tobytes().hex() + " " + one.time.tobytes().hex())
"""
    with fmu_run.Fmu(testbed) as fmu:
        wrists = fmu.instances(2)
        wrists.set(MOTORS, [[0.1, 0.2], [0.3, -0.1]])
        wrists.step(1e-3)
        texts = "\n".join(state.hex() for state in wrists.serialize(wrists.save()) if state is not None)
        other = subprocess.run([sys.executable, "-c", program], input=texts, capture_output=True, text=True, check=True)
        wrists.step(1e-3)
        assert other.stdout.split() == [wrists.get(OUTPUTS).tobytes().hex(), wrists.time.tobytes().hex()]
        first, second = map(bytes.fromhex, texts.split())
        with pytest.raises(fmu_run.FmuError, match=r"instance 1: .*damaged"):
            wrists.deserialize([first, second[:-1] + bytes([second[-1] ^ 1])])


def test_a_failed_instance_does_not_affect_the_others(testbed) -> None:
    with fmu_run.Fmu(testbed) as fmu:
        wrists, single = fmu.instances(3), fmu.instances()
        saved = wrists.save()
        wrists.set(MOTORS, [[0.1, 0.0], [np.inf, 0.0], [0.3, 0.0]])
        wrists.step(1e-3)
        read = wrists.get("tau1")
        assert list(wrists.errors) == [1] and "theta1 must be a finite number" in wrists.errors[1]
        assert np.array_equal(np.isnan(read), [False, True, False])
        wrists.restore(saved)
        assert wrists.errors == {} and np.array_equal(wrists.get("tau1"), np.zeros(3))
        with pytest.raises(fmu_run.FmuError, match="theta1 must be a finite number"):
            single.set("theta1", np.nan)
        gone = r"^the instance has dropped out before; reset\(\) or restore\(\) brings .*theta1 must be a finite number"
        for call in (lambda: single.step(1e-3), lambda: single.get("roll"), single.save):
            with pytest.raises(fmu_run.FmuError, match=gone):
                call()
        single.reset()
        assert single.errors == {} and single.get("roll")[0] == 0.0
        with pytest.raises(fmu_run.FmuError, match="k1 must not be below"):
            fmu.instances(2, start={"k1": -1.0})


def test_events_of_the_controller(controller) -> None:
    """Samples are time events. Values can be set in Event Mode."""
    with fmu_run.Fmu(controller) as fmu:
        law = fmu.instances(3, interface="model-exchange")
        due = law.next_event_time.copy()
        assert np.all(due > 0.0)
        law.set_time(due)
        law.handle_events("pitch_ref", 0.2, mask=[True, True, False])
        assert np.array_equal(law.next_event_time > due, [True, True, False])
        assert np.array_equal(law.wants_to_end, np.zeros(3))
        assert np.array_equal(law.completed_integrator_step(), np.zeros((3, 2)))


def test_invalid_arguments(testbed) -> None:
    with fmu_run.Fmu(testbed) as fmu:
        wrists = fmu.instances(3)
        for call, message in [
            (
                lambda: wrists.set(MOTORS, np.zeros((2, 2))),
                r"values has the shape \(2, 2\); it must be \(3, 2\), \(2,\) or a number",
            ),
            (lambda: wrists.set("theta1", [0.0, 1.0]), r"values has the shape \(2,\); it must be \(3,\) or a number"),
            (lambda: wrists.set(["theta1", "theta1"], [1.0, 2.0]), "theta1 is twice among the variables"),
            (lambda: wrists.get(MOTORS, out=np.zeros((3, 3))), r"shape \(3, 2\)"),
            (lambda: wrists.get(MOTORS, out=np.zeros((2, 3)).T), "contiguous"),
            (lambda: wrists.get("theta1", out=np.zeros(3, dtype=np.float32)), "float64"),
            (lambda: wrists.step(), "either the size of the step or the time"),
            (lambda: wrists.step(1e-3, mask=[True]), "1 Booleans for 3 instances"),
            (lambda: wrists.restore(fmu.instances(3).save()), "states belong to other instances"),
            (lambda: fmu.instances(3, start={"k1": [100.0]}), "k1 has 1 start values for 3 instances"),
            (lambda: fmu.instances(0), "count must be at least 1, it is 0"),
            (lambda: fmu.instances(-3), "count must be at least 1, it is -3"),
            (lambda: fmu.instances(2, threads=-1), "threads must be at least 1, it is -1"),
            (lambda: wrists.advance(MOTORS, 0.0, -1e-3, MOTORS), "the size of a step is -0.001 s; it must be above 0"),
            (lambda: wrists.step(to=0.0), "to is 0 s; it must be after .*, and instance 0 is at 0 s"),
            (lambda: fmu.instances(interface="both"), "co-simulation"),
            (lambda: wrists.deserialize([None, b"", None]), "the state of instance 1 is cut short"),
            (lambda: wrists.handle_events(), "for Co-Simulation; this is for Model Exchange"),
            (lambda: wrists.get_derivatives(), "for Co-Simulation; this is for Model Exchange"),
            (lambda: wrists.set_time(0.0), "for Co-Simulation; this is for Model Exchange"),
            (lambda: fmu.instances(interface="model-exchange").step(1e-3), "only Co-Simulation has steps"),
            (lambda: fmu.instances(interface="model-exchange").set_time(np.inf), "time is inf; it must be finite"),
        ]:
            with pytest.raises(ValueError, match=message):
                call()
        assert wrists.errors == {}


def test_more_instances_than_memory(testbed) -> None:
    with fmu_run.Fmu(testbed) as fmu:
        for count in (200_000_000, 10**30):
            with pytest.raises(MemoryError, match="instances need more memory than there is"):
                fmu.instances(count)
        with pytest.raises(MemoryError, match="trajectories need more memory"):
            fmu.run(np.arange(1e6), start={"k1": np.full(10**7, 90.0)}, outputs=["roll"] * 10**6)


def test_python_threads_share_instances(testbed) -> None:
    """Calls wait for each other without a deadlock. The instances still work after the FMU is closed."""
    fmu = fmu_run.Fmu(testbed)
    wrists = fmu.instances(64, threads=2)
    fmu.close()

    def work() -> None:
        for _ in range(200):
            wrists.step(1e-3)
            wrists.save()

    workers = [threading.Thread(target=work) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert np.allclose(wrists.time, 0.8) and wrists.errors == {}
