"""The FMU under libcosim (FMI Library, int64 nanoseconds): Fig. 4 again, and nothing to complain about."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from instance import assert_close
from lagrange import OUTPUTS
from reference import follow

from prw.motion import fig4

pytest.importorskip("libcosimpy")

STEP_NS = 1_000_000
MASTER = Path(__file__).with_name("libcosim_master.py")


def test_fig4(fmu, description, model, tmp_path):
    """libcosim logs to the process's stderr, so it runs in a process of its own."""
    motion = fig4()
    references = {v.name: v.valueReference for v in description.modelVariables}
    inputs, result = tmp_path / "inputs.npy", tmp_path / "result.npy"
    np.save(inputs, np.hstack([motion.theta, motion.omega]))
    wanted = ["theta1", "theta2", "omega1", "omega2", "use_omega", *OUTPUTS]
    run = subprocess.run(
        [
            sys.executable,
            str(MASTER),
            str(fmu),
            str(STEP_NS),
            str(inputs),
            str(result),
            *(str(references[n]) for n in wanted),
        ],
        capture_output=True,
        text=True,
        timeout=120,
    )
    log = run.stdout + run.stderr
    assert run.returncode == 0, log
    assert not [
        line for line in log.splitlines() if any(word in line.lower() for word in ("error", "warning", "fatal"))
    ], log
    found = dict(zip(OUTPUTS, np.load(result).T))
    _, after = follow(model, motion.time, motion.theta, motion.omega)
    for values in (found, after):
        for name in ("pitch", "pitch_rate"):
            assert np.max(np.abs(values.pop(name))) <= 1e-14
        values.update(pitch=np.zeros(2000), pitch_rate=np.zeros(2000))
    # Nanoseconds are what libcosim counts: 1e-9 of a 1 ms step.
    assert_close(found, after, 1e-11)
