"""The animation of the wrist in the README: equal motor rates, opposite ones, and both motions with a controller."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from fmu_run import Fmu

from prw.frames import MEASURED
from prw.motion import Array, Motion
from prw.simulation import Run

#: Communication step, s.
STEP = 1e-3
#: Seconds of the run per second of the animation.
SPEED = 0.8
#: Amplitude of prescribed motor motions, rad, and the durations of their three parts, s: to the amplitude, to its
#: opposite, and back to 0.
SWING, LEGS = np.deg2rad(35), (0.45, 0.7, 0.45)
#: Goals of the controller, pitch and roll in rad, one after the other, and the duration of each, s.
GOALS, STAY = (np.deg2rad((30, 60)), np.zeros(2)), 0.8
MOTORS = ("theta1", "theta2", "omega1", "omega2")
CONTROLLED = ("pitch", "roll", "pitch_rate", "roll_rate", "tau1", "tau2")


def captioned_run(testbed_fmu: Path, controller_fmu: Path) -> tuple[Run, list[tuple[float, str]]]:
    """Run the testbed, first with prescribed motor motions, then with the controller. The run begins and ends at rest at zero.
    Returns the run and its captions, each with the time (s) from which it is shown."""
    prescribed = _there_and_back()
    with Fmu(testbed_fmu) as loaded_testbed, Fmu(controller_fmu) as loaded_controller:
        testbed, controller = loaded_testbed.instances(start={"use_omega": True}), loaded_controller.instances()
        rows, captions = [], []

        def motors(theta: Sequence[float], omega: Sequence[float]) -> None:
            testbed.set(MOTORS, (*theta, *omega))
            rows.append(testbed.get((*MOTORS, *MEASURED))[0])

        for caption, second in (("Equal motors: the wrist pitches", 1), ("Opposite motors: the wrist rolls", -1)):
            captions.append((testbed.time[0], caption))
            for theta, omega in prescribed:
                motors((theta, second * theta), (omega, second * omega))
                testbed.step(STEP)
        captions.append((testbed.time[0], "With a controller: both at once"))
        for pitch, roll in GOALS:
            controller.set(("pitch_ref", "roll_ref"), (pitch, roll))
            for _ in range(round(STAY / STEP)):
                theta1, theta2, omega1, omega2 = controller.get(MOTORS)[0]
                motors((theta1, theta2), (omega1, omega2))
                controller.set(CONTROLLED, testbed.get(CONTROLLED)[0])
                for instance in (testbed, controller):
                    instance.step(STEP)
        counts = {name: int(testbed.get(name)[0]) for name in ("M", "N")}
    found = np.array(rows)
    time: Array = STEP * np.arange(len(rows), dtype=np.float64)
    motion = Motion(time, found[:, :2], found[:, 2:4], "animation")
    return Run(motion, dict(zip(MEASURED, found[:, 4:].T)), counts), captions


def _there_and_back() -> Array:
    """Angle (rad) and rate (rad/s) of a motor that goes to SWING, to its opposite and back, with minimal jerk."""
    angles, parts = (0, SWING, -SWING, 0), []
    for begin, end, duration in zip(angles, angles[1:], LEGS):
        s = np.arange(round(duration / STEP)) * STEP / duration
        way, slope = s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2 / duration
        parts.append(np.column_stack([begin + (end - begin) * way, (end - begin) * slope]))
    return np.vstack(parts)
