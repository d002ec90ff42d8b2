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
    """An event.

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
    clocks
        Names of the clocks that ticked. Outputs that have one of them have the values of the tick in `after`.
    """

    run: int
    time: float
    before: dict[str, float]
    after: dict[str, float]
    clocks: list[str]


class _Column(NamedTuple):
    """An output, or an element of a whole array among the outputs."""

    name: str
    shape: tuple[int, ...]
    elements: list[str]
    #: Index of the first column in trajectories, statistics and events; None if float64 cannot represent the values.
    first: int | None
    #: (runs, times, ...): the values if float64 cannot represent them.
    exact: NDArray[Any] | None
    #: Whether it has values only while a clock is active, so that NaN is not a fault.
    clocked: bool

    def of_elements(self) -> Iterator[_Column]:
        for number, element in enumerate(self.elements):
            first = None if self.first is None else self.first + number
            exact = self.exact
            if exact is not None:
                exact = exact.reshape(*exact.shape[:2], -1)[..., number]
            yield _Column(element, (), [element], first, exact, self.clocked)


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
        columns: Iterable[tuple[str, tuple[int, ...], list[str], int | None, NDArray[Any] | None, bool]],
        trajectories: _Array,
        measures: Sequence[str],
        measured: _Array | None,
        errors: Iterable[tuple[int, str]],
        notes: Iterable[tuple[int, str]],
        start: Mapping[str, Any],
        arrays: Mapping[str, tuple[tuple[int, ...], list[str]]],
        events: Iterable[tuple[int, float, list[float], list[float], list[str]]] = (),
    ):
        self.time, self._errors, self.notes = time, dict(errors), dict(notes)
        self._reported, self._checked = not self._errors, set[str | tuple[str, str]]()
        self._trajectories, self._measured = trajectories, measured
        #: The outputs, in which each column occurs in one place.
        self._outputs = [_Column(*column) for column in columns]
        self._measures, self._start = measures, start
        #: Shape and element names of each array among the start values.
        self._arrays = arrays
        self._events = list(events)

    @cached_property
    def events(self) -> list[Event]:
        """The events of all runs, sorted by run and time. Empty unless `Fmu.run` was called with events=True."""
        names = [element for column in self._outputs if column.first is not None for element in column.elements]
        return [
            Event(run, time, dict(zip(names, before, strict=True)), dict(zip(names, after, strict=True)), clocks)
            for run, time, before, after, clocks in self._events
        ]

    @cached_property
    def start(self) -> dict[str, Any]:
        """The given start values by name: (runs,) each, and (runs, ...) for a whole array. A single string or bytes is unchanged."""
        return {
            name: value
            if isinstance(value, str | bytes)
            else np.broadcast_to(_column(value), (self.count, *(self._arrays[name][0] if name in self._arrays else ())))
            for name, value in self._start.items()
        }

    @cached_property
    def _columns(self) -> dict[str, _Column]:
        """The outputs by name."""
        return {column.name: column for column in self._outputs}

    @cached_property
    def _elements(self) -> dict[str, _Column]:
        """The elements of the outputs by name. There may be many."""
        return {element.name: element for column in self._outputs for element in column.of_elements()}

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
        column = None
        if isinstance(output, str) and len(measure) < 2:
            column = self._columns.get(output) or self._elements.get(output)
        if column is None:
            known = ", ".join(of.name for of in self._outputs)
            raise KeyError(f"no output {output if isinstance(output, str) else key!r} was requested; there are {known}")
        if measure and column.first is None:
            raise KeyError(f"{output} has no measures; only numbers up to 2**53 have")
        if not measure and not self._trajectories.shape[2]:
            raise KeyError(f"{key}: no trajectories were kept; request them with every=1, or read [output, measure]")
        if measure and measure[0] not in self._measures:
            known = ", ".join(self._measures) or "none"
            raise KeyError(f"no measure {measure[0]!r} was requested; there are {known}")
        if column.first is None:
            assert column.exact is not None
            return column.exact
        results, first = self._trajectories, column.first
        if measure and self._measured is not None:
            results = self._measured[:, :, self._measures.index(measure[0]), None]
        found: _Array = results[:, first]
        if column.shape:
            columns = results[:, first : first + len(column.elements)].swapaxes(1, 2)
            found = columns.reshape(*columns.shape[:2], *column.shape)
        if measure:
            found = found[:, 0]
        self._announce(key, found, column.clocked)
        return found

    def _announce(self, key: str | tuple[str, str], values: _Array, clocked: bool) -> None:
        """Warn about failed runs, unless the caller has read `errors`, and about NaN in other runs, unless the output has a clock."""
        lines = []
        if not self._reported:
            number, why = next(iter(self._errors.items()))
            count = "all" if len(self._errors) == self.count else f"{len(self._errors)} of {self.count}"
            lines.append(f"{count} runs failed, see Runs.errors; run {number}: {why}")
        if not clocked and key not in self._checked:
            bad: NDArray[np.bool_] = np.asarray(np.isnan(values).reshape(self.count, -1).any(axis=1))
            bad[list(self._errors)] = False
            if bad.any():
                lines.append(f"{key} is not a number in {bad.sum()} finished runs, run {bad.argmax()} among them")
        self._reported = True
        self._checked.add(key)
        for line in lines:
            warnings.warn(line, RuntimeWarning, stacklevel=3)

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys(column.name for column in self._outputs) if self._trajectories.shape[2] else ())

    def __len__(self) -> int:
        return sum(1 for _ in iter(self))

    def __bool__(self) -> bool:
        return True

    def to_pandas(self) -> pandas.DataFrame:
        """Return a table with a row for each run and each stored time, which are its index. If there are only measures, it has a row for
        each run.

        The columns are start values and outputs, by name, and measures, such as `roll_peak`. Start values and measures are repeated in
        all rows of a run. A start value of an output is called `roll at start`. Raises ImportError without pandas, and ValueError if two
        different columns would have the same name.
        """
        pandas = _needed("pandas")
        runs = np.arange(self.count)
        index, repeat = pandas.Index(runs, name="run"), 1
        if len(self):
            index, repeat = pandas.MultiIndex.from_product([runs, self.time], names=["run", "time"]), len(self.time)
        table = _Table()
        for name, value in self.start.items():
            ending = AT_START if name in [*self] else ""
            if isinstance(value, str | bytes):
                table.add(f"{name}{ending}", ("start", name), value)
                continue
            for element, values in _split(self._arrays[name][1] if name in self._arrays else [name], value, 1):
                table.add(f"{element}{ending}", ("start", element), np.repeat(values, repeat))
        for column, measure in self._measured_columns():
            for element, values in _split(column.elements, self[column.name, measure], 1):
                table.add(f"{element}_{measure}", ("measure", element, measure), np.repeat(values, repeat))
        for name, series in self.items():
            for element, values in _split(self._columns[name].elements, series, 2):
                table.add(element, ("output", element), values.ravel())
        return pandas.DataFrame(table.columns, index=index)

    def to_xarray(self) -> xarray.Dataset:
        """Return a dataset of outputs with the dimensions run and time, and of measures, such as `roll_peak`, with the dimension run. Start
        values are coordinates of run; a start value of an output is called `roll at start`. The dimensions of an array T are called
        `T_0`, `T_1` and so on. Raises ImportError without xarray, and ValueError if two different variables would have the same name."""
        needed = _needed("xarray")

        def dims(name: str, shape: tuple[int, ...], *first: str) -> tuple[str, ...]:
            return (*first, *(f"{name}_{number}" for number in range(len(shape))))

        table = _Table()
        table.add("run", "the runs", np.arange(self.count))
        if len(self):
            table.add("time", "the times", self.time)
        for name, value in self.start.items():
            given = value if isinstance(value, str | bytes) else (dims(name, value.shape[1:], "run"), value)
            table.add(f"{name}{AT_START}" if name in [*self] else name, ("start", name), given)
        coordinates = dict(table.columns)
        for name, series in self.items():
            table.add(name, ("output", name), (dims(name, self._columns[name].shape, "run", "time"), series))
        for column, measure in self._measured_columns():
            measured = (dims(column.name, column.shape, "run"), self[column.name, measure])
            table.add(f"{column.name}_{measure}", ("measure", column.name, measure), measured)
        variables = {name: values for name, values in table.columns.items() if name not in coordinates}
        dataset: xarray.Dataset = needed.Dataset(variables, coordinates)
        return dataset

    def _measured_columns(self) -> list[tuple[_Column, str]]:
        numbers = [column for column in self._outputs if column.first is not None]
        return [(column, measure) for column in numbers for measure in self._measures]

    def __repr__(self) -> str:
        measures = f", measures {', '.join(self._measures)}" if self._measures else ""
        failed = f", {len(self._errors)} failed" if self._errors else ""
        outputs = ", ".join(column.name for column in self._outputs)
        return f"<Runs: {self.count} of {outputs}, {len(self.time)} times{measures}{failed}>"


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


class _Table:
    """Columns by name, each with what it is."""

    def __init__(self) -> None:
        self.columns: dict[str, Any] = {}
        self._meanings: dict[str, object] = {}

    def add(self, name: str, meaning: object, values: Any) -> None:
        if self._meanings.setdefault(name, meaning) != meaning:
            raise ValueError(f"two different columns would be called {name!r}; read them from the Runs")
        self.columns[name] = values


def _split(elements: Sequence[str], values: _Array, ahead: int) -> list[tuple[str, _Array]]:
    """Return the name of each element with its values, which keep the first `ahead` dimensions."""
    columns = values.reshape(*values.shape[:ahead], -1)
    return [(element, columns[..., k]) for k, element in enumerate(elements)]


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
