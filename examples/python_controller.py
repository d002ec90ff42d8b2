"""A controller for the wrist in Python, as an FMU. Enter `pip install pythonfmu==0.7.0`, then

    pythonfmu build -f examples/python_controller.py -d target/fmu
    cargo run --release -p prw_controller --bin build_closed_loop -- --controller target/fmu/PythonController.fmu --out out/python

The second command connects the FMU to the testbed. This works because the FMU has the inputs and outputs of
prw_controller.fmu. To run the FMU, Python must be installed.
"""

from typing import Any

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

INPUTS = ("pitch_ref", "roll_ref", "pitch", "roll", "pitch_rate", "roll_rate", "tau1", "tau2")
OUTPUTS = ("theta1", "theta2", "omega1", "omega2")


class PythonController(Fmi2Slave):
    """Moves to a new reference on a minimum-jerk path, and then integrates the remaining error."""

    description = "Point-to-point controller for the pitch-roll wrist testbed, written in Python"

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        for name in INPUTS + OUTPUTS:
            setattr(self, name, 0.0)
            causality = Fmi2Causality.input if name in INPUTS else Fmi2Causality.output
            self.register_variable(Real(name, causality=causality))
        #: Duration of a move, s; integral gain, 1/s; M / N of eq. (1).
        self.duration, self.gain, self.motor_per_roll = 0.6, 5.0, 4 / 7
        for name in ("duration", "gain", "motor_per_roll"):
            self.register_variable(Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed))
        self.began = 0.0  # when the move began, s
        self.goal, self.origin = [0.0, 0.0], [0.0, 0.0]  # pitch and roll, rad
        self.correction = [0.0, 0.0]

    def do_step(self, current_time: float, step_size: float) -> bool:
        reference, measured = [self.pitch_ref, self.roll_ref], [self.pitch, self.roll]
        if reference != self.goal:
            self.origin, self.goal, self.began = self._plan(current_time)[0], reference, current_time
        at, _ = self._plan(current_time)
        if current_time - self.began > self.duration + 0.5 * step_size:  # regardless of rounding errors of the time
            for axis in range(2):
                self.correction[axis] += self.gain * step_size * (at[axis] - measured[axis])
        at, rate = self._plan(current_time + step_size)
        (pitch, roll), (pitch_rate, roll_rate) = [a + c for a, c in zip(at, self.correction)], rate
        self.theta1, self.theta2 = pitch + self.motor_per_roll * roll, pitch - self.motor_per_roll * roll
        self.omega1 = pitch_rate + self.motor_per_roll * roll_rate
        self.omega2 = pitch_rate - self.motor_per_roll * roll_rate
        return True

    def _plan(self, time: float) -> tuple[list[float], list[float]]:
        """Pitch and roll on the path, and their rates: the quintic that begins and ends at rest."""
        s = min(max((time - self.began) / self.duration, 0.0), 1.0)
        way, slope = s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2 / self.duration
        angles = [a + (b - a) * way for a, b in zip(self.origin, self.goal)]
        return angles, [(b - a) * slope for a, b in zip(self.origin, self.goal)]
