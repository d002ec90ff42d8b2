"""Is `prw identify` unbiased, and are its intervals honest? Repetitions on simulated rigs; `make monte-carlo` runs it.

    python tests/analysis/monte_carlo.py target/fmu/prw_testbed.fmu [--repetitions 200] [--sensors all|torque]
        [--motion independent|equal|opposite|fig4|slow] [--seed 0] [--counts 10000] [--workers N] [--out out/monte_carlo.json]

Every repetition has its own rig (parameters up to 30 % off Table 1, where the search starts), its own motion of 10 s
at 1 kHz, its own noise, encoder positions and sensor offsets; see rig.py. Exit status 1 if an estimate is biased by
more than a quarter of its standard error and twice what is chance, or a 95 % interval holds the truth in less than 92 %
of the repetitions.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "oracle"))

import rig  # noqa: E402
from threadpoolctl import threadpool_limits  # noqa: E402

from prw.identification import task_of  # noqa: E402
from prw.identification.experiment import prepare  # noqa: E402
from prw.identification.fit import fit  # noqa: E402
from prw.identification.model import Model  # noqa: E402
from prw.identification.statistics import certainty  # noqa: E402
from prw.motion import Motion  # noqa: E402
from prw.recording import Recording  # noqa: E402

SENSORS = {"all": rig.ALL, "torque": ("tau1", "tau2")}
MOTIONS = ("independent", "equal", "opposite", "fig4", "slow")


def repetition(fmu: str, seed: int, channels, counts: int, motion: str) -> tuple:
    """Logarithms of estimate over truth, their standard errors, and whether the 95 % intervals hold the truth, all
    (5,), and the seconds it took."""
    truth = rig.experiment(seed, pattern=motion)
    columns = rig.measure(truth, seed + 1_000_000, channels, counts)
    theta = np.column_stack([columns["theta1"], columns["theta2"]])
    measured = Recording(Path("rig.csv"), Motion(truth.time, theta), {name: columns[name] for name in channels}, {})
    with Model(fmu) as model, threadpool_limits(1):
        begin = time.perf_counter()
        solution = fit(model, [prepare(measured)], task_of(model.known, rig.NAMES), starts=1)
        sure = certainty(solution)
        seconds = time.perf_counter() - begin
    true = np.array([truth.parameters[name] for name in rig.NAMES])
    return solution.logarithms - np.log(true), sure.relative, (sure.low < true) & (true < sure.high), seconds


def main() -> int:
    """Run the repetitions, print and write what came of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fmu")
    parser.add_argument("--repetitions", type=int, default=200)
    parser.add_argument("--sensors", choices=SENSORS, default="all")
    parser.add_argument("--motion", choices=MOTIONS, default="independent")
    parser.add_argument("--seed", type=int, default=0, help="of the first repetition; the others follow")
    parser.add_argument("--counts", type=int, default=rig.COUNTS)
    parser.add_argument("--workers", type=int, default=multiprocessing.cpu_count())
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    arguments = [
        [options.fmu] * options.repetitions,
        range(options.seed, options.seed + options.repetitions),
        [SENSORS[options.sensors]] * options.repetitions,
        [options.counts] * options.repetitions,
        [options.motion] * options.repetitions,
    ]
    with ProcessPoolExecutor(options.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        found = list(pool.map(repetition, *arguments))
    errors, sigmas, inside, seconds = (np.array([entry[i] for entry in found]) for i in range(4))
    print(
        f"{options.repetitions} repetitions, {', '.join(SENSORS[options.sensors])}, {options.counts} counts a turn, "
        f"{np.median(seconds):.1f} s each"
    )
    print(f"  {'':4}{'mean error':>12}{'its s.e.':>10}{'scatter':>10}{'claimed':>10}{'95 % intervals hold':>22}")
    rows, good = {}, True
    for i, name in enumerate(rig.NAMES):
        bias, scatter, claimed = errors[:, i].mean(), errors[:, i].std(), np.sqrt(np.mean(sigmas[:, i] ** 2))
        cover = inside[:, i].mean()
        rows[name] = {"bias": bias, "scatter": scatter, "claimed": claimed, "coverage": cover}
        good &= abs(bias) < claimed / 4 + 2 * scatter / np.sqrt(len(errors)) and cover >= 0.92
        print(
            f"  {name:4}{bias:>12.4%}{scatter / np.sqrt(len(errors)):>10.4%}{scatter:>10.4%}{claimed:>10.4%}"
            f"{cover:>22.1%}"
        )
    if options.out:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(json.dumps({"repetitions": options.repetitions, "parameters": rows}, indent=2) + "\n")
    print("unbiased, intervals honest" if good else "BIASED, or intervals too narrow")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
