"""The model description: valid for FMPy and the XSD, and the interface other models connect to, name by name."""

from __future__ import annotations

import zipfile
from math import pi

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from lagrange import PER_DEGREE, REAL, TABLE_1, table_1
from lxml import etree

STATES = ("theta3", "theta4", "theta5", "theta6", "omega5", "omega6")
INPUTS = ("theta1", "theta2", "omega1", "omega2")
UNITS = {
    "J2": ("kg.m2", None),
    "J3": ("kg.m2", None),
    "H3": ("kg.m2", None),
    "k1": ("N.m/rad", "N.m/deg"),
    "k2": ("N.m/rad", "N.m/deg"),
    "c1": ("N.m.s/rad", "N.m.s/deg"),
    "c2": ("N.m.s/rad", "N.m.s/deg"),
    "c3": ("N.m.s/rad", "N.m.s/deg"),
}
ANGLE, RATE = ("rad", "deg"), ("rad/s", "deg/s")


@pytest.fixture(scope="module")
def variables(description):
    return {v.name: v for v in description.modelVariables}


@pytest.fixture(scope="module")
def xml(fmu):
    with zipfile.ZipFile(fmu) as archive:
        return etree.fromstring(archive.read("modelDescription.xml"))


def units(variable):
    """Unit and display unit, given with the variable or by its declared type (section 2.2.7)."""
    declared = variable.declaredType
    return (
        variable.unit or (declared.unit if declared else None),
        variable.displayUnit or (declared.displayUnit if declared else None),
    )


def test_fmpy_finds_no_problem(fmu):
    assert validate_fmu(str(fmu)) == []


def test_names(description):
    assert description.modelName == "PitchRollWristTestbed"
    assert description.coSimulation.modelIdentifier == "prw_testbed"
    assert description.fmiVersion == "2.0"


@pytest.mark.parametrize("name", INPUTS)
def test_inputs(variables, name):
    v = variables[name]
    assert (v.type, v.causality, v.variability, float(v.start)) == ("Real", "input", "continuous", 0.0)
    assert units(v) == (ANGLE if name.startswith("theta") else RATE)


def test_only_what_belongs_to_a_state_is_a_derivative(description, variables):
    """OMSimulator counts the variables that have the attribute, to know how many states there are."""
    attributed = {v.name for v in variables.values() if v.derivative is not None}
    assert attributed == {d.variable.name for d in description.derivatives}


@pytest.mark.parametrize(
    "name, unit",
    [
        ("tau1", ("N.m", None)),
        ("tau2", ("N.m", None)),
        ("pitch", ANGLE),
        ("roll", ANGLE),
        ("pitch_rate", RATE),
        ("roll_rate", RATE),
    ],
)
def test_calculated_outputs(variables, name, unit):
    v = variables[name]
    assert (v.type, v.causality, v.variability, v.initial) == ("Real", "output", "continuous", "calculated")
    assert v.start is None
    assert units(v) == unit


@pytest.mark.parametrize("name", STATES)
def test_states(variables, name):
    v = variables[name]
    causality = "output" if name in ("theta3", "theta4") else "local"
    assert (v.type, v.causality, v.variability, v.initial) == ("Real", causality, "continuous", "calculated")
    assert v.start is None
    assert units(v) == (ANGLE if name.startswith("theta") else RATE)
    start = variables[f"{name}_start"]
    assert (start.type, start.causality, start.variability, start.initial) == ("Real", "parameter", "fixed", "exact")
    assert float(start.start) == 0.0
    assert units(start) == units(v)


def test_derivatives_of_the_states(description, variables):
    derivatives = [d.variable for d in description.derivatives]
    assert [d.derivative.name for d in derivatives] == list(STATES)
    for d in derivatives:
        assert (d.causality, d.variability, d.initial, d.start) == ("local", "continuous", "calculated", None)
        assert d.name == f"der({d.derivative.name})"


@pytest.mark.parametrize("name", REAL)
def test_real_parameters(variables, name):
    v = variables[name]
    assert (v.type, v.causality, v.variability, v.initial) == ("Real", "parameter", "fixed", "exact")
    assert units(v) == UNITS[name]
    assert float(v.start) == pytest.approx(table_1()[name], rel=1e-15)


@pytest.mark.parametrize("name", ["M", "N"])
def test_integer_parameters(variables, name):
    v = variables[name]
    assert (v.type, v.causality, v.variability, v.initial) == ("Integer", "parameter", "fixed", "exact")
    assert v.start == TABLE_1[name]


@pytest.mark.parametrize("name, start", [("use_omega", "false"), ("start_at_rest", "true")])
def test_boolean_parameters(variables, name, start):
    v = variables[name]
    assert (v.type, v.causality, v.variability, v.initial) == ("Boolean", "parameter", "fixed", "exact")
    assert v.start == start


def test_the_start_is_the_first_boolean(variables):
    """OpenModelica 1.27.0 hands over all Booleans in one array and garbles all but the first: the second arrives as false,
    and a testbed with turned motors would start with a bang. use_omega is false anyway, and of no use in Model Exchange."""
    assert [v.name for v in variables.values() if v.type == "Boolean"] == ["start_at_rest", "use_omega"]


def test_display_units_give_the_printed_values(description, variables):
    factors = {u.name: {d.name: float(d.factor) for d in u.displayUnits} for u in description.unitDefinitions}
    assert factors["rad"]["deg"] == pytest.approx(180 / pi, rel=1e-15)
    for name in PER_DEGREE:
        v = variables[name]
        unit, display_unit = units(v)
        shown = float(v.start) * factors[unit][display_unit]
        assert shown == pytest.approx(float(TABLE_1[name]), rel=1e-14)


def test_base_units(xml):
    found = {u.get("name"): dict(u.find("BaseUnit").attrib) for u in xml.iter("Unit")}
    expected = {
        "rad": {"rad": "1"},
        "rad/s": {"rad": "1", "s": "-1"},
        "N.m": {"kg": "1", "m": "2", "s": "-2"},
        "kg.m2": {"kg": "1", "m": "2"},
        "N.m/rad": {"kg": "1", "m": "2", "s": "-2", "rad": "-1"},
        "N.m.s/rad": {"kg": "1", "m": "2", "s": "-1", "rad": "-1"},
    }
    for name, base in expected.items():
        assert {k: v for k, v in found[name].items() if v != "0" and k not in ("factor", "offset")} == base


def test_names_are_flat_and_references_unique(variables):
    names = [n[4:-1] if n.startswith("der(") else n for n in variables]
    assert all(n.isidentifier() and n.isascii() and n != "time" for n in names)
    assert len({(v.type, v.valueReference) for v in variables.values()}) == len(variables)


def test_interface_is_complete(variables):
    outputs = {"tau1", "tau2", "pitch", "roll", "pitch_rate", "roll_rate", "theta3", "theta4"}
    assert {n for n, v in variables.items() if v.causality == "input"} == set(INPUTS)
    assert {n for n, v in variables.items() if v.causality == "output"} == outputs
    starts = {f"{name}_start" for name in STATES}
    parameters = {*UNITS, "M", "N", "use_omega", "start_at_rest", *starts}
    assert {n for n, v in variables.items() if v.causality == "parameter"} == parameters


def test_capabilities(xml):
    cs = xml.find("CoSimulation")
    assert cs.get("canHandleVariableCommunicationStepSize") == "true"
    assert cs.get("canInterpolateInputs") == "true"
    assert cs.get("maxOutputDerivativeOrder") == "1"
    for name in ("canGetAndSetFMUstate", "canSerializeFMUstate", "providesDirectionalDerivative"):
        assert cs.get(name) == "true", name


def test_dependencies_are_the_sparsity_of_the_equations(description, model):
    """Each output and derivative depends on the states and inputs that enter it, and says so."""
    knowns = (*STATES, *INPUTS)
    rows = dict(zip((f"der({s})" for s in STATES), np.hstack([model.a, model.b_angle, model.b_rate])))
    zeros = np.zeros(4)
    n_over_m = 7 / 4
    rows.update(zip(("tau1", "tau2"), np.hstack([model.c, model.d_angle, model.d_rate])))
    rows["pitch"] = np.array([0, 0, 0.5, 0.5, 0, 0, *zeros])
    rows["roll"] = np.array([0, 0, n_over_m / 2, -n_over_m / 2, 0, 0, *zeros])
    rows["pitch_rate"] = np.array([0, 0, 0, 0, 0.5, 0.5, *zeros])
    rows["roll_rate"] = np.array([0, 0, 0, 0, n_over_m / 2, -n_over_m / 2, *zeros])
    rows["theta3"], rows["theta4"] = np.eye(10)[0], np.eye(10)[1]
    for unknown in (*description.outputs, *description.derivatives):
        name = unknown.variable.name
        expected = {known for known, value in zip(knowns, rows.pop(name)) if abs(value) > 1e-12}
        assert {v.name for v in unknown.dependencies} == expected, name
        # The factors of angles and rates also depend on where Co-Simulation takes the rates from, and on its steps.
        for known, kind in zip(unknown.dependencies, unknown.dependenciesKind, strict=True):
            assert kind in (["dependent"] if known.causality == "input" else ["fixed", "constant"]), name
    assert rows == {}
