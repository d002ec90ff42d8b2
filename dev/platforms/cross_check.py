"""Packs the reference experiments by the rules of the FMI Cross-Check (4.1, section 9.1.4). Each experiment has a directory
with the FMU, inputs, outputs and options."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

#: Directory of the experiments in the FMU.
DIRECTORY = "extra/org.fmi-standard.fmi-ls-ref"
#: Relative tolerance for tools that use one tolerance for all variables.
RELATIVE_TOLERANCE = 1e-3
#: Fixed time of every file in the zip file, for reproducible bytes.
TIME = (1980, 1, 1, 0, 0, 0)


def pack(fmu: Path, destination: Path) -> None:
    """Writes the experiments in `fmu` to the zip file `destination`, one directory for each."""
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(destination, "w", zipfile.ZIP_DEFLATED) as archive:

        def write(name: str, content: bytes) -> None:
            about = zipfile.ZipInfo(name, TIME)
            about.compress_type, about.create_system, about.external_attr = zipfile.ZIP_DEFLATED, 3, 0o644 << 16
            archive.writestr(about, content)

        whole = fmu.read_bytes()
        for experiment in json.loads(source.read(f"{DIRECTORY}/experiments.json")):
            name = experiment["name"]
            write(f"{name}/{name}.fmu", whole)
            for kind in ("inputs", "reference", "parameters"):
                write(f"{name}/{experiment[kind]}", source.read(f"{DIRECTORY}/{experiment[kind]}"))
            write(f"{name}/{name}_ref.opt", options(experiment).encode())
            write(f"{name}/README.md", readme(experiment).encode())


def options(experiment: dict[str, Any]) -> str:
    """Returns the content of NAME_ref.opt."""
    values = {
        "StartTime": experiment["start_time"],
        "StopTime": experiment["stop_time"],
        "StepSize": experiment["interfaces"]["CoSimulation"]["step_size"],
        "RelTol": RELATIVE_TOLERANCE,
        "SolverType": "FixedStep",
    }
    return "".join(f"{name}, {value}\n" for name, value in values.items())


def readme(experiment: dict[str, Any]) -> str:
    """Returns the content of README.md."""
    interfaces = experiment["interfaces"]
    name = experiment["name"]
    heads = "".join(f" {interface} |" for interface in interfaces)
    rows = "\n".join(
        f"| {output} |" + "".join(f" {interface['tolerance'][output]:g} |" for interface in interfaces.values())
        for output in interfaces["CoSimulation"]["tolerance"]
    )
    return f"""# {name}

{experiment["description"]}.

Set the parameters of `{name}.ssv` first, including `use_omega`. `{name}_ref.csv` comes from a solution that shares no code with
the FMU. The table lists the tolerances in rad, rad/s and N.m, for communication steps of
{interfaces["CoSimulation"]["step_size"]:g} s. In Model Exchange the inputs are interpolated at every evaluation.

| output |{heads}
|---|{"---|" * len(interfaces)}
{rows}

`documentation/fmi-ls-ref.txt` in the FMU explains the experiments.
"""
