"""Effect of tolerances in stiffness and damping on tracking: 10,000 wrists

You learn to run an FMU ten thousand times with random parameters (fmu_run), because no wrist is built exactly as
planned. The plots show how far pitch and roll deviate from a wrist with rigid couplings, and which parameter causes
it.

    make examples; .venv/bin/python examples/tolerances.py
"""

import fmu_run
import numpy as np
from matplotlib.figure import Figure

import prw

RUNS, STEP, MOVE, LENGTH = 10_000, 2e-3, 0.35, 0.7  # s
GOAL = np.deg2rad([20, 30])  # pitch and roll, rad
SIDES = np.array([[1, 4 / 7], [1, -4 / 7]])  # motor angles per pitch and roll: inverse of eq. (1), M = 4, N = 7
TOLERANCES = {"k1": 0.1, "k2": 0.1, "c1": 0.3, "c2": 0.3, "c3": 0.3}  # standard deviation / value


def motion() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time (n,) s, and pitch and roll (n, 2) with their rates: from rest to rest at the goal on a quintic."""
    time = STEP * np.arange(round(LENGTH / STEP) + 1)
    s = np.minimum(time / MOVE, 1)[:, None]
    return time, GOAL * s**3 * (10 - 15 * s + 6 * s**2), GOAL * 30 * s**2 * (1 - s) ** 2 / MOVE


def draw(nominal: dict[str, float], runs: int) -> dict[str, np.ndarray]:
    """Parameters (runs,) by name, drawn from lognormal distributions, whose values are never negative."""
    numbers = np.random.default_rng(1)
    return {name: nominal[name] * np.exp(numbers.normal(0, share, runs)) for name, share in TOLERANCES.items()}


def errors(runs: int = RUNS) -> tuple[np.ndarray, dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Time (n,) s, the drawn parameters, and the errors of pitch and roll by name, (runs, n) in rad."""
    time, wrist, rates = motion()
    motors = dict(zip(("theta1", "theta2", "omega1", "omega2"), (*(wrist @ SIDES.T).T, *(rates @ SIDES.T).T)))
    with fmu_run.Fmu(prw.default_fmu()) as fmu:
        drawn = draw({name: float(fmu.variables[name].start or 0) for name in TOLERANCES}, runs)
        found = fmu.run(time, inputs=motors, start={**drawn, "use_omega": True}, outputs=["pitch", "roll"]).check()
    return time, drawn, {name: found[name] - wrist[:, k] for k, name in enumerate(("pitch", "roll"))}


def blame(drawn: dict[str, np.ndarray], statistic: np.ndarray) -> dict[str, float]:
    """Each parameter's share in the variance of a statistic (runs,), by linear regression on the logarithms. The shares add
    up to less than 1 if the statistic is nonlinear or depends on combinations of parameters."""
    columns = np.column_stack([np.log(values) for values in drawn.values()])
    columns -= columns.mean(axis=0)
    slopes, *_ = np.linalg.lstsq(columns, statistic - statistic.mean(), rcond=None)
    return dict(zip(drawn, slopes**2 * columns.var(axis=0) / statistic.var()))


def main(runs: int = RUNS) -> tuple[Figure, dict[str, dict[str, float]]]:
    """Run, print and draw; returns the figure, and the shares of the parameters in the variance of each peak error."""
    time, drawn, error = errors(runs)
    figure, shares = Figure(figsize=(8, 4.2), layout="constrained"), {}
    axes = figure.subplots(2, 2, width_ratios=(2, 1))
    for (name, trajectory), row, colour in zip(error.items(), axes, ("#009E73", "#CC79A7")):
        peak = np.rad2deg(np.abs(trajectory).max(axis=1))
        shares[name] = blame(drawn, peak)
        low, middle, high = np.percentile(peak, [2.5, 50, 97.5])
        print(
            f"{name:<6} peak error: median {middle:.2f} deg, 95 % of {runs} wrists between {low:.2f} and {high:.2f} deg"
        )
        for inner, outer, alpha in ((0, 100, 0.2), (2.5, 97.5, 0.5)):
            band = np.rad2deg(np.percentile(trajectory, [inner, outer], axis=0))
            row[0].fill_between(time, *band, color=colour, alpha=alpha, linewidth=0, label=f"{outer - inner:g} %")
        row[0].set(ylabel=f"error of {name} (deg)", xlim=(0, LENGTH))
        row[0].legend(frameon=False, fontsize=8)
        row[1].barh(list(drawn), [100 * share for share in shares[name].values()], color=colour)
        row[1].set(xlim=(0, 100))
        row[1].invert_yaxis()
    axes[1, 0].set_xlabel("time (s)")
    axes[1, 1].set_xlabel("share in the variance\nof the largest error (%)")
    return figure, shares


if __name__ == "__main__":
    main()[0].savefig("tolerances.png", dpi=110)
