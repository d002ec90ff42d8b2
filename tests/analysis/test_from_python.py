"""`prw.identify` and `prw.excite` as a notebook uses them."""

from __future__ import annotations

import json

import numpy as np
import pytest
import rig
from lagrange import table_1
from lxml import etree

import prw


@pytest.fixture(scope="module")
def recording(tmp_path_factory, experiment):
    path = tmp_path_factory.mktemp("recorded") / "run.csv"
    rig.write(path, rig.measure(experiment, 5, ("tau1", "theta3", "theta4")))
    return path


@pytest.fixture(scope="module")
def found(recording, fmu):
    return prw.identify(recording, fmu=fmu)


def test_it_prints_and_writes_nothing(recording, fmu, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    prw.identify([prw.read(recording)], starts=1, fmu=fmu)
    prw.excite(["tau1"], duration=2, rate=100, fmu=fmu)
    assert capfd.readouterr() == ("", "") and not list(tmp_path.iterdir())


def test_the_result(found, experiment, tmp_path):
    assert list(found.parameters) == list(rig.NAMES)
    for name, estimate in found.parameters.items():
        low, high = estimate.interval
        assert low < estimate.value < high and estimate.value == found.values[name]
        assert estimate.standard_error == pytest.approx(estimate.relative * estimate.value)
        assert abs(estimate.value - experiment.parameters[name]) < 4.5 * estimate.standard_error
    assert found.parameters["k1"].unit == "N.m/rad" and found.parameters["k1"].shown == "N.m/deg"
    assert found.values["J2"] == pytest.approx(experiment.parameters["J2"])
    assert found.correlation.shape == (5, 5) and found.undetermined == []
    assert "k1" in found.summary() and repr(found) == found.summary()
    page = etree.HTML(found._repr_html_())
    assert [row[0].text for row in page.iterfind(".//tr")] == ["parameter", *rig.NAMES]
    assert json.loads(found.to_json())["parameters"]["k1"]["value"] == found.parameters["k1"].value
    assert found.to_ssv(tmp_path / "k.ssv") == (tmp_path / "k.ssv").read_text(encoding="utf-8")
    found.report(tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text(encoding="utf-8").count("<svg") == 3


def test_priors_fixed_values_and_bounds(recording, fmu, experiment):
    simulated = {name: experiment.parameters[name] for name in ("k2", "c1", "c2", "c3")}
    found = prw.identify(
        recording,
        estimate=["k1"],
        parameters=simulated,
        priors={"J2": (0.004, 0.02)},
        bounds={"k1": (50, 200)},
        starts=1,
        fmu=fmu,
    )
    assert list(found.parameters) == ["J2", "k1"] and found.values["c3"] == simulated["c3"]
    assert found.parameters["J2"].relative <= 0.0201 and found.parameters["J2"].prior == (0.004, 0.02)


def test_either_version_of_fmi(recording, fmu, found):
    again = prw.identify(recording, fmu=fmu.parent / "fmi3" / fmu.name)
    assert again.values == found.values and again.known.real == found.known.real
    assert again.to_ssv() == found.to_ssv()


@pytest.mark.parametrize(
    "options, message",
    [
        ({"estimate": ["k9"]}, "estimate: k9 is not known; there are J2, J3, H3, k1"),
        ({"estimate": []}, "estimate: nothing is named"),
        ({"estimate": None}, "estimate: None is neither a name nor a sequence of names"),
        ({"priors": {"k1": -0.1}}, "priors: k1 -0.1 is not a finite number above 0"),
        ({"priors": {"J3": 10}}, "priors: J3 has a standard deviation of 1000%; 100 % is the most"),
        ({"priors": {"J3": (None, 0.1)}}, "priors: J3 None is not a finite number above 0"),
        ({"parameters": {"k1": None}}, "parameters: k1 None is not a finite number of at least 0"),
        ({"bounds": {"k1": None}}, "bounds: k1 None; write (least, greatest)"),
        ({"parameters": {"k1": float("nan")}}, "parameters: k1 nan is not a finite number of at least 0"),
        ({"bounds": {"k1": (5, 2)}}, "bounds: k1 from 5 to 2"),
        ({"noise": {"pitch": 0.1}}, "noise: pitch is not known; there are tau1"),
        ({"noise": {"tau1": None}}, "noise: tau1 None is not a finite number above 0"),
        (
            {"parameters": {"c3": 0}, "estimate": "c3"},
            "c3 starts at 0, from where it cannot be estimated; give it another start value, bounds, or a prior",
        ),
        ({"parameters": {"c3": 0}, "priors": {"c3": 0.1}}, "priors: c3 starts at 0; write (value, fraction)"),
        ({"starts": 0}, "starts 0: must be an integer of at least 1"),
        ({"bounds": {"J2": (0.001, 0.01)}}, "bounds: J2 is not estimated, so it needs no bounds; estimate it, or omit"),
        ({"quantum": "1"}, "quantum: '1' is not a finite number of at least 0"),
        ({"quantum": float("nan")}, "quantum: nan is not a finite number of at least 0"),
        ({"starts": True}, "starts True: must be an integer of at least 1"),
        ({"noise": {"tau1": True}}, "noise: tau1 True is not a finite number above 0"),
        ({"offsets": "no"}, "offsets 'no': must be True or False"),
        ({"robust": 2}, "robust 2: must be True or False"),
        ({"starts": None}, "starts None: must be an integer of at least 1"),
        ({"seed": -1}, "seed -1: must be an integer of at least 0"),
        ({"follow": -1}, "follow -1: must be an integer of at least 0"),
        ({"fmu": "none.fmu"}, "none.fmu: no such FMU"),
    ],
)
def test_wrong_arguments(recording, fmu, options, message):
    with pytest.raises(prw.UserError) as error:
        prw.identify(recording, **{"fmu": fmu, **options})
    assert message in str(error.value)


@pytest.fixture(scope="module")
def undamped():
    """A rig whose output has no damping, and a recording of it."""
    simulated = rig.experiment(1, 2)
    parameters = {**simulated.parameters, "c3": 0.0}
    frequency, waves = np.array([0.7, 2.1, 6.3]), np.array([[1, 0.6j, 0.3], [0.8j, -0.5, 0.2j]])
    return parameters, rig.measure(rig.respond(parameters, simulated.time, frequency, waves), 5, ("tau1", "tau2"))


def test_a_parameter_that_is_0(undamped, recording, experiment, fmu):
    """A parameter that is 0 can be fixed. If it is estimated, the search starts at a prior's value or between the bounds, not at 0."""
    parameters, columns = undamped
    fixed = {name: parameters[name] for name in ("k2", "c1", "c2", "c3")}
    found = prw.identify(columns, estimate="k1", parameters=fixed, starts=1, fmu=fmu)
    assert found.fits and found.values["c3"] == 0 and list(found.parameters) == ["k1"]
    assert abs(found.values["k1"] - parameters["k1"]) < 4.5 * found.parameters["k1"].standard_error
    # All other parameters are known, so that the data fit, and no causes are looked for.
    known = {name: experiment.parameters[name] for name in ("k1", "k2", "c1", "c2")}
    start = table_1()["c3"]

    def estimated(c3: float, **options) -> float:
        with_start = {"parameters": {**known, "c3": c3}, "starts": 1, "fmu": fmu}
        return prw.identify(recording, estimate="c3", **with_start, **options).values["c3"]

    expected, prior = estimated(start), {"priors": {"c3": (start, 1)}}
    assert estimated(0, bounds={"c3": (start / 10, start * 20)}) == pytest.approx(expected, rel=1e-6)
    assert estimated(0, **prior) == pytest.approx(estimated(start, **prior), rel=1e-6)


def test_sources_that_are_not_recordings(recording, fmu):
    read, run = prw.read(recording), prw.simulate(fmu=fmu)
    for files, options, message in (
        (None, {}, "None is not a recording"),
        ([None], {}, "None is not a recording"),
        ([], {}, "files: at least one is needed"),
        (read, {"units": {"tau1": "mN.m"}}, "units: is for files and tables, and these recordings were read before"),
        ([read, run], {"degrees": False}, "degrees: is for files and tables"),
        (run, {"skip": 1}, "skip: is for files and tables"),
    ):
        with pytest.raises(prw.UserError, match=message):
            prw.identify(files, **options)


def test_columns_in_memory_and_one_name(recording, experiment, fmu):
    """A dict may replace a file, also in a list, and a name may replace a list of one name."""
    read = prw.read(recording)
    columns = {name: read[name] for name in read.units}
    known = {"parameters": {name: experiment.parameters[name] for name in ("k2", "c1", "c2", "c3")}, "starts": 1}
    expected = prw.identify(recording, estimate=["k1"], **known, fmu=fmu).values
    for files in (columns, [columns]):
        assert prw.identify(files, estimate="k1", **known, fmu=fmu).values == expected


def test_excite(fmu):
    ranking = prw.excite("tau1", estimate="k1", duration=2, rate=100, fmu=fmu)
    assert 39 < np.rad2deg(max(np.abs(each.motion.theta).max() for each in ranking)) < 40.01
    with pytest.raises(prw.UserError, match="angle: None is not a finite number above 0"):
        prw.excite(angle=None, fmu=fmu)
    with pytest.raises(prw.UserError, match="noise: pitch is not known; there are tau1"):
        prw.excite("tau1", noise={"pitch": 0.1}, fmu=fmu)
    same = [
        prw.excite("tau1", estimate="k2", parameters={"k1": k1}, duration=2, rate=100, fmu=fmu)[0].expected_errors
        for k1 in ((2.0, "N.m/deg"), 360 / np.pi)
    ]
    assert same[0] == pytest.approx(same[1])
