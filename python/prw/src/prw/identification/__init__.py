"""Estimates parameters of the testbed: the values with which the FMU comes closest to the measurements.

The modules in the order of dependence; `identify` below combines them::

    path                 smoothed motor angles
    experiment           spectra of inputs, of measurements and of the errors of both
    model, response      the FMU's equations and outputs
    effects              friction, backlash and other effects that the FMU does not model
    fit, statistics      least squares; standard errors and intervals
    verdict, diagnosis   whether the model explains the data, and possible causes if not
    design, excitation   more informative experiments; `prw.excite`
    rounding             digits of numbers
    outliers             the robust fit, in which values far from the model count less
    residuals            hum, spikes and jitter in the residuals
    findings, results    the return value, as attributes, text and files
    report               the HTML page
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING, TypeAlias, cast

import numpy as np

from prw.arguments import (
    Table,
    check_names,
    counted,
    flag,
    is_path,
    is_table,
    names_of,
    not_negative,
    positive,
    spread_of,
)
from prw.columns import ANGLES, CHANNELS
from prw.errors import UserError, need

if TYPE_CHECKING:
    from prw.arguments import Given
    from prw.identification.experiment import Experiment, Rates
    from prw.identification.fit import Solution, Task
    from prw.identification.model import Parameters
    from prw.identification.response import Distortion
    from prw.identification.results import Identification
    from prw.recording import Recording
    from prw.simulation import Run

    #: The sources of an experiment.
    Source: TypeAlias = str | os.PathLike[str] | Recording | Run | Table

#: The parameters that are estimated by default.
DEFAULT_ESTIMATE = ("k1", "k2", "c1", "c2", "c3")
#: Default bounds: the start value divided and multiplied by this factor.
BOUNDS_FACTOR = 100.0


def identify(
    files: Source | Iterable[Source],
    *,
    estimate: str | Iterable[str] = DEFAULT_ESTIMATE,
    priors: Mapping[str, float | tuple[float, float]] = {},
    parameters: Given = None,
    bounds: Mapping[str, tuple[float, float]] = {},
    noise: Mapping[str, float] = {},
    units: Mapping[str, str] = {},
    degrees: bool | None = None,
    quantum: float = 0.0,
    offsets: bool = True,
    starts: int = 6,
    seed: int = 0,
    delay: Sequence[str] = (),
    lag: Sequence[str] = (),
    gain: Sequence[str] = (),
    friction: Sequence[str] = (),
    backlash: Sequence[str] = (),
    clearance: Sequence[str] = (),
    cubic: Sequence[str] = (),
    asymmetry: Sequence[str] = (),
    viscous: Sequence[str] = (),
    softening: Sequence[str] = (),
    turned: Sequence[str] = (),
    fading: Sequence[str] = (),
    crosstalk: Sequence[str] = (),
    drift: Sequence[str] = (),
    hum: Mapping[str, float] = {},
    robust: bool = False,
    follow: int = 0,
    names: Mapping[str, str] = {},
    skip: int = 0,
    encoding: str = "",
    fmu: str | os.PathLike[str] | None = None,
) -> Identification:
    """Estimate parameters of the testbed from one experiment or several.

    Sensor offsets and the state at the first sample are estimated, too. All values are in SI.

    Parameters
    ----------
    files
        CSV tables, DataFrames or dicts of arrays for `prw.read`, or return values of `prw.read` or `prw.simulate`.
    estimate
        Names of the parameters to estimate, or one name.
    priors
        Prior knowledge by parameter: the standard deviation as a fraction of the parameter's start value
        (0.1 is 10 %, 1 the most), or (value, fraction). The parameter is then estimated, too.
    parameters
        Other start values, or values of fixed parameters, as for `prw.simulate`.
    bounds
        (least, greatest) by parameter.
    noise
        Known standard deviations by channel.
    units, degrees, names, skip, encoding
        As for `prw.read`.
    quantum
        Resolution of the motors' encoders, rad (default: found in the data).
    offsets
        Whether sensors may have offsets.
    starts, seed
        Number of starting points, and the seed of their random generator.
    delay, lag, gain, drift
        Channels with an unknown delay, first-order lag, gain or slow drift, which are then estimated, too.
    friction
        Where there is dry friction (N.m), which is then estimated, too: "shafts" (equal in both input shafts), "shaft1", "shaft2",
        "output" (equal about pitch and roll), "motor1", "motor2".
    backlash
        Springs that have backlash (rad), "k1" or "k2" (equal on both sides), or "motors". The dampers c1 and c2 have none.
    clearance
        Couplings that have clearance (rad), "k1" or "k2" (equal on both sides): neither spring nor damper acts in it, and the coupling
        lets go when its torque would pull.
    cubic
        Springs with the torque k (twist + cubic twist^3), cubic in 1/rad^2: "k1", "k2".
    asymmetry
        "k1", "k2", "c1", "c2": side 2 differs from side 1 by a fraction of the parameter, which is the value of side 1.
    viscous
        Where there is viscous friction (N.m.s/rad): "shafts" (equal in both input shafts), "between" (equal in both shafts between the
        couplings).
    softening
        "k1", "k2": the stiffness decreases linearly by a fraction during each recording; the parameter is its value at the beginning.
    turned
        "imu": the inertial sensor is turned about the axis that is vertical to pitch and roll (rad).
    fading
        Channels whose gain decreases linearly from 1 by a fraction during each recording.
    crosstalk
        Torque channels to which the other torque adds a share: "tau1", "tau2", or "torques" (equal in both).
    hum
        Frequency in Hz by channel that contains hum of the mains, such as {"tau1": 50}. Its frequency may differ by up to 0.5 Hz, but must
        be exact if the motors move the channel at this frequency, too; the hum is then estimated with the parameters.
    robust
        Whether values that are more than 4 standard deviations from the model count less, as spikes of a sensor: beyond this limit, the
        loss grows linearly instead of quadratically. The motors' angles have no such limit.
    follow
        Maximum number of steps in which the first cause of a misfit is assumed and the fit is repeated. A step is not taken if
        several causes explain the data, or if the cause needs a correction of the recording. See `assumed` and `stopped`.
    fmu
        The testbed FMU (default: as for `prw.simulate`).

    Returns
    -------
    Identification
        Estimates, standard errors, notes and warnings. If friction, backlash, cubic stiffness or drift explains what the model
        cannot, they are estimated without a request: see `additions`. Data that remain unexplained raise no error, nor do
        undetermined parameters: see `fits`, `misfits`, `diagnosis` and `undetermined`.

    Raises
    ------
    UserError
        A file cannot be read or has too few values, a name is not known, or the FMU rejects a value.
    """
    need("scipy", "threadpoolctl")
    # These imports are slow.
    from threadpoolctl import threadpool_limits

    from prw.arguments import values_of
    from prw.identification.design import advice
    from prw.identification.diagnosis import Explanation, explain, over_time
    from prw.identification.experiment import may_be_simulated, prepare
    from prw.identification.fit import fit, no_hum
    from prw.identification.kinds import KINDS
    from prw.identification.model import Model
    from prw.identification.outliers import fit_robustly
    from prw.identification.response import Distortion
    from prw.identification.results import Identification
    from prw.identification.statistics import certainty
    from prw.identification.verdict import judge
    from prw.recording import Recording, check_units, read_columns
    from prw.simulation import Run

    starts, seed, follow = counted("starts", starts), counted("seed", seed, 0), counted("follow", follow, 0)
    offsets, robust = flag("offsets", offsets), flag("robust", robust)
    quantum = not_negative("quantum", quantum)
    one = is_path(files) or is_table(files) or isinstance(files, Recording) or not isinstance(files, Iterable)
    several = cast("list[Source]", [files] if one else list(cast("Iterable[Source]", files)))
    if not several:
        raise UserError("at least one is needed", argument="files")
    if all(isinstance(each, (Recording, Run)) for each in several):
        reading = {"units": units, "degrees": degrees is not None, "names": names, "skip": skip, "encoding": encoding}
        for argument, chosen in reading.items():
            if chosen:
                raise UserError("is for files and tables, and these recordings were read before", argument=argument)
    places = {
        "delay": delay,
        "lag": lag,
        "gain": gain,
        "friction": friction,
        "backlash": backlash,
        "clearance": clearance,
        "cubic": cubic,
        "asymmetry": asymmetry,
        "viscous": viscous,
        "softening": softening,
        "turned": turned,
        "fading": fading,
        "crosstalk": crosstalk,
    }
    requested = {kind: names_of(kind, given) for kind, given in places.items()}
    drift = names_of("drift", drift)
    # There are many small matrices, with which more threads would be slower.
    with Model(fmu) as model, threadpool_limits(1):
        distortions = tuple(
            dict.fromkeys(Distortion(kind, name) for kind, given in requested.items() for name in given)
        )
        given = values_of(parameters, model.loaded)
        task = task_of(model.known, estimate, priors, given, bounds, noise, offsets, distortions, drift, hum)
        measured = [
            each.recording()
            if isinstance(each, Run)
            else each
            if isinstance(each, Recording)
            else read_columns(each, units, degrees, CHANNELS, names, skip, encoding)
            for each in several
        ]
        check_units(units, measured)
        _check_different(measured)
        channels = dict.fromkeys(name for m in measured for name in m.measured)
        for argument, named in (("noise", noise), *requested.items(), ("drift", drift), ("hum", hum)):
            check_names(argument, named, argument in KINDS and KINDS[argument].places or channels)
        rates: list[Rates] = [
            "motors" if not isinstance(each, Run) else "angles" if each.motion.omega is None else "inputs"
            for each in several
        ]
        how = [(quantum, rate, rate != "motors", hum) for rate in rates]
        experiments = [prepare(each, *more) for each, more in zip(measured, how)]
        # Recordings with very exact motor angles may be simulations of the FMU, in which the motors jump between steps. If the
        # model does not explain the data, these recordings are compared with the FMU's own steps.
        exact = [may_be_simulated(experiment) for experiment in experiments]
        ways: tuple[Rates, ...] = ("inputs", "angles") if any(exact) else ()
        assumed: list[str] = []

        def fitted(task: Task) -> tuple[list[Experiment], Solution]:
            if robust:
                return fit_robustly(model, experiments, task, starts, seed)
            return experiments, fit(model, experiments, task, starts, seed)

        while True:
            used, solution = fitted(task)
            if absent := no_hum(solution):
                task = replace(task, hum={name: at for name, at in task.hum.items() if name not in absent})
                experiments = [
                    replace(e, notes=(*e.notes, *(note for name, note in absent.items() if name in e.channels)))
                    for e in experiments
                ]
                used, solution = fitted(task)
            verdict = judge(solution)
            for way in ways:
                if not verdict.fits:
                    again = [
                        prepare(m, quantum, way, hum=hum) if x else e for m, x, e in zip(measured, exact, experiments)
                    ]
                    other = fit(model, again, task, starts, seed)
                    if (better := judge(other)).fits:
                        experiments = used = again
                        solution, verdict = other, better
            found = Explanation(solution, verdict, (), ()) if verdict.fits else explain(solution, verdict)
            if robust and found.verdict.fits and found.causes:
                # What was added explains some of the values that the model alone did not.
                used, solution = fitted(found.solution.task)
                verdict = judge(solution)
                wider = np.maximum(verdict.widening, found.verdict.widening)
                found = found._replace(solution=solution, verdict=verdict._replace(widening=wider))
            stopped = "" if found.verdict.fits or not follow else found.unclear
            if found.verdict.fits or stopped or len(assumed) == follow:
                break
            assumed.append(found.causes[0].text)
            task = found.causes[0].applied(task)
        if follow and not found.verdict.fits and not stopped:
            stopped = f"the limit of {follow} is reached"
        # The data of a jump may fit an even decrease, too.
        steady = found.known and not any(cause.argument == "softening" for cause in found.causes)
        parts = [] if found.verdict.fits or steady else over_time(model, measured, task, how)
        sure = certainty(found.solution, found.verdict.widening)
        hints = advice(model, used, found.solution) if sure.undetermined else []
        sources = tuple(str(each.source) for each in measured)
        judged = found, tuple(parts), tuple(hints), tuple(assumed), stopped
        return Identification(model.fmu, model.known, sources, tuple(used), found.solution, sure, *judged)


def _check_different(measured: Sequence[Recording]) -> None:
    """Raise UserError if a recording contains the rows of another one, which would count twice and narrow the intervals."""
    for (i, one), (j, other) in combinations(enumerate(measured, 1), 2):
        short, long = (one, other) if len(one.time) <= len(other.time) else (other, one)
        _, at, rows = np.intersect1d(short.time, long.time, assume_unique=True, return_indices=True)
        shared = [name for name in short.measured if name in long.measured]
        if not shared or len(at) < len(short.time):
            continue
        if all(np.array_equal(short[name][at], long[name][rows], equal_nan=True) for name in (*ANGLES, *shared)):
            raise UserError(
                f"{one.source} and {other.source} (files {i} and {j}) contain the same measurements, which would count twice; "
                "name each experiment once"
            )


def task_of(
    known: Parameters,
    estimate: str | Iterable[str],
    priors: Mapping[str, float | tuple[float, float]] = {},
    parameters: Mapping[str, float] = {},
    bounds: Mapping[str, tuple[float, float]] = {},
    noise: Mapping[str, float] = {},
    offsets: bool = True,
    distortions: tuple[Distortion, ...] = (),
    drift: tuple[str, ...] = (),
    hum: Mapping[str, float] = {},
) -> Task:
    """The task that these arguments of `identify` describe, for an FMU with the parameters `known`. Raises UserError for a
    name that is not known, or a value that is out of range."""
    from prw.columns import MEASURED
    from prw.identification.fit import Prior, Task

    estimate = names_of("estimate", estimate)
    counts = f"; {', '.join(known.counts)} are counted, not estimated" if known.counts else ""
    for argument, names in (("estimate", estimate), ("priors", priors), ("parameters", parameters), ("bounds", bounds)):
        check_names(argument, names, known.real, counts)
    check_names("noise", noise, MEASURED)
    start = {**known.starts, **parameters}
    if not estimate and not priors:
        raise UserError(f"nothing is named; there are {', '.join(known.real)}", argument="estimate")
    beliefs = {name: Prior(*spread_of("priors", name, p, start[name])) for name, p in priors.items()}
    chosen = tuple(name for name in known.real if name in estimate or name in beliefs)
    for name, value in parameters.items():
        not_negative("parameters", value, name)
    for name, value in noise.items():
        positive("noise", value, name)
    for name, frequency in hum.items():
        positive("hum", frequency, name)
    for name, span in bounds.items():
        if name not in chosen:
            raise UserError(
                f"{name} is not estimated, so it needs no bounds; estimate it, or omit them", argument="bounds"
            )
        if not isinstance(span, Sequence) or len(span) != 2:
            raise UserError(f"{name} {span!r}; write (least, greatest)", argument="bounds")
        if not positive("bounds", span[0], name) < positive("bounds", span[1], name):
            raise UserError(
                f"{name} from {span[0]:g} to {span[1]:g}; the first must be below the second", argument="bounds"
            )
    # 0 has no logarithm, so the search for such a parameter begins at its prior or in the middle of its bounds.
    for name in chosen:
        if start[name] == 0 and name in beliefs:
            start[name] = beliefs[name].value
        elif start[name] == 0 and name in bounds:
            start[name] = math.sqrt(bounds[name][0] * bounds[name][1])
        elif start[name] == 0:
            raise UserError(
                f"{name} starts at 0, from where it cannot be estimated; give it another start value, bounds, or a prior with a value"
            )
    spans = {**{name: (value / BOUNDS_FACTOR, value * BOUNDS_FACTOR) for name, value in start.items()}, **bounds}
    return Task(chosen, start, spans, beliefs, dict(noise), offsets, distortions, drift, dict(hum))
