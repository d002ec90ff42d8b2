"""Results of runs: `Runs`, `Event` and `Interrupted`."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmu_run._native import FmuError

if TYPE_CHECKING:
    import pandas
    import xarray

_Array = NDArray[np.float64]
#: Suffix of the name of a start value in tables where its variable is also an output.
AT_START = " at start"


class Event(NamedTuple):
    """An event in Model Exchange.

    Parameters
    ----------
    run
        Index of the run.
    time
        Time of the event, s.
    before
        Values of the numeric outputs just before the event, by name, in the units of the FMU. Elements of an array have separate names,
        such as y[1].
    after
        The same just after the event.
    """

    run: int
    time: float
    before: dict[str, float]
    after: dict[str, float]


class Runs(Mapping[str, _Array]):
    """Results of `Fmu.run`: time series by output, and statistics by output and measure.

    runs["roll"] is an array (runs, times), at the stored times, and runs["roll", "peak"] is an array (runs,). A whole array is
    (runs, times, ...), and its measures are (runs, ...). Values at times that a run has not reached are NaN. The measures of a run are
    NaN if it failed. If a value is NaN, all of them except "end", the last value, are NaN. If the FMU ended a run early, they cover the
    times until then.

    Strings and bytes are arrays of objects. An Int64 or UInt64 variable is an array of integers, or of objects if a run has not reached
    all times. These arrays have None instead of NaN, and no measures.

    As a mapping, the object contains the time series by output, and is empty if only measures were requested. As a condition, it is
    always true.

    A RuntimeWarning reports NaN at the first use of a result. It also reports failed runs, unless `errors` or `ok` was read before.
    """

    #: (times,): the stored times, s.
    time: _Array
    #: dict[int, str]: notes on finished runs by index: the FMU ended the simulation at the last time, or rejected its termination.
    notes: dict[int, str]

    def __init__(
        self,
        time: _Array,
        outputs: Sequence[str],
        trajectories: _Array,
        measures: Sequence[str],
        measured: _Array | None,
        errors: Iterable[tuple[int, str]],
        notes: Iterable[tuple[int, str]],
        start: Mapping[str, Any],
        arrays: Mapping[str, tuple[tuple[int, ...], list[str]]] | None = None,
        exact: Mapping[str, NDArray[Any]] | None = None,
        events: Iterable[tuple[int, float, list[float], list[float]]] = (),
    ):
        self.time, self._errors, self.notes = time, dict(errors), dict(notes)
        self._reported, self._checked = not self._errors, set[str | tuple[str, str]]()
        self._trajectories, self._measured = trajectories, measured
        self._outputs, self._measures, self._start = outputs, measures, start
        #: Shape and element names of each array among the outputs and start values.
        self._arrays = arrays or {}
        #: Outputs whose values float64 cannot represent.
        self._exact = exact or {}
        self._events = list(events)

    @cached_property
    def events(self) -> list[Event]:
        """The events of all runs in Model Exchange, sorted by run and time. Empty unless `Fmu.run` was called with events=True."""
        names = [element for name in self._numbers for element in self._elements(name)]
        return [
            Event(run, time, dict(zip(names, before, strict=True)), dict(zip(names, after, strict=True)))
            for run, time, before, after in self._events
        ]

    @cached_property
    def start(self) -> dict[str, Any]:
        """The given start values by name: (runs,) each, and (runs, ...) for a whole array. A single string or bytes is unchanged."""
        return {
            name: value
            if isinstance(value, str | bytes)
            else np.broadcast_to(_column(value), (self.count, *self._shape(name)))
            for name, value in self._start.items()
        }

    @cached_property
    def _columns(self) -> dict[str, int]:
        """Index of the first column of each output in the results, and of the column of each array element."""
        columns: dict[str, int] = {}
        elements: dict[str, int] = {}
        first = 0
        for name in self._outputs:
            if name in self._exact:
                continue
            columns[name] = first
            elements |= {element: first + k for k, element in enumerate(self._elements(name))}
            first += len(self._elements(name))
        return elements | columns

    @property
    def _numbers(self) -> list[str]:
        """Names of the outputs that have measures."""
        return [name for name in self._outputs if name not in self._exact]

    def _shape(self, name: str) -> tuple[int, ...]:
        return self._arrays[name][0] if name in self._arrays else ()

    def _elements(self, name: str) -> list[str]:
        return self._arrays[name][1] if name in self._arrays else [name]

    @property
    def count(self) -> int:
        """The number of runs."""
        return int(self._trajectories.shape[0])

    @property
    def errors(self) -> dict[int, str]:
        """Messages of the FMU about runs that failed or that it ended before the last time, by index of the run. Each contains the time
        ("at 0.5 s: ...", "ended by the FMU at t = 0.5 s: ...")."""
        self._reported = True
        return self._errors

    @property
    def ok(self) -> NDArray[np.bool_]:
        """(runs,): whether each run has reached the last time."""
        finished = np.ones(self.count, dtype=bool)
        finished[list(self.errors)] = False
        return finished

    def check(self) -> Runs:
        """Return this object if all runs have reached the last time; otherwise raise FmuError with the first error."""
        if self.errors:
            number, why = next(iter(self.errors.items()))
            many = f" ({len(self.errors)} of {self.count} runs failed)" if self.count > 1 else ""
            raise FmuError(f"run {number}: {why}{many}" if self.count > 1 else why)
        return self

    def __getitem__(self, key: str | tuple[str, str]) -> _Array:
        output, *measure = (key,) if isinstance(key, str) else key if isinstance(key, tuple) else (None,)
        if output in self._exact:
            if measure:
                raise KeyError(f"{output} has no measures; only numbers up to 2**53 have")
            return self._exact[output]
        if output not in self._columns or len(measure) > 1:
            raise KeyError(
                f"no output {output if isinstance(output, str) else key!r} was requested; there are {', '.join(self._outputs)}"
            )
        if not measure and not self._trajectories.shape[2]:
            raise KeyError(f"{key}: no trajectories were kept; request them with every=1, or read [output, measure]")
        if measure and measure[0] not in self._measures:
            known = ", ".join(self._measures) or "none"
            raise KeyError(f"no measure {measure[0]!r} was requested; there are {known}")
        results, shape = self._trajectories, self._shape(output)
        first = self._columns[output]
        if measure and self._measured is not None:
            results = self._measured[:, :, self._measures.index(measure[0]), None]
        found: _Array = results[:, first]
        if shape:
            columns = results[:, first : first + len(self._elements(output))].swapaxes(1, 2)
            found = columns.reshape(*columns.shape[:2], *shape)
        if measure:
            found = found[:, 0]
        self._announce(key, found)
        return found

    def _announce(self, key: str | tuple[str, str], values: _Array) -> None:
        """Warn about failed runs, unless the caller has read `errors`, and about NaN in other runs."""
        lines = []
        if not self._reported:
            number, why = next(iter(self._errors.items()))
            count = "all" if len(self._errors) == self.count else f"{len(self._errors)} of {self.count}"
            lines.append(f"{count} runs failed, see Runs.errors; run {number}: {why}")
        if key not in self._checked:
            bad: NDArray[np.bool_] = np.asarray(np.isnan(values).reshape(self.count, -1).any(axis=1))
            bad[list(self._errors)] = False
            if bad.any():
                lines.append(f"{key} is not a number in {bad.sum()} finished runs, run {bad.argmax()} among them")
        self._reported = True
        self._checked.add(key)
        for line in lines:
            warnings.warn(line, RuntimeWarning, stacklevel=3)

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys(self._outputs) if self._trajectories.shape[2] else ())

    def __len__(self) -> int:
        return len(set(self._outputs)) if self._trajectories.shape[2] else 0

    def __bool__(self) -> bool:
        return True

    def to_pandas(self) -> pandas.DataFrame:
        """Return a table with a row for each run and each stored time, which are its index. If there are only measures, it has a row for
        each run.

        The columns are start values and outputs, by name, and measures, such as `roll_peak`. Start values and measures are repeated in
        all rows of a run. A start value of an output is called `roll at start`. Raises ImportError without pandas.
        """
        pandas = _needed("pandas")
        runs = np.arange(self.count)
        index, repeat = pandas.Index(runs, name="run"), 1
        if len(self):
            index, repeat = pandas.MultiIndex.from_product([runs, self.time], names=["run", "time"]), len(self.time)
        by_run = {**self._starts(), **self._by_name()}
        columns = {
            element: values if isinstance(values, str) else np.repeat(values, repeat)
            for name, value in by_run.items()
            for element, values in self._split(name, value, 1)
        }
        for name, series in self.items():
            columns |= {element: values.ravel() for element, values in self._split(name, series, 2)}
        return pandas.DataFrame(columns, index=index)

    def to_xarray(self) -> xarray.Dataset:
        """Return a dataset of outputs with the dimensions run and time, and of measures, such as `roll_peak`, with the dimension run. Start
        values are coordinates of run; a start value of an output is called `roll at start`. The dimensions of an array T are called
        `T_0`, `T_1` and so on. Raises ImportError without xarray."""
        needed = _needed("xarray")

        def dims(name: str, *first: str) -> tuple[str, ...]:
            return (*first, *(f"{name}_{number}" for number in range(len(self._shape(name)))))

        starts = {
            name: value if isinstance(value, str) else (dims(name.removesuffix(AT_START), "run"), value)
            for name, value in self._starts().items()
        }
        measures = {
            f"{output}_{measure}": (dims(output, "run"), self[output, measure])
            for output in self._numbers
            for measure in self._measures
        }
        times = {"time": self.time} if len(self) else {}
        series = {name: (dims(name, "run", "time"), series) for name, series in self.items()}
        dataset: xarray.Dataset = needed.Dataset(
            {**series, **measures}, {"run": np.arange(self.count), **times, **starts}
        )
        return dataset

    def _starts(self) -> dict[str, Any]:
        return {f"{name}{AT_START}" if name in self else name: value for name, value in self.start.items()}

    def _by_name(self) -> dict[str, _Array]:
        found: dict[str, _Array] = {}
        for output in self._numbers:
            for measure in self._measures:
                of_elements = self._split(output, self[output, measure], 1)
                found |= {f"{element}_{measure}": values for element, values in of_elements}
        return found

    def _split(self, name: str, values: _Array | str, ahead: int) -> list[tuple[str, Any]]:
        """Split an array into pairs of the name of an element and its values, which keep the first `ahead` dimensions. Other values are one
        pair."""
        array = name.removesuffix(AT_START)
        if array not in self._arrays or isinstance(values, str):
            return [(name, values)]
        columns = values.reshape(*values.shape[:ahead], -1)
        ending = name[len(array) :]
        return [(f"{element}{ending}", columns[..., k]) for k, element in enumerate(self._elements(array))]

    def __repr__(self) -> str:
        measures = f", measures {', '.join(self._measures)}" if self._measures else ""
        failed = f", {len(self._errors)} failed" if self._errors else ""
        return f"<Runs: {self.count} of {', '.join(self._outputs)}, {len(self.time)} times{measures}{failed}>"


class Interrupted(KeyboardInterrupt):
    """Ctrl-C has stopped `Fmu.run`.

    Parameters
    ----------
    runs
        The results. A run that was not finished has the error "cancelled", and its values are NaN.
    """

    def __init__(self, runs: Runs):
        super().__init__()
        self.runs = runs


def _column(values: Any) -> NDArray[Any]:
    """Return start values as an array. Bytes are objects, because NumPy would remove zeros at their end."""
    if isinstance(values, Sequence) and any(isinstance(value, bytes) for value in values):
        column = np.empty(len(values), dtype=object)
        column[:] = values
        return column
    return np.asarray(values)


def _needed(package: str) -> Any:
    try:
        return importlib.import_module(package)
    except ImportError:
        raise ImportError(f"{package} is missing; install it with: pip install {package}", name=package) from None
