"""Tests on simulated rigs that `prw identify` is unbiased and that its intervals have the stated coverage; `make monte-carlo`.

    python tests/analysis/monte_carlo.py target/fmu/prw_testbed.fmu [--repetitions 300] [--sensors all|torque]
        [--motion independent|equal|opposite|fig4|slow|moves] [--seed 0]
        [--faulty N | --real N] [--counts 10000] [--workers N] [--out out/monte_carlo.json]

Every repetition has its own rig (parameters up to 30 % off Table 1, where the search starts), its own motion of 10 s
at 1 kHz, its own noise, encoder positions and sensor offsets; see rig.py. The exit status is 1 in three cases:

* The bias of an estimate exceeds a quarter of its standard error plus twice the sampling error.
* Less than 92 % of the 95 % intervals of a parameter contain the true value.
* Less than 97 % of the verdicts are "fits".

A low share only counts if chance is an improbable cause: with true shares of 95 % and 99 %, its probability must be below 5 %.

With --faulty, the rigs have faults, and their motions last 6 s. The exit status is 1 if, of the rigs with an interval that misses
the true value by more than two of its widths, more than 1 % have the verdict "fits".

With --real, plant.py simulates N rigs for each row of REAL, for 6 s, with other equations and with what reality adds: friction,
backlash, changes over time and so on. `prw.identify` has to name each cause. The exit status is 1 in four cases:

* More than 5 % of the rigs without any addition are rejected or doubted.
* An accepted rig has an interval that misses the true value by more than its width.
* Less than 92 % of the intervals of all accepted rigs contain the true value.
* Less than 80 % of the causes are named.
"""

from __future__ import annotations

import argparse
import itertools
import json
import multiprocessing
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "oracle"))

import plant  # noqa: E402
import rig  # noqa: E402
from scipy.interpolate import CubicSpline  # noqa: E402
from scipy.stats import binom  # noqa: E402
from threadpoolctl import threadpool_limits  # noqa: E402

import prw  # noqa: E402
from prw.identification import task_of  # noqa: E402
from prw.identification.experiment import prepare  # noqa: E402
from prw.identification.fit import fit  # noqa: E402
from prw.identification.model import Model  # noqa: E402
from prw.identification.statistics import certainty  # noqa: E402
from prw.identification.verdict import judge  # noqa: E402
from prw.recording import read  # noqa: E402

SENSORS = {"all": rig.ALL, "torque": ("tau1", "tau2")}
MOTIONS = ("independent", "equal", "opposite", "fig4", "slow", "moves")


#: Faults of a rig or its sensors: description with the unit, and sizes from harmless to gross.
FAULTS = {
    "late": ("torques late, ms", (0.003, 0.01, 0.03, 0.1, 1.0)),
    "lag": ("lag of all sensors, ms", (0.001, 0.003, 0.01, 0.1, 2.0)),
    "gain": ("gain of tau1, % too much", (0.01, 0.03, 0.1, 1.0, 10.0)),
    "backlash": ("backlash at the motors, mrad", (0.01, 0.03, 0.1, 0.5, 2.0)),
    "friction": ("friction about pitch and roll, N.m", (0.001, 0.003, 0.01, 0.05, 0.15)),
    "clipped": ("torques cut off at, share of the peak", (0.99, 0.97, 0.9, 0.7, 0.3)),
}


def with_fault(simulated: rig.Rig, fault: str, size: float) -> rig.Rig:
    """Returns the rig with a fault of FAULTS. size: in the unit of the fault."""
    if fault == "late":
        return rig.late(simulated, 1e-3 * size)
    if fault == "lag":
        return rig.lagging(simulated, 1e-3 * size)
    if fault == "backlash":
        return rig.nonlinear(simulated, backlash=1e-3 * size)
    if fault == "friction":
        return rig.nonlinear(simulated, friction=size)
    outputs = dict(simulated.outputs)
    if fault == "gain":
        outputs["tau1"] = (1 + size / 100) * outputs["tau1"]
    for name in ("tau1", "tau2"):
        if fault == "clipped":
            peak = size * np.abs(outputs[name]).max()
            outputs[name] = np.clip(outputs[name], -peak, peak)
    return simulated._replace(outputs=outputs)


class Row(NamedTuple):
    """What reality adds to a rig.

    Attributes
    ----------
    text
        Description with the unit of the sizes.
    sizes
        From hardly detectable to gross; the rigs of a row have them in turn.
    fields
        Fields of plant.Case for a size.
    recorded
        Change of the recorded columns for a size and a random generator.
    named
        Part of an addition, a cause or a note that names it; for two additions, one part for each.
    sampled
        Change of the rig before its sensors measure, as `recorded`.
    """

    text: str
    sizes: tuple[float, ...]
    named: str | tuple[str, str]
    fields: Callable[[float], dict] = lambda size: {}
    recorded: Callable[[dict, float, np.random.Generator], dict] = lambda columns, size, random: columns
    sampled: Callable[[rig.Rig, float, np.random.Generator], rig.Rig] = lambda simulated, size, random: simulated


def drifting(columns: dict, size: float, random: np.random.Generator) -> dict:
    """Returns the columns with a drift of one sensor: a sum of a line and a slow wave, of `size` times its motion."""
    name = str(random.choice([n for n in rig.ALL if n in columns]))
    x = np.linspace(0, 1, len(columns["time"]))
    drift = x * random.choice([-1, 1]) + 0.5 * np.sin(np.pi * x * random.uniform(0.5, 1.5))
    return {**columns, name: columns[name] + size * np.ptp(columns[name]) * drift}


def wrapped(columns: dict, size: float, random: np.random.Generator) -> dict:
    """Returns the columns with angles that restart after a full turn."""
    turn, zero = 2 * np.pi, np.pi + size
    return {n: (y + zero) % turn - np.pi if n.startswith("theta") else y for n, y in columns.items()}


def mixed(columns: dict, size: float, random: np.random.Generator) -> dict:
    """Returns the columns with crosstalk between the torques."""
    tau1, tau2 = columns["tau1"], columns["tau2"]
    return {**columns, "tau1": tau1 + size * tau2, "tau2": tau2 + size * tau1}


def turned(columns: dict, size: float, random: np.random.Generator) -> dict:
    """Returns the columns of an inertial sensor that is turned by `size` rad from pitch towards roll."""
    pitch, roll = columns["pitch"], columns["roll"]
    found = np.cos(size) * pitch + np.sin(size) * roll, np.cos(size) * roll - np.sin(size) * pitch
    return {**columns, "pitch": found[0], "roll": found[1]}


def fading(columns: dict, size: float, random: np.random.Generator) -> dict:
    """Returns the columns with a gain of tau1 that decreases evenly by `size`."""
    return {**columns, "tau1": columns["tau1"] * (1 - size * np.linspace(0, 1, len(columns["time"])))}


def unsteady(simulated: rig.Rig, size: float, random: np.random.Generator) -> rig.Rig:
    """Returns the rig, sampled at times with errors of `size` s."""
    time = simulated.time
    when = np.clip(time + random.normal(0, size, len(time)), time[0], time[-1])
    outputs = {name: CubicSpline(time, y)(when) for name, y in simulated.outputs.items()}
    return simulated._replace(theta=CubicSpline(time, simulated.theta)(when), outputs=outputs)


def off(size: float) -> dict:
    """Inertias that differ from the drawing by `size`, J3 in the other direction."""
    return {"inertia": (1 + size, 1 - size / 2, 1 + size)}


REAL = {
    "nothing": Row("nothing", (0.0,), ""),
    "friction": Row(
        "friction of the shafts, N.m", (0.003, 0.005, 0.01, 0.02), "friction in both", lambda s: {"friction": (s, s)}
    ),
    "output": Row(
        "friction of the output, N.m", (0.01, 0.02, 0.04), "friction about", lambda s: {"output_friction": s}
    ),
    "backlash 1": Row(
        "backlash of k1, rad", (0.0005, 0.001, 0.002, 0.004), "couplings k1", lambda s: {"play": (s, 0.0)}
    ),
    "backlash 2": Row(
        "backlash of k2, rad", (0.001, 0.002, 0.004, 0.008), "couplings k2", lambda s: {"play": (0.0, s)}
    ),
    "clearance 1": Row(
        "clearance of k1, rad",
        (0.0005, 0.001, 0.002),
        "clearance of the couplings k1",
        lambda s: {"play": (s, 0.0), "loose": True},
    ),
    "clearance 2": Row(
        "clearance of k2, rad",
        (0.001, 0.002, 0.004),
        "clearance of the couplings k2",
        lambda s: {"play": (0.0, s), "loose": True},
    ),
    "cubic 1": Row(
        "cubic stiffness of k1, 1/rad2",
        (100, 200, 400),
        "cubic stiffness of the couplings k1",
        lambda s: {"cubic": (s, 0.0)},
    ),
    "cubic 2": Row(
        "cubic stiffness of k2, 1/rad2",
        (20, 40, 80),
        "cubic stiffness of the couplings k2",
        lambda s: {"cubic": (0.0, s)},
    ),
    "inertias": Row("wrong inertias, fraction", (0.05, -0.05, 0.03, 0.1), "inertias", off),
    "softening": Row("k1 falls midway by, fraction", (0.02, 0.05, 0.1), "k1 changes", lambda s: {"softening": s}),
    "drift": Row("drift of a sensor, fraction of its motion", (0.01, 0.02, 0.05), "drift", recorded=drifting),
    "wrapped": Row("wrapped angles, beginning at, rad", (3.0, -2.9, 3.1), "restarts", recorded=wrapped),
    "crosstalk": Row("crosstalk of the torques, fraction", (0.01, -0.01, 0.02), "crosstalk", recorded=mixed),
    "jitter": Row("jitter of the times, s", (1e-4, 2e-4, 4e-4), "jitter", sampled=unsteady),
    "springs": Row(
        "excess of k2 on side 2, fraction",
        (0.01, 0.03, 0.08),
        "excess of k2",
        lambda s: {"sides": (1.0, 1 + s, 1.0, 1.0)},
    ),
    "dampers": Row(
        "excess of c1 on side 2, fraction",
        (0.05, 0.1, -0.15),
        "excess of c1",
        lambda s: {"sides": (1.0, 1.0, 1 + s, 1.0)},
    ),
    "viscous": Row(
        "viscous friction of the input shafts, N.m.s/rad",
        (0.01, 0.03, 0.05),
        "viscous friction in both",
        lambda s: {"viscous": (s, 0.0)},
    ),
    "between": Row(
        "viscous friction between the couplings, N.m.s/rad",
        (0.01, 0.03, 0.05),
        "viscous friction of both shafts between",
        lambda s: {"viscous": (0.0, s)},
    ),
    "turned": Row("turned inertial sensor, rad", (0.003, 0.005, 0.02), "turn of the inertial sensor", recorded=turned),
    "fading": Row("decrease of the gain of tau1, fraction", (0.01, 0.02, 0.05), "fading of tau1", recorded=fading),
    "friction, cubic": Row(
        "friction of the shafts, N.m; cubic stiffness",
        (0.005, 0.01, 0.02),
        ("friction in both", "cubic stiffness of the couplings k1"),
        lambda s: {"friction": (s, s), "cubic": (200.0, 0.0)},
    ),
    "friction, backlash": Row(
        "friction of the shafts; backlash of k1, rad",
        (0.001, 0.002, 0.004),
        ("friction in both", "backlash in the couplings k1"),
        lambda s: {"friction": (0.01, 0.01), "play": (s, 0.0)},
    ),
    "springs, turned": Row(
        "excess of k2; turned inertial sensor, rad",
        (0.003, 0.005, 0.02),
        ("excess of k2", "turn of the inertial sensor"),
        lambda s: {"sides": (1.0, 1.03, 1.0, 1.0)},
        turned,
    ),
}


def repetition(fmu: str, seed: int, channels, counts: int, motion: str, fault: str = "", size: float = 0.0) -> tuple:
    """Identifies a rig of `rig.experiment`, with a fault if one is named."""
    simulated = rig.experiment(seed, 6.0 if fault else 10.0, pattern=motion)
    return identified(fmu, with_fault(simulated, fault, size) if fault else simulated, seed, channels, counts)


class Outcome(NamedTuple):
    """What `prw.identify` made of a rig: whether it accepted the data, doubted them in a note, and named the cause; whether each interval
    contains the true value, and the largest distance of a true value from its interval, in widths; and the report in words."""

    accepted: bool
    doubted: bool
    named: bool
    inside: list[bool]
    missed: float
    words: list[str]


def realistic(fmu: str, simulated: rig.Rig, seed: int, kind: str, size: float) -> Outcome:
    """Identifies a rig of `plant.experiments` as a user would, with all sensors and what the row `kind` of REAL does to the record."""
    row, random = REAL[kind], np.random.default_rng(seed + 2_000_000)
    columns = row.recorded(rig.measure(row.sampled(simulated, size, random), seed + 1_000_000), size, random)
    found = prw.identify(columns, starts=1, fmu=fmu)
    low, high = np.log([found.parameters[name].interval for name in rig.NAMES]).T
    true = np.log([simulated.parameters[name] for name in rig.NAMES])
    words = [*found.additions, *found.diagnosis, *found.notes]
    doubted = any("suggest" in note for note in found.notes)
    missed = float((np.maximum(low - true, true - high) / (high - low)).max())
    # A cause counts as named if it is among the first two.
    parts = (row.named,) if isinstance(row.named, str) else row.named
    listed = [*found.additions, *found.diagnosis[:2], *found.notes]
    named = bool(row.named) and all(any(part in each for each in listed) for part in parts)
    return Outcome(found.fits, doubted, named, ((low < true) & (true < high)).tolist(), missed, words)


def identified(fmu: str, simulated: rig.Rig, seed: int, channels, counts: int) -> tuple:
    """Identifies the parameters NAMES from simulated measurements of a rig.

    Returns three lists of five values: log(estimate / true value), its standard error, and whether the 95 % interval contains the
    true value. Then follow the seconds, whether the verdict is "fits", and the largest distance of a true value from its interval, in
    widths of the interval; the distance is negative if all intervals contain the true values."""
    columns = rig.measure(simulated, seed + 1_000_000, channels, counts)
    with Model(fmu) as model, threadpool_limits(1):
        begin = time.perf_counter()
        solution = fit(model, [prepare(read(columns))], task_of(model.known, rig.NAMES), starts=1)
        verdict = judge(solution)
        sure = certainty(solution, verdict.widening)
        seconds = time.perf_counter() - begin
    true = np.log([simulated.parameters[name] for name in rig.NAMES])
    low, high = np.log(sure.low), np.log(sure.high)
    missed = float((np.maximum(low - true, true - high) / (high - low)).max())
    inside = (low < true) & (true < high)
    return (solution.logarithms - true).tolist(), sure.relative.tolist(), inside.tolist(), seconds, verdict.fits, missed


#: Directories on which the results depend.
SOURCES = ("python/prw/src", "tests/analysis", "tests/oracle", "src", "modelDescription")


def commit() -> str:
    """Returns the short hash of the commit, with "-dirty" if SOURCES differ from it."""

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(Path(__file__).resolve().parents[2]), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    return git("rev-parse", "--short", "HEAD") + "-dirty" * bool(git("status", "--porcelain", "--", *SOURCES))


def campaign(pool: ProcessPoolExecutor, options: argparse.Namespace) -> tuple[dict, bool]:
    """Returns the verdicts on rigs with faults, by fault and size, and whether gross errors are noticed. They are noticed if, of the
    rigs with an interval that misses by more than two of its widths, at most 1 % have the verdict "fits"."""
    rows, rigs = {}, options.faulty
    print(
        f"{rigs} rigs for each fault and size, all sensors: share that does not fit (worst miss where it fits, in widths)"
    )
    cases = [(fault, size) for fault, (_, sizes) in FAULTS.items() for size in sizes]
    jobs = [
        (options.fmu, options.seed + i, rig.ALL, rig.COUNTS, MOTIONS[i % 2 * 4], *case)
        for case in cases
        for i in range(rigs)
    ]
    results = iter(pool.map(repetition, *zip(*jobs)))
    grossly = missed = 0
    for fault, size in cases:
        found = list(itertools.islice(results, rigs))
        rejected = float(np.mean([not each[4] for each in found]))
        grossly += sum(each[5] > 2 for each in found)
        missed += sum(each[5] > 2 and each[4] for each in found)
        worst = max([0.0, *(each[5] for each in found if each[4])])
        rows.setdefault(fault, []).append({"size": size, "does_not_fit": rejected, "worst_miss_where_it_fits": worst})
        print(f"  {FAULTS[fault][0]:<40}{size:>8g}{rejected:>8.0%}{worst:>8.2g}", flush=True)
    good = missed <= 0.01 * grossly
    print(
        f"  {grossly} rigs with an interval that misses by more than two widths; {missed} of them have the verdict that it fits"
    )
    if options.figure:
        draw(rows, options.figure)
    return {"commit": commit(), "rigs": rigs, "faults": rows, "missed_grossly": grossly, "unnoticed": missed}, good


def reality(pool: ProcessPoolExecutor, options: argparse.Namespace) -> tuple[dict, bool]:
    """Returns what was made of rigs with what reality adds, by row of REAL, and whether that is good enough."""
    motions, cases = tuple(plant.MOTIONS), []
    for kind, row in REAL.items():
        count = options.real if row.named else 5 * options.real
        for i in range(count):
            size, seed = row.sizes[i % len(row.sizes)], options.seed + len(cases)
            cases.append((seed, kind, size, plant.Case(seed, motions[i % len(motions)], **row.fields(size))))
    simulated: dict[int, rig.Rig] = {}
    # The couplings that let go need shorter steps.
    for loose in (False, True):
        group = [case for *_, case in cases if case.loose == loose]
        simulated |= zip([case.seed for case in group], plant.experiments(group, 6.0) if group else [])
    rigs = [simulated[seed]._replace(at=None) for seed, *_ in cases]
    seeds, kinds, sizes, _ = zip(*cases)
    results = list(pool.map(realistic, [options.fmu] * len(cases), rigs, seeds, kinds, sizes))
    print(f"  {'':50}{'rigs':>6}{'accepted':>10}{'named':>7}{'intervals with the true value':>32}{'worst miss':>12}")
    rows, good, named, inside = {}, True, [], []
    for kind, row in REAL.items():
        found = [result for result, k in zip(results, kinds) if k == kind]
        fits = [result for result in found if result.accepted]
        worst = max([0.0, *(result.missed for result in fits)])
        hold = [each for result in fits for each in result.inside]
        counted = {
            "rigs": len(found),
            "accepted": len(fits),
            "named": sum(result.named for result in found),
            "doubted": sum(result.accepted and result.doubted for result in found),
            "intervals": [sum(hold), len(hold)],
            "worst_miss": worst,
        }
        rows[kind] = counted
        share = f"{sum(hold)} of {len(hold)}" if hold else ""
        print(
            f"  {row.text:<50}{len(found):>6}{len(fits):>10}{counted['named']:>7}{share:>32}{worst:>12.2g}", flush=True
        )
        good &= worst < 1
        inside += hold
        if row.named:
            named += [result.named for result in found]
        else:
            good &= not is_too_rare(np.array([r.accepted and not r.doubted for r in found]), 0.95, 0.99)
    good &= not is_too_rare(np.array(inside), 0.92, 0.95) and np.mean(named) >= 0.8
    print(
        f"  {sum(named)} of {len(named)} causes named; {sum(inside)} of {len(inside)} intervals of accepted rigs contain the true value"
    )
    print(f"  of the rigs without additions, {rows['nothing']['doubted']} are accepted with a doubt")
    if options.verbose:
        for seed, kind, size, result in zip(seeds, kinds, sizes, results):
            print(seed, kind, size, result.accepted, result.named, f"{result.missed:.2g}", "; ".join(result.words))
    return {"commit": commit(), "real": rows}, bool(good)


def draw(rows: dict, path: Path) -> None:
    """Draws the share of rigs that do not fit over the size of each fault; equal rows give equal bytes."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(8, 4.6), layout="constrained")
    for axes, (fault, entries) in zip(drawn.subplots(2, 3, sharey=True).flat, rows.items()):
        axes.plot([e["size"] for e in entries], [100 * e["does_not_fit"] for e in entries], "o-", color="#0072B2")
        axes.set(
            title=FAULTS[fault][0].rpartition(",")[0],
            xlabel=FAULTS[fault][0].rpartition(",")[2].strip(),
            ylim=(-5, 105),
        )
        if fault != "clipped":
            axes.set_xscale("log")
        else:
            axes.invert_xaxis()
    drawn.supylabel("does not fit (% of rigs)")
    path.parent.mkdir(parents=True, exist_ok=True)
    with rc_context({"svg.hashsalt": "prw"}):
        drawn.savefig(path, metadata={"Date": None})


def write(found: dict, path: Path | None) -> None:
    """Writes the results as JSON, if a path is given."""
    if path:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(found, indent=2) + "\n")


def is_too_rare(hits: np.ndarray, least: float, expected: float) -> bool:
    """Returns whether the share of hits is less than `least`, and so low a share has a probability below 5 % if the true share is
    `expected`."""
    return bool(hits.mean() < least and binom.cdf(hits.sum(), hits.size, expected) < 0.05)


def main() -> int:
    """Runs the repetitions, prints and writes their results. Returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fmu")
    parser.add_argument("--repetitions", type=int, default=300)
    parser.add_argument("--sensors", choices=SENSORS, default="all")
    parser.add_argument("--motion", choices=MOTIONS, default="independent")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first repetition; the others count up from it")
    parser.add_argument("--counts", type=int, default=rig.COUNTS)
    parser.add_argument("--workers", type=int, default=multiprocessing.cpu_count())
    parser.add_argument("--faulty", type=int, default=0, metavar="N", help="rigs for each fault and size instead")
    parser.add_argument(
        "--real", type=int, default=0, metavar="N", help="rigs for each row of REAL instead, and 5 N clean ones"
    )
    parser.add_argument("--verbose", action="store_true", help="with --real, also print a line for each rig")
    parser.add_argument("--figure", type=Path, help="curves of detection over size, SVG")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.repetitions)
    jobs = [(options.fmu, seed, SENSORS[options.sensors], options.counts, options.motion) for seed in seeds]
    with ProcessPoolExecutor(options.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        if options.faulty or options.real:
            rows, good = (campaign if options.faulty else reality)(pool, options)
            write(rows, options.out)
            return 0 if good else 1
        found = list(pool.map(repetition, *zip(*jobs)))
    errors, sigmas, inside, seconds, fits = (np.array([entry[i] for entry in found]) for i in range(5))
    print(
        f"{options.repetitions} repetitions, {', '.join(SENSORS[options.sensors])}, {options.counts} counts a turn, "
        f"{np.median(seconds):.1f} s each"
    )
    print(f"  {'':4}{'mean error':>12}{'its s.e.':>10}{'scatter':>10}{'claimed':>10}{'95 % coverage':>22}")
    rows, good = {}, not is_too_rare(fits, 0.97, 0.99)
    for i, name in enumerate(rig.NAMES):
        bias, scatter, claimed = errors[:, i].mean(), errors[:, i].std(), np.sqrt(np.mean(sigmas[:, i] ** 2))
        cover = inside[:, i].mean()
        rows[name] = {"bias": bias, "scatter": scatter, "claimed": claimed, "coverage": cover}
        good &= abs(bias) < claimed / 4 + 2 * scatter / np.sqrt(len(errors))
        good &= not is_too_rare(inside[:, i], 0.92, 0.95)
        print(
            f"  {name:4}{bias:>12.4%}{scatter / np.sqrt(len(errors)):>10.4%}{scatter:>10.4%}{claimed:>10.4%}"
            f"{cover:>22.1%}"
        )
    print(f"  {fits.mean():.1%} of the verdicts are that the model fits")
    whole = {"commit": commit(), "fits": float(fits.mean()), "repetitions": options.repetitions, "parameters": rows}
    write(whole, options.out)
    print("unbiased, intervals have the stated coverage" if good else "BIASED, intervals too narrow, or false alarms")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
