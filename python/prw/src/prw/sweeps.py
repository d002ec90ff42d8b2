"""Parameter studies and Monte Carlo over thousands of runs of the testbed: `sweep`."""

from __future__ import annotations

import contextlib
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, get_args

import fmu_run
from numpy.typing import ArrayLike

from prw.arguments import Given, Table, check_names, counted, names_of, numbers_of, values_of
from prw.batch import Part, Request, run_part
from prw.draws import SAMPLINGS, Joint, Random, joint_of, layout, tabulated
from prw.errors import Interrupted, UserError, need
from prw.motion import Array, Motion
from prw.parts import TABLE, Parts, digest, part_size, record_in, versions
from prw.progress import Progress
from prw.recording import Recording
from prw.simulation import Run, motion_of
from prw.testbed import CONTINUOUS, Testbed, existing_fmu

if TYPE_CHECKING:
    import pyarrow

#: The default statistics of each output.
STATISTICS: tuple[fmu_run.Measure, ...] = ("peak", "rms", "end")
#: The default number, seed and method of random draws.
DRAWS: dict[str, Any] = {"runs": 1000, "seed": 0, "sampling": SAMPLINGS[0]}


def sweep(
    grid: Mapping[str, ArrayLike] | None = None,
    random: Random | None = None,
    *,
    table: Table | str | os.PathLike[str] | None = None,
    again: str | os.PathLike[str] | None = None,
    parameters: Given = None,
    runs: int | None = None,
    seed: int | None = None,
    sampling: str | None = None,
    outputs: str | Sequence[str] | None = None,
    statistics: str | Sequence[str] | None = None,
    trajectories: int | None = None,
    motion: Motion | Recording | Run | str | os.PathLike[str] | Table | None = None,
    threads: int | None = None,
    scheduler: str | None = None,
    fmu: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> pyarrow.Table:
    """Run the testbed with many sets of parameters.

    Parameters
    ----------
    grid
        Values by parameter, in SI or with a unit as ([1.5, 1.9], "N.m/deg"); all combinations are run.
    random
        The distribution of each parameter, in SI: ("uniform", low, high), ("normal", mean, standard deviation) or
        ("lognormal", median, relative standard deviation). For a lognormal distribution, (median, relative) suffices,
        or only the relative standard deviation (0.1 is 10 %) if the median is the start value.
        Or the result of `prw.identify`, or its file report.json: the estimates are then drawn with their correlation, and the
        parameters that were not estimated have the values with which the estimates were found.
    table
        The parameters of each run, instead of `grid` and `random`: a DataFrame, a dict of arrays, or a CSV or Parquet file whose
        columns are parameters in SI.
    again
        A file runs.parquet, whose sweep is repeated with the parameters, outputs and statistics that the file contains. `motion` and
        `fmu` must be as in that sweep, and `out` may not contain a finished sweep. Only `threads`, `scheduler` and `out` may be given
        in addition to these.
    parameters
        Values that are the same in all runs, as for `prw.simulate`.
    runs, seed
        Number of random draws for each combination of the grid (default: 1000), and their seed (default: 0).
    sampling
        How draws are distributed: "random" (default), "latin" (Latin hypercube) or "sobol" (scrambled Sobol points; `runs` must be a
        power of 2). The last two cover the distribution more evenly, so that averages need fewer runs.
    outputs
        Names of the outputs, any Real variables (default: those of `prw.simulate`).
    statistics
        Statistics of each output, as for `measures` of `fmu_run.Fmu.run` (default: peak, rms and end).
    trajectories
        Every how many samples the outputs are written into the directory `trajectories` in `out`; by default they are not. Its
        Parquet files have a row for each run and sample, and can be read as one data set.
    motion, fmu
        As for `prw.simulate`.
    threads
        Number of threads (default: one for each processor).
    scheduler
        The address of the scheduler of a Dask cluster. The simulations then run on the cluster instead of in this process.
    out
        A directory, in which the table is written as runs.parquet. Until then, finished runs are in its directory `parts`. If the
        sweep is interrupted, the same call continues it; with other arguments, it raises UserError. Without `out`, the finished runs
        are in the attribute `table` of the exception KeyboardInterrupt.
    progress
        Called with the numbers of finished runs and of all runs: first with the runs that are kept from `out`, then repeatedly.

    Returns
    -------
    pyarrow.Table
        An Arrow table with a row for each run; its method to_pandas makes a DataFrame. The columns are `run`; `status`,
        "done" or "failed"; `message`, the cause of a failure, for example that the FMU rejects a value; the parameters that vary;
        and the statistics of each output in SI. For the roll these are `roll_peak`, the peak of its magnitude; `roll_rms`; and
        `roll_end`, its value at the end. The metadata of its schema contain, as JSON, the arguments, the guid of the FMU, the
        versions of the packages and the hash of the motion.

    Raises
    ------
    UserError
        An argument is out of range, a file cannot be read or written, `out` contains another sweep, or the cluster does not respond.

    Warns
    -----
    UserWarning
        A file in `out` is damaged, so its runs are repeated.
    RuntimeWarning
        All runs failed.
    """
    need("pyarrow", "scipy", *(["distributed"] if scheduler is not None else []))
    if scheduler is not None and threads is not None:
        raise UserError("is for this machine, not for a cluster (scheduler); omit one", argument="threads")
    threads = counted("threads", threads) if threads is not None else os.cpu_count() or 1
    draws: dict[str, Any] = {"runs": runs, "seed": seed, "sampling": sampling}
    moved = motion_of(motion)
    with Testbed(existing_fmu(fmu)) as testbed:
        if again is not None:
            own = (grid, random, table, parameters, outputs, statistics, trajectories, *draws.values())
            if any(given is not None for given in own):
                raise UserError("repeats a sweep with its own arguments; omit them", argument="again", given=again)
            if out is not None and (Path(out) / TABLE).exists():
                raise UserError(
                    f"{Path(out) / TABLE} exists, so nothing would be repeated; name another directory, or remove it",
                    argument="out",
                )
            request, values, record = _recorded(Path(again), testbed, moved)
        else:
            if random is None:
                for name, given in draws.items():
                    if given is not None:
                        raise UserError(
                            "is for random draws; give a distribution (random), or omit it", argument=name, given=given
                        )
            draws = {name: DRAWS[name] if given is None else given for name, given in draws.items()}
            fixed = values_of(parameters, testbed.loaded)
            joint = random if random is None or isinstance(random, Mapping) else joint_of(random)
            if isinstance(joint, Joint):
                fixed = {**{n: v for n, v in joint.others.items() if n not in (grid or {})}, **fixed}
            testbed.with_starts(fixed)
            if grid is not None and not isinstance(grid, Mapping):
                raise UserError(f"{grid!r} is not a mapping from parameters to values", argument="grid")
            if table is None:
                values = layout(grid or {}, joint or {}, testbed=testbed, fixed=fixed, **draws)
            elif grid is not None or random is not None:
                raise UserError("replaces grid and random; choose one", argument="table")
            else:
                values = tabulated(table, testbed, fixed)
            request = _request(moved, fixed, outputs, statistics, trajectories, testbed)
            drawn = draws if random is not None else {}
            distribution = joint._asdict() if isinstance(joint, Joint) else joint
            record = {"grid": grid, "random": distribution, **drawn, **_record(request, values, testbed)}
        if request.every and out is None:
            raise UserError("are written into a directory; give it as out", argument="trajectories")
        samples = len(moved.time) * (len(request.outputs) if request.every == 1 else 1)
        size = part_size(len(next(iter(values.values()))), samples)
        parts = Parts(record, values, size, None if out is None else Path(out))
        with parts.opened():
            for note in parts.notes:
                warnings.warn(note, UserWarning, stacklevel=2)
            found = _complete(parts, testbed, request, values, threads, scheduler, progress)
    if "done" not in found["status"].to_pylist():
        all_runs = "the only run" if found.num_rows == 1 else f"all {found.num_rows} runs"
        warnings.warn(f"{all_runs} failed; run 0: {found['message'][0]}", RuntimeWarning, stacklevel=2)
    return found


def _request(
    motion: Motion,
    fixed: Mapping[str, Any],
    outputs: str | Sequence[str] | None,
    statistics: str | Sequence[str] | None,
    trajectories: int | None,
    testbed: Testbed,
) -> Request:
    names = testbed.loaded.outputs if outputs is None else names_of("outputs", outputs)
    chosen = STATISTICS if statistics is None else names_of("statistics", statistics)
    known = testbed.loaded.variables
    check_names("outputs", names, [name for name in known if known[name].type in CONTINUOUS])
    check_names("statistics", chosen, get_args(fmu_run.Measure))
    for argument, given in (("outputs", names), ("statistics", chosen)):
        if not given or len(set(given)) != len(given):
            raise UserError("needs at least one name, and each only once", argument=argument)
    every = None if trajectories is None else counted("trajectories", trajectories)
    return Request(motion, fixed, names, cast("tuple[fmu_run.Measure, ...]", chosen), every)


def _record(request: Request, values: Mapping[str, Array], testbed: Testbed) -> dict[str, Any]:
    """The part of the record that does not depend on how the values were chosen."""
    motion = request.motion
    return {
        "parameters": dict(request.fixed),
        "outputs": request.outputs,
        "statistics": request.statistics,
        "trajectories": request.every,
        "varied": list(values),
        "values": digest(*values.values()),
        "motion": {"name": motion.name, "sha256": digest(motion.time, motion.theta, motion.omega)},
        "fmu": {"guid": testbed.loaded.token},
        "versions": versions(),
    }


def _recorded(path: Path, testbed: Testbed, motion: Motion) -> tuple[Request, dict[str, Array], dict[str, Any]]:
    """The sweep whose result is a file. Raises UserError if the motion or the FMU are not those of the sweep."""
    import pyarrow as pa
    from pyarrow import parquet

    record = record_in(path)
    try:
        read = parquet.read_table(path, partitioning=None)
    except (OSError, pa.ArrowException) as error:
        raise UserError(f"{path}: cannot be read ({error})") from None
    values = {name: numbers_of(f"{path}: {name}", read[name]) for name in record["varied"] if name in read.column_names}
    chosen = tuple(record["outputs"]), tuple(record["statistics"])
    request = Request(motion, record["parameters"], *chosen, record["trajectories"])
    now = _record(request, values, testbed)
    if record["values"] != now["values"]:
        raise UserError(f"{path}: its parameters were changed after the sweep, so it cannot be repeated")
    if record["motion"].get("sha256") != now["motion"]["sha256"]:
        raise UserError(
            f"the sweep had another motion, {record['motion'].get('name')}; give that motion, not {motion.name}",
            argument="motion",
        )
    if record["fmu"] != now["fmu"]:
        raise UserError(
            f"the sweep ran the FMU with the guid {record['fmu'].get('guid')}, {testbed.fmu} is another one",
            argument="fmu",
        )
    return request, values, {**record, "versions": now["versions"]}


def _complete(
    parts: Parts,
    testbed: Testbed,
    request: Request,
    values: Mapping[str, Array],
    threads: int,
    scheduler: str | None,
    progress: Callable[[int, int], None] | None,
) -> pyarrow.Table:
    """Carry out the missing runs, and return the table of all."""
    missing = parts.missing()
    done = parts.runs - sum(part.stop - part.start for part in missing.values())
    with Progress(f"{parts.runs} runs", parts.runs) as shown, contextlib.ExitStack() as stack:

        def report(finished: int) -> None:
            shown(finished)
            if progress is not None:
                progress(finished, parts.runs)

        report(done)
        if not missing:
            results: Iterator[tuple[int, Part]] = iter(())
        elif scheduler is not None:
            from prw.cluster import on_cluster

            results = stack.enter_context(
                contextlib.closing(on_cluster(testbed.fmu, request, values, missing, scheduler))
            )
        else:
            results = (
                (
                    k,
                    run_part(
                        testbed,
                        request,
                        {n: v[part] for n, v in values.items()},
                        threads,
                        lambda now, _: report(done + now),
                    ),
                )
                for k, part in missing.items()
            )
        try:
            for index, found in results:
                parts.keep(index, found)
                done += missing[index].stop - missing[index].start
                report(done)
        except KeyboardInterrupt:
            more = "; start the same sweep again to continue" if parts.are_on_disk else ""
            raise Interrupted(f"{done} of {parts.runs} runs are finished{more}", parts.table()) from None
    return parts.finish()


def repeated(before: str | os.PathLike[str], now: pyarrow.Table) -> list[str]:
    """Names of the columns in which the table of a repeated sweep differs from the file of the earlier one."""
    from pyarrow import parquet

    earlier = parquet.read_table(before)
    names = dict.fromkeys([*now.column_names, *earlier.column_names])
    both = {*now.column_names} & {*earlier.column_names}
    return [name for name in names if name not in both or not now[name].equals(earlier[name])]
