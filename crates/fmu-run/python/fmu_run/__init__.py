"""Runs FMUs fast: batches of one to millions of runs, and stateful instances, one or thousands::

    with fmu_run.Fmu("model.fmu") as fmu:
        runs = fmu.run(time, inputs={"u": u}, start={"k": k_of_each_run}, outputs=["y"])
    runs["y"]  # (runs, times)

    model = fmu.instances(start={"k": 2.0})
    model.set("u", 1.0)
    model.step(1e-3)
    model.get("y")  # (instances,)

    links = {"law.u": "plant.u", "plant.y": "law.y"}
    loop = fmu_run.System({"law": law, "plant": fmu}, links)
    loop.run(time, start={"law.gain": gains}, outputs=["plant.y"])

Values are in the FMU's units, which `Fmu.variables` contains. FMI 2.0 and FMI 3.0 are supported.
"""

from __future__ import annotations

from fmu_run._native import FmuError, Instances, States
from fmu_run.arguments import Log, Measure, Start
from fmu_run.fmu import Fmu
from fmu_run.model import Variable
from fmu_run.runs import Event, Interrupted, Runs
from fmu_run.sensitivities import Sensitivities
from fmu_run.system import System

__all__ = [
    "Event",
    "Fmu",
    "FmuError",
    "Instances",
    "Interrupted",
    "Log",
    "Measure",
    "Runs",
    "Sensitivities",
    "Start",
    "States",
    "System",
    "Variable",
]
