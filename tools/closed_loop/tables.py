"""Columns as CSV."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from prw.files import replacing


def write_columns(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, each (n,), with a line of names; twelve digits."""
    with replacing(path) as temporary:
        rows = np.column_stack(list(columns.values())) + 0.0
        np.savetxt(temporary, rows, fmt="%.12g", delimiter=",", header=",".join(columns), comments="")
