"""Variables and functions that FMUs and systems of FMUs have in common."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import TracebackType
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fmu_run._native import Instances, Loaded, numbers
from fmu_run.arguments import Interface, Log, Measure, Solver, Start, Trajectory
from fmu_run.runs import Interrupted, Runs
from fmu_run.sensitivities import LARGEST, Sensitivities, differentiate

_Array = NDArray[np.float64]
#: In the description of an input: the interface type in which it has an effect only while a Boolean variable is true, and that variable.
_CONDITION = re.compile(r"used (?:in (Co-Simulation|Model Exchange) )?only if (\w+) is true")


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of the model description.

    Attributes
    ----------
    name
        Name in the FMU or the system.
    type
        Real, Integer, Boolean, String, Enumeration, or one of FMI 3.0's other types.
    causality
        input, output, parameter, local and so on.
    variability
        fixed, tunable, discrete, continuous and so on; None if not declared.
    start
        Start value as a string, as it is written in the model description; None if not declared. In a system from an SSP file, the
        value that the file gives, if it gives one.
    unit
        Unit of the variable or of its declared type; None if not declared.
    description
        Description; empty if not declared.
    min, max
        Smallest and largest value, in `unit`, of the variable or of its declared type; None if not declared.
    display_unit
        Display unit of the variable or of its declared type; None if not declared.
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


class Model:
    """Functions that FMUs and systems of FMUs have in common."""

    def __init__(self, loaded: Loaded):
        self._loaded = loaded
        self._variables = loaded.variables()
        #: Interface types.
        self._interfaces: Collection[str] = ("co-simulation",)
        #: Inputs about which `run` has warned.
        self._warned = set[str]()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @cached_property
    def variables(self) -> dict[str, Variable]:
        """The variables by name, in the order of the model description. As in FMI 2.0, each element of an array of FMI 3.0 is a
        variable: T[3]. Clocks and variables that have clocks are omitted. The first access takes about 2 s for a million elements."""
        return self._variables.dict(Variable)

    def close(self) -> None:
        """Unload the FMUs and remove the unpacked files as soon as all instances are freed. Further calls have no effect."""
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
        reuse: bool = False,
        clocks: Mapping[str, ArrayLike] | None = None,
        hold: bool = False,
    ) -> Runs:
        """Run the FMU once, or several times if an argument has a separate value for each run.

        If the FMU rejects a call or ends a run early, all other runs continue. `Runs.errors` contains the errors, and `Runs.check`
        raises the first one. A run that fails without a message is repeated with logging on after all other runs, only to get the
        message. After Ctrl-C, each run completes its current step and stops; the finished runs are in the exception, see below.

        Parameters
        ----------
        time
            (times,): the communication points, s. At each of them the inputs are set, the outputs are read, and a step to the next one
            is performed.
        outputs
            Names of the variables to read, of any type except Clock. The name of an array stands for all of its elements, and its results
            are (runs, times, ...), where the dimensions of the array come last. In FMI 2.0, y[1], y[2] and so on are the array y.
        inputs
            Values of inputs by name: one number, (times,) for all runs, or (runs, times) for each run. Values may have a unit,
            {"theta1": (angles, "deg")}. Inputs that are not named keep their start values.

            An input may have its own times: {"u": (times, values)}, where the values have the shape (times,) or (runs, times). Between
            these times, a continuous variable is interpolated linearly, and any other keeps the earlier value. Two equal times make a
            jump. Before the first and after the last time, the value is constant.

            Strings and bytes are given in the same shapes. For a whole array, the dimensions of the array follow the dimensions above;
            a constant array has only its own dimensions. In Model Exchange, an input can be the derivative of another input,
            {"omega1": "der(theta1)"}.
        input_derivatives
            First time derivatives of inputs by name, in the same shapes. In Co-Simulation, they are for FMUs of FMI 2.0 that can
            interpolate inputs. In Model Exchange, they are for any continuous input, which is then interpolated by cubics instead of lines.
        start
            Start values of parameters, states and so on by name: one value for all runs, or (runs,) for each run. Values are numbers,
            strings, bytes, enumeration items, or numbers with a unit, {"k1": (1.9, "N.m/deg")}. A whole array has its own shape for all
            runs, {"A": np.eye(3)}, or (runs, ...). A structural parameter, which determines the sizes of arrays, has one value for all
            runs.
        every
            Store the outputs only at every `every`-th time, beginning with the first. Default: they are stored at all times, or at none
            if there are measures.
        measures
            Statistics of each numeric output over all times: min, max, peak (the largest magnitude), time_of_peak (s), mean and rms (of
            the samples), and end (the last value). If a value is NaN, all of them except end are NaN.
        threads
            Number of threads. Default: one for each processor, or one if the FMU allows only one instance per process.
        read_before_set
            Read the outputs of a time before its inputs are set, as FMPy does.
        progress
            Function that is called ten times per second with the number of finished runs and the number of all runs.
        tolerance
            Relative tolerance of a solver inside the FMU; also the default of rtol. Default: the tolerance of the default experiment in
            the model description, as in FMPy. With None, the FMU chooses.
        log
            Receiver of the FMU's messages: a function that is called with the index of the run, the status, the category and the
            message, or a `logging.Logger`. With a receiver, the FMU's logging is switched on. The index is None if the run is unknown,
            because the FMU logs from a thread of its own and passes an unknown environment pointer to the logger.
        interface
            "co-simulation" or "model-exchange". Default: Co-Simulation, or Model Exchange if the FMU has only that. In Model Exchange,
            fmu_run integrates the states from event to event. Continuous inputs are interpolated linearly between their values, even
            between two communication points, so that results converge as the tolerance of the solver decreases. All other inputs change
            in Event Mode. Systems only run in Co-Simulation.
        solver
            Method in Model Exchange: "dop853" or "dopri5" (Runge-Kutta of order 8 or 5), "bdf" (for stiff models), "auto" (dop853, and
            bdf as soon as the model proves stiff), or "rk4" (Runge-Kutta of order 4 with one step between two communication points, or
            several equal steps if `max_step` is shorter).
        rtol, atol
            Relative and absolute tolerance of the solver in Model Exchange. Default of rtol: `tolerance`, or 1e-6 if there is none.
            Default of atol: a hundredth of rtol. For each state, atol is multiplied by the nominal value.
        max_step
            Largest step of the solver, s. Event indicators are evaluated at the ends of steps and at communication points. Choose
            `max_step` so that no indicator changes its sign twice between two such times, because these events are not detected.
        events
            Store the outputs before and after each event in `Runs.events`: in Model Exchange, and in Co-Simulation if the FMU has event mode
            (FMI 3.0). Steps of Co-Simulation then end at events.
        reuse
            Let a run reset the instance of an earlier run, even of an earlier call, instead of creating one. This saves time if the FMU
            takes long to create an instance. Use it only if the reset of the FMU is complete, because otherwise something of one run
            affects the next; `fmu-check` tests that. It has no effect with `log`, so that the messages of each run are complete, and in runs
            with clocks or with events in Co-Simulation.
        clocks
            Times of the ticks of triggered input clocks by name, s: {"pressed": [0.2, 0.7]}. All other input clocks tick at the times
            that follow from their intervals. A clocked input has the value at the time of the tick.
        hold
            Whether an output that has a clock keeps the value of the last tick until the next one. Otherwise it is NaN at communication
            points at which its clock does not tick. Before the first tick, it is always NaN.

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
        Interrupted
            After Ctrl-C: a KeyboardInterrupt whose attribute `runs` contains the finished runs.

        Warns
        -----
        UserWarning
            Once for each input that has no effect, because its description is like "used only if use_omega is true", and that variable is
            false in all runs.

        Examples
        --------
        >>> runs = fmu.run(np.arange(0, 1, 1e-3), outputs=["y"], start={"k": [1.0, 2.0]})
        >>> runs["y"].shape
        (2, 1000)
        """
        found = self._loaded.run(
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
            reuse,
            clocks,
            hold,
        )
        # An FMU lists its interface types, and is integrated if it has only Model Exchange. Systems run in Co-Simulation.
        default: Interface = "co-simulation" if "co-simulation" in self._interfaces else "model-exchange"
        self._warn_of_unused(_items("inputs", inputs), _items("start", start), interface or default)
        runs, raised = Runs(*found[:-1]), found[-1]
        if isinstance(raised, KeyboardInterrupt):
            raise Interrupted(runs) from None
        if raised is not None:
            raise raised
        return runs

    def _warn_of_unused(self, inputs: Mapping[str, Any], start: Mapping[str, Any], interface: Interface) -> None:
        for name in inputs:
            variable = self.variables.get(name)
            if variable is None or name in self._warned or not (found := _CONDITION.search(variable.description)):
                continue
            # In a system, names begin with the name of the component.
            condition = name[: -len(name.rpartition(".")[2])] + found[2]
            if condition not in self.variables or (found[1] or interface)[0].lower() != interface[0]:
                continue
            value = start.get(condition, self.variables[condition].start)
            # Without a start value, it is unknown; as an input, it may become true.
            if value is None or condition in inputs:
                continue
            if not np.isin(np.asarray(value).astype(str), ("true", "True", "1", "1.0")).any():
                self._warned.add(name)
                why = f"{name} has no effect, because {condition} is false; add {condition!r}: True to start"
                warnings.warn(why, UserWarning, stacklevel=3)

    def sensitivities(
        self,
        time: ArrayLike,
        *,
        outputs: str | Sequence[str],
        parameters: str | Sequence[str],
        start: Mapping[str, Start] | None = None,
        steps: Mapping[str, float] = {},
        **others: Any,
    ) -> Sensitivities:
        """Differentiate trajectories with respect to parameters, by central differences in one batch of 12 runs for each parameter.

        `Instances.directional_derivative` is the derivative at one instant, at which the states do not depend on the parameters. Here they
        do, because all values at and before this instant depend on them.

        Parameters
        ----------
        time, outputs
            As in `run`; outputs must be numeric.
        parameters
            Names of parameters, or of other variables with a floating-point start value.
        start
            Start values as in `run`, but the same for all runs. The derivatives are at these values.
        steps
            The largest step of a parameter by name, in the unit of the FMU. Default: an eighth of its value. Five smaller steps are tried,
            the smallest of which is 1/1024 of the largest.
        others
            Further arguments of `run`, such as `inputs`, `every` and `threads`. Inputs, like start values, are the same for all runs.

        Returns
        -------
        Sensitivities
            The derivatives and their estimated errors. If the FMU has a solver, its tolerance determines how large the errors are.

        Raises
        ------
        ValueError
            For invalid arguments, such as a parameter that is 0 and has no step, or if the FMU rejects the steps of a parameter.
        FmuError
            As in `run`.

        Examples
        --------
        >>> found = fmu.sensitivities(time, outputs=["y"], parameters=["k"])
        >>> found["y", "k"], found.errors["y", "k"]
        """
        names = [parameters] if isinstance(parameters, str) else list(dict.fromkeys(parameters))
        outputs = [outputs] if isinstance(outputs, str) else list(outputs)
        given, values, largest = _items("start", start), dict[str, float](), dict[str, float]()
        if "measures" in others:
            raise ValueError("measures are not differentiated; calculate them from the trajectories")
        if unknown := [name for name in steps if name not in names]:
            raise ValueError(f"steps: {unknown[0]!r} is not among the parameters {', '.join(names)}")
        self._check_one_run("start", {name: value for name, value in given.items() if name not in names})
        for argument in ("inputs", "input_derivatives"):
            self._check_one_run(argument, _items(argument, others.get(argument)))
        for name in names:
            if name not in self.variables:
                raise ValueError(f"parameters: the FMU has no variable {name!r}")
            value = given.pop(name, self.variables[name].start)
            if value is None:
                raise ValueError(f"{name} has no start value; give one, as in start={{{name!r}: 1.0}}")
            if isinstance(value, tuple) and len(value) == 2 and isinstance(value[1], str):
                value = self.converted(name, *value)
            try:
                array = numbers(name, float(value) if isinstance(value, str) else value)
            except ValueError as error:
                if isinstance(value, str):
                    why = f"the start value of {name} in the FMU is {value!r}, not a number; give one in start"
                    raise ValueError(why) from error
                raise
            if array.ndim != 0:
                raise ValueError(f"start: {name} has the shape {array.shape}; sensitivities need one value")
            values[name] = float(array)
            step = numbers(f"steps: {name}", steps.get(name, LARGEST * abs(values[name])))
            if step.ndim or not np.isfinite(step) or not step > 0:
                raise ValueError(f"{name} is {values[name]:g}; give its largest step, as in steps={{{name!r}: 0.1}}")
            largest[name] = float(step)
        if not names:
            raise ValueError("parameters: name at least one")
        return differentiate(
            lambda varied: self.run(time, outputs=outputs, start={**given, **varied}, **others),
            outputs,
            values,
            largest,
        )

    def _check_one_run(self, argument: str, given: Mapping[str, Any]) -> None:
        """Raise ValueError for a value that differs from run to run, because the runs differ in the parameters only."""
        for name, value in given.items():
            is_tuple = isinstance(value, tuple) and len(value) in (2, 3)
            if is_tuple and isinstance(value[-1], str):  # (values, unit), or (times, values, unit)
                value = value[-2]
            elif is_tuple and argument != "start" and np.ndim(value[0]) and np.ndim(value[1]):  # (times, values)
                value = value[1]
            element = next((other for other in self.variables if other.startswith(f"{name}[")), None)
            own = 0 if name in self.variables or element is None else element[len(name) :].count(",") + 1
            if np.ndim(value) > own + (argument != "start"):
                raise ValueError(
                    f"{argument}: {name} has the shape {np.shape(value)}; sensitivities need the same for all runs"
                )

    def converted(self, name: str, values: ArrayLike, unit: str) -> float | _Array:
        """Convert values to the unit of a variable.

        Parameters
        ----------
        name
            Name of the variable.
        values
            Numbers in `unit`.
        unit
            A display unit of the variable.

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
        array: _Array = numbers("values", values)
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
            The interface type. New instances for Model Exchange have handled the initial event and are in Continuous-Time Mode.
        start
            Start values of parameters, states, inputs and so on by name, as in `run`: one for all instances, or (count,) for each.
        start_time
            Start time, s.
        stop_time
            Stop time, s; None if it is unknown.
        threads
            Number of threads; None means one for each processor. Several threads are faster if a call takes much longer than waking a
            thread, which takes about 0.01 ms: with hundreds of instances, or for slow models. After a call, the threads poll for work for
            0.05 ms before they sleep.
        tolerance, log
            As in `run`. The index of a message is the index of the instance, and messages are passed on at the end of each call.

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
            If the FMU does not have this interface type, or if all instances fail.
        """
        return Instances(self._loaded, count, interface, start, start_time, stop_time, threads, tolerance, log)


def _items(argument: str, given: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return a mapping as a dict. Objects of pandas, such as a DataFrame with a column for each input, are accepted, too."""
    try:
        return {} if given is None else dict(given.items())
    except (AttributeError, TypeError, ValueError):
        raise ValueError(f"{argument} must be a dict of values by name, it is {given!r}") from None
