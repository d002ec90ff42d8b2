"""The paper's experiment (Sec. 4, Fig. 4) through the FMU."""

from __future__ import annotations

import fmpy
import numpy as np
from instance import assert_close
from lagrange import OUTPUTS
from reference import follow, integrate

from prw.motion import FIG4_FREQUENCY, fig4


def run(instance, motion):
    instance.start(motion.theta[0], motion.omega[0])
    return instance.run(motion.time, motion.theta, rate=motion.omega)


def without_pitch(values):
    return {name: np.zeros_like(v) if name in ("pitch", "pitch_rate") else v for name, v in values.items()}


def test_exact_between_communication_points(instance, model):
    motion = fig4()
    expected_at, expected_after = follow(model, motion.time, motion.theta, motion.omega)
    at, after = run(instance, motion)
    assert_close(without_pitch(at), without_pitch(expected_at), 1e-11)
    assert_close(without_pitch(after), without_pitch(expected_after), 1e-11)
    for values in (at, after):
        assert np.max(np.abs(values["pitch"])) <= 1e-14
        assert np.max(np.abs(values["pitch_rate"])) <= 1e-14


def test_true_response(instance, model):
    """A millisecond is fine enough for the curves of Fig. 4: within 6e-4 of the response to the unsampled motion."""
    motion, sign = fig4(), np.array([1, -1])
    at, _ = run(instance, motion)
    some = slice(None, None, 40)
    true = integrate(
        model,
        motion.time[some],
        lambda t: sign * (1 - np.cos(FIG4_FREQUENCY * t)) / FIG4_FREQUENCY,
        lambda t: sign * np.sin(FIG4_FREQUENCY * t),
    )
    found = {name: values[some] for name, values in at.items()}
    assert_close(without_pitch(found), without_pitch(true), 6e-4)


def test_simulate_fmu(fmu, instance):
    """FMPy's own master, with its defaults, finds what the bare calls find; it reads after each step."""
    motion = fig4()
    _, after = run(instance, motion)
    table = np.rec.fromarrays([motion.time, *motion.theta.T, *motion.omega.T], names="time,theta1,theta2,omega1,omega2")
    result = fmpy.simulate_fmu(
        str(fmu),
        stop_time=2.0,
        output_interval=1e-3,
        input=np.asarray(table),
        output=list(OUTPUTS),
        start_values={"use_omega": True},
        fmi_type="CoSimulation",
    )
    found = {name: result[name][1:] for name in OUTPUTS}
    assert_close(without_pitch(found), without_pitch(after), 1e-11)
    assert np.max(np.abs(found["pitch"])) <= 1e-14
