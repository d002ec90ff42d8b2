"""The parameters of each run of a sweep: from a table, from a grid, or drawn at random."""

from __future__ import annotations

import itertools
import json
import math
import os
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from prw.arguments import (
    Table,
    check_names,
    columns_of,
    counted,
    finite_numbers,
    in_own_unit,
    is_path,
    is_real,
    is_table,
    numbers_of,
    spread_of,
)
from prw.errors import UserError
from prw.files import check_regular, read_text
from prw.motion import Array
from prw.table import read_table
from prw.testbed import Testbed

if TYPE_CHECKING:
    from prw.identification.results import Identification

MAX_RUNS = 10_000_000
#: Tolerance of the entries of a correlation matrix, which may be rounded.
EXACT = 1e-3
#: How points are drawn: independently, or more evenly by `scipy.stats.qmc`.
SAMPLINGS = ("random", "latin", "sobol")
#: The distribution of a parameter, see `prw.sweep`.
Spread = float | tuple[float, float] | tuple[str, float, float]
#: Distributions by parameter, or an identification (or its report.json) with the joint distribution of its estimates.
Random: TypeAlias = "Mapping[str, Spread] | Identification | str | os.PathLike[str]"


class Joint(NamedTuple):
    """The lognormal distribution of the parameters that an identification has estimated.

    Attributes
    ----------
    medians
        Estimates in SI, by name.
    relative
        (p,), their relative standard errors.
    correlation
        (p, p), their correlation.
    others
        The parameters that were not estimated, in SI.
    """

    medians: dict[str, float]
    relative: Array
    correlation: Array
    others: dict[str, float]


def joint_of(random: Identification | str | os.PathLike[str]) -> Joint:
    """The distribution of the estimates of an identification, or of its file report.json. Raises UserError if it cannot be read,
    or if the parameters were not identified."""
    where = str(random) if is_path(random) else "the identification"
    try:
        content = json.loads(read_text(Path(random)) if is_path(random) else random.to_json())  # type: ignore[arg-type, union-attr]
        names, matrix = list(content["correlation"]["names"]), content["correlation"]["matrix"]
        entries, identified = dict(content["parameters"]), content["identified"]
        if not all(isinstance(name, str) for name in names):
            raise TypeError
    except OSError as error:
        raise UserError(f"{random} cannot be read ({error.strerror or error})", argument="random") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        wrong = f"{random!r} is neither a dict of distributions, nor an identification or its report.json"
        raise UserError(
            f"{random} is not a report.json of an identification" if is_path(random) else wrong, argument="random"
        ) from None
    if identified is not True:
        raise UserError(
            "the data did not determine the parameters, or the FMU does not explain the data; give the distributions yourself",
            argument="random",
        )
    values = {name: _entry(where, f"parameters.{name}.value", entry, "value") for name, entry in entries.items()}
    correlation = _correlation(where, names, matrix)
    chosen = [k for k, name in enumerate(names) if name in entries]  # Distortions are not parameters of the FMU.
    medians = {names[k]: values[names[k]] for k in chosen}
    for name, value in medians.items():
        if value <= 0:
            raise UserError(f"{where}: parameters.{name}.value is {value:g}; it must be above 0", argument="random")
    key = "relative_standard_error"
    relative = np.array([_entry(where, f"parameters.{name}.{key}", entries[name], key) for name in medians])
    for name, deviation in zip(medians, relative):
        if deviation < 0:
            raise UserError(
                f"{where}: parameters.{name}.{key} is {deviation:g}; it must be at least 0", argument="random"
            )
    others = {name: value for name, value in values.items() if name not in medians}
    return Joint(medians, relative, correlation[np.ix_(chosen, chosen)], others)


def _entry(where: str, name: str, entry: Any, key: str) -> float:
    """The finite number `entry[key]` of a report. Raises UserError, which calls it `name`."""
    value = entry.get(key) if isinstance(entry, dict) else None
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= sys.float_info.max:
        raise UserError(f"{where}: {name} is {value!r}, not a finite number", argument="random")
    return float(value)


def _correlation(where: str, names: list[str], matrix: Any) -> Array:
    """The correlation matrix (p, p) of a report. Raises UserError that names the first entry that cannot be right."""
    p = len(names)
    if not isinstance(matrix, list) or [len(row) if isinstance(row, list) else -1 for row in matrix] != [p] * p:
        raise UserError(f"{where}: correlation.matrix needs {p} rows and columns, one for each name", argument="random")
    if doubled := [name for k, name in enumerate(names) if name in names[:k]]:
        raise UserError(f"{where}: correlation.names has {doubled[0]} twice", argument="random")
    pairs = [(i, j) for i in range(p) for j in range(p)]
    called = {(i, j): f"correlation.matrix[{i}][{j}], of {names[i]} with {names[j]}," for i, j in pairs}
    found = np.reshape([_entry(where, called[i, j], {"": matrix[i][j]}, "") for i, j in pairs], (p, p))
    for i, j in pairs:
        if abs(found[i, j]) > 1 + EXACT or (i == j and abs(found[i, j] - 1) > EXACT):
            right = "1" if i == j else "between -1 and 1"
            raise UserError(f"{where}: {called[i, j]} is {found[i, j]:g}; it must be {right}", argument="random")
        if abs(found[i, j] - found[j, i]) > EXACT:
            raise UserError(
                f"{where}: {called[i, j]} is {found[i, j]:g}, but {found[j, i]:g} in the other order", argument="random"
            )
    if p and (least := float(np.linalg.eigvalsh(found)[0])) < -EXACT * p:
        raise UserError(
            f"{where}: correlation.matrix has the eigenvalue {least:.3g}; no parameters have such correlations",
            argument="random",
        )
    return found


def tabulated(table: Table | str | os.PathLike[str], testbed: Testbed, fixed: Mapping[str, Any]) -> dict[str, Array]:
    """The columns of a table, (runs,) by parameter. Raises UserError if it cannot be read or has other columns than parameters."""
    where = "table"
    if is_path(table):
        where = str(table)
        read = _parquet if Path(where).suffix.lower() == ".parquet" else _csv
        columns = read(Path(where), lambda names: _check("table", names, testbed))
    elif is_table(table):
        columns = columns_of(table)
    else:
        raise UserError(f"{table!r} is neither a table nor the path of a CSV or Parquet file", argument="table")
    _check("table", columns, testbed)
    if both := [name for name in columns if name in fixed]:
        raise UserError(f"{both[0]} is also in parameters; choose one", argument="table")
    values = {name: numbers_of(f"{where}: {name}", column) for name, column in columns.items()}
    lengths = {len(column) for column in values.values()}
    if len(lengths) != 1 or not 0 < min(lengths) <= MAX_RUNS:
        raise UserError(f"needs 1 to {MAX_RUNS} rows and equally long columns", argument="table")
    for name, column in values.items():
        if not np.isfinite(column).all():
            row = int(np.isfinite(column).argmin()) + 1
            raise UserError(f"{name} has values that are not finite numbers, first in row {row}", argument="table")
    return values


def _csv(path: Path, check: Callable[[Collection[str]], None]) -> dict[str, Array]:
    """The columns of a CSV file, with the rules of recordings. check: raises UserError for a wrong name."""
    names: list[str] = []

    def choose(header: Sequence[str], line: int) -> Sequence[tuple[str, int]]:
        check(header)
        names.extend(header)
        return [(name, k) for k, name in enumerate(header)]

    table = read_table(path, choose, least=1)
    return dict(zip(names, table.T))


def _parquet(path: Path, check: Callable[[Collection[str]], None]) -> dict[str, Any]:
    """The columns of a Parquet file. check: raises UserError for a wrong name."""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        check_regular(path)
        check(parquet.read_schema(path).names)
        read = parquet.read_table(path, partitioning=None)
    except (OSError, pa.ArrowException) as error:
        raise UserError(f"{path}: cannot be read ({error})") from None
    return {name: read[name].to_numpy() for name in read.column_names}


def _check(argument: str, names: Collection[str], testbed: Testbed) -> None:
    """Raise UserError for a name that is not a Real parameter, or that is there twice."""
    variables = testbed.loaded.variables.values()
    integers = [v.name for v in variables if v.causality == "parameter" and "Int" in v.type]
    more = f"; {', '.join(integers)} are integers, which a sweep does not vary" if integers else ""
    check_names(argument, names, testbed.starts, more)
    if doubled := [name for k, name in enumerate(names) if name in list(names)[:k]]:
        raise UserError(f"two columns are called {doubled[0]}; rename or remove one", argument=argument)


def layout(
    grid: Mapping[str, ArrayLike],
    random: Mapping[str, Spread] | Joint,
    runs: int,
    seed: int,
    sampling: str,
    testbed: Testbed,
    fixed: Mapping[str, Any],
) -> dict[str, Array]:
    """The values of each parameter that varies, one value per run: all combinations of the grid, each with its own draws. If
    only a relative standard deviation is given, the median is the value in `fixed` or the FMU's start value. Raises UserError for
    invalid arguments."""
    drawn = random.medians if isinstance(random, Joint) else random
    starts = {**testbed.starts, **fixed}
    _check("grid", grid, testbed)
    _check("random", drawn, testbed)
    # A value in `fixed` is the median of a distribution that has none of its own.
    centred = {*drawn} if isinstance(random, Joint) else {name for name in drawn if _has_median(random[name])}
    for name in (*grid, *drawn):
        if (name in grid) + (name in drawn) + (name in fixed and (name in grid or name in centred)) > 1:
            raise UserError(f"{name} is in more than one of grid, random and parameters; choose one")
    if not grid and not drawn:
        raise UserError("nothing varies; give values of a parameter (grid), its distribution (random) or a table")
    draws = counted("runs", runs) if drawn else 1
    counted("seed", seed, least=0)
    axes = {
        name: _column(name, in_own_unit(name, values, testbed.loaded, argument="grid")) for name, values in grid.items()
    }
    total = math.prod(map(len, axes.values())) * draws
    if total > MAX_RUNS:
        raise UserError(f"{total} runs are more than the limit of {MAX_RUNS}; give fewer values (grid) or draws (runs)")
    combinations = np.array(list(itertools.product(*axes.values())), dtype=np.float64).reshape(
        total // draws, len(axes)
    )
    table = dict(zip(axes, np.repeat(combinations, draws, axis=0).T))
    scores = _scores(sampling, len(drawn), draws, total // draws, seed)
    if isinstance(random, Joint):
        values, vectors = np.linalg.eigh(random.correlation)
        correlated = scores @ (vectors * np.sqrt(np.maximum(values, 0))).T
        return table | {
            name: median * np.exp(random.relative[k] * correlated[:, k])
            for k, (name, median) in enumerate(random.medians.items())
        }
    return table | {name: _drawn(name, spread, starts[name], z) for (name, spread), z in zip(random.items(), scores.T)}


def _scores(sampling: str, parameters: int, draws: int, combinations: int, seed: int) -> Array:
    """Draws (combinations * draws, parameters) from the standard normal distribution. Raises UserError for an unknown method."""
    if sampling not in SAMPLINGS:
        raise UserError(f"{sampling!r} is not known; there are {', '.join(SAMPLINGS)}", argument="sampling")
    if sampling == "random" or not parameters:
        return np.random.default_rng(seed).standard_normal((parameters, combinations * draws)).T
    from scipy.special import ndtri
    from scipy.stats import qmc

    if sampling == "sobol" and draws.bit_count() != 1:
        least = 1 << draws.bit_length()
        raise UserError(f"must be a power of 2 with sobol, such as {least}", argument="runs", given=draws)
    engine = (qmc.Sobol if sampling == "sobol" else qmc.LatinHypercube)(parameters, rng=np.random.default_rng(seed))
    shares = np.vstack([engine.random(draws) for _ in range(combinations)])
    return np.asarray(ndtri(np.clip(shares, 2.0**-60, 1 - 2.0**-53)))


def _has_median(spread: Spread) -> bool:
    """Whether a distribution consists of more than a relative standard deviation."""
    return isinstance(spread, Sequence) and (len(spread) != 2 or not isinstance(spread[0], str))


def _drawn(name: str, spread: Spread, start: float, scores: Array) -> Array:
    """Convert standard normal draws (count,) to another distribution, see `sweep`. Raises UserError for an invalid one."""
    named = isinstance(spread, tuple) and spread and isinstance(spread[0], str)
    kind, *numbers = spread if named else ("lognormal", spread)  # type: ignore[misc]
    if kind == "lognormal":
        median, relative = spread_of("random", name, tuple(numbers) if len(numbers) != 1 else numbers[0], start)
        return median * np.exp(relative * scores)
    finite = len(numbers) == 2 and all(is_real(n) and math.isfinite(float(n)) for n in numbers)
    one, other = map(float, numbers) if finite else (math.nan, math.nan)
    if kind == "uniform" and one < other:
        from scipy.special import ndtr

        return np.asarray(one + (other - one) * ndtr(scores))
    if kind == "normal" and other > 0:
        return one + other * scores
    raise UserError(
        f'{name} {spread!r}: write ("uniform", low, high), ("normal", mean, deviation) or ("lognormal", median, relative)',
        argument="random",
    )


def _column(name: str, values: Any) -> Array:
    column = finite_numbers(values)
    # The range is not checked here: if the FMU rejects a value, only the runs with this value fail.
    if column is None or not len(column):
        raise UserError(f"{name} must have one or more finite numbers as values, not {values!r}")
    return column
