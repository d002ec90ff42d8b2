"""Runs of the reference experiments, and their differences from the reference."""

from __future__ import annotations

import datetime
import json
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from fmu_run import Fmu

from prw.checking import check
from prw.checking.agreement import Agreement, compare
from prw.checking.experiments import Experiment, find, read_experiments
from prw.checking.result import Result
from prw.columns import MEASURED
from prw.identification.model import Parameters
from prw.motion import Array
from prw.testbed import existing_fmu
from tools.validation import masters, system
from tools.validation.importers import IMPORTERS, Tool, by_fmu_run

#: Paths of the FMUs by FMI version.
FMUS = {"2.0": Path("prw_testbed.fmu"), "3.0": Path("fmi3/prw_testbed.fmu")}
#: Relative change of a parameter, with which the tolerances are tested.
CHANGE = 0.01


@dataclass(frozen=True)
class Row:
    """One run of an experiment.

    Attributes
    ----------
    importer
        Name of the tool.
    version, interface, fmi
        Version of the tool, interface type and FMI version; empty if a file does not contain them.
    experiment
        Name of the experiment.
    share
        Largest difference as a fraction of its tolerance.
    largest
        Largest difference by quantity: angle (rad), rate (rad/s), torque (N.m).
    outputs
        Number of compared outputs.
    """

    importer: str
    version: str
    interface: str
    fmi: str
    experiment: str
    share: float
    largest: dict[str, float]
    outputs: int

    @property
    def agrees(self) -> bool:
        """Whether every output is within its tolerance."""
        return self.share <= 1

    def __str__(self) -> str:
        fmi = self.fmi and f"FMI {self.fmi}"
        return f"{self.experiment}: {', '.join(filter(None, (self.tool, self.interface, fmi)))}"

    @property
    def tool(self) -> str:
        """Importer and version."""
        return f"{self.importer} {self.version}".strip()


@dataclass(frozen=True)
class Validation:
    """All results.

    Attributes
    ----------
    guid
        Guid of the FMU for FMI 2.0.
    date, machine
        When and where the experiments were run.
    experiments
        Descriptions by name.
    rows
        The runs.
    sensitivity
        Largest difference that a change of a parameter by CHANGE causes, as a fraction of its tolerance, by experiment and
        parameter.
    absent
        Importers that are not installed.
    """

    guid: str
    date: str
    machine: str
    experiments: dict[str, str]
    rows: list[Row]
    sensitivity: dict[str, dict[str, float]]
    absent: list[str]

    def to_json(self) -> str:
        """All numbers as JSON."""
        rows = [{**asdict(row), "agrees": row.agrees} for row in self.rows]
        content = {**asdict(self), "rows": rows, "parameters_changed_by": CHANGE}
        return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def validate(fmus: Path, results: Mapping[str, Path] = {}) -> Validation:
    """Run all experiments. results: files of other tools by tool. Raises UserError if an FMU or a file is missing, or if an
    FMU rejects a call."""
    from fmpy import read_model_description

    paths = {fmi: existing_fmu(fmus / name) for fmi, name in FMUS.items()}
    known = read_experiments(paths["2.0"])
    rows, absent = [], [f"{t.name} (pip {t.package})" for t in (*IMPORTERS, *masters.MASTERS) if t.version() is None]
    for importer in filter(Tool.version, IMPORTERS):
        for fmi, path in paths.items():
            for experiment in known:
                found = importer.run(path, experiment, experiment.parameters)
                agreement = compare(found, experiment, importer.interface)
                rows.append(row(importer.name, str(importer.version()), fmi, agreement))
    loop = system.read(fmus / "prw_closed_loop.ssp", fmus / "prw_closed_loop")
    for master in filter(Tool.version, masters.MASTERS):
        found = of_testbed(masters.run_separately(master, loop))
        agreement = compare(found, find(known, "closed_loop"), master.interface)
        rows.append(row(f"{master.name}, with the controller's FMU", str(master.version()), "2.0", agreement))
    for tool, file in results.items():
        result_row = row(f"{tool}, from the file {file.name}", "", "", check(file, fmu=paths["2.0"]))
        rows.append(replace(result_row, interface=""))
    return Validation(
        guid=str(read_model_description(str(paths["2.0"])).guid),
        date=datetime.date.today().isoformat(),
        machine=f"{platform.system()} on {platform.machine()}, Python {platform.python_version()}",
        experiments={experiment.name: experiment.description for experiment in known},
        rows=rows,
        sensitivity={experiment.name: sensitivity(paths["2.0"], experiment) for experiment in known},
        absent=absent,
    )


def row(importer: str, version: str, fmi: str, agreement: Agreement) -> Row:
    """The row of a comparison."""
    largest = dict.fromkeys(("angle", "rate", "torque"), 0.0)
    for name, difference in agreement.variables.items():
        quantity = MEASURED[name].quantity
        largest[quantity] = max(largest[quantity], difference.largest)
    experiment, count = agreement.experiment.name, len(agreement.variables)
    return Row(importer, version, agreement.interface, fmi, experiment, share(agreement), largest, count)


def share(agreement: Agreement) -> float:
    """The largest difference as a fraction of its tolerance."""
    return max(difference.largest / difference.allowed for difference in agreement.variables.values())


def of_testbed(values: Mapping[str, Array]) -> Result:
    """The testbed's outputs in a master's results."""
    outputs = {name.removeprefix("testbed."): v for name, v in values.items() if name.startswith("testbed.")}
    return Result(Path("closed loop"), values["time"], outputs)


def sensitivity(fmu: Path, experiment: Experiment) -> dict[str, float]:
    """The largest difference that a change of each parameter by CHANGE causes in Co-Simulation, as a fraction of its
    tolerance."""
    found = {}
    with Fmu(fmu) as loaded:
        measured = Parameters(loaded).real
    for name in measured:
        # A parameter that is 0 becomes CHANGE.
        changed = {**experiment.parameters, name: experiment.parameters[name] * (1 + CHANGE) or CHANGE}
        found[name] = share(compare(by_fmu_run(fmu, experiment, changed), experiment, "CoSimulation"))
    return found
