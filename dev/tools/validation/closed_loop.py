"""Runs the closed loop, prw_closed_loop.ssp or OspSystemStructure.xml, under FMPy, libcosim, Ecos and sofirpy, if they are installed.
Compares the results, and calculates the error of the coupling for several communication steps. Writes closed_loop.csv,
closed_loop.png, coupling.csv and coupling.png."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

import numpy as np

from prw.errors import UserError
from prw.files import write_table
from tools.validation import add_directories

if TYPE_CHECKING:
    from tools.validation.system import System

#: A pitch or roll within this of its reference has settled, deg.
SETTLED = 0.1

HELP = "run testbed and controller under several masters"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    add_directories(parser)


def run(arguments: argparse.Namespace) -> None:
    """Carry out `tools closed-loop`. Raises UserError with a message of one line."""
    from tools.validation import coupling, masters, plots
    from tools.validation.system import read

    system = read(arguments.fmus / "prw_closed_loop.ssp", arguments.fmus / "prw_closed_loop")
    runs, absent = {}, []
    for master in masters.MASTERS:
        if master.version() is None:
            absent.append(master)
        else:
            runs[f"{master.name} {master.version()}"] = masters.run_separately(master, system)
    if not runs:
        raise UserError("no co-simulation master is installed; `make closed-loop` installs them")
    name, first = next(iter(runs.items()))
    study = coupling.study(system)

    out = arguments.out
    write_table(out / "closed_loop.csv", first)
    plots.plot_response(out / "closed_loop.png", system, first)
    written = ["closed_loop.csv", "closed_loop.png"]
    if study is not None:
        write_table(out / "coupling.csv", study.columns())
        plots.plot_coupling(out / "coupling.png", study)
        written += ["coupling.csv", "coupling.png"]
    lines = [f"experiment  {_experiment(system)}, communication step {system.step * 1e3:g} ms"]
    lines += _response(system, first)
    lines += [f"master      {other}: {_difference(first, values, name)}" for other, values in runs.items()]
    lines += [f"absent      {master.name}: pip package {master.package} is not installed" for master in absent]
    if study is None:
        lines.append("coupling    not studied, because not every FMU has input and output derivatives")
    else:
        lines += [
            f"coupling    {step * 1e3:g} ms: error {held:.2g} deg; with input derivatives {derivatives:.2g} deg"
            for step, held, derivatives in zip(*study)
            if step >= system.step
        ]
    lines.append(f"wrote       {', '.join(str(out / name) for name in written)}")
    print("\n".join(lines))


def _experiment(system: System) -> str:
    goals = ", ".join(f"{name} {np.rad2deg(value):g} deg" for name, (_, value) in system.inputs.items())
    return f"{goals}, {system.stop_time:g} s"


def settling_time(time: np.ndarray, values: np.ndarray, goal: float) -> float:
    """The time, s, after which values (n,) rad over time (n,) s stay within SETTLED of goal (rad); infinite if there is none."""
    outside = np.nonzero(np.abs(np.rad2deg(values - goal)) > SETTLED)[0]
    if not len(outside):
        return float(time[0])
    return float(time[outside[-1] + 1]) if outside[-1] + 1 < len(time) else float("inf")


def _response(system: System, values: dict[str, np.ndarray]) -> list[str]:
    lines = []
    for axis in ("pitch", "roll"):
        goal, angle = system.inputs[f"{axis}_ref"][1], values[f"testbed.{axis}"]
        settled = settling_time(values["time"], angle, goal)
        when = f"within {SETTLED} deg after {settled:.3f} s" if np.isfinite(settled) else f"not within {SETTLED} deg"
        beyond = np.rad2deg(np.max((angle - goal) * np.sign(goal)))
        lines.append(
            f"{axis:<11} {when}, {max(beyond, 0):.2f} deg beyond; off by {np.rad2deg(abs(angle[-1] - goal)):.1g} deg at the end"
        )
    torque = max(np.abs(values[f"testbed.tau{i}"]).max() for i in (1, 2))
    rate = max(np.abs(values[f"controller.omega{i}"]).max() for i in (1, 2))
    lines.append(f"motors      rate up to {rate:.3g} rad/s, torque up to {torque:.3g} N.m")
    return lines


def _difference(first: dict[str, np.ndarray], other: dict[str, np.ndarray], name: str) -> str:
    if other is first:
        return "the others are compared with it"
    torques = [key for key in first if ".tau" in key]
    motion, torque = (
        max(np.abs(first[key] - other[key]).max() for key in first if (key in torques) == wanted)
        for wanted in (False, True)
    )
    # Torques depend on the motors at the same instant, so it matters whether a master reads them before it sets the inputs.
    when = ", read after the next inputs are set" if torque > 1e-6 > motion else ""
    return f"angles and rates within {motion:.1g} (rad, rad/s) of {name}, torques within {torque:.1g} N.m{when}"
