"""The closed loop as the documentation says it: its programs run as printed."""

from __future__ import annotations

import html
import re
import shutil
import subprocess
import sys
import zipfile

import pytest
from conftest import ROOT

from tools.documentation.pages import CONTROLLER, TESTBED
from tools.figures import ICON, ICON_SVG


@pytest.mark.parametrize("master, package", [("fmpy", "fmpy"), ("libcosim", "libcosimpy")])
def test_the_programs(closed_loop, tmp_path, master, package):
    pytest.importorskip(package)
    page = (ROOT / TESTBED.path).read_text(encoding="utf-8")
    (program,) = re.findall(rf'<pre data-run="closed_loop_in_{master}"><code>(.*?)</code></pre>', page, flags=re.S)
    shutil.copy(closed_loop.ssp, tmp_path)
    shutil.copytree(closed_loop.osp, tmp_path / closed_loop.osp.name)
    run = subprocess.run(
        [sys.executable, "-c", html.unescape(program)], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert run.returncode == 0, run.stderr
    pitch, roll = map(float, run.stdout.splitlines()[-1].split())
    assert pitch == pytest.approx(30, abs=0.1) and roll == pytest.approx(60, abs=0.1)


def test_the_page_and_the_icons_travel_in_the_controller(controller_fmu):
    with zipfile.ZipFile(controller_fmu) as archive:
        assert archive.read("documentation/index.html") == (ROOT / CONTROLLER.path).read_bytes()
        for icon in (ICON, ICON_SVG):
            assert archive.read(icon.as_posix()) == (ROOT / CONTROLLER.content / icon).read_bytes()


def test_the_model_for_openmodelica_has_the_wires_of_the_ssp(closed_loop):
    """Nothing here can read Modelica; the names and values at least are those of what is run elsewhere."""
    model = (ROOT / "examples/openmodelica/ClosedLoop.mo").read_text(encoding="utf-8")
    wires = re.findall(r"^  connect\(([\w.]+), ([\w.]+)\);$", model, flags=re.M)
    assert sorted(wires) == sorted(tuple(wire) for wire in closed_loop.connections)
    for name, (end, value) in closed_loop.inputs.items():
        assert f"  parameter Real {name} = {value} " in model and f"  {end} = {name};" in model
    script = (ROOT / "examples/openmodelica/closed_loop.mos").read_text(encoding="utf-8")
    for fmu in closed_loop.fmus.values():
        assert f"target/fmu/{fmu}" in script and f"  {fmu.removesuffix('.fmu')}_me_FMU " in model
