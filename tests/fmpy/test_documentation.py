"""The page in the FMU and the figures: up to date, self-contained, and its programs run as printed."""

from __future__ import annotations

import html
import json
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from lxml import etree

from prw.documentation import PAGE, render, typeset
from prw.figures import COMMITTED, ICON
from prw.figures.gallery import figures
from prw.figures.results import numbers, results
from prw.figures.writing import write_for_page, write_svg

ROOT = Path(__file__).resolve().parents[2]
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


@pytest.fixture(scope="module")
def page() -> str:
    return (ROOT / PAGE).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def found(fmu):
    return results(fmu)


def test_the_page_is_up_to_date(page):
    assert page == render(ROOT), f"{PAGE} is out of date; write it anew with `make docs`"


def test_the_page_travels_in_the_fmu(fmu, page):
    with zipfile.ZipFile(fmu) as archive:
        assert archive.read("documentation/index.html").decode() == page
        assert archive.read("model.png") == (ROOT / ICON).read_bytes()
    assert fmu.stat().st_size < 2e6


def test_nothing_is_loaded_and_nothing_runs(page):
    assert len(page.encode()) < 400e3
    assert "<script" not in page and "@import" not in page and "javascript:" not in page
    links = re.findall(r'(?:href|src)\s*=\s*"([^"]*)"', page)
    assert all(link.startswith("#") or link == "licenses/license.txt" for link in links)
    assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", page))


def test_links_inside_the_page(page):
    ids = re.findall(r'\sid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    targets = re.findall(r'href="#([^"]+)"', page) + re.findall(r"url\(#([^)]+)\)", page)
    assert set(targets) <= set(ids)


def test_the_page_is_well_formed(page):
    etree.fromstring(re.sub(r"<!DOCTYPE html>|<meta [^>]*>", "", page))


def test_every_variable_is_in_the_page(page, description):
    for variable in description.modelVariables:
        assert f"<code>{variable.name}</code>" in page and html.escape(variable.description) in page
    assert description.guid not in page and description.guid.strip("{}") not in page


def test_no_equation_is_left_untyped(page):
    text = re.sub(r"<pre.*?</pre>", "", page, flags=re.S)
    assert "\\" not in text and "$" not in text
    assert page.count("<math") > 30


def test_typeset():
    block = typeset(r"\[ \begin{bmatrix} a & b \end{bmatrix} < 1 \tag{8} \]")
    assert block.startswith('<div class="equation"><math display="block">') and block.endswith("(8)</span></div>")
    assert '<mtable class="matrix">' in block and "<mo>&lt;</mo>" in block


def program(page: str, name: str) -> str:
    (text,) = re.findall(rf'<pre data-run="{name}"><code>(.*?)</code></pre>', page, flags=re.S)
    return html.unescape(text)


def run(text: str, fmu: Path, folder: Path) -> np.ndarray:
    (folder / "prw_testbed.fmu").write_bytes(fmu.read_bytes())
    result = subprocess.run([sys.executable, "-c", text], cwd=folder, capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    return np.array([float(number) for number in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", result.stdout)])


def roll_at_2(model, time=2.0) -> float:
    """Roll at 2 s for motors that turn by sin(t) and -sin(t): the forced motion, for transients are gone."""
    b = (model.b_angle + 1j * model.b_rate) @ np.array([1, -1])
    theta5, theta6 = (np.linalg.solve(1j * np.eye(6) - model.a, b) * np.exp(1j * time)).imag[2:4]
    return 7 / 8 * (theta5 - theta6)


@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
def test_the_fmpy_program(page, fmu, model, tmp_path, interface):
    text = program(page, "fmpy").replace("CoSimulation", interface)
    assert run(text, fmu, tmp_path) == pytest.approx(roll_at_2(model), rel=1e-3)


def test_the_libcosim_program(page, fmu, model, tmp_path):
    pytest.importorskip("libcosimpy")
    pitch, roll = run(program(page, "libcosim"), fmu, tmp_path)[-2:]
    assert abs(pitch) < 1e-12 and roll == pytest.approx(roll_at_2(model), rel=1e-4)


def test_numbers_are_up_to_date(found):
    """Two digits are quoted of the measured deviations, more of the rest; the last one may differ between machines."""
    committed, fresh = json.loads((ROOT / COMMITTED / "numbers.json").read_text(encoding="utf-8")), numbers(found)

    def compare(old, new, path):
        if isinstance(old, dict):
            assert old.keys() == new.keys(), path
            for key in old:
                compare(old[key], new[key], f"{path}/{key}")
        elif isinstance(old, list):
            for k, (a, b) in enumerate(zip(old, new)):
                compare(a, b, f"{path}[{k}]")
        elif not isinstance(old, str):
            assert new == pytest.approx(old, rel=0.05, abs=1e-12), path

    compare(committed, fresh, "numbers.json")


def test_figures_are_up_to_date(found, tmp_path):
    """The committed figures show what the FMU does now: the same drawing, to a fiftieth of a point."""
    made_with = json.loads((ROOT / COMMITTED / "numbers.json").read_text(encoding="utf-8"))["made_with"]
    if made_with != f"matplotlib {matplotlib.__version__}":
        pytest.skip(f"the figures were drawn by {made_with}")
    for name, drawn in figures(found).items():
        if not drawn.for_page:
            continue
        write_for_page(tmp_path / f"{name}.svg", drawn.figure)
        fresh, kept = ((folder / f"{name}.svg").read_text(encoding="utf-8") for folder in (tmp_path, ROOT / COMMITTED))
        ids = rf"{name}-[mp][0-9a-f]+"
        fresh, kept = (re.sub(ids, "id", text) for text in (fresh, kept))
        message = f"{COMMITTED}/{name}.svg is out of date; `make figures docs` renews it"
        assert NUMBER.sub("#", fresh) == NUMBER.sub("#", kept), message
        values = (np.array(NUMBER.findall(text), dtype=float) for text in (fresh, kept))
        np.testing.assert_allclose(*values, atol=0.021, err_msg=message)


def test_the_same_figure_is_the_same_file(found, tmp_path):
    for attempt in "12":
        write_svg(tmp_path / f"{attempt}.svg", figures(found)["fig5_b"].figure)
    assert (tmp_path / "1.svg").read_bytes() == (tmp_path / "2.svg").read_bytes()
    assert b"<dc:date>" not in (tmp_path / "1.svg").read_bytes()


def test_the_command(fmu, tmp_path):
    run_figures = [sys.executable, "-m", "prw", "figures", "--fmu", "absent.fmu"]
    result = subprocess.run(run_figures, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert result.returncode == 1 and result.stderr.count("\n") == 1 and "absent.fmu: no such FMU" in result.stderr
    result = subprocess.run(
        [sys.executable, "-m", "prw", "docs"], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert result.returncode == 1 and result.stderr.count("\n") == 1 and "cannot be read" in result.stderr
