"""Results of runs."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fmu_run._native import FmuError

if TYPE_CHECKING:
    import pandas
    import xarray

_Array = NDArray[np.float64]


class Runs(Mapping[str, _Array]):
    """Results of `Fmu.run`: time series by output, statistics by output and measure.

    runs["roll"]: (runs, times), at the kept times. runs["roll", "peak"]: (runs,). Times that a run has not reached are NaN.
    Measures are NaN for a rejected run; for a run that the FMU ended they cover the times until then. As a mapping, the
    object contains time series by output, none if only measures were requested; its truth value is always true.

    A RuntimeWarning reports NaN at the first use of a result. It reports failed runs only if neither `errors` nor `ok` was
    read before.
    """

    #: (times,), s: the kept times.
    time: _Array
    #: Notes on finished runs: the FMU ended by itself at the last time, or rejected the termination.
    notes: dict[int, str]
    #: (runs,): the given start values by name; strings unchanged.
    start: dict[str, _Array | str]

    def __init__(
        self,
        time: _Array,
        outputs: Sequence[str],
        trajectories: _Array,
        measures: Sequence[str],
        measured: _Array,
        errors: dict[int, str],
        notes: dict[int, str],
        start: Mapping[str, float | str | _Array],
    ):
        self.time, self._errors, self.notes = time, errors, notes
        self._reported, self._checked = not errors, set[str | tuple[str, str]]()
        runs = trajectories.shape[0]
        self.start = {
            name: value if isinstance(value, str) else np.broadcast_to(value, runs) for name, value in start.items()
        }
        self._outputs = {name: index for index, name in enumerate(outputs)}
        self._measures = {name: index for index, name in enumerate(measures)}
        self._trajectories, self._measured = trajectories, measured

    @property
    def count(self) -> int:
        """The number of runs."""
        return int(self._trajectories.shape[0])

    @property
    def errors(self) -> dict[int, str]:
        """Messages of the FMU, by index, on runs that it rejected or ended before the last time, with the time reached
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
        """Return this object if all runs are finished; else raise FmuError with the first error."""
        if self.errors:
            number, why = next(iter(self.errors.items()))
            many = f" ({len(self.errors)} of {self.count} runs failed)" if self.count > 1 else ""
            raise FmuError(f"run {number}: {why}{many}" if self.count > 1 else why)
        return self

    def __getitem__(self, key: str | tuple[str, str]) -> _Array:
        output, *measure = [key] if isinstance(key, str) else key
        if output not in self._outputs:
            raise KeyError(f"no output {output!r} was requested; there are {', '.join(self._outputs)}")
        if not measure and not self._trajectories.shape[2]:
            raise KeyError(f"{key}: no trajectories were kept; request them with every=1, or read [output, measure]")
        if measure and measure[0] not in self._measures:
            known = ", ".join(self._measures) or "none"
            raise KeyError(f"no measure {measure[0]!r} was requested; there are {known}")
        values = (self._measured if measure else self._trajectories)[:, self._outputs[output]]
        found: _Array = values[:, self._measures[measure[0]]] if measure else values
        self._announce(key, found)
        return found

    def _announce(self, key: str | tuple[str, str], values: _Array) -> None:
        """Warn about failed runs, unless the caller has read `errors`, and about other results with NaN."""
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
        return iter(self._outputs if self._trajectories.shape[2] else ())

    def __len__(self) -> int:
        return len(self._outputs) if self._trajectories.shape[2] else 0

    def __bool__(self) -> bool:
        return True

    def to_pandas(self) -> pandas.DataFrame:
        """Return a row for each run and each kept time, with both as index; a row for each run if there are only measures.

        The columns: start values by name, outputs by name, measures as `roll_peak`; values of a run are repeated in all of its
        rows. A start value of an output is called `roll at start`. Raises ImportError without pandas.
        """
        pandas = _needed("pandas")
        runs = np.arange(self.count)
        index, repeat = pandas.Index(runs, name="run"), 1
        if len(self):
            index, repeat = pandas.MultiIndex.from_product([runs, self.time], names=["run", "time"]), len(self.time)
        by_run = {**self._starts(), **self._by_name()}
        columns = {
            name: value if isinstance(value, str) else np.repeat(value, repeat) for name, value in by_run.items()
        }
        return pandas.DataFrame({**columns, **{name: series.ravel() for name, series in self.items()}}, index=index)

    def to_xarray(self) -> xarray.Dataset:
        """Return outputs over the dimensions run and time, measures as `roll_peak` over run, start values as coordinates of run. A
        start value of an output is called `roll at start`. Raises ImportError without xarray."""
        needed = _needed("xarray")
        starts = {name: value if isinstance(value, str) else ("run", value) for name, value in self._starts().items()}
        measures = {name: ("run", values) for name, values in self._by_name().items()}
        times = {"time": self.time} if len(self) else {}
        dataset: xarray.Dataset = needed.Dataset(
            {**{name: (("run", "time"), series) for name, series in self.items()}, **measures},
            {"run": np.arange(self.count), **times, **starts},
        )
        return dataset

    def _starts(self) -> dict[str, _Array | str]:
        return {f"{name} at start" if name in self else name: value for name, value in self.start.items()}

    def _by_name(self) -> dict[str, _Array]:
        names = [(output, measure) for output in self._outputs for measure in self._measures]
        return {f"{output}_{measure}": self[output, measure] for output, measure in names}

    def __repr__(self) -> str:
        measures = f", measures {', '.join(self._measures)}" if self._measures else ""
        failed = f", {len(self._errors)} failed" if self._errors else ""
        return f"<Runs: {self.count} of {', '.join(self._outputs)}, {len(self.time)} times{measures}{failed}>"


def _needed(package: str) -> Any:
    try:
        return importlib.import_module(package)
    except ImportError:
        raise ImportError(f"{package} is missing; install it with: pip install {package}", name=package) from None
