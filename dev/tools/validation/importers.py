"""Importers that run a reference experiment with the packed FMU."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from ctypes import c_double
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from prw.checking.experiments import Experiment, Value
from prw.checking.result import Result
from prw.columns import ANGLES, RATES
from prw.motion import Array, Motion
from prw.testbed import OUTPUTS, Testbed

#: Relative tolerance of the solver in Model Exchange.
SOLVER_TOLERANCE = 1e-7


@dataclass(frozen=True)
class Tool:
    """An importer or a co-simulation master. package: the Python package that contains it. interface: the type that it
    imports. run: of an importer run(fmu, experiment, parameters), with these parameters instead of the experiment's; of
    a master run(system)."""

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


def at_rest(description: Any, experiment: Experiment) -> dict[str, float]:
    """Start values of the motors, and of the states if they are settable."""
    first = {name: float(experiment.inputs[name][0]) for name in ANGLES}
    states = {f"theta{i}": first["theta1" if i % 2 else "theta2"] for i in (3, 4, 5, 6)}
    settable = {v.name for v in description.modelVariables if v.initial == "exact"}
    return {**first, **{name: value for name, value in states.items() if name in settable}}


def by_fmpy(fmu: Path, experiment: Experiment, parameters: Mapping[str, Value]) -> Result:
    """FMPy's simulate_fmu in Co-Simulation; it reads outputs before it sets the next inputs."""
    from fmpy import read_model_description, simulate_fmu

    step = experiment.step["CoSimulation"]
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
        start_values={**parameters, **at_rest(read_model_description(str(fmu)), experiment)},
        output=list(OUTPUTS),
    )
    return Result(fmu, np.asarray(rows["time"], dtype=np.float64), {name: np.asarray(rows[name]) for name in OUTPUTS})


def by_scipy(fmu: Path, experiment: Experiment, parameters: Mapping[str, Value]) -> Result:
    """Model Exchange through FMPy's calls, solved by SciPy, with inputs interpolated at every evaluation. (FMPy's
    own master holds inputs between communication points, and so is of first order in the inputs.)"""
    import fmpy
    from fmpy.simulation import apply_start_values, instantiate_fmu
    from scipy.integrate import solve_ivp

    description, directory = fmpy.read_model_description(str(fmu)), fmpy.extract(str(fmu))
    instance = instantiate_fmu(directory, description, fmi_type="ModelExchange")
    references = {v.name: v.valueReference for v in description.modelVariables}
    inputs, outputs = [references[name] for name in (*ANGLES, *RATES)], [references[name] for name in OUTPUTS]
    fmi2 = description.fmiVersion.startswith("2.")
    set_reals, get_reals = (instance.setReal, instance.getReal) if fmi2 else (instance.setFloat64, instance.getFloat64)
    derivatives_of = instance.getDerivatives if fmi2 else instance.getContinuousStateDerivatives
    x, dx = (c_double * 6)(), (c_double * 6)()

    def move_to(t: float) -> None:
        instance.setTime(t)
        table = experiment.inputs
        set_reals(inputs, [float(np.interp(t, table["time"], table[name])) for name in (*ANGLES, *RATES)])

    def right_hand_side(t: float, state: Array) -> list[float]:
        move_to(t)
        x[:] = state.tolist()
        instance.setContinuousStates(x, len(x))
        derivatives_of(dx, len(dx))
        return list(dx)

    try:
        if fmi2:
            instance.setupExperiment(startTime=0.0)
        apply_start_values(instance, description, {**parameters, **at_rest(description, experiment)})
        instance.enterInitializationMode()
        instance.exitInitializationMode()
        (instance.newDiscreteStates if fmi2 else instance.updateDiscreteStates)()
        instance.enterContinuousTimeMode()
        instance.getContinuousStates(x, len(x))
        time = experiment.reference["time"]
        # Interpolated inputs bend at every row.
        step = experiment.step["CoSimulation"]
        solved = solve_ivp(right_hand_side, time[[0, -1]], list(x), t_eval=time, rtol=SOLVER_TOLERANCE, max_step=step)
        rows = []
        for t, state in zip(time, solved.y.T):
            right_hand_side(t, state)
            rows.append(get_reals(outputs))
        instance.terminate()
    finally:
        instance.freeInstance()
        shutil.rmtree(directory, ignore_errors=True)
    return Result(fmu, time, dict(zip(OUTPUTS, np.array(rows).T)))


def by_fmu_run(fmu: Path, experiment: Experiment, parameters: Mapping[str, Value]) -> Result:
    """fmu_run, as `prw.simulate` uses it; it reads outputs with the inputs of the same instant."""
    step = experiment.step["CoSimulation"]
    time: Array = np.arange(round(experiment.stop_time / step) + 1, dtype=np.float64) * step
    table = experiment.inputs
    theta, omega = (
        np.column_stack([np.interp(time, table["time"], table[name]) for name in names]) for names in (ANGLES, RATES)
    )
    with Testbed(fmu) as testbed:
        found = testbed.respond(Motion(time, theta, omega), OUTPUTS, parameters)
    return Result(fmu, time, found)


IMPORTERS = (
    Tool("FMPy", "fmpy", "CoSimulation", by_fmpy),
    Tool("fmu_run", "fmu-run", "CoSimulation", by_fmu_run),
    Tool("SciPy's RK45 through FMPy's calls", "fmpy", "ModelExchange", by_scipy),
)
