"""Writes the reference experiments as files that the FMU contains, in the directory of the layered standard FMI-LS-REF
(version 1.0.0-alpha.1).

    python tests/oracle/write_experiments.py [DIRECTORY]

The content of modelDescription, which is the default DIRECTORY, becomes part of the FMU.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from experiments import GROUPS, SAMPLE_TIME, STEP_SIZES, Experiment, experiments
from lxml import etree

ROOT = Path(__file__).resolve().parents[2]
LAYER = "org.fmi-standard.fmi-ls-ref"
#: Paths in the directory. The standard recommends a document for readers, which is the second path.
FILES, ABOUT = Path("extra", LAYER), Path("documentation", "fmi-ls-ref.txt")
LS = "http://fmi-standard.org/fmi-ls-manifest"
SSV, SSC = (f"http://ssp-standard.org/SSP1/SystemStructure{kind}" for kind in ("ParameterValues", "Common"))
#: Decimals of all numbers in the tables. The last one is at most a hundredth of the smallest tolerance.
DECIMALS = 8
#: Every experiment starts at rest, so start values of states are ignored. They equal the defaults of the FMU.
START = {"start_at_rest": True} | {
    f"{state}_start": 0.0 for state in ("theta3", "theta4", "theta5", "theta6", "omega5", "omega6")
}
#: Largest relative tolerance of a solver for which the tolerances in Model Exchange apply.
SOLVER = 1e-7


def files(found: list[Experiment]) -> dict[Path, str]:
    """Returns the content of every file by its path in the directory."""
    texts = {}
    for experiment in found:
        for kind, columns in (("in", experiment.inputs), ("ref", experiment.reference)):
            texts[FILES / f"{experiment.name}_{kind}.csv"] = table(columns)
        texts[FILES / f"{experiment.name}.ssv"] = parameter_set(experiment)
    texts[FILES / "experiments.json"] = json.dumps([entry(experiment) for experiment in found], indent=1) + "\n"
    texts[FILES / "fmi-ls-manifest.xml"] = manifest(found)
    texts[ABOUT] = about(found)
    return texts


def table(columns: dict[str, Any]) -> str:
    """Returns a table as CSV in the format of the FMI Cross-Check, with quoted names and commas."""
    rows = np.round(np.column_stack(list(columns.values())), DECIMALS) + 0.0  # Adding 0.0 turns -0.0 into 0.0.
    lines = [",".join(f'"{name}"' for name in columns), *(",".join(f"{v:.10g}" for v in row) for row in rows)]
    return "\n".join(lines) + "\n"


def parameter_set(experiment: Experiment) -> str:
    """Returns all parameters as an SSV file of SSP 1.0, in the units of the FMU."""
    root = etree.Element(
        f"{{{SSV}}}ParameterSet",
        nsmap={"ssv": SSV, "ssc": SSC},
        version="1.0",
        name=experiment.name,
        description=experiment.description,
    )
    parameters = etree.SubElement(root, f"{{{SSV}}}Parameters")
    for name, value in {**experiment.parameters, **START}.items():
        kind = {bool: "Boolean", int: "Integer", float: "Real"}[type(value)]
        element = etree.SubElement(parameters, f"{{{SSV}}}Parameter", name=name)
        etree.SubElement(element, f"{{{SSV}}}{kind}", value=json.dumps(value))
    return xml(root)


def entry(experiment: Experiment) -> dict[str, Any]:
    """Returns the entry of an experiment in experiments.json."""
    t = experiment.reference["time"]
    return {
        "name": experiment.name,
        "description": experiment.description,
        "start_time": float(t[0]),
        "stop_time": float(t[-1]),
        "inputs": f"{experiment.name}_in.csv",
        "reference": f"{experiment.name}_ref.csv",
        "parameters": f"{experiment.name}.ssv",
        "interfaces": {
            interface: {"step_size": step, "tolerance": experiment.allowed(interface)}
            for interface, step in STEP_SIZES.items()
        },
    }


def manifest(found: list[Experiment]) -> str:
    """Returns the content of fmi-ls-manifest.xml."""
    root = etree.Element("fmiReferences", nsmap={"fmi-ls": LS})
    root.set(f"{{{LS}}}fmi-ls-name", LAYER)
    root.set(f"{{{LS}}}fmi-ls-version", "1.0.0-alpha.1")
    description = "Layered Standard providing information on related files included in an FMU."
    root.set(f"{{{LS}}}fmi-ls-description", description)

    def related(source: str, kind: str, role: str, description: str, label: str = "") -> None:
        element = etree.SubElement(root, "Related", type=kind, source=source, role=role, description=description)
        if label:
            etree.SubElement(element, "Label", name=f"experiment:{label}")

    about = "All experiments: their files, times, step sizes and tolerances"
    related("experiments.json", "application/json", "experiment/validation", about)
    related(f"../../{ABOUT.as_posix()}", "text/plain", "document", "How to carry out and judge the experiments")
    for experiment in found:
        name = experiment.name
        related(f"{name}.ssv", "application/x-ssp-parameter-set", "parameter", experiment.description, name)
        related(f"{name}_in.csv", "text/csv", "testcase", "Inputs over time, to be interpolated linearly", name)
        related(f"{name}_ref.csv", "text/csv", "result", "Outputs over time, not calculated by the FMU", name)
    return xml(root)


def about(found: list[Experiment]) -> str:
    """Returns the content of documentation/fmi-ls-ref.txt."""
    listed = "\n".join(f"  {e.name:<17} {e.description}" for e in found)
    kinds = ", ".join(" ".join(names) for names in GROUPS)
    return f"""Reference experiments

The folder extra/{LAYER} contains experiments to test an importer. A program that shares no code with
the FMU calculated the outputs from the energies of the testbed's parts.

{listed}

For each experiment NAME:

  NAME.ssv          all parameters (SSP 1.0), in SI
  NAME_in.csv       motor angles (rad) and rates (rad/s) over time (s), to be interpolated linearly between rows
  NAME_ref.csv      outputs over time (s): torques (N.m), angles (rad), rates (rad/s)
  experiments.json  start and stop time, step size and tolerances (in the outputs' units) for each interface type

The tolerances are for communication steps of {STEP_SIZES["CoSimulation"] * 1e3:g} ms in Co-Simulation, with use_omega = true, and in Model Exchange
for solvers with a relative tolerance of {SOLVER:g} or less that interpolate inputs at every evaluation. Inputs that are held
between communication points cause a first-order error that exceeds the tolerances. Variables of one kind share a tolerance:
{kinds}. In Co-Simulation the tolerance of torques is wider, because many
importers read outputs before they set the next inputs: torques then belong to the last rates.

In rate_step the motors turn at constant rates, so Co-Simulation is exact at any step size, and Model Exchange is exact up
to the solver's tolerance. The motors of the other experiments are sampled every {SAMPLE_TIME * 1e3:g} ms.

`prw check RESULT` compares a table of any tool with an experiment.
"""


def xml(root: Any) -> str:
    found: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    return found.decode("utf-8")


def main() -> None:
    directory = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "modelDescription"
    texts = files(experiments())
    for path, text in texts.items():
        (directory / path).parent.mkdir(parents=True, exist_ok=True)
        (directory / path).write_text(text, encoding="utf-8", newline="\n")
    print(f"wrote {len(texts)} files, {sum(map(len, texts.values())) // 1000} kB, into {directory}")


if __name__ == "__main__":
    main()
