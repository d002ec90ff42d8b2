"""Runs the FMUs in any Python from 3.11 on, and prints all results exactly, as hexadecimal numbers:

    python elsewhere.py RECORDING FMU...

Uses the installed fmu_run, FMPy, and prw with the FMU in its wheel. The inputs are polynomials, because sines have other
last digits on other systems.
"""

import sys

import fmpy
import fmu_run
import numpy as np

import prw

OUTPUTS = ["tau1", "tau2", "pitch", "roll"]
TIME = np.arange(501) * 1e-3
MOTORS = {"theta1": TIME * (0.5 - TIME), "theta2": TIME * TIME}
RATES = {"omega1": 0.5 - 2.0 * TIME, "omega2": 2.0 * TIME}


def show(name, values) -> None:
    print(name, *(float(value).hex() for value in np.ravel(values)))


def batch(path) -> None:
    """Prints two runs, which must differ, and derivatives of an instance. Checks that a restored state gives the same outputs."""
    with fmu_run.Fmu(path) as fmu:
        start = {"k1": np.array([60.0, 240.0])}
        runs = fmu.run(TIME, inputs=MOTORS, start=start, outputs=OUTPUTS, every=25).check()
        for name in OUTPUTS:
            soft, stiff = runs[name]
            if not np.abs(soft - stiff).max() > 1e-3 * np.abs(soft).max() > 0:
                raise SystemExit(f"error: {name} does not depend on the parameter")
            show(name, runs[name])
        wrists = fmu.instances(1)
        wrists.set(list(MOTORS), [0.1, 0.2])
        wrists.step(1e-3)
        saved = wrists.serialize(wrists.save())
        show("derivatives", wrists.directional_derivative(OUTPUTS, list(MOTORS), [1.0, 2.0]))
        wrists.step(1e-3)
        first = wrists.get(OUTPUTS)
        wrists.restore(wrists.deserialize(saved))
        wrists.step(1e-3)
        if not (wrists.get(OUTPUTS) == first).all():
            raise SystemExit("error: a restored state gives other outputs")


def importer(path, kind) -> None:
    """Prints the results of FMPy, which finds the library and calls it without fmu_run."""
    motors = {"time": TIME, **MOTORS, **RATES}
    table = np.array(list(zip(*motors.values())), dtype=[(name, float) for name in motors])
    start = {"k1": 250.0, "use_omega": True}
    # FMPy for ARM does not contain CVode.
    given = {"fmi_type": kind, "solver": "Euler", "step_size": 1e-3, "input": table, "output": OUTPUTS}
    rows = fmpy.simulate_fmu(path, stop_time=0.5, output_interval=0.01, start_values=start, **given)
    for name in OUTPUTS:
        show(f"{kind} {name}", rows[name])


def main(recording, *paths) -> None:
    for name, values in prw.simulate(recording).items():
        show(f"prw {name}", values[::10])
    for path in paths:
        print("FMI", fmpy.read_model_description(path).fmiVersion)
        batch(path)
        for kind in ("CoSimulation", "ModelExchange"):
            importer(path, kind)


if __name__ == "__main__":
    main(*sys.argv[1:])
