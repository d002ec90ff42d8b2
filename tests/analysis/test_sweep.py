"""`prw sweep` returns the same numbers as single runs, on this machine and on a cluster."""

from __future__ import annotations

import numpy as np
import pyarrow.parquet as pq
import pytest

import prw
from prw.motion import fig4
from prw.testbed import OUTPUTS, Testbed


def rows(directory):
    return pq.read_table(directory / "runs.parquet").to_pylist()


def test_grid_random_and_failures(prw, tmp_path, fmu):
    # --workers is the name that --threads had in 0.2.0.
    result = prw("sweep", "--grid", "k1=-50:150:3", "--random", "c3=0.4:20%", "--runs", 4, "--workers", 2)
    assert result.returncode == 0, result.stderr
    assert "ran         12 runs on 2 threads" in result.stdout
    assert "failed      4 runs; run 0: the FMU stopped: fmi2SetReal: k1 must not be below 1e-300" in result.stdout
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
    arguments = ["sweep", "--grid", "k1=150:-50:3", "--random", "c3=20%", "--runs", 20]
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        result = prw(*arguments, "--scheduler", address, "--out", "remote")
    assert result.returncode == 0, result.stderr
    assert f"60 runs on {address}" in result.stdout
    assert prw(*arguments, "--out", "local").returncode == 0
    assert rows(tmp_path / "remote") == rows(tmp_path / "local")


@pytest.mark.parametrize(
    "arguments, message",
    [
        ([], "nothing varies; give values of a parameter (grid)"),
        (["--grid", "k1=1:2"], "--grid k1=1:2: write NAME=LOW:HIGH:N"),
        (["--grid", "k9=1:2:3"], "--grid: k9 is not known"),
        (["--random", "k1=5"], "--random k1=5: write NAME=10%"),
        (["--random", "k1=5%", "--runs", "0"], "--runs 0: must be an integer of at least 1"),
        (["--random", "k1=5%", "--input", "none.csv"], "none.csv: cannot be read"),
    ],
)
def test_wrong_options(prw, tmp_path, arguments, message):
    result = prw("sweep", *arguments)
    assert result.returncode == 1 and message in result.stderr and result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_sweep_in_which_all_runs_fail(fmu):
    with pytest.warns(RuntimeWarning, match=r"all 2 runs failed; run 0: .*k1 must not be below"):
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
