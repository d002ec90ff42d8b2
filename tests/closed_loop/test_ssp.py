"""The files of the closed loop: valid against the schemas of SSP 1.0, complete, with the FMUs as they were built."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import fmpy.ssp
import pytest
from built import ROOT
from lxml import etree

SCHEMAS = Path(fmpy.ssp.__file__).parent / "schema"
BUILD = ["cargo", "run", "--quiet", "--release", "-p", "prw_controller", "--bin", "build_closed_loop", "--"]


@pytest.fixture(scope="module")
def archive(closed_loop):
    with zipfile.ZipFile(closed_loop.ssp) as archive:
        yield archive


def test_every_part_is_valid(archive):
    for name in archive.namelist():
        schema = {
            ".ssd": "SystemStructureDescription.xsd",
            ".ssv": "SystemStructureParameterValues.xsd",
        }.get(Path(name).suffix)
        if schema:
            etree.XMLSchema(file=str(SCHEMAS / schema)).assertValid(etree.fromstring(archive.read(name)))
    assert archive.testzip() is None
    assert {Path(name).suffix for name in archive.namelist()} == {".ssd", ".ssv", ".fmu"}


def test_the_fmus_in_it_are_those_that_were_built(archive, closed_loop, fmu, controller_fmu):
    for each in (fmu, controller_fmu):
        assert archive.read(f"resources/{each.name}") == each.read_bytes()
        assert (closed_loop.osp / each.name).read_bytes() == each.read_bytes()


def test_connections_have_the_units_of_the_fmus(archive, closed_loop):
    root = etree.fromstring(archive.read("SystemStructure.ssd"))
    ns = {
        "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
        "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    }
    defined = {unit.get("name") for unit in root.findall("ssd:Units/ssc:Unit", ns)}
    for component in root.findall(".//ssd:Component", ns):
        variables = fmpy.read_model_description(
            str(closed_loop.osp / Path(component.get("source")).name)
        ).modelVariables
        units = {
            variable.name: variable.unit or variable.declaredType.unit
            for variable in variables
            if variable.type == "Real"
        }
        for connector in component.findall("ssd:Connectors/ssd:Connector", ns):
            unit = connector.find("ssc:Real", ns).get("unit")
            assert unit == units[connector.get("name")] and unit in defined


def test_it_is_the_same_every_time_and_says_what_is_wrong(closed_loop, tmp_path):
    fmus = {f"--{name}": closed_loop.osp / fmu for name, fmu in closed_loop.fmus.items()}

    def build(options, folder):
        arguments = [str(part) for option in {**fmus, **options, "--out": folder}.items() for part in option]
        return subprocess.run([*BUILD, *arguments], cwd=ROOT, capture_output=True, text=True)

    assert build({}, tmp_path).returncode == 0
    assert (tmp_path / "prw_closed_loop.ssp").read_bytes() == closed_loop.ssp.read_bytes()
    name = "OspSystemStructure.xml"
    assert (tmp_path / "prw_closed_loop" / name).read_bytes() == (closed_loop.osp / name).read_bytes()

    for wrong, message in [
        ({"--testbed": fmus["--controller"]}, "testbed.pitch is input, not output"),
        ({"--controller": "none.fmu"}, "none.fmu is no usable FMU: it cannot be read"),
        ({"--step-size": 0}, "--step-size must be > 0"),
    ]:
        run = build(wrong, tmp_path / "no")
        assert run.returncode == 1 and message in run.stderr and run.stderr.count("\n") == 1, run.stderr
        assert not (tmp_path / "no").exists()
