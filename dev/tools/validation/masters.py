"""Third-party co-simulation masters that run the closed loop: FMPy's SSP support, libcosim, Ecos, sofirpy.

All couple by Jacobi's method: during a step, every FMU gets the outputs that the others had at the beginning of
the step. So with the same step size, their results must agree within rounding error, except for the torques of Ecos
and sofirpy, which read them later. Each master runs in a separate process, because libraries in C++ start loggers and thread pools,
and may crash.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from prw.errors import UserError
from tools.validation.importers import Tool
from tools.validation.system import System, read

#: The recorded variables, as `component.variable`.
RECORDED = (
    *(f"controller.{name}" for name in ("theta1", "theta2", "omega1", "omega2")),
    *(f"testbed.{name}" for name in ("pitch", "roll", "tau1", "tau2")),
)
TIMEOUT = 300.0
#: The directory of the package tools.
ABOVE = Path(__file__).resolve().parents[2]


def fmpy_ssp(system: System) -> np.ndarray:
    """FMPy's simulate_ssp. It ignores the start values in the SSP, and sets the inputs of the system only after the first
    step. Results lag one step, so the first row is dropped."""
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import Parameter, ParameterSet

    start = ParameterSet(parameters=[Parameter(name=name, value=value) for name, value in system.start.items()])
    inputs = {name: (lambda _time, value=value: value) for name, (_, value) in system.inputs.items()}
    stop_time = (system.steps + 0.5) * system.step
    rows = simulate_ssp(str(system.ssp), stop_time=stop_time, step_size=system.step, parameter_set=start, input=inputs)
    return np.column_stack([rows[name] for name in RECORDED])[1:]


def libcosim(system: System) -> np.ndarray:
    """libcosim, from OspSystemStructure.xml only."""
    from fmpy import read_model_description
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.WARNING)
    execution = CosimExecution.from_osp_config_file(str(system.osp))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    wanted = []
    for component, fmu in system.fmus.items():
        variables = read_model_description(str(system.osp / fmu)).modelVariables
        references = {variable.name: variable.valueReference for variable in variables}
        names = [name.partition(".")[2] for name in RECORDED if name.partition(".")[0] == component]
        index = execution.slave_index_from_instance_name(component)
        wanted.append((index, [references[name] for name in names]))
    rows = np.empty((system.steps, len(RECORDED)))
    for row in rows:
        if not execution.step():
            raise RuntimeError("libcosim stopped")
        row[:] = np.concatenate([observer.last_real_values(*slave) for slave in wanted])
    return rows


def ecos(system: System) -> np.ndarray:
    """Ecos, connected by calls, because its SSP import rejects connectors of the system ("No element named").

    Ecos returns outputs after the inputs of the next step have been set. Torques depend on these inputs directly, so they differ
    from the other masters' by the jump of an input at a communication point. Signals that are fed back do not differ.
    """
    # Ecos does not find its dependency, which the wheel `tbb` installs into `lib` of the environment.
    ctypes.CDLL(str(Path(sys.prefix, "lib", "libtbb.so.12")), mode=ctypes.RTLD_GLOBAL)
    from ecospy import EcosSimulation, EcosSimulationStructure

    def there(name: str) -> str:
        return name.replace(".", "::")

    values = {**system.start, **dict(system.inputs.values())}
    with EcosSimulationStructure() as structure:
        for component, fmu in system.fmus.items():
            structure.add_model(component, str(system.osp / fmu))
        for start, end in system.connections:
            structure.make_real_connection(there(start), there(end))
        structure.add_parameter_set("default", {there(name): value for name, value in values.items()})
        with EcosSimulation(structure=structure, step_size=system.step) as simulation:
            simulation.init(parameter_set="default")
            rows = np.empty((system.steps, len(RECORDED)))
            for row in rows:
                simulation.step()
                row[:] = [simulation.get_real(there(name)) for name in RECORDED]
    return rows


def sofirpy(system: System) -> np.ndarray:
    """sofirpy, connected by a table, because it does not read SSPs. Like Ecos, it records torques after it has set the next inputs."""
    warnings.filterwarnings("ignore", "pkg_resources is deprecated")  # by a part of sofirpy that saves runs
    from sofirpy import simulate

    connections: dict[str, Any] = {component: [] for component in system.fmus}
    values: dict[str, Any] = {component: {} for component in system.fmus}
    recorded: dict[str, list[str]] = {component: [] for component in system.fmus}
    for start, end in system.connections:
        (source, output), (target, name) = start.split("."), end.split(".")
        connections[target].append(
            {"parameter_name": name, "connect_to_system": source, "connect_to_external_parameter": output}
        )
    for variable, value in {**system.start, **dict(system.inputs.values())}.items():
        component, name = variable.split(".")
        values[component][name] = value
    for variable in RECORDED:
        component, name = variable.split(".")
        recorded[component].append(name)
    rows = simulate(
        stop_time=(system.steps + 0.5) * system.step,  # half a step more, in case that the last end is rounded up
        step_size=system.step,
        fmu_paths={component: system.osp / fmu for component, fmu in system.fmus.items()},
        connections_config=connections,
        start_values=values,
        parameters_to_log=recorded,
    )
    return np.array(rows[list(RECORDED)])[1:]


MASTERS = (
    Tool("FMPy", "fmpy", "CoSimulation", fmpy_ssp),
    Tool("libcosim", "libcosimpy", "CoSimulation", libcosim),
    Tool("Ecos", "ecospy", "CoSimulation", ecos),
    Tool("sofirpy", "sofirpy", "CoSimulation", sofirpy),
)


def run_separately(master: Tool, system: System) -> dict[str, np.ndarray]:
    """Run the system under the master in a separate process.

    Returns `time` and RECORDED by name, each (steps,): the values at the end of every step. Raises UserError with a
    line of its output if the process fails, or if it logs a warning or an error.
    """
    with tempfile.TemporaryDirectory() as directory:
        result = Path(directory, "result.npy")
        command = [sys.executable, "-m", __name__, master.name, *map(os.path.abspath, (system.ssp, system.osp, result))]
        try:
            process = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, cwd=ABOVE)
        except subprocess.TimeoutExpired:
            raise UserError(f"{master.name} did not finish within {TIMEOUT:g} s") from None
        output = [line for line in (process.stdout + process.stderr).splitlines() if line.strip()]
        if process.returncode:
            raise UserError(f"{master.name} failed: {output[-1] if output else f'status {process.returncode}'}")
        complaints = [line for line in output if any(word in line.lower() for word in ("error", "warn", "fatal"))]
        if complaints:
            raise UserError(f"{master.name} complains: {complaints[0]}")
        rows = np.load(result)
    time = system.step * np.arange(1, system.steps + 1)
    return {"time": time, **dict(zip(RECORDED, np.ascontiguousarray(rows.T)))}


if __name__ == "__main__":
    _name, _ssp, _osp, _result = sys.argv[1:]
    _simulate = next(master.run for master in MASTERS if master.name == _name)
    np.save(_result, _simulate(read(Path(_ssp), Path(_osp))))
