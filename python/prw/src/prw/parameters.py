"""Values of parameters: by name, or a file such as `prw identify` writes."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import fmu_run

from prw.arguments import is_path
from prw.description import Unit, read_description
from prw.errors import UserError

#: Values by name, or the path of a JSON file with them.
Given = Mapping[str, Any] | str | os.PathLike[str] | None


def values_of(given: Given, fmu: Path, loaded: fmu_run.Fmu) -> dict[str, Any]:
    """Values by name in the units of the FMU, which is in the file `fmu` and loaded. Raises UserError for a file that
    cannot be read, or has none of its units."""
    if given is None:
        return {}
    if isinstance(given, Mapping):
        return dict(given)
    if not is_path(given):
        raise UserError(f"parameters: {given!r} are neither values by name nor a JSON file with them")
    path = Path(given)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        # The whole report has them among other things.
        entries = dict(content["parameters"] if isinstance(content.get("parameters"), dict) else content)
    except OSError as error:
        raise UserError(f"parameters: {path} cannot be read ({error.strerror or error})") from None
    except (ValueError, AttributeError):
        raise UserError(f"parameters: {path} is no JSON file with values by name; an FMU is named by `fmu`") from None
    units = read_description(fmu).units
    return {name: _value(path, name, entry, loaded.variables.get(name), units) for name, entry in entries.items()}


def _value(
    path: Path, name: str, entry: Any, variable: fmu_run.Variable | None, units: Mapping[str, Unit]
) -> float | int | bool:
    """A number in the FMU's unit, of one in this unit or of an entry that names another."""
    value, unit = (entry.get("value"), str(entry.get("unit", ""))) if isinstance(entry, dict) else (entry, "")
    if not isinstance(value, (int, float)):
        raise UserError(f"parameters: {path}: {name} is {value!r}, not a number")
    own = (variable.unit if variable else None) or "1"
    if variable is None or unit in ("", own):
        return value
    known = units[own].displayed if own in units else {}
    if unit not in known:
        raise UserError(f"parameters: {path}: {name} is in {unit}; it must be in {', '.join([own, *known])}")
    return value * known[unit]
