"""Importers that run a reference experiment with the packed FMU."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from fmu_run import Fmu

from prw.checking.experiments import Experiment, Value
from prw.checking.result import Result
from prw.columns import ANGLES, RATES
from prw.motion import Array, Motion
from prw.testbed import Testbed

#: Relative tolerance of the solver in Model Exchange.
SOLVER_TOLERANCE = 1e-7


@dataclass(frozen=True)
class Tool:
    """An importer or a co-simulation master.

    Attributes
    ----------
    name
        Name of the tool.
    package
        Python package that contains it.
    interface
        Interface type that it imports.
    run
        For an importer run(fmu, experiment, parameters), with parameters that replace the experiment's; for a master
        run(system).
    """

    name: str
    package: str
    interface: str
    run: Callable[..., Any]

    def version(self) -> str | None:
        """The installed version, or None."""
        try:
            return metadata.version(self.package)
        except metadata.PackageNotFoundError:
            return None


def outputs_of(experiment: Experiment) -> tuple[str, ...]:
    """The names of the outputs in the reference."""
    return tuple(name for name in experiment.reference if name != "time")


def by_fmpy(fmu: Path, experiment: Experiment, parameters: Mapping[str, Value]) -> Result:
    """FMPy's simulate_fmu in Co-Simulation; it reads outputs before it sets the next inputs."""
    from fmpy import simulate_fmu

    step, outputs = experiment.step["CoSimulation"], outputs_of(experiment)
    table = np.zeros(len(experiment.inputs["time"]), dtype=[(name, np.float64) for name in experiment.inputs])
    for name, values in experiment.inputs.items():
        table[name] = values
    rows = simulate_fmu(
        str(fmu),
        fmi_type="CoSimulation",
        stop_time=experiment.stop_time,
        step_size=step,
        output_interval=step,
        input=table,
        start_values={**parameters, **{name: float(table[name][0]) for name in ANGLES}},
        output=list(outputs),
    )
    return Result(fmu, np.asarray(rows["time"], dtype=np.float64), {name: np.asarray(rows[name]) for name in outputs})


def by_scipy(fmu: Path, experiment: Experiment, parameters: Mapping[str, Value]) -> Result:
    """Model Exchange solved by SciPy, with inputs interpolated at every evaluation. (FMPy's solver holds inputs between
    communication points, so its error is first order.)"""
    from scipy.integrate import solve_ivp

    table, time, motors = experiment.inputs, experiment.reference["time"], (*ANGLES, *RATES)
    outputs = outputs_of(experiment)
    with Fmu(fmu) as loaded:
        first = {name: float(table[name][0]) for name in motors}
        instance = loaded.instances(interface="model-exchange", start={**parameters, **first})

        def right_hand_side(t: float, state: Array) -> Array:
            instance.set_time(t)
            instance.set(motors, [float(np.interp(t, table["time"], table[name])) for name in motors])
            instance.set_continuous_states(state)
            derivatives: Array = instance.get_derivatives()[0]
            return derivatives

        # Interpolated inputs have a corner at every row, so no step of the solver may be longer than the distance
        # between two rows.
        step, start = experiment.step["CoSimulation"], instance.get_continuous_states()[0]
        solved = solve_ivp(right_hand_side, time[[0, -1]], start, t_eval=time, rtol=SOLVER_TOLERANCE, max_step=step)
        rows = []
        for t, state in zip(time, solved.y.T):
            right_hand_side(t, state)
            rows.append(instance.get(outputs)[0])
    return Result(fmu, time, dict(zip(outputs, np.array(rows).T)))


def by_fmu_run(fmu: Path, experiment: Experiment, parameters: Mapping[str, Value]) -> Result:
    """fmu_run, as `prw.simulate` uses it; it reads outputs with the inputs of the same instant."""
    step = experiment.step["CoSimulation"]
    time: Array = np.arange(round(experiment.stop_time / step) + 1, dtype=np.float64) * step
    table = experiment.inputs
    theta, omega = (
        np.column_stack([np.interp(time, table["time"], table[name]) for name in names]) for names in (ANGLES, RATES)
    )
    with Testbed(fmu) as testbed:
        found = testbed.respond(Motion(time, theta, omega), outputs_of(experiment), parameters)
    return Result(fmu, time, found)


IMPORTERS = (
    Tool("FMPy", "fmpy", "CoSimulation", by_fmpy),
    Tool("fmu_run", "fmu-run", "CoSimulation", by_fmu_run),
    Tool("SciPy's RK45 through fmu_run", "fmu-run", "ModelExchange", by_scipy),
)
