"""The model descriptions are valid for FMPy and the schemas. Both FMI versions have the same variables, except `time`, and results."""

from __future__ import annotations

from pathlib import Path
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest
from built import built
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from lagrange import OUTPUTS, TABLE_1, linear_model, table_1
from lxml import etree
from packaging.version import Version

#: Start values with twisted couplings and moving carriers.
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


@pytest.mark.parametrize("name", ["prw_testbed", "prw_controller", "prw_motor", "lag"])
def test_fmpy_finds_no_problem(version, name):
    fmu = str(built(f"{version}{name}.fmu"))
    assert fmpy.read_model_description(fmu, validate=True).modelName and validate_fmu(fmu) == []


def test_the_oracle_has_all_parameters_and_outputs(description):
    """Without this test, a parameter that is 0 by default could be missing in the equations of the oracle."""
    listed = {
        causality: [v.name for v in description.modelVariables if v.causality == causality and v.type != "Boolean"]
        for causality in ("parameter", "output")
    }
    parameters = {name for name in listed["parameter"] if not name.endswith("_start")}
    hint = "add them to tests/oracle/lagrange.py: "
    assert parameters == set(TABLE_1), f"{hint}TABLE_1 and the energies"
    known = linear_model(table_1()).outputs(np.zeros(6), np.zeros(2), np.zeros(2))
    assert listed["output"] == list(known), f"{hint}LinearModel.outputs"


def test_attributes_that_importers_need(description):
    """OMSimulator counts the variables with the attribute `derivative` to know how many states there are. OpenModelica 1.27.0
    passes all Booleans in one array and garbles all but the first, which arrive as false. So `start_at_rest` is the first:
    if it were false, a testbed with turned motors would not start at rest."""
    variables = description.modelVariables
    attributed = {v.name for v in variables if v.derivative is not None}
    assert attributed == {d.variable.name for d in description.derivatives}
    assert [v.name for v in variables if v.type == "Boolean"] == ["start_at_rest", "use_omega"]


def test_units_and_nominal_values_are_in_the_types(fmu3):
    """fmi-sim 0.7 rejects FMUs whose variables have these attributes themselves, so their types have them instead."""
    root = etree.fromstring(ZipFile(fmu3).read("modelDescription.xml"))
    units = {
        by_name.get("name")
        for by_name in root.find("TypeDefinitions")
        if by_name.get("unit") and by_name.get("nominal")
    }
    for variable in root.find("ModelVariables"):
        assert not {"quantity", "unit", "displayUnit", "nominal"} & set(variable.keys()), variable.get("name")
        is_real = variable.tag == "Float64" and variable.get("causality") != "independent"
        assert (variable.get("declaredType") in units) == is_real, variable.get("name")


def test_the_terminals_are_valid_and_only_in_fmi3(fmu, fmu3):
    """FMI 2.0.4 and later allow terminals (section 2.3), but FMI Library rejects an FMU for FMI 2.0 that has them."""
    file = "terminalsAndIcons/terminalsAndIcons.xml"
    assert file not in ZipFile(fmu).namelist()
    root = etree.fromstring(ZipFile(fmu3).read(file))
    schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
    etree.XMLSchema(etree.parse(schema)).assertValid(root)
    known = {variable.name for variable in fmpy.read_model_description(str(fmu)).modelVariables}
    members = [member.get("variableName") for member in root.iter("TerminalMemberVariable")]
    assert len(members) == 10 and known.issuperset(members)


def test_the_variables_are_the_same(fmu, fmu3):
    """Compares names, types, causality, variability, `initial`, start values, units and ranges. FMI 3.0 has the additional variable
    `time`. Value references start at 0 in FMI 2.0, but at 1 in FMI 3.0, because OMSimulator 3.0.0 needs that."""

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
def test_results_are_bit_identical(fmu, fmu3, options):
    def run(path):
        return simulate_fmu(
            str(path), stop_time=0.3, output_interval=1e-3, start_values=START, input=MOTORS,
            output=list(OUTPUTS), **options,
        )  # fmt: skip

    two, three = run(fmu), run(fmu3)
    assert np.ptp(two[OUTPUTS[0]]) > 0.1
    # In Co-Simulation of FMI 3.0, FMPy before 0.3.22 uses step sizes that differ in the last digits.
    same_steps = "CoSimulation" not in options.values() or Version(fmpy.__version__) >= Version("0.3.22")
    for name in ("time", *OUTPUTS):
        if same_steps:
            assert np.array_equal(two[name], three[name]), name
        else:
            np.testing.assert_allclose(three[name], two[name], rtol=0, atol=1e-11, err_msg=name)
