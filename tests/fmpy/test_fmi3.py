"""The FMU for FMI 3.0: valid for FMPy, and bit for bit the testbed of the FMU for FMI 2.0."""

from __future__ import annotations

from pathlib import Path
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest
from built import built
from fmpy import simulate_fmu
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from lagrange import OUTPUTS
from lxml import etree
from packaging.version import Version

#: Let go with the couplings wound up, while both motors turn.
START = {
    "start_at_rest": False, "theta3_start": 0.5, "theta4_start": -0.3, "theta5_start": 0.1, "theta6_start": 0.4,
    "omega5_start": 3.0, "omega6_start": -2.0, "k1": 130.0,
}  # fmt: skip
MOTORS = np.array(
    [(t, 0.2 * np.sin(9 * t), 0.1 * t, 1.8 * np.cos(9 * t), 0.1) for t in np.linspace(0, 0.3, 301)],
    dtype=[(name, float) for name in ("time", "theta1", "theta2", "omega1", "omega2")],
)


@pytest.fixture(scope="module")
def fmu3():
    """The packed FMU for FMI 3.0."""
    return built("fmi3/prw_testbed.fmu", "fmu")


@pytest.fixture
def testbed3(fmu3, unpack):
    """An instance for Co-Simulation of FMI 3.0, in initialization mode, and its value references by name."""
    description = fmpy.read_model_description(str(fmu3))
    instance = FMU3Slave(
        guid=description.guid,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=unpack(fmu3),
        instanceName="testbed",
    )
    instance.instantiate(loggingOn=True)
    instance.enterInitializationMode(startTime=0.0)
    yield instance, {v.name: v.valueReference for v in description.modelVariables}
    instance.freeInstance()


def test_fmpy_finds_no_problem(fmu3):
    assert fmpy.read_model_description(str(fmu3), validate=True).fmiVersion == "3.0"
    assert validate_fmu(str(fmu3)) == []


def test_units_and_nominal_values_are_in_the_types(fmu3):
    """fmi-sim 0.7 refuses to read FMUs with variables that have them themselves."""
    root = etree.fromstring(ZipFile(fmu3).read("modelDescription.xml"))
    units = {of.get("name") for of in root.find("TypeDefinitions") if of.get("unit") and of.get("nominal")}
    for variable in root.find("ModelVariables"):
        assert not {"quantity", "unit", "displayUnit", "nominal"} & set(variable.keys()), variable.get("name")
        is_real = variable.tag == "Float64" and variable.get("causality") != "independent"
        assert (variable.get("declaredType") in units) == is_real, variable.get("name")


def test_the_terminals_are_valid_and_in_fmi3_alone(fmu, fmu3):
    """FMI 2.0 may have them since 2.0.4 (section 2.3), but FMI Library calls that a fatal mismatch."""
    file = "terminalsAndIcons/terminalsAndIcons.xml"
    assert file not in ZipFile(fmu).namelist()
    root = etree.fromstring(ZipFile(fmu3).read(file))
    schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
    etree.XMLSchema(etree.parse(schema)).assertValid(root)
    known = {variable.name for variable in fmpy.read_model_description(str(fmu)).modelVariables}
    members = [member.get("variableName") for member in root.iter("TerminalMemberVariable")]
    assert len(members) == 10 and known.issuperset(members)


def test_the_variables_are_the_same(fmu, fmu3):
    """Names, causality, variability, start values, units and ranges; the time is one more. Only the value references
    count from 0 in one, in the other from 1 in the order of the variables, which OMSimulator 3.0.0 needs."""

    def variables(path, first):
        kind = {"Real": "Float64", "Integer": "Int32"}
        return {
            v.name: (
                v.valueReference + first,
                kind.get(v.type, v.type),
                v.causality,
                v.variability,
                v.initial,
                v.start,
                v.declaredType and (v.declaredType.unit, v.declaredType.min, v.declaredType.max),
            )
            for v in fmpy.read_model_description(str(path)).modelVariables
        }

    two, three = variables(fmu, first=1), variables(fmu3, first=0)
    assert [name for name in three if name not in two] == ["time"]
    assert {name: three[name] for name in two} == two
    assert [facts[0] for facts in three.values()] == list(range(1, len(three) + 1))


@pytest.mark.parametrize(
    "options",
    [
        {"fmi_type": "CoSimulation"},
        {"fmi_type": "ModelExchange", "solver": "Euler", "step_size": 1e-4},
        {"fmi_type": "ModelExchange", "solver": "CVode", "relative_tolerance": 1e-8},
    ],
    ids=["co-simulation", "euler", "cvode"],
)
def test_results_are_the_same_bits(fmu, fmu3, options):
    def run(path):
        return simulate_fmu(
            str(path), stop_time=0.3, output_interval=1e-3, start_values=START, input=MOTORS,
            output=list(OUTPUTS), **options,
        )  # fmt: skip

    two, three = run(fmu), run(fmu3)
    assert np.ptp(two[OUTPUTS[0]]) > 0.1
    # FMPy before 0.3.22 has steps for FMI 3.0 in Co-Simulation that differ in the last digits.
    same_steps = "CoSimulation" not in options.values() or Version(fmpy.__version__) >= Version("0.3.22")
    for name in ("time", *OUTPUTS):
        if same_steps:
            assert np.array_equal(two[name], three[name]), name
        else:
            np.testing.assert_allclose(three[name], two[name], rtol=0, atol=1e-11, err_msg=name)


def test_the_same_partial_derivatives_both_ways(testbed3, make_instance):
    """Of all outputs by all inputs: as in FMI 2.0, and the adjoint ones are the transpose."""
    instance, references = testbed3
    other = make_instance()
    other.start()
    instance.exitInitializationMode()
    inputs = ("theta1", "theta2", "omega1", "omega2")
    outputs, knowns = ([other.variables[name].valueReference for name in names] for names in (OUTPUTS, inputs))
    two = [other.fmi.getDirectionalDerivative(outputs, [known], [1.0]) for known in knowns]
    outputs, knowns = ([references[name] for name in names] for names in (OUTPUTS, inputs))
    forward = [instance.getDirectionalDerivative(outputs, [known], [1.0], len(outputs)) for known in knowns]
    adjoint = [instance.getAdjointDerivative([output], knowns, [1.0], len(knowns)) for output in outputs]
    assert np.any(two)
    assert np.array_equal(forward, two)
    assert np.array_equal(np.transpose(adjoint), two)


def test_a_state_can_be_saved_and_restored(testbed3):
    instance, references = testbed3
    outputs = [references[name] for name in OUTPUTS]
    instance.setFloat64([references["omega1"]], [2.0])
    instance.exitInitializationMode()
    instance.doStep(0.0, 0.01)
    state = instance.getFMUState()
    instance.doStep(0.01, 0.02)
    once = instance.getFloat64(outputs)
    instance.setFMUState(state)
    instance.doStep(0.01, 0.02)
    assert instance.getFloat64(outputs) == once
    instance.freeFMUState(state)
