"""Runs FMUs fast: batches of one to millions of runs, and one or thousands of stateful instances::

    with fmu_run.Fmu("model.fmu") as fmu:
        runs = fmu.run(time, inputs={"u": u}, start={"k": k_of_each_run}, outputs=["y"])
    runs["y"]  # (runs, times)

    model = fmu.instances(start={"k": 2.0})
    model.set("u", 1.0)
    model.step(1e-3)
    model.get("y")  # (instances,)

    loop = fmu_run.System({"law": law, "plant": fmu}, {"law.u": "plant.u", "plant.y": "law.y"})
    loop.run(time, start={"law.gain": gains}, outputs=["plant.y"])

Values are in the FMU's units, which `Fmu.variables` lists. Both FMI 2.0 and FMI 3.0 are supported.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fmu_run._native import FmuError, Instances, States
from fmu_run._native import Loaded as _Loaded
from fmu_run._native import numbers as _numbers
from fmu_run.runs import Event, Runs

__all__ = ["Event", "Fmu", "FmuError", "Instances", "Log", "Measure", "Runs", "Start", "States", "System", "Variable"]

Measure = Literal["min", "max", "peak", "time_of_peak", "mean", "rms", "end"]
#: Interface type of FMI; both spellings are the same.
Interface = Literal["co-simulation", "model-exchange", "co_simulation", "model_exchange"]
Solver = Literal["auto", "dopri5", "dop853", "bdf", "rk4"]
_Array = NDArray[np.float64]

#: A start value: one for all runs or instances, or one for each. A string is the value of a String variable, or the name of an item of an
#: enumeration. A pair of a number or an array and a unit is converted from that unit, which must be a display unit of the variable.
Start = ArrayLike | str | Sequence[str] | tuple[ArrayLike, str]
#: Values of an input at the communication points, with a unit or without, as for `Start`; or at other times: (times, values) or
#: (times, values, unit).
Trajectory = ArrayLike | tuple[ArrayLike, str] | tuple[ArrayLike, ArrayLike] | tuple[ArrayLike, ArrayLike, str]
#: Receiver of messages of the FMU: a logger, or a function that is called with the index of the run or instance, the status, the
#: category and the message.
Log = Callable[[int | None, str, str, str], Any] | logging.Logger


@dataclass(frozen=True)
class Variable:
    """A variable of the model description.

    Attributes
    ----------
    name, description
        As in the model description.
    type
        Real, Integer, Boolean, String, Enumeration, or one of FMI 3.0's other types.
    causality
        input, output, parameter, local and so on.
    variability, start, unit, min, max, display_unit
        None if not declared. `start` is a string. `unit`, `min`, `max` and `display_unit` may come from the declared type.
    """

    name: str
    type: str
    causality: str
    variability: str | None
    start: str | None
    unit: str | None
    description: str
    min: float | None
    max: float | None
    display_unit: str | None


class _Model:
    """Base class of FMUs and systems of FMUs."""

    def __init__(self, loaded: _Loaded):
        self._loaded = loaded
        #: dict[str, Variable]: the variables by name, in the order of the model description. Each element
        #: of an array of FMI 3.0 is a variable, as in FMI 2.0: T[3]. Clocks are omitted.
        self.variables = {fields[0]: Variable(*fields) for fields in loaded.variables()}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Unload the FMUs and remove the unpacked files, after all instances are freed. Further calls have no effect."""
        self._loaded.close()

    def run(
        self,
        time: ArrayLike,
        *,
        outputs: Sequence[str],
        inputs: Mapping[str, Trajectory] | None = None,
        input_derivatives: Mapping[str, ArrayLike] | None = None,
        start: Mapping[str, Start] | None = None,
        every: int | None = None,
        measures: Sequence[Measure] = (),
        threads: int | None = None,
        read_before_set: bool = False,
        progress: Callable[[int, int], Any] | None = None,
        tolerance: float | Literal["default"] | None = "default",
        log: Log | None = None,
        interface: Interface | None = None,
        solver: Solver = "auto",
        rtol: float | None = None,
        atol: float | None = None,
        max_step: float | None = None,
        events: bool = False,
    ) -> Runs:
        """Run the FMU once, or as many times as an argument has values for separate runs.

        If the FMU rejects a call or ends a run early, the other runs continue; `Runs.errors` has the errors, and
        `Runs.check` raises them. A run that fails without a message is repeated with logging on, after all others, only to
        get the message. After Ctrl-C, each run completes its current step and stops.

        Parameters
        ----------
        time
            (times,), the communication points, s. At each of them the inputs are set, the outputs are read, and a step to
            the next one is made.
        outputs
            The variables to read, of any type except Clock. The name of an array means all of its elements: (runs, times, ...) in the
            results, with the dimensions of the array last. In FMI 2.0, y[1], y[2] and so on are the array y.
        inputs
            By name: (times,) for all runs, (runs, times) for each run, or a constant number; with a unit or without,
            {"theta1": (angles, "deg")}. Inputs that are not named keep their start values. An input with its own times is
            {"u": (times, values)}, values of the shape (times,) or (runs, times): between its times, a continuous variable follows the
            line, and any other keeps the earlier value; two equal times are a step; before the first and after the last time the
            value is constant. Strings and bytes are given in the same shapes. For a whole array, the
            dimensions of the array follow these; the shape of a constant array is only its dimensions.
            In Model Exchange, "der(u)" is the derivative of the input u.
        input_derivatives
            d/dt of inputs, in the same shapes: in Co-Simulation for FMUs of FMI 2.0 that can interpolate inputs, in Model Exchange for
            any continuous input, which then follows a cubic between its times instead of a line.
        start
            Start values of parameters, states and so on by name: one for all runs or (runs,) for each run; numbers,
            strings, bytes, enumeration items, or numbers with a unit, {"k1": (1.9, "N.m/deg")}. A whole array has its own shape for all
            runs, {"A": np.eye(3)}, or (runs, ...). A structural parameter has one
            value for all runs, and determines the sizes of arrays.
        every
            Store the outputs only at every `every`-th time, beginning with the first. Default: at all times, or at none if
            there are measures.
        measures
            Statistics of each output over all times: min, max, peak (of the magnitude), time_of_peak, mean and rms (of
            the samples), end. If a value is NaN, all of them except end, the last value, are NaN.
        threads
            Number of threads. Default: one for each processor, or one if the FMU allows only one instance per process.
        read_before_set
            Read outputs before the inputs of their time are set, as FMPy does.
        progress
            Called with the numbers of finished runs and of all runs, ten times per second.
        tolerance
            Relative tolerance for a solver inside the FMU, and the default of rtol. Default: the tolerance of the default experiment
            in the model description, as in FMPy. With None, the FMU chooses.
        log
            Receives the messages of the FMU, whose logging is then switched on: a function that is called with the index of the
            run, status, category and message, or a `logging.Logger`. The index is None if the message cannot be
            attributed to a run, because the FMU logs from another thread with an unknown environment.
        interface
            "co-simulation" or "model-exchange". Default: Co-Simulation, or Model Exchange if that is the only one. In Model
            Exchange fmu_run integrates the states, from event to event. Continuous inputs are interpolated linearly between two values,
            also between two communication points, so that results converge as the tolerance of the solver decreases.
            All other inputs change in Event Mode. Systems run in Co-Simulation only.
        solver
            In Model Exchange: "dop853" and "dopri5" (Runge-Kutta of order 8 and 5), "bdf" (for stiff models), "auto" (dop853, and bdf
            once the model proves stiff), or "rk4": one fixed step between two communication points, or several equal steps if
            `max_step` is shorter.
        rtol, atol
            Tolerances of the solver, in Model Exchange. Default of rtol: `tolerance`, or 1e-6 if there is none; of atol: a hundredth of
            rtol. atol is multiplied by the nominal value of each state.
        max_step
            The largest step of the solver, s. Choose it so that no event indicator changes its sign twice within one step and
            between the same two communication points, because such a pair of events is not detected.
        events
            Keep the outputs before and after each event, in `Runs.events`.

        Returns
        -------
        Runs
            The results, with the errors of failed runs.

        Raises
        ------
        ValueError
            For invalid arguments.
        FmuError
            If the FMU is closed.

        Examples
        --------
        >>> runs = fmu.run(np.arange(0, 1, 1e-3), outputs=["y"], start={"k": [1.0, 2.0]})
        >>> runs["y"].shape
        (2, 1000)
        """
        return Runs(
            *self._loaded.run(
                time,
                outputs,
                inputs,
                input_derivatives,
                start,
                every,
                measures,
                threads,
                read_before_set,
                progress,
                tolerance,
                log,
                interface,
                solver,
                (rtol, atol, max_step),
                events,
            )
        )

    def converted(self, name: str, values: ArrayLike, unit: str) -> float | _Array:
        """Convert values to the unit of a variable.

        Parameters
        ----------
        name
            The variable.
        values
            Numbers in `unit`.
        unit
            One of the FMU's display units.

        Returns
        -------
        float or array
            The numbers in the variable's unit, in the shape of `values`.

        Raises
        ------
        ValueError
            If the FMU does not have the variable, or the variable does not have the unit.
        """
        factor, offset = self._loaded.display_unit(name, unit)
        array: _Array = _numbers("values", values)
        found = (array - offset) / factor
        return float(found) if found.ndim == 0 else found

    def instances(
        self,
        count: int = 1,
        *,
        interface: Interface = "co-simulation",
        start: Mapping[str, Start] | None = None,
        start_time: float = 0.0,
        stop_time: float | None = None,
        threads: int | None = 1,
        tolerance: float | Literal["default"] | None = "default",
        log: Log | None = None,
    ) -> Instances:
        """Create instances, set their start values and initialize them.

        Parameters
        ----------
        count
            Number of instances.
        interface
            The interface type. Instances for Model Exchange have handled the initial events and are in Continuous-Time Mode.
        start
            Start values of parameters, states, inputs and so on by name: one for all or (count,) for each instance, as in `run`.
        start_time, stop_time
            Start time, s, and stop time, if it is known.
        threads
            More than one is faster if a call takes much longer than waking a thread, about 0.01 ms: with hundreds of instances,
            or for slow models. The threads look for work for 0.05 ms after a call before they sleep. With None, there is one
            for each processor.
        tolerance, log
            As in `run`, but the index of a message is the index of the instance. Messages are passed on at the end of a call.

        Returns
        -------
        Instances
            The initialized instances.

        Raises
        ------
        ValueError
            For invalid arguments.
        MemoryError
            If memory does not suffice for the instances.
        FmuError
            If the FMU has no such interface type, or rejects all instances.
        """
        return Instances(self._loaded, count, interface, start, start_time, stop_time, threads, tolerance, log)


class Fmu(_Model):
    """An FMU, unpacked and loaded once. A context manager: leaving it unloads the FMU after all instances are freed.

    The library of the FMU runs in this process: a crash ends the process.

    Parameters
    ----------
    path
        The file.
    execution_tool
        Run the FMU also if its library starts another program (needsExecutionTool), which must be installed.

    Raises
    ------
    FmuError
        If the file is not an FMU, or has no library for this platform.
    """

    def __init__(self, path: str | os.PathLike[str], *, execution_tool: bool = False):
        super().__init__(_Loaded(path, execution_tool))
        #: "2.0" or "3.0"; the name of the model; the guid (FMI 2.0) or the instantiation token (FMI 3.0).
        self.fmi_version, self.model_name, self.token, derivatives, outputs, directional, units = self._loaded.about()
        #: Name of the derivative of each continuous state, by the name of the state; names of the continuous outputs. Both are in the
        #: order of the model structure.
        self.derivatives, self.outputs = dict(derivatives), tuple(outputs)
        #: By interface type, whether the FMU has directional derivatives.
        self.directional = dict(directional)
        #: By unit, the attributes of its base unit: exponents, factor and offset, as strings.
        self.units = {name: dict(attributes) for name, attributes in units.items()}

    def __repr__(self) -> str:
        closed = ", closed" if self._loaded.is_closed() else ""
        return f"<Fmu {self.model_name}, FMI {self.fmi_version}, {len(self.variables)} variables{closed}>"


class System(_Model):
    """Connected FMUs that run as one FMU.

    Variables are named `component.variable`; connectors of an SSP's system keep their names. During a communication step,
    all components keep the input values from the start of the step.

    Parameters
    ----------
    source
        An SSP file, or the components by name: FMUs of FMI 2.0 or 3.0 with Co-Simulation, either open `Fmu` objects or paths.
        An FMU may occur more than once.
    connections
        The input that each output is connected to, `{"law.u": "plant.u"}` or as pairs; a list if there are several inputs. Not
        allowed with an SSP file, which defines its connections.
    order
        The order of data exchange. "dependencies": at each communication point every output is read after the inputs on which it
        depends directly; for an algebraic loop, ValueError names the loop. "jacobi": all
        outputs are read at the end of a step and all inputs set at the start of the next, as in FMPy and libcosim; outputs that
        depend directly on inputs lag one step.

    Raises
    ------
    ValueError
        For invalid connections.
    FmuError
        If the file is not an SSP or one of its FMUs cannot be loaded.
    """

    def __init__(
        self,
        source: str | os.PathLike[str] | Mapping[str, Fmu | str | os.PathLike[str]],
        connections: Mapping[str, str | Sequence[str]] | Iterable[tuple[str, str | Sequence[str]]] | None = None,
        *,
        order: Literal["dependencies", "jacobi"] = "dependencies",
    ):
        if isinstance(source, Mapping):
            fmus = [(name, _component(name, fmu)._loaded) for name, fmu in source.items()]
            super().__init__(_Loaded.connected("system", fmus, _pairs(connections), order))
        elif not isinstance(source, str | os.PathLike):
            raise ValueError(f"source must be the path of an SSP or a dict of FMUs by name, it is {source!r}")
        elif connections is not None:
            raise ValueError("an SSP has its own connections; give connections with FMUs only")
        else:
            super().__init__(_Loaded.ssp(source, order))
        #: Name of the system; order of data exchange, in stages of (output, input); stop time of the SSP's experiment, s, or None.
        self.name, self.stages, self.stop_time = self._loaded.about_system()

    def __repr__(self) -> str:
        connections = sum(map(len, self.stages))
        return f"<System {self.name}, {connections} connections, {len(self.variables)} variables>"


def _component(name: str, fmu: Fmu | str | os.PathLike[str]) -> Fmu:
    if not isinstance(name, str):
        raise ValueError(f"the names in source must be str, one is {name!r}")
    if not isinstance(fmu, Fmu | str | os.PathLike):
        raise ValueError(f"source: {name} must be an Fmu or a path, it is {fmu!r}")
    return fmu if isinstance(fmu, Fmu) else Fmu(fmu)


def _pairs(
    connections: Mapping[str, str | Sequence[str]] | Iterable[tuple[str, str | Sequence[str]]] | None,
) -> list[tuple[str, str]]:
    """Returns the connections as pairs of one output and one input."""
    try:
        given = connections.items() if isinstance(connections, Mapping) else () if connections is None else connections
        found = [(output, to) for output, ends in given for to in ([ends] if isinstance(ends, str) else ends)]
    except (TypeError, ValueError):
        found = [("", None)]  # Causes the error below.
    for output, to in found:
        if not isinstance(output, str) or not isinstance(to, str):
            raise ValueError(
                f"connections must be a dict of outputs and their inputs, both str, or pairs of them, they are {connections!r}"
            )
    return found
