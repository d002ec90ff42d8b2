"""`prw sweep` returns the same numbers as single runs, on this machine and on a cluster."""

from __future__ import annotations

import copy
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from lagrange import OUTPUTS
from scipy.stats import norm, qmc

import prw
from prw.errors import Interrupted
from prw.motion import fig4
from prw.testbed import Testbed


def rows(directory):
    return pq.read_table(directory / "runs.parquet").to_pylist()


def files(directory):
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def test_grid_random_and_failures(prw, tmp_path, fmu):
    # --workers is the name that --threads had in 0.2.0.
    result = prw("sweep", "--grid", "k1=-50:150:3", "--random", "c3=0.4:20%", "--runs", 4, "--workers", 2)
    assert result.returncode == 0, result.stderr
    assert "ran         12 runs on 2 threads" in result.stdout
    assert "failed      4 runs; run 0: the FMU stopped: k1 must be above 0" in result.stdout
    table = rows(tmp_path / "out" / "sweep")
    assert [row["run"] for row in table] == list(range(12))
    assert [row["status"] for row in table] == ["failed"] * 4 + ["done"] * 8
    assert np.std(np.log([row["c3"] for row in table])) == pytest.approx(0.2, rel=0.6)
    for row in (table[5], table[11]):
        with Testbed(fmu) as testbed:
            response = testbed.respond(fig4(), start={"k1": row["k1"], "c3": row["c3"]})
        for name in OUTPUTS:
            assert row[f"{name}_peak"] == np.abs(response[name]).max()
            assert row[f"{name}_rms"] == pytest.approx(np.sqrt(np.mean(response[name] ** 2)), rel=1e-12)
            assert row[f"{name}_end"] == response[name][-1]
    assert all(value is None for key, value in table[0].items() if key.endswith(("_peak", "_rms", "_end")))
    assert sorted(p.name for p in (tmp_path / "out" / "sweep").iterdir()) == ["runs.parquet"]


def test_dask_cluster(prw, tmp_path):
    """The runs are divided into several tasks, and all runs of the last task fail."""
    arguments = ["sweep", "--grid", "k1=150:-50:3", "--random", "c3=20%", "--runs", 20, "--trajectories", 500]
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        result = prw(*arguments, "--scheduler", address, "--out", "remote")
    assert result.returncode == 0, result.stderr
    assert f"60 runs on {address}" in result.stdout
    assert prw(*arguments, "--out", "local").returncode == 0
    assert files(tmp_path / "remote") == files(tmp_path / "local")
    result = prw(*arguments, "--scheduler", "foo", "--out", "absent")
    assert result.returncode == 1 and result.stderr.count("\n") == 1
    assert "--scheduler foo: no Dask scheduler responds there (missing port" in result.stderr


@pytest.mark.parametrize(
    "arguments, message",
    [
        ([], "nothing varies; give --grid, --random, --identified or --table"),
        (["--grid", "k1=1:2"], "--grid k1=1:2: write NAME=LOW:HIGH:N"),
        (["--grid", "k1=1:2:1"], "--grid k1=1:2:1: write NAME=LOW:HIGH:N, with an integer N of at least 2, or NAME="),
        (["--grid", "k1=1_0:20:2"], "--grid k1=1_0:20:2: write NAME=LOW:HIGH:N"),
        (["--random", "k1=1_0%"], "--random k1=1_0%: '1_0' is not a finite number above 0"),
        (["--grid", "M=3:5:2"], "M, N are integers, which a sweep does not vary"),
        (["--grid", "k1=1:2:2", "--runs", "30"], "--runs 30: is for random draws; give a distribution (random)"),
        (["--grid", "k1=1:2:2", "--sampling", "sobol"], "--sampling sobol: is for random draws; give a distribution"),
        (["--grid", "k1=1:2:2", "--degrees"], "--degrees and --radians belong to a recording (--input)"),
        (["--table", "a.csv", "--seed", "7"], "--seed 7: is for random draws; give a distribution (random)"),
        (["--random", "k1=5%", "--seed", "-1"], "--seed -1: must be an integer of at least 0"),
        (["--grid", "k9=1:2:3"], "--grid: k9 is not known"),
        (["--random", "k1=5"], "--random k1=5: write NAME=10%"),
        (["--random", "k1=5%", "--runs", "0"], "--runs 0: must be an integer of at least 1"),
        (["--random", "k1=5%", "--input", "none.csv"], "none.csv: cannot be read"),
        (["--random", "k1=5%", "--sampling", "sobol"], "--runs 1000: must be a power of 2 with sobol, such as 1024"),
        (["--random", "k1=5%", "--outputs", "yaw"], "--outputs: yaw is not known; there are theta1"),
        (["--random", "k1=5%", "--statistics", "median"], "--statistics: median is not known; there are min, max"),
        (["--random", "k1=5%", "--trajectories", "0"], "--trajectories 0: must be an integer of at least 1"),
        (["--random", "k1=5%", "--identified", "a.json"], "--identified: replaces --random; choose one"),
        (["--identified", "a.json"], "--identified: a.json cannot be read (No such file or directory)"),
        (["--table", "a.csv", "--grid", "k1=1:2:3"], "--table: replaces grid and random; choose one"),
        (["--identified", "p.json"], "--identified: p.json is not a report.json of an identification"),
        (["--table", "a.csv"], "a.csv: cannot be read (No such file or directory)"),
        (["--again", "a.parquet"], "a.parquet: cannot be read"),
        (["--again", "a.parquet", "--grid", "k1=1:2:3"], "--again a.parquet: repeats a sweep with its own arguments"),
        (["--again", "a.parquet", "--runs", "70"], "--again a.parquet: repeats a sweep with its own arguments"),
    ],
)
def test_wrong_options(prw, tmp_path, arguments, message):
    (tmp_path / "p.json").write_text('{"parameters": {}}')
    result = prw("sweep", *arguments)
    assert result.returncode == 1 and message in result.stderr and result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("k1,k2\n100,50\n1_00,50\n", "row 3, column k1: '1_00' is not a number"),
        ("k1\ntrue\nfalse\n", "row 2, column k1: 'true' is not a number"),
        ("k1,k1\n1,2\n3,4\n", "table: two columns are called k1; rename or remove one"),
        ("k1,note\n1,a\n3,b\n", "table: note is not known; there are J2"),
        ("k1\n1\nnan\n", "row 3, column k1: nan is not finite"),
        ("# mine\n k1 ; k2 \n100,5;50\n120;60\n", ""),
        ("k1,k2\n100.5,50\n", ""),
        ("k1,k2\n", "no rows below the header; at least one row is needed"),
    ],
)
def test_tables_are_read_as_recordings_are(fmu, tmp_path, content, message):
    path = tmp_path / "table.csv"
    path.write_text(content)
    if message:
        with pytest.raises(prw.UserError, match=message):
            prw.sweep(table=path, fmu=fmu)
    else:
        found = prw.sweep(table=path, outputs="roll", statistics="end", fmu=fmu)
        rows = found.num_rows
        assert found["k1"].to_pylist() == [100.5, 120.0][:rows] and found["k2"].to_pylist() == [50.0, 60.0][:rows]
    pq.write_table(pa.table([[1.0], [2.0]], names=["k1", "k1"]), tmp_path / "table.parquet")
    with pytest.raises(prw.UserError, match="two columns are called k1"):
        prw.sweep(table=tmp_path / "table.parquet", fmu=fmu)


def test_a_sweep_in_which_all_runs_fail(fmu):
    with pytest.warns(RuntimeWarning, match=r"all 2 runs failed; run 0: .*k1 must be above 0"):
        prw.sweep({"k1": [-1.0, -2.0]}, fmu=fmu)


def test_spreads_fixed_values_and_units(fmu):
    spreads = {"k1": ("uniform", 100.0, 120.0), "k2": ("normal", 50.0, 2.0), "c1": ("lognormal", 0.5, 0.1)}
    fixed = {"c3": 0.3, "c2": (0.007, "N.m.s/deg")}
    table = prw.sweep(random=spreads, parameters=fixed, runs=200, fmu=fmu).to_pandas()
    assert (table["status"] == "done").all() and "c3" not in table
    assert table["k1"].between(100, 120).all() and 4 < table["k1"].std() < 7
    assert abs(table["k2"].mean() - 50) < 0.6 and 1.6 < table["k2"].std() < 2.4
    assert abs(np.log(table["c1"] / 0.5).std() - 0.1) < 0.02
    run = prw.simulate(parameters={**table.loc[7, ["k1", "k2", "c1"]].to_dict(), **fixed}, fmu=fmu)
    assert np.abs(run["tau1"]).max() == table.loc[7, "tau1_peak"]
    assert run.parameters["c2"] == pytest.approx(0.007 * 180 / np.pi)
    grid = prw.sweep({"k1": ([1.5, 1.9], "N.m/deg")}, fmu=fmu)["k1"].to_numpy()
    np.testing.assert_allclose(grid, np.array([1.5, 1.9]) * 180 / np.pi)
    for arguments, message_part in [
        ({"random": {"k1": ("even", 1.0, 2.0)}}, r'random: k1 \(.even., 1.0, 2.0\): write \("uniform", low, high\)'),
        ({"random": {"k1": ("uniform", 2.0, 1.0)}}, "uniform"),
        ({"grid": {"k1": 1.0}, "parameters": {"k1": 2.0}}, "k1 is in more than one of grid, random and parameters"),
        ({"grid": {"k1": 1.0}, "parameters": {"k9": 2.0}}, "parameters: k9 is not known"),
        ({"grid": {"k1": ([1.0], "N")}}, "k1 can be given in N.m/rad or N.m/deg"),
    ]:
        with pytest.raises(prw.UserError, match=message_part):
            prw.sweep(fmu=fmu, **arguments)


SWEEP = {
    "random": {"k1": 0.1, "c3": 0.2},
    "runs": 50,
    "outputs": "roll",
    "statistics": ["max", "end"],
    "trajectories": 100,
}

#: Kills the process before it renames the file with this number. Then the file exists under a temporary name.
KILLED = f"""
import os, signal, sys, prw
rename, left = os.replace, [int(sys.argv[1])]
def replace(*paths):
    if left[0] == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    left[0] -= 1
    rename(*paths)
os.replace = replace
prw.sweep(**{SWEEP}, fmu=sys.argv[2], out=sys.argv[3])
"""


def test_a_killed_sweep_continues(tmp_path, fmu):
    """There are 4 parts with 2 files each, then the table. The killed processes have finished 0, 1, 2 and 1 parts."""
    for renamed in (0, 3, 4, 2):
        ended = subprocess.run([sys.executable, "-c", KILLED, str(renamed), fmu, tmp_path / "killed"], timeout=120)
        assert ended.returncode == -signal.SIGKILL
    assert not (tmp_path / "killed" / "runs.parquet").exists()
    table = prw.sweep(**SWEEP, fmu=fmu, out=tmp_path / "killed")
    assert table.equals(prw.sweep(**SWEEP, fmu=fmu, out=tmp_path / "whole"))
    assert files(tmp_path / "killed") == files(tmp_path / "whole")
    assert table.column_names == ["run", "status", "message", "k1", "c3", "roll_max", "roll_end"]
    kept = pq.read_table(tmp_path / "whole" / "trajectories").to_pandas()
    run = prw.simulate(parameters={name: table[name][37].as_py() for name in ("k1", "c3")}, fmu=fmu)
    assert np.array_equal(kept[kept["run"] == 37]["roll"], run["roll"][::100])
    assert np.array_equal(kept[kept["run"] == 37]["time"], run.time[::100])
    for changed, message in [
        ({"seed": 1}, "seed was 0 and is 1"),
        ({"statistics": "max"}, r'statistics was \["max", "end"\] and is \["max"\]'),
        ({"motion": fig4(2e-3)}, "motion: sha256 was"),
    ]:
        with pytest.raises(
            prw.UserError, match=rf"is from a sweep with other arguments \({message}.*another directory"
        ):
            prw.sweep(**{**SWEEP, **changed}, fmu=fmu, out=tmp_path / "killed")
    assert files(tmp_path / "killed") == files(tmp_path / "whole")


FEW = {"grid": {"k1": list(np.linspace(100, 140, 40))}, "outputs": "roll", "statistics": "end", "motion": fig4(0.05)}
#: Runs in a part, and the number of parts.
PART, PARTS = 16, 3


@pytest.fixture(scope="module")
def interrupted(fmu, tmp_path_factory):
    """A sweep with trajectories whose table is not yet written, and the table."""
    directory, replace = tmp_path_factory.mktemp("interrupted"), os.replace

    def stop(source, target):
        if Path(target).name == "runs.parquet":
            raise KeyboardInterrupt
        replace(source, target)

    os.replace = stop
    try:
        with pytest.raises(KeyboardInterrupt):
            prw.sweep(**FEW, trajectories=1, fmu=fmu, out=directory)
    finally:
        os.replace = replace
    return directory, prw.sweep(**FEW, fmu=fmu)


def rewritten(change):
    """A damage that changes the rows or columns of a table but keeps its record and its checksum."""

    def damage(path):
        table = pq.read_table(path, partitioning=None)
        pq.write_table(change(table).replace_schema_metadata(table.schema.metadata), path)

    return damage


def as_fifo(path):
    path.unlink()
    os.mkfifo(path)


def changed_value(table):
    return table.set_column(table.column_names.index("roll_end"), "roll_end", pa.array(np.zeros(len(table))))


DAMAGES = {
    "truncated": lambda path: path.write_bytes(path.read_bytes()[:-100]),
    "empty": lambda path: path.write_bytes(b""),
    "a pipe": as_fifo,
    "another part": lambda path: shutil.copy(path.with_name("part-00002.parquet"), path),
    "missing rows": rewritten(lambda table: table.slice(1)),
    "doubled rows": rewritten(lambda table: pa.concat_tables([table, table])),
    "other columns": rewritten(lambda table: table.drop_columns("run")),
    "a new column": rewritten(lambda table: table.append_column("old", pa.array([[1]] * len(table)))),
    "a changed value": rewritten(changed_value),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_part_is_repeated(interrupted, fmu, tmp_path, damage):
    """Only the runs of the damaged part are repeated, with a warning, and the result is as if nothing had happened."""
    directory, whole = interrupted
    kinds = ["parts"] if "value" in damage else ["parts", "trajectories"]
    for kind in kinds:
        out, finished = tmp_path / kind, []
        shutil.copytree(directory, out)
        DAMAGES[damage](out / kind / "part-00001.parquet")
        with pytest.warns(UserWarning, match=rf"{kind}.part-00001.parquet.* runs 16 to 31 are repeated") as warned:
            table = prw.sweep(**FEW, trajectories=1, fmu=fmu, out=out, progress=lambda *done: finished.append(done))  # noqa: B023
        assert len(warned) == 1 and table.equals(whole) and finished[0] == (40 - PART, 40)
        assert pq.read_table(out / "trajectories")["run"].to_pylist() == list(np.repeat(np.arange(40), 41))
        assert not (out / "parts").exists()


def test_a_damaged_table_is_made_again(prw, tmp_path):
    (tmp_path / "in.csv").write_text("time,theta1,theta2\n0,0,0\n0.05,0.01,0\n0.1,0.03,0\n")
    line = ["sweep", "--grid", "k1=100:140:40", "--outputs", "roll", "--statistics", "end", "--input", "in.csv"]
    line += ["--out", "out"]
    assert "ran         40 runs" in prw(*line).stdout
    path = tmp_path / "out" / "runs.parquet"
    sound = path.read_bytes()
    rewritten(lambda table: pa.concat_tables([table] * 100))(path)
    result = prw(*line)
    assert result.returncode == 0 and "ran         40 runs" in result.stdout
    assert (
        "note        out/runs.parquet: was changed after it was written, so runs 0 to 39 are repeated" in result.stdout
    )
    assert path.read_bytes() == sound
    result = prw(*line)
    assert "kept        40 finished runs in out" in result.stdout and "ran         0 runs" in result.stdout


def test_foreign_files_in_the_directory_of_a_sweep(interrupted, fmu, tmp_path):
    """A file that this sweep has not written is never overwritten or counted."""

    def with_record(change):
        def write(path):
            table = pq.read_table(path, partitioning=None)
            metadata = table.schema.metadata
            pq.write_table(
                table.replace_schema_metadata({**metadata, b"prw.sweep": change(metadata[b"prw.sweep"])}), path
            )

        return write

    def other_seed(record):
        return json.dumps({**json.loads(record), "outputs": ["pitch"]}).encode()

    first, again = "parts/part-00000.parquet", "parts/part-00000 (1).parquet"
    for number, (name, write, message) in enumerate(
        [
            (
                again,
                lambda path: shutil.copy(path.with_name("part-00000.parquet"), path),
                "is not a part of this sweep",
            ),
            ("parts/part-00003.parquet", lambda path: path.write_bytes(b""), "is not a part of this sweep"),
            ("trajectories/notes.txt", lambda path: path.write_text("mine"), "is not a part of this sweep"),
            (first, with_record(other_seed), r'other arguments \(outputs was \["pitch"\] and is \["roll"\]\)'),
            (first, with_record(lambda record: record[:-5]), "has no record of its sweep"),
            (first, with_record(lambda record: b"[]"), "has no record of its sweep"),
            (first, with_record(lambda record: b'{"varied": 1}'), "has no record of its sweep"),
            (first, lambda path: pq.write_table(pa.table({"run": [1]}), path), "has no record of its sweep"),
            ("runs.parquet", lambda path: path.write_text("mine"), "cannot be read"),
            ("runs.parquet", os.mkfifo, "it is not a regular file"),
        ]
    ):
        out = tmp_path / str(number)
        shutil.copytree(interrupted[0], out)
        write(out / name)
        with pytest.raises(prw.UserError, match=rf"{re.escape(name)}.*{message}.*; write into another directory"):
            prw.sweep(**FEW, trajectories=1, fmu=fmu, out=out)
        assert (out / name).exists() and len(list(out.glob("parts/part-0000?.parquet"))) >= PARTS


def test_an_interrupted_sweep_keeps_the_finished_runs(tmp_path, fmu, monkeypatch):
    from prw import sweeps

    def interrupted(testbed, request, values, *others):
        if len(calls) == 2:
            raise KeyboardInterrupt
        calls.append(values)
        return run_part(testbed, request, values, *others)

    run_part, calls = sweeps.run_part, []
    monkeypatch.setattr(sweeps, "run_part", interrupted)
    for out, message in ((None, "32 of 50 runs are finished"), (tmp_path, "32 of 50.*start the same sweep again")):
        calls.clear()
        with pytest.raises(Interrupted, match=message) as caught:
            prw.sweep(**{**SWEEP, "trajectories": None}, fmu=fmu, out=out)
        assert caught.value.table["run"].to_pylist() == list(range(32))


def test_a_sweep_is_repeated_from_its_file(prw, tmp_path, fmu):
    arguments = ["--random", "k1=10%", "--sampling", "latin", "--runs", 20, "--outputs", "roll", "--statistics", "max"]
    assert prw("sweep", *arguments, "--out", "first").returncode == 0
    result = prw("sweep", "--again", "first/runs.parquet")
    assert result.returncode == 0 and "all values are equal" in result.stdout, result.stderr
    assert files(tmp_path / "first") == files(tmp_path / "out" / "sweep-again")
    for out in ("out/sweep-again", "first"):
        result = prw("sweep", "--again", "first/runs.parquet", *(["--out", out] if out == "first" else []))
        assert result.returncode == 1 and result.stdout == ""
        assert f"--out: {out}/runs.parquet exists, so nothing would be repeated; name another" in result.stderr
    record = json.loads(pq.read_schema(tmp_path / "first" / "runs.parquet").metadata[b"prw.sweep"])
    assert record["seed"] == 0 and record["random"] == {"k1": 0.1} and record["motion"]["name"] == "fig4"
    assert set(record["versions"]) == {"prw", "fmu-run", "numpy", "scipy"} and record["fmu"]["guid"]
    (tmp_path / "still.csv").write_text("time,theta1,theta2\n0,0,0\n1,0,0\n")
    result = prw("sweep", "--again", "first/runs.parquet", "--input", "still.csv", "--out", "other")
    assert "--input: the sweep had another motion, fig4; give that motion, not still" in result.stderr
    path = tmp_path / "first" / "runs.parquet"
    sound = path.read_bytes()
    for change, message in [
        (lambda table: table.slice(1), "its parameters were changed after the sweep"),
        (lambda table: table.drop_columns("k1"), "its parameters were changed after the sweep"),
        (lambda table: table.set_column(3, "k1", pa.array(["x"] * 20)), "first/runs.parquet: k1: does not consist of"),
    ]:
        rewritten(change)(path)
        result = prw("sweep", "--again", "first/runs.parquet", "--out", "other")
        assert result.returncode == 1 and message in result.stderr and result.stderr.count("\n") == 1
        path.write_bytes(sound)
    rewritten(lambda table: table.drop_columns("roll_max"))(path)
    result = prw("sweep", "--again", "first/runs.parquet", "--out", "other")
    assert "other values in roll_max" in result.stdout


@pytest.mark.parametrize("sampling", ["latin", "sobol"])
def test_even_sampling(fmu, sampling):
    """Every combination of the grid has evenly distributed points. Independent ones would fail, with a discrepancy of about 0.01."""
    spreads = {"k1": ("uniform", 100.0, 120.0), "k2": ("normal", 50.0, 2.0)}
    table = prw.sweep(
        {"c3": [0.2, 0.3]}, spreads, runs=64, sampling=sampling, outputs="roll", statistics="end", fmu=fmu
    )
    k1, k2 = (table[name].to_numpy().reshape(2, 64) for name in ("k1", "k2"))
    for each in np.stack([(k1 - 100) / 20, norm.cdf(k2, 50, 2)], axis=2):
        for column in each.T:
            assert sorted(np.floor(64 * column).astype(int)) == list(range(64)), "each of 64 intervals has one point"
        assert qmc.discrepancy(each) < 2e-3
    assert not np.array_equal(k1[0], k1[1])


def test_parameters_of_an_identification_and_from_a_table(fmu, tmp_path):
    """The draws have the errors and the correlation of the estimates; the other parameters have the values of the fit."""
    report = {
        "identified": True,
        "correlation": {"names": ["k1", "c1", "gain of tau1"], "matrix": [[1, 0.68, 0], [0.68, 1, 0], [0, 0, 1]]},
        "parameters": {
            "k1": {"value": 110.0, "relative_standard_error": 0.02},
            "c1": {"value": 0.5, "relative_standard_error": 0.05},
            "c2": {"value": 0.3},
        },
    }
    path, few = tmp_path / "report.json", {"outputs": "roll", "statistics": "end", "fmu": fmu}
    path.write_text(json.dumps(report))
    found = prw.sweep(random=path, runs=2048, sampling="sobol", **few)
    logarithms = np.log([found["k1"].to_numpy() / 110, found["c1"].to_numpy() / 0.5])
    assert logarithms.std(axis=1) == pytest.approx([0.02, 0.05], rel=0.02)
    assert np.corrcoef(logarithms)[0, 1] == pytest.approx(0.68, abs=0.01)
    table = {name: found[name].to_numpy()[:5] for name in ("k1", "c1")}
    again = prw.sweep(table=table, parameters={"c2": 0.3}, **few)
    assert again["roll_end"].to_pylist() == found["roll_end"].to_pylist()[:5]
    for place, value, message in [
        (
            ("correlation", "matrix", 0, 1),
            2,
            r"correlation.matrix\[0\]\[1\], of k1 with c1, is 2; it must be between -1 and 1",
        ),
        (("correlation", "matrix", 0, 1), 0.5, r"matrix\[0\]\[1\], of k1 with c1, is 0.5, but 0.68 in the other order"),
        (
            ("correlation", "matrix", 2, 2),
            0,
            r"matrix\[2\]\[2\], of gain of tau1 with gain of tau1, is 0; it must be 1",
        ),
        (("correlation", "matrix", 1, 2), math.nan, r"matrix\[1\]\[2\], of c1 with gain of tau1, is nan, not a finite"),
        (("correlation", "matrix", 1), [1], "correlation.matrix needs 3 rows and columns"),
        (("correlation", "matrix"), [[1, 0.9, -0.9], [0.9, 1, 0.9], [-0.9, 0.9, 1]], "has the eigenvalue -0.8"),
        (("correlation", "names", 1), "k1", "correlation.names has k1 twice"),
        (("correlation", "names", 1), ["k1"], "report.json is not a report.json of an identification"),
        (("parameters", "k1", "relative_standard_error"), math.nan, "parameters.k1.relative_standard_error is nan"),
        (
            ("parameters", "k1", "relative_standard_error"),
            -0.1,
            "relative_standard_error is -0.1; it must be at least 0",
        ),
        (("parameters", "k1", "value"), 0, "parameters.k1.value is 0; it must be above 0"),
        (("parameters", "c2", "value"), "0.3", "parameters.c2.value is '0.3', not a finite number"),
        (("parameters", "c2", "value"), 10**400, "parameters.c2.value is 1000"),
        (("parameters", "c2"), 0.3, "parameters.c2.value is None"),
        (("identified",), "no", "the data did not determine"),
    ]:
        damaged = copy.deepcopy(report)
        inside = damaged
        for key in place[:-1]:
            inside = inside[key]
        inside[place[-1]] = value
        path.write_text(json.dumps(damaged))
        with pytest.raises(prw.UserError, match=message):
            prw.sweep(random=path, runs=2, **few)
    path.write_text(json.dumps({**report, "identified": False}))
    for arguments, message in [
        ({"random": path}, "random: the data did not determine the parameters"),
        ({"random": {}}, "nothing varies"),
        ({"random": 3}, "3 is neither a dict of distributions"),
        ({"table": {"run": [1]}}, "table: run is not known; there are J2"),
        ({"table": {"k1": [1.0], "k2": [1.0, 2.0]}}, "equally long columns"),
        ({"table": {"k1": [1.0, np.nan]}}, "table: k1 has values that are not finite"),
        ({"table": {"k1": [1.0]}, "parameters": {"k1": 1.0}}, "table: k1 is also in parameters"),
        ({"grid": {"k1": 1.0}, "trajectories": 1}, "trajectories: are written into a directory; give it as out"),
    ]:
        with pytest.raises(prw.UserError, match=message):
            prw.sweep(**few, **arguments)
