"""Compares runs with direct calls of the C functions by FMPy, and statistics with NumPy."""

from __future__ import annotations

import re
import shutil
import sys
import tracemalloc
import warnings
import zipfile

import fmpy
import fmu_run
import numpy as np
import pytest
from built import ROOT
from fmpy.simulation import instantiate_fmu

OUTPUTS = ["tau1", "pitch", "roll", "pitch_rate", "theta3", "M"]
INPUTS = ["theta1", "theta2", "omega1", "omega2"]


def motion(samples: int = 400, scale: float = 1.0) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Returns uneven times (samples,) s after 0.3 s, and the motors' angles and rates by name."""
    time = 0.3 + np.cumsum(np.random.default_rng(3).uniform(2e-4, 3e-3, samples))
    angles = [scale * 0.4 * np.sin(9 * time), -scale * 0.3 * np.cos(14 * time)]
    rates = [scale * 3.6 * np.cos(9 * time), scale * 4.2 * np.sin(14 * time)]
    return time, dict(zip(INPUTS, [*angles, *rates]))


def by_fmpy(path, time, inputs, start, outputs, slopes=None, read_before_set=False) -> dict[str, np.ndarray]:
    """Simulates with direct calls of the C functions through the classes of FMPy."""
    description = fmpy.read_model_description(str(path))
    by_name = {v.name: v for v in description.modelVariables}
    directory = fmpy.extract(str(path))
    slave = instantiate_fmu(directory, description, fmi_type="CoSimulation")
    is_fmi2 = description.fmiVersion == "2.0"
    getters = {"Real": "getReal", "Integer": "getInteger", "Boolean": "getBoolean"}
    getters |= {"Float64": "getFloat64", "Int32": "getInt32", "Enumeration": "getInteger" if is_fmi2 else "getInt64"}

    def put(values):
        for name, value in values.items():
            getattr(slave, getters[by_name[name].type].replace("get", "set"))([by_name[name].valueReference], [value])

    def get(name):
        return getattr(slave, getters[by_name[name].type])([by_name[name].valueReference])[0]

    if is_fmi2:
        slave.setupExperiment(startTime=time[0], stopTime=time[-1])
    put(start)
    slave.enterInitializationMode(**({} if is_fmi2 else {"startTime": time[0], "stopTime": time[-1]}))
    put({name: values[0] for name, values in inputs.items()})
    slave.exitInitializationMode()
    rows = []
    for k, t in enumerate(time):
        if read_before_set:
            rows.append([get(name) for name in outputs])
        put({name: values[k] for name, values in inputs.items()})
        for name, values in (slopes or {}).items():
            slave.setRealInputDerivatives([by_name[name].valueReference], [1], [values[k]])
        if not read_before_set:
            rows.append([get(name) for name in outputs])
        if k + 1 < len(time):
            slave.doStep(currentCommunicationPoint=t, communicationStepSize=time[k + 1] - t)
    slave.terminate()
    slave.freeInstance()
    shutil.rmtree(directory)
    return dict(zip(outputs, np.array(rows, dtype=float).T))


def same(runs, expected, run=0):
    assert list(runs) == list(expected)
    for name, signal in expected.items():
        assert np.abs(signal).max() > 0, name
        np.testing.assert_array_equal(runs[name][run], signal, err_msg=name)


@pytest.mark.parametrize("read_before_set", [False, True])
def test_the_testbed(testbed, read_before_set):
    time, inputs = motion()
    start = {"use_omega": True, "k1": 77.0, "start_at_rest": False, "theta3_start": 0.1, "N": 5}
    expected = by_fmpy(testbed, time, inputs, start, OUTPUTS, read_before_set=read_before_set)
    with fmu_run.Fmu(testbed) as fmu:
        runs = fmu.run(time, inputs=inputs, start=start, outputs=OUTPUTS, read_before_set=read_before_set)
    same(runs, expected)
    np.testing.assert_array_equal(runs.time, time)


def test_input_derivatives(fmu):
    time, inputs = motion()
    slopes = {"theta1": inputs.pop("omega1"), "theta2": inputs.pop("omega2")}
    expected = by_fmpy(fmu, time, inputs, {}, OUTPUTS, slopes)
    with fmu_run.Fmu(fmu) as loaded:
        same(loaded.run(time, inputs=inputs, input_derivatives=slopes, outputs=OUTPUTS), expected)


@pytest.mark.parametrize("threads", [1, 2, 7])
def test_each_run_has_its_own_values(testbed, threads):
    scales = np.linspace(0.5, 1.5, 20)
    stiffness = np.linspace(60.0, 200.0, 20)
    time, _ = motion()
    signals = [motion(scale=scale)[1] for scale in scales]
    inputs = {name: np.stack([signal[name] for signal in signals]) for name in INPUTS}
    inputs["omega2"] = signals[0]["omega2"]
    with fmu_run.Fmu(testbed) as fmu:
        start = {"k1": stiffness, "k2": 100, "use_omega": True}
        runs = fmu.run(time, inputs=inputs, start=start, outputs=OUTPUTS, threads=threads)
    assert runs["roll"].shape == (20, len(time)) and runs.count == 20 and runs.ok.all()
    for run in (0, 7, 19):
        one = signals[run] | {"omega2": signals[0]["omega2"]}
        start = {"k1": stiffness[run], "k2": 100.0, "use_omega": True}
        same(runs, by_fmpy(testbed, time, one, start, OUTPUTS), run)


@pytest.mark.parametrize("interface", ["co-simulation", "model-exchange"])
def test_reused_instances_have_the_same_results(testbed, interface):
    """Also if a parameter is not set again, and from one call to the next."""
    time, inputs = motion(samples=40)
    starts = [{"k1": np.linspace(60.0, 200.0, 8), "use_omega": True}, {"theta3_start": 0.1, "start_at_rest": False}, {}]
    with fmu_run.Fmu(testbed) as fmu:
        for start in starts:
            arguments = {"inputs": inputs, "start": start, "outputs": OUTPUTS, "interface": interface, "threads": 2}
            new, reused = (fmu.run(time, **arguments, reuse=reuse).check() for reuse in (False, True))
            assert all(new[name].tobytes() == reused[name].tobytes() for name in OUTPUTS)


def test_measures_and_kept_times(testbed):
    time, inputs = motion()
    with fmu_run.Fmu(testbed) as fmu:
        complete = fmu.run(time, inputs=inputs, start={"k1": [80.0, 90.0]}, outputs=["roll", "M"])
        runs = fmu.run(
            time,
            inputs=inputs,
            start={"k1": [80.0, 90.0]},
            outputs=["roll", "M"],
            every=7,
            measures=["min", "max", "peak", "time_of_peak", "mean", "rms", "end"],
        )
        measured = fmu.run(time, inputs=inputs, start={"k1": [80.0, 90.0]}, outputs=["roll"], measures=["peak"])
    np.testing.assert_array_equal(runs.time, time[::7])
    np.testing.assert_array_equal(runs["roll"], complete["roll"][:, ::7])
    signal = complete["roll"]
    np.testing.assert_array_equal(runs["roll", "min"], signal.min(axis=1))
    np.testing.assert_array_equal(runs["roll", "max"], signal.max(axis=1))
    np.testing.assert_array_equal(runs["roll", "peak"], np.abs(signal).max(axis=1))
    np.testing.assert_array_equal(runs["roll", "time_of_peak"], time[np.abs(signal).argmax(axis=1)])
    np.testing.assert_allclose(runs["roll", "mean"], signal.mean(axis=1), rtol=1e-13)
    np.testing.assert_allclose(runs["roll", "rms"], np.sqrt((signal**2).mean(axis=1)), rtol=1e-13)
    np.testing.assert_array_equal(runs["roll", "end"], signal[:, -1])
    np.testing.assert_array_equal(runs["M", "mean"], [4, 4])
    np.testing.assert_array_equal(measured["roll", "peak"], runs["roll", "peak"])
    assert measured and len(measured) == 0 and len(measured.time) == 0
    with pytest.raises(KeyError, match="every=1"):
        measured["roll"]


def test_frames_and_datasets(testbed, monkeypatch):
    """Checks that numbers have the coordinates of their run, time and start values, and that rejected runs contain NaN."""
    time, inputs = motion(5)
    start = {"k1": [80.0, -1.0, 90.0], "use_omega": True, "theta1": 0.25}
    with fmu_run.Fmu(testbed) as fmu:
        runs = fmu.run(time, inputs=inputs, start=start, outputs=["roll", "theta1"], every=2, measures=["peak"])
        measured = fmu.run(time, inputs=inputs, start=start, outputs=["roll"], measures=["peak", "end"])
    assert list(runs.errors) == [1] and runs.start["k1"].tolist() == start["k1"]
    frame, dataset = runs.to_pandas(), runs.to_xarray()
    names = ["k1", "use_omega", "theta1 at start", "roll_peak", "theta1_peak", "roll", "theta1"]
    assert frame.index.names == ["run", "time"] and list(frame) == names and len(frame) == 9
    assert dict(dataset.sizes) == {"run": 3, "time": 3} and set(dataset.coords) == {"run", "time", *names[:3]}
    for run in (0, 2):
        for position, t in enumerate(time[::2]):
            row = frame.loc[(run, t)]
            assert row["roll"] == runs["roll"][run, position] == dataset["roll"].sel(run=run, time=t)
            assert row["roll_peak"] == runs["roll", "peak"][run] == dataset["roll_peak"].sel(run=run)
            assert row["theta1"] == inputs["theta1"][::2][position] and row["theta1 at start"] == 0.25
            assert row["k1"] == start["k1"][run] == dataset["k1"].sel(run=run) and row["use_omega"] == 1
    assert frame.loc[1]["roll"].isna().all() and dataset["roll_peak"].isnull().values.tolist() == [False, True, False]
    frame = measured.to_pandas()
    assert frame.index.name == "run" and list(frame) == ["k1", "use_omega", "theta1", "roll_peak", "roll_end"]
    np.testing.assert_array_equal(frame["roll_end"], measured["roll", "end"])
    assert dict(measured.to_xarray().sizes) == {"run": 3}
    for package, call in (("pandas", runs.to_pandas), ("xarray", runs.to_xarray)):
        monkeypatch.setitem(sys.modules, package, None)
        with pytest.raises(ImportError, match=f"{package} is missing; install it with: pip install {package}"):
            call()


def test_names_that_were_not_requested(testbed):
    with fmu_run.Fmu(testbed) as fmu:
        runs = fmu.run([0.0, 1e-3], outputs=["roll", "tau1"], every=1, measures=["peak"])
    for key, message in [
        ("nix", "no output 'nix' was requested; there are roll, tau1"),
        (("roll", "rms"), "no measure 'rms' was requested; there are peak"),
    ]:
        with pytest.raises(KeyError, match=message):
            runs[key]


def test_results_that_are_not_a_number_are_reported(testbed, faulty_fmu):
    time = np.arange(11) / 10
    with fmu_run.Fmu(testbed) as fmu:
        arguments = {"inputs": {"theta1": np.zeros(11)}, "outputs": ["roll"], "measures": ["peak"], "every": 1}
        some = fmu.run(time, start={"k1": [100.0, -1.0, 100.0]}, **arguments)
        every = fmu.run(time, start={"k1": -1.0}, **arguments)
        checked = fmu.run(time, start={"k1": -1.0}, **arguments)
    assert checked.errors
    with fmu_run.Fmu(faulty_fmu) as fmu:
        endless = fmu.run(time, inputs={"slope": np.where(time < 0.35, 1.0, np.nan)}, outputs=["y"])
    with pytest.warns(RuntimeWarning, match=r"^1 of 3 runs failed, see Runs.errors; run 1: .*k1 must not be below"):
        some["roll"]
    with pytest.warns(RuntimeWarning, match=r"^all runs failed"):
        every.to_pandas()
    with pytest.warns(RuntimeWarning, match=r"^y is not a number in 1 finished runs, run 0 among them"):
        endless["y"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for runs in (some, every, checked):
            runs["roll"], runs["roll", "peak"]
        endless["y"]


def test_statistics_of_outputs_that_are_not_a_number(faulty_fmu):
    """In one run the input becomes NaN, in another one it is always NaN. Their statistics are NaN, and other runs are not affected."""
    time, measures = np.arange(11) / 10, ["min", "max", "peak", "time_of_peak", "mean", "rms", "end"]
    slopes = np.array([np.ones(11), np.where(time < 0.35, -1.0, np.nan), np.full(11, np.nan), 2.0 * np.ones(11)])
    with fmu_run.Fmu(faulty_fmu) as fmu:
        runs = fmu.run(time, inputs={"slope": slopes}, outputs=["y", "slope"], measures=measures, every=1).check()
    for measure in measures:
        with pytest.warns(RuntimeWarning, match="is not a number in 2 finished runs, run 1 among them"):
            found = runs["slope", measure]
        assert np.isnan(found[1:3]).all() and np.isfinite(found[[0, 3]]).all(), measure
        # In the third run, y is 4 before the first step and NaN from then on.
        with pytest.warns(RuntimeWarning, match="is not a number in 2 finished runs"):
            found = runs["y", measure]
        assert np.isnan(found[1:3]).all() and np.isfinite(found[[0, 3]]).all(), measure
    assert runs["y", "time_of_peak"].tolist()[::3] == [1.0, 1.0]


def test_many_short_runs_leave_nothing_behind(testbed, tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    time, inputs = motion(20)
    with fmu_run.Fmu(testbed) as fmu:
        assert len(list(tmp_path.iterdir())) == 1
        stiffness = np.tile([50.0, 100.0, 150.0], 2000)
        peaks = fmu.run(time, inputs=inputs, start={"k1": stiffness}, outputs=["tau1"], measures=["peak"])
        # A run does not depend on the previous run of its instance.
        np.testing.assert_array_equal(np.ptp(peaks["tau1", "peak"].reshape(-1, 3), axis=0), 0.0)
    assert list(tmp_path.iterdir()) == []


def test_the_programs_run(fmu, monkeypatch, capsys):
    """The programs run unchanged in the repository root, and print what the page shows after them."""
    page = "crates/fmu-run/README.md"
    blocks = re.findall(r"^```(\w+)[^\n]*\n(.*?)^```", (ROOT / page).read_text(encoding="utf-8"), flags=re.S | re.M)
    monkeypatch.chdir(ROOT)
    names: dict = {}
    outputs = []
    for (language, program), (following, output) in zip(blocks, [*blocks[1:], ("", "")]):
        if language == "python":
            exec(compile(program, page, "exec"), names)
            outputs.append(output if following == "text" else "")
            assert capsys.readouterr().out == outputs[-1]
    assert sum(map(bool, outputs)) == 2
    text = "\n".join(program for language, program in blocks if language == "python")
    runs = names["runs"].check()
    assert runs["roll"].shape == (1000, 2001) and abs(runs["roll"]).max() > 0.01
    assert names["torques"].shape == (1000, 2) and names["wrists"].errors == {}
    assert len({*names["wrists"].time}) == 2, "some of the instances must be restored, but not all"
    assert names["peaks"]["tau1", "peak"].max() == abs(runs["tau1"]).max()
    shapes = re.findall(r"^(?:([^\s#=][^#=]*?)|\s*(\w+) = .*?) +# (\([\d, ]+\))", text, flags=re.M)
    assert len(shapes) == 6
    for expression, name, shape in shapes:
        assert str(np.shape(eval(expression or name, names))) == shape, expression or name


def test_arrays_may_be_written_meanwhile(testbed) -> None:
    """Another thread may write to the arrays of the caller while FMUs run without the GIL."""
    time, steps = np.arange(100_000) * 1e-3, []
    moves = np.stack([np.full(len(time), k / 64) for k in range(64)])

    def overwrite(*done: int) -> None:
        steps.append(done)
        time.fill(np.nan)
        moves.fill(np.nan)

    with fmu_run.Fmu(testbed) as fmu:
        runs = fmu.run(time, inputs={"theta1": moves}, outputs=["pitch"], measures=["end"], progress=overwrite)
        assert runs.ok.all() and steps and np.isnan(moves).all()
        assert np.allclose(runs["pitch", "end"], np.arange(64) / 128)
        wrists, shared = fmu.instances(3), np.zeros((3, 2))
        assert wrists.advance(("theta1", "theta2"), shared, 1e-3, ("theta1", "M"), out=shared) is shared
        assert (shared == [0.0, 4.0]).all()


def test_elements_of_arrays_share_their_attributes(faulty_fmu3, tmp_path) -> None:
    for count, letters in [(1000, 100), (100_000, 1), (100_000, 10_000)]:
        path = tmp_path / f"{count}_{letters}.fmu"
        text = "d" * letters
        array = (
            f'<Float64 name="a" valueReference="9999" causality="local" description="{text}" quantity="{text}">'
            f'<Dimension start="{count}"/></Float64></ModelVariables>'
        )
        with zipfile.ZipFile(faulty_fmu3) as before, zipfile.ZipFile(path, "w") as after:
            for name in before.namelist():
                content = before.read(name)
                if name == "modelDescription.xml":
                    content = content.replace(b"</ModelVariables>", array.encode())
                after.writestr(name, content)
        tracemalloc.start()
        with fmu_run.Fmu(path) as fmu:
            opened = tracemalloc.get_traced_memory()[1]
            assert len(fmu.variables) >= count and fmu.variables[f"a[{count}]"].description == text
        listed = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert opened < 200_000 and listed < 300_000 + 300 * count, (count, letters, opened, listed)
