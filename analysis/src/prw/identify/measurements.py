"""Reading measurements: a CSV file with motor angles and whatever else was measured, units in the header or given."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from prw.errors import UserError
from prw.identify.channels import MEASURED, MOTORS, QUANTITIES, factor, si_unit
from prw.recording import ANGLES, RATES, SHOWN_COLUMNS, doubts, read_columns

#: `pitch [deg]` or `pitch (deg)`
COLUMN = re.compile(r"^\s*([A-Za-z_]\w*)\s*(?:\[([^\]]*)\]|\(([^)]*)\))?\s*$")
#: Fewer samples of a channel say nothing about its noise.
FEWEST = 20


@dataclass(frozen=True)
class Measurements:
    """One recorded experiment in SI. name: what it is called after. time: (n,) s. theta: (n, 2) rad. omega: (n, 2) rad/s
    or None. channels: names of the measured outputs. values: (n, len(channels)), NaN where nothing was measured. units:
    the unit in the file by column. notes: lines the user should read."""

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
    degrees per second if `degrees`. A measured column may have empty cells. Raises UserError naming file, row and column.
    """
    chosen: Dict[str, str] = {}

    def choose(path, header, line) -> tuple:
        columns, found, notes = _columns(path, header, line)
        for name, unit in found.items():
            given = (units or {}).get(name, "")
            if unit and given and factor(name, unit) != factor(name, given):
                raise UserError(f"{path}, row {line}, column {name}: in {unit} by its header, but in {given} by --units")
            default = si_unit(name)
            if degrees and QUANTITIES[name] in ("angle", "rate"):
                default = default.replace("rad", "deg")
            chosen[name] = unit or given or default
            try:
                factor(name, chosen[name])
            except UserError as error:
                raise UserError(f"{path}, row {line}, column {name}: {error}") from None
        return columns, notes

    names, time, values, notes = read_columns(path, choose, may_be_empty=MEASURED)
    time = time * factor("time", chosen["time"])
    table = {name: values[:, i] * factor(name, chosen[name]) for i, name in enumerate(names)}
    theta = np.column_stack([table[name] for name in ANGLES])
    omega = np.column_stack([table[name] for name in RATES]) if RATES[0] in table else None
    channels = tuple(name for name in MEASURED if name in table)
    for name in channels:
        count = int(np.isfinite(table[name]).sum())
        if count < FEWEST:
            raise UserError(f"{path}, column {name}: {count} values; at least {FEWEST} are needed to fit anything to them")
        if np.nanmax(table[name]) == np.nanmin(table[name]):
            notes.append(f"{name} never changes; is its sensor connected?")
    seen = doubts(time, theta, omega, degrees)
    # Rates are found by smoothing here, so the advice that `prw simulate` gives is no news.
    notes += [note for note in seen if "at rest" not in note and not note.startswith("no omega")]
    values = np.column_stack([table[name] for name in channels])
    return Measurements(Path(path).stem, Path(path), time, theta, omega, channels, values, chosen, notes)


def _columns(path: Path, header: Sequence[str], line: int) -> tuple:
    """The columns to take as [(name, index)] with time first, the unit in the header of each or "", and notes."""
    found: Dict[str, int] = {}
    units: Dict[str, str] = {}
    ignored = []
    for index, text in enumerate(header):
        match = COLUMN.match(text)
        name = match.group(1) if match else None
        if name not in QUANTITIES:
            ignored.append(text or "(blank)")
            continue
        if name in found:
            raise UserError(f"{path}, row {line}, column {name}: appears twice in the header")
        found[name] = index
        units[name] = (match.group(2) or match.group(3) or "").strip()
    shown = ", ".join(text or "(blank)" for text in header[:SHOWN_COLUMNS]) + (
        ", ..." if len(header) > SHOWN_COLUMNS else ""
    )
    for name in ("time", *ANGLES):
        if name not in found:
            raise UserError(f"{path}, row {line}: column {name} is missing; the header has {shown}")
    if (RATES[0] in found) != (RATES[1] in found):
        missing = RATES[1] if RATES[0] in found else RATES[0]
        raise UserError(f"{path}, row {line}: column {missing} is missing; give both {' and '.join(RATES)}, or neither")
    if not any(name in found for name in MEASURED):
        raise UserError(
            f"{path}, row {line}: nothing measured; at least one column of {', '.join(MEASURED)} is needed, "
            f"the header has {shown}"
        )
    order = ["time", *(name for name in MOTORS if name in found), *(name for name in MEASURED if name in found)]
    notes = [f"columns ignored: {', '.join(ignored)}"] if ignored else []
    return [(name, found[name]) for name in order], units, notes
