"""Values of parameters: by name, or a file such as `prw identify` writes."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import fmu_run

from prw.arguments import is_path
from prw.errors import UserError

#: Values by name, in SI or as (value, unit), or the path of a JSON file with them.
Given = Mapping[str, Any] | str | os.PathLike[str] | None


def values_of(given: Given, loaded: fmu_run.Fmu) -> dict[str, Any]:
    """Values by name in the units of the FMU. Raises UserError for a file that cannot be read, or a unit that the FMU does not
    have."""
    if given is None:
        return {}
    if isinstance(given, Mapping):
        return {name: in_own_unit(name, value, loaded) for name, value in given.items()}
    if not is_path(given):
        raise UserError(f"{given!r} are neither values by name nor a JSON file with them", argument="parameters")
    path = Path(given)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        # The whole report has them among other things.
        entries = dict(content["parameters"] if isinstance(content.get("parameters"), dict) else content)
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror or error})", argument="parameters") from None
    except (ValueError, AttributeError):
        raise UserError(
            f"{path} is no JSON file with values by name; an FMU is named by `fmu`", argument="parameters"
        ) from None
    return {name: _value(path, name, entry, loaded) for name, entry in entries.items()}


def in_own_unit(name: str, value: Any, loaded: fmu_run.Fmu) -> Any:
    """(value, unit) in the unit of the FMU's variable; a value without a unit as it is. Raises UserError."""
    if not (isinstance(value, tuple) and len(value) == 2 and isinstance(value[1], str)) or name not in loaded.variables:
        return value
    try:
        return loaded.converted(name, *value)
    except ValueError as error:
        raise UserError(str(error), argument="parameters") from None


def _value(path: Path, name: str, entry: Any, loaded: fmu_run.Fmu) -> float | int | bool:
    """A number in the FMU's unit, of one in this unit or of an entry that names another."""
    value, unit = (entry.get("value"), str(entry.get("unit", ""))) if isinstance(entry, dict) else (entry, "")
    if not isinstance(value, (int, float)):
        raise UserError(f"{path}: {name} is {value!r}, not a number", argument="parameters")
    if unit in ("", "1") or name not in loaded.variables:
        return value
    try:
        return loaded.converted(name, value, unit)  # type: ignore[return-value]
    except ValueError as error:
        raise UserError(f"{path}: {error}", argument="parameters") from None
