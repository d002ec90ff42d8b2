"""Reading measurements: a CSV file with motor angles and whatever else was measured, units in the header or given."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Dict, List, Mapping, Optional, Tuple

import numpy as np

from prw.channels import MEASURED
from prw.columns import ANGLES, RATES, columns, shown
from prw.errors import UserError
from prw.recording import doubts, read_columns

#: Fewer samples of a channel say nothing about its noise.
FEWEST = 20


@dataclass(frozen=True)
class Measurements:
    """One recorded experiment in SI. name: what it is called after. time: (n,) s. theta: (n, 2) rad. omega: (n, 2)
    rad/s or None. channels: names of the measured outputs. values: (n, len(channels)), NaN where nothing was
    measured. units: the unit in the file by column. notes: lines the user should read."""

    name: str
    source: Path
    time: np.ndarray
    theta: np.ndarray
    omega: Optional[np.ndarray]
    channels: Tuple[str, ...]
    values: np.ndarray
    units: Dict[str, str]
    notes: List[str] = field(default_factory=list)


def read(path: Path, units: Optional[Mapping[str, str]] = None, degrees: bool = False) -> Measurements:
    """Read one experiment from the CSV file `path`, as recording.read does: time, theta1, theta2, perhaps omega1 and
    omega2, and at least one of MEASURED.

    A column's unit is in its header (`pitch [deg]`) or in `units` by name; without either it is SI, or degrees and
    degrees per second if `degrees`. A measured column may have empty cells. Raises UserError naming file, row and
    column.
    """

    def choose(path, header, line):
        found = columns(path, header, line, tuple(MEASURED), units, degrees)
        if not any(name in MEASURED for name in found.units):
            raise UserError(
                f"{path}, row {line}: nothing measured; at least one column of {', '.join(MEASURED)} is needed, "
                f"the header has {shown(header)}"
            )
        return found

    found, time, values = read_columns(path, choose, may_be_empty=MEASURED)
    table, notes = {name: values[:, i] for i, (name, _) in enumerate(found.taken[1:])}, list(found.notes)
    theta = np.column_stack([table[name] for name in ANGLES])
    omega = np.column_stack([table[name] for name in RATES]) if RATES[0] in table else None
    channels = tuple(name for name in MEASURED if name in table)
    for name in channels:
        count = int(np.isfinite(table[name]).sum())
        if count < FEWEST:
            raise UserError(
                f"{path}, column {name}: {count} values; at least {FEWEST} are needed to fit anything to them"
            )
        if np.nanmax(table[name]) == np.nanmin(table[name]):
            notes.append(f"{name} never changes; is its sensor connected?")
    seen = doubts(time, theta, omega, found.units)
    # Rates are found by smoothing here, so the advice that `prw simulate` gives is no news.
    notes += [note for note in seen if "at rest" not in note and not note.startswith("no omega")]
    values = np.column_stack([table[name] for name in channels])
    return Measurements(Path(path).stem, Path(path), time, theta, omega, channels, values, found.units, notes)
