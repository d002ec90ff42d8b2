"""The table of a simulation: time, inputs and all outputs as CSV."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import orjson

from prw.files import replacing
from prw.motion import Array, Motion
from prw.progress import Progress
from prw.testbed import OUTPUTS

BLOCK = 8192


def write_motion(path: Path, motion: Motion) -> None:
    """Write time (s), motor angles (rad) and rates (rad/s), where known, to `path`: a recording for `prw simulate`."""
    write_table(path, motion, {}, ())


def inputs_of(motion: Motion) -> dict[str, Array]:
    """Time (s), motor angles (rad) and rates (rad/s), where known, (n,) by the names of the columns."""
    inputs = {"time": motion.time, "theta1": motion.theta[:, 0], "theta2": motion.theta[:, 1]}
    if motion.omega is not None:
        inputs.update(omega1=motion.omega[:, 0], omega2=motion.omega[:, 1])
    return inputs


def write_table(path: Path, motion: Motion, response: Mapping[str, Array], outputs: Sequence[str] = OUTPUTS) -> None:
    """Write time (s), the inputs given (rad, rad/s) and the outputs (N.m, rad, rad/s) to `path`, one row per sample.

    Numbers have as many digits as it takes to read them back unchanged.
    """
    inputs = inputs_of(motion)
    # Adding 0.0 turns -0.0 into 0.0.
    table = np.column_stack([*inputs.values(), *(response[name] for name in outputs)]) + 0.0
    with (
        replacing(path) as temporary,
        Progress(f"writing {path}", len(table)) as progress,
        open(temporary, "wb") as file,
    ):
        file.write((",".join([*inputs, *outputs]) + "\n").encode("ascii"))
        for start in range(0, len(table), BLOCK):
            # JSON: [[1.0,2.0],[3.0,4.0]], with null for NaN. Brackets become line ends.
            rows = orjson.dumps(table[start : start + BLOCK], option=orjson.OPT_SERIALIZE_NUMPY)
            file.write(rows[2:-2].replace(b"],[", b"\n").replace(b"null", b"nan") + b"\n")
            progress(start)
