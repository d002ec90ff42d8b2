"""The committed reference experiments are up to date, and the two oracles agree."""

from __future__ import annotations

import io
from pathlib import Path

import fmpy
import numpy as np
import pytest
from controlled import Law
from experiments import experiments
from lagrange import OUTPUTS, linear_model
from lxml import etree
from reference import follow
from write_experiments import DECIMALS, FILES, ROOT, files

COMMITTED = ROOT / "modelDescription"
HINT = "out of date; write it again with\n    make experiments"


@pytest.fixture(scope="module")
def found():
    return experiments()


@pytest.fixture(scope="module")
def texts(found):
    return files(found)


def numbers(text: str) -> np.ndarray:
    return np.loadtxt(io.StringIO(text), delimiter=",", skiprows=1)


def test_the_committed_files_are_up_to_date(texts):
    kept = {path.relative_to(COMMITTED) for path in (COMMITTED / FILES).iterdir()}
    assert kept == {path for path in texts if FILES in path.parents}, HINT
    for path, text in texts.items():
        committed = (COMMITTED / path).read_text(encoding="utf-8")
        if path.suffix == ".csv":
            # Another processor may round the last digit differently.
            assert committed.splitlines()[0] == text.splitlines()[0], f"{path}: {HINT}"
            last_digit = 1.01 * 10.0**-DECIMALS
            np.testing.assert_allclose(numbers(committed), numbers(text), rtol=0, atol=last_digit, err_msg=HINT)
        else:
            assert committed == text, f"{path}: {HINT}"


def test_both_oracles_agree(found):
    """Compares `integrate` and the closed loop with `follow`, whose error is of second order in the interval of samples."""
    for experiment in found:
        if experiment.name == "rate_step":
            continue
        model = linear_model({n: float(v) for n, v in experiment.parameters.items() if n != "use_omega"})
        motors = experiment.inputs
        theta, omega = (np.column_stack([motors[f"{n}1"], motors[f"{n}2"]]) for n in ("theta", "omega"))
        errors = []
        for every in (2, 1):
            at, _ = follow(model, motors["time"][::every], theta[::every], omega[::every])
            common = np.isin(motors["time"][::every], experiment.reference["time"])
            off = [np.abs(at[n][common] - experiment.reference[n]).max() for n in OUTPUTS]
            errors.append(max(o / a for o, a in zip(off, experiment.allowed("ModelExchange").values())))
        assert errors[1] < 0.6 and 3 < errors[0] / errors[1] < 5, (experiment.name, errors)


def test_the_parameter_sets_are_valid_and_complete(texts):
    """The sets contain all parameters, including start values of states, so that no parameter keeps an earlier value."""
    schema = Path(fmpy.__file__).parent / "ssp" / "schema" / "SystemStructureParameterValues.xsd"
    valid = etree.XMLSchema(etree.parse(schema))
    variables = etree.parse(COMMITTED / "modelDescription.xml").iter("ScalarVariable")
    parameters = {v.get("name"): v[0].tag for v in variables if v.get("causality") == "parameter"}
    for path, text in texts.items():
        if path.suffix == ".ssv":
            root = etree.fromstring(text.encode())
            valid.assertValid(root)
            assert {p.get("name"): etree.QName(p[0]).localname for p in root.iter("{*}Parameter")} == parameters, HINT


def test_a_motor_brakes_in_whole_samples():
    """Braking from 0.09 rad/s at 30 rad/s2 takes three samples. The distance in the curve also contains half a sample at this rate."""
    rates, reached = Law().braking_curve()
    assert np.interp(0.09, rates, reached) == pytest.approx(0.09 / 2 * 1e-3 + 0.09**2 / 2 / 30)
