"""Closed loop of testbed and controller, which shares no code with the FMUs.

The testbed is the linear model of lagrange.py. Between samples, the motors have constant acceleration and the model is
propagated exactly. The controller follows the law in its documentation. It takes the rate of a motor from a table of
braking distances, which are summed sample by sample.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from lagrange import OUTPUTS, LinearModel
from reference import at_rest, exponential
from scipy.integrate import cumulative_trapezoid

MOTORS = ("theta1", "theta2", "omega1", "omega2")


@dataclass(frozen=True)
class Law:
    """Parameters of the controller in s, rad and N.m, with the start values of its documentation."""

    sample_time: float = 1e-3
    max_rate: float = 3.0
    max_acceleration: float = 30.0
    max_torque: float = 10.0
    stiffness: float = 32.0
    Kp: float = 0.1
    Ki: float = 3.0
    Kd: float = 0.01
    max_correction: float = 0.2
    M: int = 4
    N: int = 7

    @property
    def to_wrist(self) -> Any:
        """Matrix (2, 2) from motor angles to pitch and roll of a rigid wrist; eq. (1)."""
        ratio = self.N / (2 * self.M)
        return np.array([[0.5, 0.5], [ratio, -ratio]])

    def braking_curve(self) -> tuple[Any, Any]:
        """Returns the rates from which a motor brakes in an integer number of samples, and a distance for each rate.

        A motor at rest covers this distance if it accelerates to the rate within one sample and then brakes. Between
        the rates, the distance is linear in the rate.
        """
        count = int(np.ceil(self.max_rate / (self.max_acceleration * self.sample_time))) + 2
        rates = self.max_acceleration * self.sample_time * np.arange(count)
        braking = cumulative_trapezoid(rates, dx=self.sample_time, initial=0)
        return rates, braking + rates / 2 * self.sample_time


@dataclass
class Controller:
    """Controller with its state. Motors start at rest at 0."""

    law: Law
    angle: Any = field(default_factory=lambda: np.zeros(2))
    rate: Any = field(default_factory=lambda: np.zeros(2))
    integral: Any = field(default_factory=lambda: np.zeros(2))
    damping: Any = field(default_factory=lambda: np.zeros(2))
    arrived: bool = False

    def sample(self, reference: Any, measured: dict[str, float]) -> Any:
        """Returns the accelerations (2,) of the motors in rad/s2 until the next sample.

        Arguments are the reference (2,) in rad for pitch and roll, and the measured outputs of the testbed by name.
        """
        law, T = self.law, self.law.sample_time
        angles, rates, torques = (
            np.array([measured[name] for name in names])
            for names in (("pitch", "roll"), ("pitch_rate", "roll_rate"), ("tau1", "tau2"))
        )
        twist = law.to_wrist @ self.angle - angles
        b, limit = law.Kp / (1 + law.Kp), law.max_correction
        if self.arrived:
            self.integral = np.clip(self.integral + T * law.Ki * (1 - b) * (twist - self.integral), -limit, limit)
        # First-order lag with the time constant 2 Kd, integrated by the implicit Euler method.
        wanted = np.clip(law.Kd * rates, -limit, limit)
        self.damping = (2 * law.Kd * self.damping + T * wanted) / (2 * law.Kd + T)
        correction = np.clip(b * twist + (1 - b) * self.integral - self.damping, -limit, limit)
        goal = np.linalg.solve(law.to_wrist, reference + correction)
        allowed = np.clip(
            goal,
            self.angle + (torques - law.max_torque) / law.stiffness,
            self.angle + (torques + law.max_torque) / law.stiffness,
        )
        speeds, reached = law.braking_curve()
        distance = allowed - self.angle - self.rate * T / 2
        aim = np.sign(distance) * np.minimum(np.interp(np.abs(distance), reached, speeds), law.max_rate)
        acceleration = np.clip((aim - self.rate) / T, -law.max_acceleration, law.max_acceleration)
        within_one_sample = np.abs(distance) < law.max_acceleration * T**2
        self.arrived = bool(
            np.all(within_one_sample & (np.abs(aim - self.rate) <= law.max_acceleration * T) & (allowed == goal))
        )
        return acceleration

    def move(self, acceleration: Any) -> None:
        """Moves the motors to the next sample."""
        T = self.law.sample_time
        self.angle = self.angle + self.rate * T + acceleration * T**2 / 2
        self.rate = self.rate + acceleration * T


def control(model: LinearModel, law: Law, reference: Any, samples: int) -> dict[str, Any]:
    """Simulates the closed loop from rest at 0 with the constant reference `reference` (2,) in rad for pitch and roll.

    Returns MOTORS and the outputs of the testbed by name at the samples of the controller, each (samples + 1,).
    Controller and testbed exchange values without the delay of communication points.
    """
    g = np.zeros((12, 12))
    g[:6, :6], g[:6, 6:8], g[:6, 8:10] = model.a, model.b_angle, model.b_rate
    g[6:8, 8:10] = g[8:10, 10:12] = np.eye(2)
    onward = exponential(g * law.sample_time)
    controller, x, rows = Controller(law), at_rest(np.zeros(2)), []
    for _ in range(samples + 1):
        outputs = model.outputs(x, controller.angle, controller.rate)
        rows.append({**dict(zip(MOTORS, [*controller.angle, *controller.rate])), **outputs})
        acceleration = controller.sample(reference, outputs)
        x = (onward @ np.concatenate([x, controller.angle, controller.rate, acceleration]))[:6]
        controller.move(acceleration)
    return {name: np.array([row[name] for row in rows]) for name in (*MOTORS, *OUTPUTS)}
