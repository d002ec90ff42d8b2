"""FMUs in forked processes, as `multiprocessing` makes them on Linux by default before Python 3.14."""

from __future__ import annotations

import multiprocessing
import subprocess
import sys

import fmu_run
import numpy as np

#: Seconds after which a program is considered to hang.
LIMIT = 60

FORKED = """
import os, sys, threading, warnings
import fmu_run, numpy as np

warnings.simplefilter("ignore")  # Python warns if a process with threads forks.
fmu = fmu_run.Fmu(sys.argv[1])
time, stiffness = np.arange(50) * 1e-3, np.linspace(60.0, 240.0, 16)

def run():
    runs = fmu.run(time, inputs={"theta1": 0.1}, start={"k1": stiffness}, outputs=["roll"], threads=3)
    return runs.check()["roll"].tobytes()

def use():
    for _ in range(20):
        wrists.advance(("theta1", "theta2"), (0.1, -0.1), 1e-3, ("roll", "tau1"))
    wrists.set("theta1", stiffness / 1000)
    wrists.step(1e-3)
    return wrists.get("tau1").tobytes()

def whole():
    found = run() + use()
    wrists.reset()
    return found + wrists.get("roll").tobytes()

wrists = fmu.instances(16, start={"k1": stiffness}, threads=3)
expected = whole()
for depth in range(3):
    child = os.fork()
    if child == 0:
        # Each child checks its results and forks the next one; the last child only checks them.
        if whole() != expected:
            os._exit(1)
        if depth == 2:
            os._exit(0)
        continue
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    if depth > 0:
        os._exit(code)
    assert code == 0, code
    break
assert whole() == expected
print("same")
"""

LOCKED = """
import os, sys, threading, time, warnings
import fmu_run

warnings.simplefilter("ignore")
fmu = fmu_run.Fmu(sys.argv[1])
wrists = fmu.instances(20_000, threads=2)
saved = wrists.save()
def work():
    while not done:
        wrists.step(1e-3)
done, worker = False, threading.Thread(target=work)
worker.start()
for attempt in range(20):
    time.sleep(0.01)
    child = os.fork()
    if child == 0:
        try:
            wrists.step(1e-3)
        except fmu_run.FmuError as error:
            os._exit(0 if "another thread used these instances when this process was forked" in str(error) else 1)
        os._exit(2)  # The worker did not use the instances during the fork.
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code != 2:
        break
done = True
worker.join()
print(code)
"""


def printed(program: str, path: object) -> str:
    command = [sys.executable, "-c", program, str(path)]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=LIMIT).stdout


def test_threads_in_forked_processes(testbed) -> None:
    """Runs and instances with several threads work in three generations of forked processes, and afterwards in the parent."""
    assert printed(FORKED, testbed) == "same\n"


def test_instances_in_use_by_another_thread(testbed) -> None:
    """A forked child has only the thread that forked. Instances that another thread used during the fork are lost in the child; an
    error reports this."""
    assert printed(LOCKED, testbed) == "0\n"


def test_a_pool_of_processes(testbed) -> None:
    """The FMU is opened and used, with threads, before the processes are forked."""
    global _fmu
    with fmu_run.Fmu(testbed) as _fmu:
        expected = [_peak(stiffness) for stiffness in (80.0, 160.0)]
        with multiprocessing.get_context("fork").Pool(2) as pool:
            assert pool.map_async(_peak, [80.0, 160.0]).get(timeout=LIMIT) == expected


_fmu: fmu_run.Fmu


def _peak(stiffness: float) -> list[float]:
    runs = _fmu.run(
        np.arange(20) * 1e-3,
        inputs={"theta1": 0.1},
        start={"k1": [stiffness, stiffness + 1.0]},
        outputs=["roll"],
        measures=["peak"],
        threads=2,
    )
    return runs["roll", "peak"].tolist()
