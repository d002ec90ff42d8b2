"""`prw identify` on a simulated rig whose equations, motion and sensors share nothing with the FMU."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace

import fmpy
import numpy as np
import pytest
import rig
from lxml import etree

from prw.identification.findings import Findings
from prw.identification.report import _prose
from prw.identification.rounding import rounded

DEGREES = dict.fromkeys(("theta1", "theta2", "theta3", "theta4", "pitch", "roll"), ("deg", np.pi / 180))


def report(directory) -> dict:
    return json.loads((directory / "report.json").read_text())


def check_estimates(found: dict, simulated: dict, worst: float = 0.02) -> None:
    """Checks that all estimates are within 4.5 standard errors of the true values, and that no relative error exceeds `worst`."""
    for name in rig.NAMES:
        entry = found["parameters"][name]
        off = np.log(entry["value"] / simulated[name])
        assert abs(off) < 4.5 * entry["relative_standard_error"], f"{name}: {off:+.3%}"
        assert abs(off) < worst, f"{name}: {off:+.3%}"
        assert entry["interval_95"][0] < entry["value"] < entry["interval_95"][1]


def test_all_sensors(prw, tmp_path, experiment):
    rig.write(tmp_path / "run.csv", rig.measure(experiment, 5), {**DEGREES, "tau1": ("mN.m", 1e-3)})
    result = prw("identify", "run.csv")
    assert result.returncode == 0, result.stderr
    assert "k1" in result.stdout and "95 % interval" in result.stdout and "next" in result.stdout
    out = tmp_path / "out" / "identified"
    assert sorted(p.name for p in out.iterdir()) == [
        "identified.json",
        "identified.ssv",
        "report.html",
        "report.json",
    ]
    found = report(out)
    check_estimates(found, experiment.parameters, worst=0.01)
    assert found["identified"]
    noise = {channel["channel"]: channel["noise"] for channel in found["channels"]}
    assert noise["tau1"] == pytest.approx(0.02, rel=0.4) and noise["pitch"] == pytest.approx(1e-3, rel=0.3)
    assert found["motors"][0]["quantum"] == pytest.approx(2 * np.pi / rig.COUNTS, rel=1e-3)
    correlation = np.array(found["correlation"]["matrix"])
    np.testing.assert_allclose(np.diag(correlation), 1)
    assert np.linalg.eigvalsh(correlation)[0] > 0
    text = (out / "report.html").read_text(encoding="utf-8")
    assert text.count("<svg") == 6 and "prefers-color-scheme: dark" in text
    assert not re.search(r'(src|href)="(?!#)', text), "the page loads something from elsewhere"
    etree.HTML(text)


def test_only_torques_and_the_exchanged_couplings(prw, tmp_path, experiment):
    """The two couplings are in series, so torques fit as well with the couplings exchanged; a note reports it."""
    rig.write(tmp_path / "run.csv", rig.measure(experiment, 7, ("tau1", "tau2")))
    result = prw("identify", "run.csv", "--starts", 2)
    assert result.returncode == 0, result.stderr
    assert "the couplings exchanged" in result.stdout and "measurements of theta3 and theta4" in result.stdout
    # The note has the units of the table, SI.
    page = (tmp_path / "out" / "identified" / "report.html").read_text(encoding="utf-8")
    (note,) = re.findall(r'<p class="note">Other values fit the data equally well: (.*?)</p>', page)
    assert "N·m/rad" in note and "N·m/deg" not in note
    check_estimates(report(tmp_path / "out" / "identified"), experiment.parameters)


def test_several_experiments_in_motion_with_gaps_and_uneven_rows(prw, tmp_path, experiment):
    """The first recording is cut out of the motion, and its pitch and roll come from a slow camera. The second has lost rows."""
    measured = rig.measure(experiment, 8, log_rates=True)
    for name in ("pitch", "roll"):
        measured[name] = np.where(np.arange(len(measured["time"])) % 10 == 0, measured[name], np.nan)
    rig.write(tmp_path / "a.csv", measured, rows=slice(1234, 5234))
    keep = np.sort(np.random.default_rng(0).choice(6001, 3000, replace=False))
    rig.write(tmp_path / "b.csv", rig.measure(experiment, 9, ("tau1", "theta3", "theta4")), rows=keep)
    result = prw("identify", "a.csv", "b.csv", "--starts", 1)
    assert result.returncode == 0, result.stderr
    found = report(tmp_path / "out" / "identified")
    check_estimates(found, experiment.parameters)
    assert {c["samples"] for c in found["channels"] if c["channel"] == "pitch"} == {400}


def test_the_ssv_file_conforms_to_the_schema(prw, tmp_path, experiment):
    """The tutorial's test builds an FMU that has the parameters as start values."""
    rig.write(tmp_path / "run.csv", rig.measure(experiment, 5, ("tau1", "theta3", "theta4")), rows=slice(0, 4000))
    assert prw("identify", "run.csv", "--starts", 1).returncode == 0
    out = tmp_path / "out" / "identified"
    found = report(out)["parameters"]
    schema = Path(fmpy.__file__).parent / "ssp" / "schema" / "SystemStructureParameterValues.xsd"
    document = etree.parse(str(out / "identified.ssv"))
    etree.XMLSchema(etree.parse(str(schema))).assertValid(document)
    parameters = document.findall(".//{*}Parameter[{*}Real]")
    assert {element.get("name") for element in parameters} == found.keys()
    for element in parameters:
        entry = found[element.get("name")]
        assert float(element[0].get("value")) == entry["value"] and element[0].get("unit") == entry["unit"]


def test_equal_motors_do_not_determine_the_roll_inertia(prw, tmp_path):
    """The undetermined combination is named, another motion is advised, and the parameters of an earlier fit are deleted."""
    simulated = rig.experiment(seed=3, duration=5, pattern="equal")
    rig.write(tmp_path / "run.csv", rig.measure(simulated, 1, ("tau1", "tau2")))
    out = tmp_path / "out" / "identified"
    out.mkdir(parents=True)
    (out / "identified.json").write_text("of an earlier fit")
    result = prw("identify", "run.csv", "--estimate", "k2,c3,J3", *_fixed(simulated), "--starts", 1)
    assert result.returncode == 1
    assert "J3 has hardly any effect on the measurements" in result.stderr
    assert re.search(
        r"an experiment with (opposite motor rates|only one motor|motors that move independently|a spectrum made for these parameters)",
        result.stderr,
    )
    assert "`excite` proposes it for tau1,tau2 as" in result.stderr
    assert not (out / "identified.json").exists() and (out / "report.html").exists()
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "do not determine all" in page and "<code>excite</code> proposes" in page and "`" not in page


def test_inertias_that_only_occur_together_are_named_and_a_prior_settles_them(prw, tmp_path, experiment):
    rig.write(tmp_path / "run.csv", rig.measure(experiment, 1, ("tau1", "tau2", "pitch")), rows=slice(0, 5000))
    result = prw("identify", "run.csv", "--estimate", "J2,J3,H3", *_fixed(experiment), "--starts", 1)
    assert result.returncode == 1
    assert "J2, J3 and H3 cannot be distinguished" in result.stderr and "give it a prior" in result.stderr
    result = prw("identify", "run.csv", "--estimate", "J3,H3", "--prior", "J2=5%", *_fixed(experiment), "--starts", 1)
    assert result.returncode == 0, result.stderr
    found = report(tmp_path / "out" / "identified")["parameters"]
    assert found["J2"]["relative_standard_error"] == pytest.approx(0.05, rel=0.05)
    for name in ("J2", "J3", "H3"):
        off = np.log(found[name]["value"] / experiment.parameters[name])
        assert abs(off) < 4 * found[name]["relative_standard_error"]


def _fixed(simulated) -> list:
    return [word for name in rig.NAMES for word in ("--set", f"{name}={simulated.parameters[name]!r}")]


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["--estimate", "M"], "M, N are counted, not estimated"),
        (["--prior", "J3=ten"], "--prior J3=ten: write NAME=10%"),
        (["--set", "k1=-4"], "--set k1=-4: '-4' is not a finite number of at least 0"),
        (["--bounds", "k1=5:2"], "--bounds: k1 from 5 to 2; the first must be below the second"),
        (["--bounds", "k1=1:2"], "k1 starts at 120.894, outside of its bounds 1 to 2"),
        (["--units", "torque=N.m"], "--units: torque is not known"),
        (["half.csv", "--units", "roll=deg"], "run.csv, half.csv: no column roll, whose unit is given; there are time"),
        (
            ["--quantum", "1kg"],
            "--quantum 1kg: write an angle above 0 and its unit, as in 0.036deg; units are rad, mrad",
        ),
        (["--quantum", "0.036"], "--quantum 0.036: write an angle above 0 and its unit"),
        (["--quantum", "0deg"], "--quantum 0deg: write an angle above 0 and its unit"),
        (["run.csv"], "run.csv and run.csv (files 1 and 2) contain the same measurements, which would count twice"),
        (["half.csv"], "run.csv and half.csv (files 1 and 2) contain the same measurements"),
    ],
)
def test_wrong_options(prw, tmp_path, experiment, arguments, message):
    rig.write(tmp_path / "run.csv", rig.measure(experiment, 1, ("tau1",)), rows=slice(0, 200))
    rig.write(tmp_path / "half.csv", rig.measure(experiment, 1, ("tau1",)), rows=slice(0, 100))
    result = prw("identify", "run.csv", *arguments)
    assert result.returncode == 1
    assert message in result.stderr and result.stderr.count("\n") == 1, result.stderr
    assert not (tmp_path / "out").exists()


def test_a_file_after_follow_is_not_a_number_of_steps(prw):
    result = prw("identify", "--follow", "run.csv")
    assert result.returncode == 2
    assert "'run.csv' is not a number of steps; put files before --follow" in result.stderr


def test_encoder_steps_are_not_taken_for_motion(prw, tmp_path):
    """With equal motor angles the wrist does not roll, so J3 is undetermined, although the steps of the two encoders differ. The other
    parameters are identified."""
    simulated = rig.experiment(seed=3, duration=5, pattern="equal")
    rig.write(tmp_path / "run.csv", rig.measure(simulated, 1, ("tau1", "tau2", "theta3", "theta4")))
    result = prw("identify", "run.csv", "--estimate", "k1,k2,c1,c2,c3,J3", "--starts", 1)
    assert result.returncode == 1 and "J3 has hardly any effect" in result.stderr
    assert re.search(r"J3 .*not determined", result.stdout)
    assert prw("identify", "run.csv", "--starts", 1).returncode == 0
    check_estimates(report(tmp_path / "out" / "identified"), simulated.parameters)


@pytest.mark.parametrize(
    ("numbers", "shown"),
    [
        ((2.9491, 1.5), ["2.9", "1.5"]),
        ((2.9491, 0.0996, 2.75, 3.14), ["2.95", "0.10", "2.75", "3.14"]),
        ((131.94, 0.317, 131.32, 132.56), ["131.94", "0.32", "131.32", "132.56"]),
        ((13194.0, 317.0), ["13190", "320"]),
        ((-0.0019, 0.00061), ["-0.00190", "0.00061"]),
        ((3.8681e-7, 2.1e-9), ["3.868e-07", "2.1e-09"]),
        ((1.0, float("inf")), ["1", "inf"]),
    ],
)
def test_digits_follow_the_standard_error(numbers, shown):
    assert rounded(*numbers) == shown


def test_options_in_the_report_are_code():
    assert (
        str(_prose("add `--delay tau1`; k1 < 2 +- 1 N.m/deg")) == "add <code>--delay tau1</code>; k1 &lt; 2 ± 1 N·m/deg"
    )


@pytest.mark.parametrize(
    "rival, exchanged",
    [
        ({"k1": 54.0, "k2": 132.0, "c1": 0.42, "c2": 0.53}, True),
        ({"k1": 54.0, "k2": 132.0, "c1": 0.42, "c2": 0.60}, False),
        ({"c3": 0.7}, False),
    ],
)
def test_only_exchanged_couplings_are_called_exchanged(rival, exchanged):
    estimates = {"k1": 132.0, "k2": 54.0, "c1": 0.53, "c2": 0.42, "c3": 0.35}
    logarithms = np.log([estimates[name] for name in rival])
    solution = SimpleNamespace(task=SimpleNamespace(names=list(rival)), logarithms=logarithms)
    found = Findings._exchanged(SimpleNamespace(solution=solution), np.log([*rival.values()]))
    assert found is exchanged
