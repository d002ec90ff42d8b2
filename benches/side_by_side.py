"""Instances in the hand beside a loop in C over as many, and closed loops beside other masters: python benches/side_by_side.py.

Prints Markdown tables, measured in turn; each figure is the least of several rounds. What is compared must agree to the bit.
With BENCH_QUICK in the environment counts are small: the tables are then meaningless.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmu_run
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
from tools.validation import masters  # noqa: E402
from tools.validation.system import read  # noqa: E402

FMUS = ROOT / "target" / "fmu"
STEP = 1e-3
QUICK = "BENCH_QUICK" in os.environ
ROUNDS, LOOPS = (1, 2) if QUICK else (7, 1000)
#: Instances, and the steps of each.
SIZES = ((1, 50), (8, 5)) if QUICK else ((1, 50_000), (1024, 300), (16384, 40))
MOTORS, OUTPUTS = ("theta1", "theta2"), ("tau1", "tau2", "pitch", "roll")


def least(body: Callable[..., tuple[float, Any]], *arguments: Any) -> float:
    return min(body(*arguments)[0] for _ in range(ROUNDS))


def in_c(count: int, moves: np.ndarray) -> tuple[float, np.ndarray]:
    """Seconds of a step of one of so many instances in C, and the outputs of the last (times, outputs)."""
    work = ROOT / "target" / "bench"
    with fmu_run.Fmu(FMUS / "prw_testbed.fmu") as fmu:
        lists = ("0,1", ",".join(str(list(fmu.variables).index(name)) for name in OUTPUTS))
    guid = (work / "guid").read_text()
    command = [work / "loop", work / "fmu.so", guid, 1, len(moves), STEP, *lists, count]
    done = subprocess.run([str(word) for word in command], input=moves.tobytes(), capture_output=True, check=True)
    return float(done.stderr) / count / len(moves), np.frombuffer(done.stdout).reshape(len(moves), -1)


def by_fmu_run(count: int, threads: int, moves: np.ndarray) -> tuple[float, np.ndarray]:
    with fmu_run.Fmu(FMUS / "prw_testbed.fmu") as fmu:
        wrists = fmu.instances(count, threads=threads)
        rows, last = np.empty((count, len(OUTPUTS))), np.empty((len(moves), len(OUTPUTS)))
        begin = time.perf_counter()
        for k, move in enumerate(moves):
            wrists.set(MOTORS, move)
            wrists.get(OUTPUTS, rows)
            last[k] = rows[-1]
            wrists.step(STEP)
        return (time.perf_counter() - begin) / count / len(moves), last


def in_one_go(count: int, threads: int, moves: np.ndarray) -> tuple[float, np.ndarray]:
    with fmu_run.Fmu(FMUS / "prw_testbed.fmu") as fmu:
        wrists, rows = fmu.instances(count, threads=threads), np.empty((count, len(OUTPUTS)))
        begin = time.perf_counter()
        for move in moves:
            wrists.advance(MOTORS, move, STEP, OUTPUTS, rows)
        return (time.perf_counter() - begin) / count / len(moves), rows


def instances() -> None:
    print(
        "| testbeds | fmu_run, ns a step of one | fmu_run / C | in one call / C | in one call, two threads, throughput |"
    )
    print("|---|---|---|---|---|")
    for count, steps in SIZES:
        angle = 0.1 * np.sin(10 * np.pi * STEP * np.arange(steps))
        moves = np.column_stack([angle, -angle])
        np.testing.assert_array_equal(by_fmu_run(count, 1, moves)[1], in_c(count, moves)[1])
        c = least(in_c, count, moves)
        one = least(by_fmu_run, count, 1, moves)
        go, two = (least(in_one_go, count, threads, moves) for threads in (1, 2))
        print(f"| {count:,} | {one * 1e9:.3g} | {one / c:.3g} | {go / c:.3g} | {go / two:.3g} |", flush=True)


def loops() -> None:
    system = read(FMUS / "prw_closed_loop.ssp", FMUS / "prw_closed_loop")
    # libcosim counts nanoseconds.
    instants, count = np.arange(system.steps + 1) * round(system.step * 1e9) / 1e9, LOOPS
    with fmu_run.System(FMUS / "prw_closed_loop.ssp", order="jacobi") as loop:
        gains = {"controller.pitch_ref": np.full(count, system.inputs["pitch_ref"][1])}

        def ours(threads: int) -> tuple[float, fmu_run.Runs]:
            begin = time.perf_counter()
            runs = loop.run(instants, start=gains, outputs=["pitch"], measures=["end"], threads=threads).check()
            return (time.perf_counter() - begin) / count, runs

        times = {f"fmu_run, {threads} thread{'s' * (threads > 1)}": least(ours, threads) for threads in (1, 2)}
        courses = loop.run(instants, outputs=masters.RECORDED)
    for master in masters.MASTERS[:2]:
        if master.version() is None:
            continue
        rounds = []
        for _ in range(1 if QUICK else 3):
            begin = time.perf_counter()
            rows = master.run(system)
            rounds.append(time.perf_counter() - begin)
        times[f"{master.name} {master.version()}"] = min(rounds)
        if master.name == "libcosim":
            expected = np.column_stack([courses[name][0, 1:] for name in masters.RECORDED])
            np.testing.assert_array_equal(rows, expected)
    print(f"\n| closed loop, {system.steps} steps | runs a second | times one thread of fmu_run |\n|---|---|---|")
    first = next(iter(times.values()))
    for name, seconds in times.items():
        print(f"| {name} | {1 / seconds:,.3g} | {seconds / first:.3g} |")


if __name__ == "__main__":
    instances()
    loops()
