"""The reference experiments in an FMU, in the directory that the layered standard FMI-LS-REF defines."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from prw.arguments import check_names
from prw.errors import UserError
from prw.files import MAX_BYTES
from prw.motion import Array

DIRECTORY = "extra/org.fmi-standard.fmi-ls-ref"

Value = float | int | bool
#: Functions that read the values of an SSV file, by the name of the element.
READERS: dict[str, Callable[[str], Value]] = {
    "Integer": int,
    "Real": float,
    "Boolean": {"true": True, "1": True, "false": False, "0": False}.__getitem__,
}


@dataclass(frozen=True)
class Experiment:
    """A reference experiment, in SI.

    Attributes
    ----------
    name, description
        From the list of experiments in the FMU.
    stop_time
        s; the experiment starts at 0.
    inputs, reference
        (n,) by name, each with a column `time`. Inputs are to be interpolated linearly.
    parameters
        Values of the FMU's parameters by name.
    step
        Communication step by interface type, s.
    tolerance
        Largest difference that is allowed, by interface type and output.
    """

    name: str
    description: str
    stop_time: float
    inputs: Mapping[str, Array]
    reference: Mapping[str, Array]
    parameters: Mapping[str, Value]
    step: Mapping[str, float]
    tolerance: Mapping[str, Mapping[str, float]]

    @property
    def outputs(self) -> list[str]:
        """Names of the columns of the reference, without time."""
        return [name for name in self.reference if name != "time"]


def read_experiments(fmu: Path) -> list[Experiment]:
    """All experiments in the FMU file. Raises UserError if it cannot be read or has none."""
    try:
        with zipfile.ZipFile(fmu) as archive:
            return [
                Experiment(
                    entry["name"],
                    entry["description"],
                    entry["stop_time"],
                    _columns(_content(archive, entry["inputs"])),
                    _columns(_content(archive, entry["reference"])),
                    _parameters(_content(archive, entry["parameters"])),
                    {kind: values["step_size"] for kind, values in entry["interfaces"].items()},
                    {kind: values["tolerance"] for kind, values in entry["interfaces"].items()},
                )
                for entry in json.loads(_content(archive, "experiments.json"))
            ]
    except (OSError, zipfile.BadZipFile) as error:
        raise UserError(f"{fmu}: cannot be read ({error})") from None
    except (KeyError, ValueError):
        raise UserError(f"{fmu}: has no reference experiments; take the FMU of the testbed") from None


def find(known: Sequence[Experiment], name: str) -> Experiment:
    """The experiment of that name. Raises UserError if there is none."""
    by_name = {experiment.name: experiment for experiment in known}
    check_names("experiment", [name], by_name)
    return by_name[name]


def _content(archive: zipfile.ZipFile, name: str) -> str:
    with archive.open(f"{DIRECTORY}/{name}") as file:
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise zipfile.BadZipFile(f"{name} has more than {MAX_BYTES >> 20} MB")
    return content.decode("utf-8")


def _columns(table: str) -> dict[str, Array]:
    names = [name.strip('"') for name in table[: table.index("\n")].split(",")]
    return dict(zip(names, np.loadtxt(io.StringIO(table), delimiter=",", skiprows=1, ndmin=2).T))


def _parameters(ssv: str) -> dict[str, Value]:
    """The values of an SSV file."""
    found: dict[str, Value] = {}
    for parameter in ElementTree.fromstring(ssv.encode()).iterfind(".//{*}Parameter"):
        kind, value = parameter[0].tag.rpartition("}")[2], parameter[0].attrib["value"]
        found[parameter.attrib["name"]] = READERS[kind](value)
    return found
