"""Simulates the experiment of Fig. 4 with FMPy: fmpy_run.py FMU CoSimulation|ModelExchange RESULT.csv."""

import sys

import fmpy
import fmpy.util
import numpy as np

STEP, STOP = 1e-2, 1.0


def main(fmu: str, kind: str, result: str) -> None:
    t = np.linspace(0, STOP, 101)
    names = ("time", "theta1", "theta2", "omega1", "omega2")
    angle, rate = (1 - np.cos(10 * np.pi * t)) / (10 * np.pi), np.sin(10 * np.pi * t)
    motors = np.array(list(zip(t, angle, -angle, rate, -rate)), dtype=[(name, float) for name in names])
    trajectory = fmpy.simulate_fmu(
        fmu,
        fmi_type=kind,
        start_values={"use_omega": True, "k1": 250.0},
        input=motors,
        output=["tau1", "tau2", "pitch", "roll", "pitch_rate", "roll_rate"],
        output_interval=STEP,
        stop_time=STOP,
    )
    fmpy.util.write_csv(result, trajectory)


if __name__ == "__main__":
    main(*sys.argv[1:])
