"""The controller's gains tuned for wrists with tolerances: 100 wrists, 100 pairs of gains, 10,000 closed loops

You learn to run controller and testbed as one system (fmu_run.System), with different parameters in each run. Gains
that suit the nominal wrist may be bad for others, so the example chooses gains that suit nearly every wrist.

    make examples; .venv/bin/python examples/gains.py
"""

import time as clock

import fmu_run
import numpy as np
from matplotlib.figure import Figure

import prw

SSP = prw.default_fmu().with_name("prw_closed_loop.ssp")
STEP, LENGTH, KEPT = 1e-3, 1.2, 5  # s; s; every fifth sample is kept
WRISTS = 100
GOAL = {"pitch_ref": np.deg2rad(20.0), "roll_ref": np.deg2rad(30.0)}
CLOSE = np.deg2rad(0.05)
TOLERANCES = {"k1": 0.1, "k2": 0.1, "J3": 0.1, "H3": 0.1, "c1": 0.3, "c2": 0.3, "c3": 0.3}  # standard deviation / value
KI, KD = np.linspace(1.0, 10.0, 10), np.linspace(0.0, 0.0225, 10)  # 1/s, s


def settling(loop: fmu_run.System, wrists: int) -> np.ndarray:
    """Settling times (Ki, Kd, wrists) in s, after which pitch and roll stay within CLOSE of the goal; LENGTH if they do
    not settle."""
    numbers, count = np.random.default_rng(1), len(KI) * len(KD)
    start: dict[str, fmu_run.Start] = dict(GOAL)
    for name, share in TOLERANCES.items():
        nominal = float(loop.variables[f"testbed.{name}"].start or 0)
        start[f"testbed.{name}"] = np.tile(nominal * np.exp(numbers.normal(0, share, wrists)), count)
    start["controller.Ki"] = np.repeat(KI, len(KD) * wrists)
    start["controller.Kd"] = np.tile(np.repeat(KD, wrists), len(KI))
    time = STEP * np.arange(round(LENGTH / STEP) + 1)
    runs = loop.run(time, start=start, outputs=["pitch", "roll"], every=KEPT).check()
    errors = [np.abs(runs[name] - GOAL[f"{name}_ref"]) for name in ("pitch", "roll")]
    away = np.maximum(*errors) > CLOSE
    last = np.where(away.any(axis=1), len(runs.time) - np.argmax(away[:, ::-1], axis=1), 0)
    return np.append(runs.time, LENGTH)[last].reshape(len(KI), len(KD), wrists)


def main(wrists: int = WRISTS) -> tuple[Figure, dict[str, np.ndarray]]:
    """Run, print and draw; returns the figure, and the settling times (wrists,) in s with the default gains and with
    the best ones."""
    with fmu_run.System(SSP) as loop:
        begin = clock.perf_counter()
        times = settling(loop, wrists)
        print(f"{times.size} closed loops of {LENGTH:g} s in {clock.perf_counter() - begin:.1f} s")
        shipped = [float(loop.variables[f"controller.{name}"].start or 0) for name in ("Ki", "Kd")]
    most = np.percentile(times, 95, axis=2)
    best = np.unravel_index(np.argmin(most), most.shape)
    near = np.argmin(np.abs(KI - shipped[0])), np.argmin(np.abs(KD - shipped[1]))
    found = {"as shipped": times[near], "tuned": times[best]}
    for name, index in (("as shipped", near), ("tuned", best)):
        gains = f"Ki = {KI[index[0]]:g} 1/s, Kd = {1e3 * KD[index[1]]:g} ms"
        print(f"{name:<10} {gains:<25} 95 % of the wrists have settled after {most[index]:.3f} s")
    figure = Figure(figsize=(8, 3.6), layout="constrained")
    grid, spread = figure.subplots(1, 2)
    image = grid.pcolormesh(1e3 * KD, KI, most, cmap="cividis_r")
    figure.colorbar(image, ax=grid, label="95 % have settled after (s)")
    for marker, index in (("o", near), ("*", best)):
        grid.plot(1e3 * KD[index[1]], KI[index[0]], marker, color="white", markeredgecolor="black", markersize=11)
    grid.set(xlabel="Kd (ms)", ylabel="Ki (1/s)", title="o as shipped, \N{BLACK STAR} tuned")
    for (name, times), colour in zip(found.items(), ("#CC79A7", "#009E73")):
        spread.ecdf(times, label=name, color=colour)
    spread.set(xlabel="settling time (s)", ylabel="share of the wrists", xlim=(0, LENGTH))
    spread.legend(frameon=False)
    return figure, found


if __name__ == "__main__":
    main()[0].savefig("gains.png", dpi=110)
