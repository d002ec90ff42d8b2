"""The files of the closed loop: programs and models in the documentation and in examples/, and the SSP."""

from __future__ import annotations

import html
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from unittest.mock import Mock, call, create_autospec, patch

import fmpy.ssp
import pytest
from built import ROOT, built, program, text_of
from lxml import etree

from tools.documentation.sources import CONTROLLER, TESTBED, read_description


@pytest.mark.parametrize("master, package", [("fmpy", "fmpy"), ("libcosim", "libcosimpy")])
def test_the_programs(closed_loop, tmp_path, master, package):
    pytest.importorskip(package)
    page = text_of(built("prw_testbed.fmu"))
    (program,) = re.findall(
        rf'<pre data-run="closed_loop_in_{master}" tabindex="0"><code>(.*?)</code></pre>', page, flags=re.S
    )
    shutil.copy(closed_loop.ssp, tmp_path)
    shutil.copytree(closed_loop.osp, tmp_path / closed_loop.osp.name)
    run = subprocess.run(
        [sys.executable, "-c", html.unescape(program)], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert run.returncode == 0, run.stderr
    pitch, roll = map(float, run.stdout.splitlines()[-1].split())
    assert pitch == pytest.approx(30, abs=0.1) and roll == pytest.approx(60, abs=0.1)


class SSP:
    """Signatures of the class in the Python package OMSimulator (2940ef1, 2026-08, 3.0.0), as far as the script calls them."""

    def addResource(self, filename, new_name=None, validate=True): ...
    def addComponent(self, cref, resource): ...
    def addConnection(self, cref1, cref2): ...
    def instantiate(self): ...


class InstantiatedModel:
    """Signatures of the class of which `SSP.instantiate` returns an object."""

    def setValue(self, cref, value): ...
    def setFixedStepSize(self, stepSize): ...
    def setStopTime(self, stopTime): ...
    def setResultFile(self, filename, bufferSize=10): ...
    def initialize(self): ...
    def simulate(self): ...
    def terminate(self): ...
    def delete(self): ...


def test_the_script_for_omsimulator(closed_loop):
    """OMSimulator cannot be installed from PyPI without its server. So a mock with the signatures of OMSimulator records the calls of
    the script, which must build the same system as the SSP."""
    page = text_of(built("prw_testbed.fmu"))
    (script,) = re.findall(r'<pre data-script="oms" tabindex="0"><code>(.*?)</code></pre>', page, flags=re.S)
    loop, wrist = create_autospec(SSP, instance=True), create_autospec(InstantiatedModel, instance=True)
    loop.instantiate.return_value = wrist
    library = Mock(spec=("CRef", "SSP"), CRef=lambda system, *names: ".".join(names), SSP=lambda: loop)
    with patch.dict(sys.modules, {"OMSimulator": library}):
        exec(html.unescape(script), {})
    files = {f"resources/{fmu}": call(fmu, new_name=f"resources/{fmu}") for fmu in closed_loop.fmus.values()}
    assert sorted(loop.addResource.mock_calls) == sorted(files.values())
    assert dict(added.args for added in loop.addComponent.mock_calls) == {
        component: f"resources/{fmu}" for component, fmu in closed_loop.fmus.items()
    }
    assert sorted(connection.args for connection in loop.addConnection.mock_calls) == sorted(closed_loop.connections)
    values = {**closed_loop.start, **dict(closed_loop.inputs.values())}
    assert dict(value.args for value in wrist.setValue.mock_calls) == pytest.approx(values)
    wrist.setFixedStepSize.assert_called_once_with(closed_loop.step)


def test_the_model_for_openmodelica_has_the_connections_of_the_ssp(closed_loop):
    """Compares names and values with the SSP, because OpenModelica, which would import the FMUs, is not installed here."""
    model = (ROOT / "examples/openmodelica/ClosedLoop.mo").read_text(encoding="utf-8")
    connections = re.findall(r"^  connect\(([\w.]+), ([\w.]+)\);$", model, flags=re.M)
    # These signals are sampled, not connected. Without `pre`, OpenModelica assumes an algebraic loop.
    (sampled,) = re.findall(
        r"^  when sample\(0, controller\.sample_time\) then\n    y = \{(.*?)\};\n  end when;$", model, flags=re.M
    )
    (inputs,) = re.findall(r"^  \{(.*?)\} = y;$", model, flags=re.M)
    outputs = [re.fullmatch(r"pre\((testbed\.\w+)\)", value)[1] for value in sampled.split(", ")]
    assert f"  discrete Real y[{len(outputs)}](each fixed = true) " in model
    connections += zip(outputs, inputs.split(", "), strict=True)
    assert sorted(connections) == sorted(tuple(connection) for connection in closed_loop.connections)
    for name, (end, value) in closed_loop.inputs.items():
        assert f"  parameter Real {name} = {value} " in model and f"  {end} = {name};" in model
    for component, path in (("testbed", TESTBED), ("controller", CONTROLLER)):
        known = {variable.name for variable in read_description(ROOT / path).modelVariables}
        assert set(re.findall(rf"\b{component}\.(\w+)", model)) <= known


def test_the_script_for_openmodelica_gives_each_fmu_a_directory(closed_loop):
    """In a shared directory the second modelDescription.xml would replace the first. With a relative `workdir`, `simulate` fails."""
    script = (ROOT / "examples/openmodelica/closed_loop.mos").read_text(encoding="utf-8")
    model = (ROOT / "examples/openmodelica/ClosedLoop.mo").read_text(encoding="utf-8")
    imports = dict(
        re.findall(
            r'importFMU\("../../../target/fmu/([\w.]+)", workdir = cd\(\) \+ "/(\w+)", fullPath = true\)', script
        )
    )
    assert imports == {fmu: component for component, fmu in closed_loop.fmus.items()}
    assert script.index('cd("build")') < script.index("importFMU(") < script.index('loadFile("../ClosedLoop.mo")')
    for component, fmu in closed_loop.fmus.items():
        assert script.index(f'mkdir("{component}")') < script.index(f'cd() + "/{component}"')
        assert f"  {fmu.removesuffix('.fmu')}_me_FMU {component};" in model


SCHEMAS = Path(fmpy.ssp.__file__).parent / "schema"
BUILD = program("build_closed_loop", "prw_controller")


@pytest.fixture(scope="module")
def archive(closed_loop):
    with zipfile.ZipFile(closed_loop.ssp) as archive:
        yield archive


def test_the_files_are_valid_against_the_schemas_of_ssp(archive):
    for name in archive.namelist():
        schema = {
            ".ssd": "SystemStructureDescription.xsd",
            ".ssv": "SystemStructureParameterValues.xsd",
        }.get(Path(name).suffix)
        if schema:
            etree.XMLSchema(file=str(SCHEMAS / schema)).assertValid(etree.fromstring(archive.read(name)))
    assert archive.testzip() is None
    assert {Path(name).suffix for name in archive.namelist()} == {".ssd", ".ssv", ".fmu"}


def test_the_program_reports_errors_in_one_line(closed_loop, tmp_path):
    fmus = {f"--{name}": closed_loop.osp / fmu for name, fmu in closed_loop.fmus.items()}
    for wrong, message in [
        ({"--testbed": fmus["--controller"]}, "testbed.pitch is input, not output"),
        ({"--controller": "none.fmu"}, "none.fmu is not a usable FMU: it cannot be read"),
        ({"--step-size": 0}, "--step-size must be finite and > 0"),
    ]:
        options = {**fmus, **wrong, "--out": tmp_path / "no"}
        arguments = [str(part) for option in options.items() for part in option]
        run = subprocess.run([*BUILD, *arguments], cwd=ROOT, capture_output=True, text=True)
        assert run.returncode == 1 and message in run.stderr and run.stderr.count("\n") == 1, run.stderr
        assert not (tmp_path / "no").exists()
