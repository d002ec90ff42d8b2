"""Runs the packed FMU with the installed fmu_run and prints what comes out, for any Python from 3.11 on.

    python wheel_run.py FMU...

Each output has its line, of numbers at a few times of two runs. Needs nothing but fmu_run and NumPy.
"""

import sys

import fmu_run
import numpy as np

OUTPUTS = ["tau1", "tau2", "pitch", "roll"]


def main(paths: list[str]) -> None:
    time = np.linspace(0.0, 0.5, 501)
    motor = 0.1 * np.sin(10 * np.pi * time)
    inputs, start = {"theta1": motor, "theta2": -0.5 * motor}, {"k1": np.array([60.0, 240.0])}
    for path in paths:
        with fmu_run.Fmu(path) as fmu:
            runs = fmu.run(time, inputs=inputs, start=start, outputs=OUTPUTS, every=25).check()
            print(f"FMI {fmu.fmi_version}")
        for name in OUTPUTS:
            soft, stiff = runs[name]
            if not np.abs(soft - stiff).max() > 1e-3 * np.abs(soft).max() > 0:
                raise SystemExit(f"error: {name} is the same for other parameters")
            print(name, *(repr(float(value)) for value in (*soft, *stiff)))


if __name__ == "__main__":
    main(sys.argv[1:])
