"""One simulation of the testbed: `simulate`, and the `Run` that it returns."""

from __future__ import annotations

import html
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from prw.arguments import Given, Table, check_names, names_of, values_of
from prw.beginning import ROUNDING, Beginning, beginning
from prw.columns import MEASURED, QUANTITIES, si_unit
from prw.errors import need
from prw.files import write_table
from prw.motion import Array, Motion, fig4
from prw.recording import Recording, read, read_motion
from prw.testbed import Testbed

#: Sampling error, as a fraction of the peak, above which there is a warning.
DOUBTFUL = 0.01
#: The sampling error is estimated only if a second run, with every second sample, has at least this number of samples.
MIN_TIMES = 8

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from prw.testbed import Value


class Run(Mapping[str, Array]):
    """The response of the testbed: a mapping from the name of an output to its values, (n,), in SI, at the times `time`.

    Attributes
    ----------
    motion
        The motion of the motors.
    parameters
        The value of every parameter of the FMU in this run, except strings and `use_omega`, in SI.
    sampling_errors
        The largest error of each output that is caused by the sampling of the motors, as a fraction of the output's
        peak. They are estimated by a second run with every second sample. The mapping is empty if that run would be too
        short.
    beginning
        The effect of motors that turn already at the first sample, or None. The sampling errors are then those after its end.
    measured
        The measured values, (n,), of those outputs of the run that the recording contains; NaN where a cell is empty.
    """

    def __init__(
        self,
        motion: Motion,
        outputs: Mapping[str, Array],
        parameters: Mapping[str, Value],
        sampling_errors: Mapping[str, float] = {},
        beginning: Beginning | None = None,
        measured: Mapping[str, Array] = {},
    ):
        self.motion, self.parameters, self.beginning = motion, dict(parameters), beginning
        self._outputs, self.sampling_errors = dict(outputs), dict(sampling_errors)
        self.measured = {name: values for name, values in measured.items() if name in self._outputs}

    @property
    def notes(self) -> list[str]:
        """Notes for the user, for example on probable mistakes in the recording, and on a large sampling error."""
        return [*self.motion.notes, *self.doubts]

    @property
    def doubts(self) -> list[str]:
        """Warnings about a recording that begins in motion, and about a large sampling error."""
        begins = [] if self.beginning is None else [str(self.beginning)]
        return [*begins, *filter(None, [self.doubt])]

    @property
    def doubt(self) -> str:
        """A warning about the sampling error, if it is large, else an empty string."""
        worst = max(self.sampling_errors, key=self.sampling_errors.__getitem__, default="")
        if not worst or (error := self.sampling_errors[worst]) < DOUBTFUL:
            return ""
        rate = (len(self.time) - 1) / float(self.time[-1] - self.time[0])
        needed = _rounded_up(rate * float(np.sqrt(error / DOUBTFUL)))
        rates = (
            "; it also decreases if you give the motors' rates omega1 and omega2" if self.motion.omega is None else ""
        )
        return (
            f"{worst} may be off by {error:.1%} of its peak, because the motors are sampled at "
            f"{float(f'{rate:.3g}'):.10g} Hz; at about {needed:.10g} Hz, the error would be {DOUBTFUL:.0%}{rates}"
        )

    @property
    def time(self) -> Array:
        """Times of the samples, (n,), in s."""
        return self.motion.time

    def __getitem__(self, output: str) -> Array:
        if output not in self._outputs:
            raise KeyError(f"{output} is not in this run, which has {', '.join(self)}; request it with `outputs=`")
        return self._outputs[output]

    def __iter__(self) -> Iterator[str]:
        return iter(self._outputs)

    def __len__(self) -> int:
        return len(self._outputs)

    @property
    def differences(self) -> dict[str, Array]:
        """The measured minus the simulated values, (n,), of each measured output; NaN where nothing was measured."""
        return {name: values - self[name] for name, values in self.measured.items()}

    def recording(self) -> Recording:
        """The run as a recording of those outputs that can also be measured."""
        measured = {name: self[name] for name in MEASURED if name in self}
        return Recording(Path(self.motion.name), self.motion, measured, dict.fromkeys(self, ""))

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write time (s), the motors' angles (rad) and, if given, rates (rad/s), and the outputs (SI) to `path`,
        one row for each time. Numbers keep all their digits. Raises UserError if the file cannot be written."""
        write_table(Path(path), {**self.motion.columns, **self._outputs})

    def to_pandas(self) -> pandas.DataFrame:
        """The columns of `to_csv` as a DataFrame, with the time as index. Raises UserError without pandas."""
        need("pandas")
        import pandas

        columns = {**self.motion.columns, **self._outputs}
        return pandas.DataFrame(columns, index=pandas.Index(columns.pop("time"), name="time"))

    def plot(self, title: str | None = None, *, angles: bool = True) -> Figure:
        """A figure of the motors, pitch and roll, and the torques over time, if the run has them, with the measured
        values over the simulated ones. Save the figure with `.savefig(path)`.

        angles: show the angles of motors and wrist, in degrees. If false, the wrist's angles are left out, and the motors'
        rates, if they are known, replace their angles, as in Fig. 4. Raises UserError without matplotlib.
        """
        need("matplotlib")
        from prw.plots import draw_response

        title = f"Response to {self.motion.name}" if title is None else title
        return draw_response(title, self.motion, self, angles, self.measured)

    def __repr__(self) -> str:
        notes = "".join(f"\n  note: {note}" for note in self.notes)
        return f"<Run of {self.motion.name}: {', '.join(self)} at {len(self.time)} times>{notes}"

    def _repr_html_(self) -> str:
        rows = [
            f"<tr><td>{html.escape(name)}</td><td>{_unit(name)}</td>"
            f"<td>{np.abs(values).max():.4g}</td><td>{values[-1]:.4g}</td></tr>"
            for name, values in self.items()
        ]
        heads = "<tr><th>output</th><th>unit</th><th>largest magnitude</th><th>at the end</th></tr>"
        span = f"{len(self.time)} times, {self.time[0]:g} to {self.time[-1]:g} s"
        notes = "".join(f"<p>{html.escape(note)}</p>" for note in self.notes)
        return f"<p>{html.escape(self.motion.name)}: {span}</p><table>{heads}{''.join(rows)}</table>{notes}"


def simulate(
    motion: Motion | Recording | Run | str | os.PathLike[str] | Table | None = None,
    parameters: Given = None,
    *,
    fmu: str | os.PathLike[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> Run:
    """Simulate the testbed with moving motors, from rest at their first angles.

    Parameters
    ----------
    motion
        The motion of the motors, or a recording of it (a CSV file, a DataFrame or a dict of arrays as `prw.read` takes it),
        or a run whose motion is repeated. Default: the paper's experiment of Fig. 4. The run contains the measured outputs
        of a recording for comparison.
    parameters
        Values of parameters by name, in SI or with a unit as in (1.9, "N.m/deg"), or the path of a JSON file that `prw
        identify` has written. Other parameters keep the FMU's start values.
    fmu
        The testbed FMU, of FMI 2.0 or 3.0. Default: see `default_fmu`.
    outputs
        Names of any Real variables. Default: all outputs.

    Returns
    -------
    Run
        The run. Sample k of each output is read at time[k], after the motors' angles of that time are set.

    Raises
    ------
    UserError
        The FMU is missing or rejects a value, a name is unknown or a file unreadable.

    Warns
    -----
    UserWarning
        The motors of a recording, or of a Motion without rates, turn at the first sample already, or are sampled so coarsely that an output may be off by more than 1 % of its peak.
    """
    if motion is not None and not isinstance(motion, (Motion, Recording, Run)):
        motion = read(motion)
    moved = motion_of(motion)
    with Testbed(None if fmu is None else Path(fmu)) as testbed:
        names = testbed.loaded.outputs if outputs is None else names_of("outputs", outputs)
        given = values_of(parameters, testbed.loaded)
        values = testbed.with_starts(given)
        check_names("outputs", names, testbed.loaded.variables)
        found = testbed.respond(moved, names, given)
        other: dict[str, Array] = {}
        begins = None
        if len(moved.time[::2]) >= MIN_TIMES:
            coarse = Motion(moved.time[::2], moved.theta[::2], None if moved.omega is None else moved.omega[::2])
            other = testbed.respond(coarse, names, given)
            # The rates of a Motion say how the motors begin.
            if moved.omega is None or not isinstance(motion, Motion):
                begins = beginning(moved, found, lambda longer: testbed.respond(longer, names, given))
    settled = moved.time[0] + (0.0 if begins is None else begins.lasts)
    # If all samples are at the beginning, the other warning covers the error.
    late = slice(int(np.searchsorted(moved.time[::2], settled)), None)
    errors = {name: _sampling_error(found[name], other[name], late) for name in other}
    measured = motion.measured if isinstance(motion, Recording) else {}
    run = Run(moved, found, values, errors, begins, measured)
    for doubt in run.doubts:
        warnings.warn(doubt, UserWarning, stacklevel=2)
    return run


def _sampling_error(fine: Array, coarse: Array, late: slice) -> float:
    """The error of the output `fine` (n,) as a fraction of its peak, at the samples `late` of `coarse`, the same output of a run with
    every second sample. Errors are second order in the step size, so the error of `coarse` is four times the error of `fine`,
    and their difference is three times the error of `fine`."""
    peak = float(np.abs(fine).max())
    return float(np.abs(coarse - fine[::2])[late].max(initial=0.0)) / 3 / peak if peak > ROUNDING else 0.0


def _rounded_up(number: float) -> float:
    """The number, rounded up to two significant digits."""
    digits = 10.0 ** (np.floor(np.log10(number)) - 1)
    # Without the subtraction, a rounding error of the division could raise the number.
    return float(np.ceil(number / digits - 1e-9) * digits)


def motion_of(source: Motion | Recording | Run | str | os.PathLike[str] | Table | None) -> Motion:
    """The motion `source`, or the motion of a recording, a run, a file or columns; by default the motion of Fig. 4. Raises
    UserError if a file or column cannot be read."""
    if source is None:
        return fig4()
    if isinstance(source, (Recording, Run)):
        return source.motion
    return source if isinstance(source, Motion) else read_motion(source)


def _unit(name: str) -> str:
    return si_unit(name) if name in QUANTITIES else ""
