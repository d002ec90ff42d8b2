"""The reference experiments: motion of the motors, parameters, and response of the testbed.

The oracle calculates the response. If the motors turn at constant rates, the FMU is exact in Co-Simulation at any step size, and in
Model Exchange up to the solver's tolerance. Other motions are given by samples, between which importers interpolate linearly; the
tolerances allow for this error.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import Any

import numpy as np
from controlled import MOTORS, Law, control
from lagrange import OUTPUTS, REAL, UNITS, linear_model, table_1, varied
from reference import follow, integrate

#: The outputs by their unit, in the order of the tolerances below.
GROUPS = [
    [name for name in OUTPUTS if UNITS[name] == unit]
    for unit in dict.fromkeys(("rad", "rad/s", "N.m", *UNITS.values()))
]
#: Tolerances of angles, rates and torques, as fractions of the largest value of all outputs with the same unit. Outputs with another
#: unit, such as a power, have the largest of the three. In Co-Simulation, torques have wider tolerances unless the motors turn at
#: constant rates, because many importers read the torques before they set the next rates of the motors. So the torques of these
#: importers lag one step.
RelativeTolerances = Mapping[str, tuple[float, float, float]]
STEP_SIZES = {"CoSimulation": 1e-3, "ModelExchange": 1e-3}
FAST_MOTION: RelativeTolerances = {"CoSimulation": (5e-4, 1e-3, 2e-2), "ModelExchange": (5e-4, 1e-3, 2e-3)}
SLOW_MOTION: RelativeTolerances = {"CoSimulation": (1e-4, 3e-4, 2e-2), "ModelExchange": (1e-4, 3e-4, 2e-3)}
EXACT: RelativeTolerances = {"CoSimulation": (1e-6,) * 3, "ModelExchange": (1e-5,) * 3}
#: Interval in s between rows of the reference, and between samples of motors that do not turn at constant rates.
INTERVAL, SAMPLE_TIME = 0.01, 1e-3
#: Duration in s of all experiments except rate_step, and of the move from point to point.
STOP, MOVE_DURATION = 1.0, 0.4

Function = Callable[[float], Any]


@dataclass(frozen=True)
class Experiment:
    """Reference experiment.

    `inputs` has `time` and MOTORS by name, which importers interpolate linearly. `reference` has `time` and OUTPUTS by
    name. `parameters` are parameters of the FMU in SI units. `tolerances` are one of the constants above.
    """

    name: str
    description: str
    parameters: dict[str, Any]
    inputs: dict[str, Any]
    reference: dict[str, Any]
    tolerances: RelativeTolerances = field(default_factory=lambda: FAST_MOTION)

    def allowed(self, interface: str) -> dict[str, float]:
        """Returns the tolerance of each output in its unit."""
        found, fractions = {}, self.tolerances[interface]
        for names, fraction in zip_longest(GROUPS, fractions, fillvalue=max(fractions)):
            largest = max(np.abs(self.reference[name]).max() for name in names)
            found.update(dict.fromkeys(names, float(f"{fraction * largest:.3g}")))
        return {name: found[name] for name in OUTPUTS}


def experiments() -> list[Experiment]:
    """Returns all reference experiments. This takes some seconds."""
    table = with_counts(table_1())
    return [
        fig4("fig4_opposite", "Fig. 4: motors with opposite rates, sin(10 pi t) rad/s; the wrist rolls", -1),
        fig4("fig4_equal", "Fig. 4 with equal rates, sin(10 pi t) rad/s; the wrist pitches", 1),
        rate_step(),
        experiment_from_motion(
            "from_40_degrees",
            "From rest at a pitch of 40 degrees to a pitch of -10 and a roll of 30 degrees in 0.4 s, and then rest",
            table,
            *point_to_point(np.deg2rad([40.0, 40.0]), inverse_kinematics(np.deg2rad([-10.0, 30.0])), MOVE_DURATION),
            tolerances=SLOW_MOTION,
        ),
        experiment_from_motion(
            "other_parameters",
            "Another testbed: every parameter differs from Table 1; the motor rates are sines of 3 and 5 Hz",
            another_testbed(),
            *sines(np.array([0.2, -0.1]), 2 * np.pi * np.array([3.0, 5.0])),
        ),
        closed_loop(table),
    ]


def another_testbed() -> dict[str, Any]:
    """Returns parameters that all differ from Table 1. A parameter that `named` lacks would have half its value of Table 1."""
    named = {
        "J2": 5e-3,
        "J3": 0.02,
        "H3": 0.03,
        "k1": 90.0,
        "k2": 60.0,
        "c1": 0.6,
        "c2": 0.4,
        "c3": 0.25,
        "M": 3,
        "N": 5,
    }
    others = varied([0.5] * len(REAL))
    return {**named, **{name: value for name, value in others.items() if name not in named}}


def with_counts(parameters: dict[str, Any]) -> dict[str, Any]:
    """Converts M and N to integers."""
    return {**parameters, "M": int(parameters["M"]), "N": int(parameters["N"])}


def inverse_kinematics(wrist: Any) -> Any:
    """Inverse kinematics at rest, eq. (1): motor angles (2,) for pitch and roll (2,), all in rad."""
    return np.linalg.solve(Law().to_wrist, wrist)


def fig4(name: str, description: str, sign: int) -> Experiment:
    """Returns the first second of the paper's experiment (Sec. 4)."""
    frequency, sides = 10 * np.pi, np.array([1, sign])
    return experiment_from_motion(
        name,
        description,
        with_counts(table_1()),
        lambda t: sides * 2 * np.sin(frequency * t / 2) ** 2 / frequency,
        lambda t: sides * np.sin(frequency * t),
    )


def point_to_point(start: Any, end: Any, duration: float) -> tuple[Function, Function]:
    """Returns functions for the angles and rates (2,) of a move of `duration` s: a polynomial of degree 5 with continuous acceleration."""

    def angle(t: float) -> Any:
        s = min(t / duration, 1.0)
        return start + (end - start) * s**3 * (10 - 15 * s + 6 * s**2)

    def rate(t: float) -> Any:
        s = min(t / duration, 1.0)
        return (end - start) * 30 * s**2 * (1 - s) ** 2 / duration

    return angle, rate


def sines(amplitude: Any, frequency: Any) -> tuple[Function, Function]:
    """Returns functions for angles and rates (2,) that start at rest at 0; frequency (2,) in rad/s."""
    return (
        lambda t: amplitude * (1 - np.cos(frequency * t)),
        lambda t: amplitude * frequency * np.sin(frequency * t),
    )


def experiment_from_motion(
    name: str,
    description: str,
    parameters: dict[str, Any],
    angle: Function,
    rate: Function,
    tolerances: RelativeTolerances = FAST_MOTION,
) -> Experiment:
    """Builds the experiment with motor angles angle(t) in rad and rates rate(t) in rad/s; the testbed starts at rest."""
    model = linear_model({key: float(value) for key, value in parameters.items()})
    t, fine = times(STOP, INTERVAL), times(STOP, SAMPLE_TIME)
    motion = np.array([(*angle(s), *rate(s)) for s in fine])
    # The motions are smooth except at the end of a move, where the solver restarts.
    true_values = integrate(model, t, angle, rate, breaks=(MOVE_DURATION,))
    return Experiment(
        name,
        description,
        {**parameters, "use_omega": True},
        {"time": fine, **dict(zip(MOTORS, motion.T))},
        {"time": t, **true_values},
        tolerances,
    )


def rate_step() -> Experiment:
    """Motor 1 turns at 0.5 rad/s from the start. Motor 2 stays at rest, and the wrist starts at rest."""
    t, speed = times(0.5, INTERVAL), np.array([0.5, 0.0])
    parameters = with_counts(table_1())
    model = linear_model({key: float(value) for key, value in parameters.items()})
    true_values, _ = follow(model, t, np.outer(t, speed), np.tile(speed, (len(t), 1)))
    ends = t[[0, -1]]
    motors = np.column_stack([np.outer(ends, speed), np.tile(speed, (2, 1))])
    return Experiment(
        "rate_step",
        "The rate of motor 1 steps from 0 to 0.5 rad/s at the first instant, motor 2 is at rest; exact at any step size",
        {**parameters, "use_omega": True},
        {"time": ends, **dict(zip(MOTORS, motors.T))},
        {"time": t, **true_values},
        EXACT,
    )


def closed_loop(parameters: dict[str, Any]) -> Experiment:
    """The controller moves the testbed to a pitch of 30 and a roll of 60 degrees."""
    model = linear_model({key: float(value) for key, value in parameters.items()})
    law = Law()
    loop = control(model, law, np.deg2rad([30.0, 60.0]), round(STOP / law.sample_time))
    fine, every = times(STOP, law.sample_time), round(INTERVAL / law.sample_time)
    return Experiment(
        "closed_loop",
        "Closed loop with the control law of prw_controller, from rest to a pitch of 30 and a roll of 60 degrees",
        {**parameters, "use_omega": True},
        {"time": fine, **{name: loop[name] for name in MOTORS}},
        {"time": fine[::every], **{name: loop[name][::every] for name in OUTPUTS}},
        SLOW_MOTION,
    )


def times(stop: float, step: float) -> Any:
    """Returns 0, step, ... stop."""
    return np.arange(round(stop / step) + 1) * step
