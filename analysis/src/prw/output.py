"""The table of a simulation: time, inputs and all outputs as CSV."""

from __future__ import annotations

from pathlib import Path
from typing import Dict

import numpy as np

from prw.files import replacing
from prw.motion import Motion
from prw.progress import Progress
from prw.testbed import OUTPUTS

BLOCK = 8192


def write_table(path: Path, motion: Motion, response: Dict[str, np.ndarray]) -> None:
    """Write time (s), the inputs given (rad, rad/s) and the outputs (N.m, rad, rad/s) to `path`, one row per sample.

    Time and inputs keep all their digits, so that they can be read back unchanged; outputs have twelve.
    """
    inputs = {"time": motion.time, "theta1": motion.theta[:, 0], "theta2": motion.theta[:, 1]}
    if motion.omega is not None:
        inputs.update(omega1=motion.omega[:, 0], omega2=motion.omega[:, 1])
    # + 0.0 turns -0.0, which reads oddly, into 0.0
    table = np.column_stack([*inputs.values(), *(response[name] for name in OUTPUTS)]) + 0.0
    row_format = ",".join(["%r"] * len(inputs) + ["%.12g"] * len(OUTPUTS)) + "\n"
    with replacing(path) as temporary, Progress(f"writing {path}", len(table)) as progress:
        with open(temporary, "w", encoding="ascii", newline="") as file:
            file.write(",".join([*inputs, *OUTPUTS]) + "\n")
            for start in range(0, len(table), BLOCK):
                file.writelines(row_format % tuple(row) for row in table[start : start + BLOCK].tolist())
                progress(start)
