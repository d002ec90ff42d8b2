"""Runs FMUs at their own speed: one run or a million, one instance in the hand or thousands.

    with fmu_run.Fmu("model.fmu") as fmu:
        runs = fmu.run(time, inputs={"u": u}, start={"k": k_of_each_run}, outputs=["y"])
    runs["y"]  # (runs, times)

    model = fmu.instances(start={"k": 2.0})
    model.set("u", 1.0)
    model.step(1e-3)
    model.get("y")  # (instances,)

Values are in the FMU's units, which `Fmu.variables` tells. FMI 2.0 and 3.0.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fmu_run._native import Fmu as _Loaded
from fmu_run._native import FmuError, Instances, States

if TYPE_CHECKING:
    import pandas
    import xarray

__all__ = ["Fmu", "FmuError", "Instances", "Measure", "Runs", "States", "Variable"]

Measure = Literal["min", "max", "peak", "time_of_peak", "mean", "rms", "end"]
_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Variable:
    """A variable as the model description has it.

    type: Real, Integer, Boolean, String, Enumeration, or one of FMI 3.0's other types. causality: input, output, parameter,
    local and so on. variability, start, unit: None where nothing is said; start as it is written, unit also from the declared type.
    """

    name: str
    type: str
    causality: str
    variability: str | None
    start: str | None
    unit: str | None
    description: str


class Runs(Mapping[str, _Array]):
    """What came of `Fmu.run`: courses by output, measures by output and measure.

    runs["roll"]: (runs, times), what was kept. runs["roll", "peak"]: (runs,). Where a run has not reached a time there is
    not a number. Nor are there measures of a run that the FMU refused; those of one that it ended are of the times until
    then. As a mapping it has the courses by output, none where only measures were asked for; it is true all the same.
    """

    #: (times,), s: the times that were kept.
    time: _Array
    #: The runs that the FMU refused or ended before the last time, by their numbers, how far they got and why, in the
    #: words of the FMU ("at 0.5 s: ...", "ended by the FMU at t = 0.5 s: ...").
    errors: dict[int, str]
    #: What is to be said of finished runs: that the FMU ended at the last time by itself, or refused to be terminated.
    notes: dict[int, str]
    #: (runs,): the start values that were given, by name; those that are texts as they are.
    start: dict[str, _Array | str]

    def __init__(
        self,
        time: _Array,
        outputs: Sequence[str],
        courses: _Array,
        measures: Sequence[str],
        measured: _Array,
        errors: dict[int, str],
        notes: dict[int, str],
        start: Mapping[str, float | str | _Array],
    ):
        self.time, self.errors, self.notes = time, errors, notes
        runs = courses.shape[0]
        self.start = {
            name: value if isinstance(value, str) else np.broadcast_to(value, runs) for name, value in start.items()
        }
        self._outputs = {name: place for place, name in enumerate(outputs)}
        self._measures = {name: place for place, name in enumerate(measures)}
        self._courses, self._measured = courses, measured

    @property
    def count(self) -> int:
        """The number of runs."""
        return int(self._courses.shape[0])

    @property
    def ok(self) -> NDArray[np.bool_]:
        """(runs,): which have reached the last time."""
        finished = np.ones(self.count, dtype=bool)
        finished[list(self.errors)] = False
        return finished

    def check(self) -> Runs:
        """Itself, if all runs are finished; raises FmuError with the first refusal otherwise."""
        if self.errors:
            number, why = next(iter(self.errors.items()))
            many = f" ({len(self.errors)} of {self.count} runs failed)" if self.count > 1 else ""
            raise FmuError(f"run {number}: {why}{many}" if self.count > 1 else why)
        return self

    def __getitem__(self, key: str | tuple[str, str]) -> _Array:
        if isinstance(key, str):
            if not self._courses.shape[2]:
                raise KeyError(f"{key}: no courses were kept; ask for them with every=1, or for [output, measure]")
            return self._courses[:, self._outputs[key], :]
        output, measure = key
        return self._measured[:, self._outputs[output], self._measures[measure]]

    def __iter__(self) -> Iterator[str]:
        return iter(self._outputs if self._courses.shape[2] else ())

    def __len__(self) -> int:
        return len(self._outputs) if self._courses.shape[2] else 0

    def __bool__(self) -> bool:
        return True

    def to_pandas(self) -> pandas.DataFrame:
        """A row for each run and each time that was kept, with both as index; for each run alone where there are only
        measures.

        The columns: start values by name, outputs by name, measures as `roll_peak`; what belongs to a run stands in all of its
        rows. A start value of an output is called `roll at start`. Raises ImportError without pandas.
        """
        pandas = _needed("pandas")
        runs = np.arange(self.count)
        index, repeat = pandas.Index(runs, name="run"), 1
        if len(self):
            index, repeat = pandas.MultiIndex.from_product([runs, self.time], names=["run", "time"]), len(self.time)
        by_run = {**self._starts(), **self._by_name()}
        columns = {name: v if isinstance(v, str) else np.repeat(v, repeat) for name, v in by_run.items()}
        return pandas.DataFrame({**columns, **{name: course.ravel() for name, course in self.items()}}, index=index)

    def to_xarray(self) -> xarray.Dataset:
        """Outputs over the dimensions run and time, measures as `roll_peak` over run, start values as coordinates of run. A
        start value of an output is called `roll at start`. Raises ImportError without xarray."""
        xarray = _needed("xarray")
        starts = {name: value if isinstance(value, str) else ("run", value) for name, value in self._starts().items()}
        measures = {name: ("run", values) for name, values in self._by_name().items()}
        times = {"time": self.time} if len(self) else {}
        return xarray.Dataset(
            {**{name: (("run", "time"), course) for name, course in self.items()}, **measures},
            {"run": np.arange(self.count), **times, **starts},
        )

    def _starts(self) -> dict[str, _Array | str]:
        return {f"{name} at start" if name in self else name: value for name, value in self.start.items()}

    def _by_name(self) -> dict[str, _Array]:
        names = [(output, measure) for output in self._outputs for measure in self._measures]
        return {f"{output}_{measure}": self[output, measure] for output, measure in names}

    def __repr__(self) -> str:
        measures = f", measures {', '.join(self._measures)}" if self._measures else ""
        failed = f", {len(self.errors)} failed" if self.errors else ""
        return f"<Runs: {self.count} of {', '.join(self._outputs)}, {len(self.time)} times{measures}{failed}>"


class Fmu:
    """An FMU, unpacked and loaded once. A context manager: leaving it unloads the FMU, once its instances are gone, too.

    Its library runs in this process: where it crashes, the process is gone. Raises FmuError where the file is no FMU, or has
    no library for this platform.

    execution_tool: run it also if its library starts another program (needsExecutionTool), which must be installed.
    """

    def __init__(self, path: str | os.PathLike[str], *, execution_tool: bool = False):
        self._loaded = _Loaded(os.fspath(path), execution_tool)
        #: "2.0" or "3.0"; the name of the model; guid or instantiation token.
        self.fmi_version, self.model_name, self.token, self._once = self._loaded.about()
        #: The variables by name, in the order of the model description. Arrays and clocks of FMI 3.0 are left out.
        self.variables = {fields[0]: Variable(*fields) for fields in self._loaded.variables()}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Unload the FMU and remove its unpacked files. Harmless when called again."""
        self._loaded.close()

    def __repr__(self) -> str:
        return f"<Fmu {self.model_name}, FMI {self.fmi_version}, {len(self.variables)} variables>"

    def run(
        self,
        time: ArrayLike,
        *,
        outputs: Sequence[str],
        inputs: Mapping[str, ArrayLike] | None = None,
        input_derivatives: Mapping[str, ArrayLike] | None = None,
        start: Mapping[str, ArrayLike | str] | None = None,
        every: int | None = None,
        measures: Sequence[Measure] = (),
        threads: int | None = None,
        read_before_set: bool = False,
        progress: Callable[[int, int], Any] | None = None,
    ) -> Runs:
        """Run the FMU as often as values for each run are given, once if there are none.

        time: (times,), the communication points, s. At each the inputs are set, the outputs read, and the step to the next
        is taken.
        outputs: the variables to read, any that are numbers.
        inputs: by name; (times,) for all runs, (runs, times) for each its own, or a number that stays. Inputs that are not
        named keep their start values.
        input_derivatives: d/dt of inputs, in the same shapes, for FMUs of FMI 2.0 that can interpolate inputs.
        start: start values of parameters, states and so on by name: one for all runs, (runs,) for each its own, or a text.
        every: keep the outputs at the first time and each `every` times after it. Default: all, or none if there are
        measures.
        measures: what to calculate of each output on the way, over all times: min, max, peak (of the magnitude),
        time_of_peak, mean and rms (of the samples), end.
        threads: default one for each processor; FMUs that can be there only once in a process get one.
        read_before_set: read outputs before the inputs of their time are set, as FMPy does.
        progress: called with the number of finished runs and of all, ten times a second.

        A run that the FMU refuses or ends does not stop the others, see `Runs.errors` and `Runs.check`. If it is refused
        without a reason, it is made once more with logging on, after all others, for the FMU's words alone. Raises ValueError for what
        does not fit the FMU or itself, FmuError if the FMU is closed. Ctrl-C stops after the runs under way.
        """
        times = _array("time", time)
        if times.ndim != 1:
            raise ValueError(f"time must have one dimension, it has {times.ndim}")
        names = [outputs] if isinstance(outputs, str) else list(outputs)
        wanted = [measures] if isinstance(measures, str) else list(measures)
        kept = 1 if every is None and not wanted else every
        if kept is not None and kept < 1:
            raise ValueError(f"every must be at least 1, it is {kept}")
        starts = [(name, _start(name, value)) for name, value in (start or {}).items()]
        courses, measured, errors, notes = self._loaded.run(
            times,
            [(name, _course(name, values, len(times))) for name, values in (inputs or {}).items()],
            [(name, _course(name, values, len(times))) for name, values in (input_derivatives or {}).items()],
            starts,
            names,
            kept,
            wanted,
            threads,
            read_before_set,
            progress,
        )
        kept_times = times[:: kept or len(times)][: courses.shape[2]]
        return Runs(kept_times, names, courses, wanted, measured, dict(errors), dict(notes), dict(starts))

    def instances(
        self,
        count: int = 1,
        *,
        interface: Literal["co-simulation", "model-exchange"] = "co-simulation",
        start: Mapping[str, ArrayLike | str] | None = None,
        start_time: float = 0.0,
        stop_time: float | None = None,
        threads: int | None = 1,
    ) -> Instances:
        """Make instances, set their start values and initialize them.

        Parameters
        ----------
        count
            How many.
        interface
            Who integrates. Those for Model Exchange have been through the events at the begin and are in Continuous-Time Mode.
        start
            Start values of parameters, states, inputs and so on by name: one for all, (count,) for each its own, or a text.
        start_time, stop_time
            When they begin, s, and when they will end, if that is known.
        threads
            More than one pays where a call takes much longer than threads to wake, about 0.1 ms: for slow models or very
            many instances. None takes one for each processor.

        Raises
        ------
        ValueError
            For what does not fit the FMU or itself.
        FmuError
            If the FMU has no such interface, or refuses all of them.
        """
        return Instances(self._loaded, count, interface, dict(start or {}), start_time, stop_time, threads)


def _needed(package: str) -> Any:
    try:
        return importlib.import_module(package)
    except ImportError:
        raise ImportError(f"{package} is missing; install it with: pip install {package}", name=package) from None


def _array(name: str, values: ArrayLike) -> _Array:
    try:
        return np.ascontiguousarray(values, dtype=np.float64).reshape(np.shape(values))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: these are no numbers ({error})") from None


def _course(name: str, values: ArrayLike, times: int) -> float | _Array:
    array = _array(name, values)
    if array.ndim == 0:
        return float(array)
    if array.ndim > 2 or array.shape[-1] != times:
        raise ValueError(f"{name} has the shape {array.shape}; it must be ({times},), (runs, {times}) or a number")
    return array


def _start(name: str, value: ArrayLike | str) -> float | str | _Array:
    if isinstance(value, str):
        return value
    array = _array(name, value)
    if array.ndim > 1:
        raise ValueError(f"the start value of {name} has the shape {array.shape}; it must be (runs,) or a number")
    return float(array) if array.ndim == 0 else array
