"""The pages in the FMUs and their figures are up to date, and the pages load nothing. The Python programs on the testbed's page run."""

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
from built import ROOT, built, pages_of, text_of
from fmpy import simulate_fmu
from lagrange import OUTPUTS
from lxml import etree
from reference import integrate

from prw.errors import UserError
from prw.motion import Motion
from tools.documentation.sources import read_table
from tools.figures import COMMITTED, bode, plots
from tools.figures.plots import figures
from tools.figures.results import numbers, results
from tools.figures.writing import write_for_page, write_small_png

#: Motion of the motors in the test of errors, from rest: AMPLITUDE * (1 - cos(FREQUENCY * t)).
END, AMPLITUDE, FREQUENCY = 0.5, np.array([0.3, -0.2]), np.array([14.0, 23.0])
EPSILON = np.finfo(float).eps
#: A number in an SVG file, in which the space before a minus and the zero before a decimal point may be missing.
NUMBER = re.compile(r"-?(?:\d+(?:\.\d+)?|\.\d+)")


@pytest.fixture(scope="module")
def page(fmu) -> str:
    """The testbed's page."""
    return text_of(fmu)


@pytest.fixture(scope="module")
def found(fmu):
    return results(fmu)


@pytest.mark.parametrize("name, sources", [("testbed", "."), ("controller", "examples/controller")])
def test_the_fmu_contains_the_icons(name, sources):
    path = built(f"prw_{name}.fmu")
    with zipfile.ZipFile(path) as archive:
        for icon in ("model.png", "documentation/model.svg"):
            assert archive.read(icon) == (ROOT / sources / "modelDescription" / icon).read_bytes()
    assert path.stat().st_size < 2e6


@pytest.mark.parametrize("name", ["testbed", "controller"])
def test_the_page_is_well_formed_and_loads_nothing(name):
    pages = pages_of(built(f"prw_{name}.fmu"))
    assert sum(len(page.encode()) for page in pages.values()) < 400e3
    ids = {title: re.findall(r'\sid="([^"]+)"', page) for title, page in pages.items()}
    for title, page in pages.items():
        etree.fromstring(re.sub(r"<!DOCTYPE html>|<meta [^>]*>", "", page))
        assert len(ids[title]) == len(set(ids[title])) and {*re.findall(r"url\(#([^)]+)", page)} <= {*ids[title]}
        assert "<script" not in page and "@import" not in page and "javascript:" not in page
        links = re.findall(r'(?:href|src)\s*=\s*"([^"]*)"', page)
        assert links
        for link in links:
            other, _, anchor = link.partition("#")
            assert not anchor or anchor in ids[other or title], link
            assert not other or other in pages, link
        assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", page))


def test_a_table_that_is_missing_or_has_gaps_is_named(tmp_path):
    path = tmp_path / "tables.md"
    path.write_text(
        "# Run\n\ntext\n\n## Deeper\n\n| a | b |\n|---|---|\n| 1 | 2 |\n\n## Gap\n\n| a | b |\n|---|---|\n| 1 |\n"
    )
    assert read_table(path, "Deeper") == (["a", "b"], [["1", "2"]])
    for heading, message in [("Run", "no table below a heading “Run”"), ("Gap", "the row of “1” has 1 cells, not 2")]:
        with pytest.raises(UserError, match=message):
            read_table(path, heading)


def program(page: str, name: str) -> str:
    (text,) = re.findall(rf'<pre data-run="{name}" tabindex="0"><code>(.*?)</code></pre>', page, flags=re.S)
    return html.unescape(text)


def run(text: str, fmu: Path, directory: Path) -> np.ndarray:
    (directory / "prw_testbed.fmu").write_bytes(fmu.read_bytes())
    result = subprocess.run([sys.executable, "-c", text], cwd=directory, capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    return np.array([float(number) for number in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", result.stdout)])


def roll_at_2(model, time=2.0) -> float:
    """Returns the roll at 2 s if the motors turn by sin(t) and -sin(t). Transients have decayed, so this is the forced response."""
    b = (model.b_angle + 1j * model.b_rate) @ np.array([1, -1])
    theta5, theta6 = (np.linalg.solve(1j * np.eye(6) - model.a, b) * np.exp(1j * time)).imag[2:4]
    return 7 / 8 * (theta5 - theta6)


@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
def test_the_fmpy_program(page, fmu, model, tmp_path, interface):
    text = program(page, "run_in_fmpy").replace("CoSimulation", interface)
    assert run(text, fmu, tmp_path) == pytest.approx(roll_at_2(model), rel=1e-3)


def test_the_libcosim_program(page, fmu, model, tmp_path):
    pytest.importorskip("libcosimpy")
    pitch, roll = run(program(page, "run_in_libcosim"), fmu, tmp_path)[-2:]
    assert abs(pitch) < 1e-12 and roll == pytest.approx(roll_at_2(model), rel=1e-4)


def angle(t):
    return AMPLITUDE * (1 - np.cos(FREQUENCY * t))


def rate(t):
    return AMPLITUDE * FREQUENCY * np.sin(FREQUENCY * t)


def test_reported_errors_of_model_exchange_in_fmpy(fmu, model):
    """The percentages in docs/compatibility.md are the errors that arise because FMPy holds inputs between communication points."""
    reported = (
        (ROOT / "docs/compatibility.md").read_text(encoding="utf-8").split("For two sines")[1].split("[fmu_run]")[0]
    )
    percents = [float(number) for number in re.findall(r"([\d.]+) %", reported)]
    found = []
    for kind, step in (("ModelExchange", 1e-3), ("ModelExchange", 1e-4), ("CoSimulation", 1e-3)):
        t = np.linspace(0, END, round(END / step) + 1)
        names = ("time", "theta1", "theta2", "omega1", "omega2")
        motors = np.array([(s, *angle(s), *rate(s)) for s in t], dtype=[(name, float) for name in names])
        options = {"start_values": {"use_omega": True}} if kind == "CoSimulation" else {"relative_tolerance": 1e-8}
        result = simulate_fmu(
            str(fmu), fmi_type=kind, stop_time=END, output_interval=step, input=motors, output=list(OUTPUTS), **options
        )
        exact = integrate(model, t, angle, rate)
        error = {name: np.max(np.abs(result[name] - exact[name])) / np.max(np.abs(exact[name])) for name in OUTPUTS}
        found += [100 * error["roll"], 100 * max(error["tau1"], error["tau2"])]
    # The document states one significant digit.
    assert percents == [float(f"{value:.1g}") for value in found]


def test_numbers_are_up_to_date(found):
    """Numbers may differ by 5 %, because some are stated with two digits, and the last digit may depend on the machine."""
    committed, fresh = (
        json.loads((ROOT / COMMITTED / "numbers.json").read_text(encoding="utf-8")),
        json.loads(numbers(found)),
    )

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


def write(directory: Path, found) -> dict[str, bytes]:
    """Writes the figures and numbers that `make figures` commits, without the animations. Returns their content by name."""
    (directory / "numbers.json").write_text(numbers(found), encoding="utf-8")
    for name, drawn in figures(found).items():
        if drawn.for_page:
            write_for_page(directory / f"{name}.svg", drawn.figure)
        if drawn.for_readme:
            write_small_png(directory / f"{name}.png", drawn.figure)
    return {path.name: path.read_bytes() for path in directory.iterdir()}


@pytest.fixture(scope="module")
def written(found, tmp_path_factory):
    return write(tmp_path_factory.mktemp("figures"), found)


def test_figures_are_up_to_date(written):
    """Coordinates in the committed SVG files differ by at most two hundredths of a point from figures drawn with the current FMU."""
    made_with = json.loads((ROOT / COMMITTED / "numbers.json").read_text(encoding="utf-8"))["made_with"]
    if made_with != f"matplotlib {matplotlib.__version__}":
        pytest.skip(f"the figures were drawn by {made_with}")
    for name in (name for name in written if name.endswith(".svg")):
        fresh, kept = written[name].decode(), (ROOT / COMMITTED / name).read_text(encoding="utf-8")
        message = f"{COMMITTED}/{name} is out of date; `make figures docs` renews it"
        assert NUMBER.sub(" # ", fresh).split() == NUMBER.sub(" # ", kept).split(), message
        values = (np.array(NUMBER.findall(text), dtype=float) for text in (fresh, kept))
        np.testing.assert_allclose(*values, atol=0.021, err_msg=message)


def in_the_last_digit(value, random):
    """Changes results in the last digit, as another processor may. Times and steps stay, because they are quotients, which are exact."""
    if isinstance(value, np.ndarray):
        return value * (1 + EPSILON * random.integers(-2, 3, value.shape))
    if isinstance(value, dict):
        exact = {"time", "step"}
        return {key: item if key in exact else in_the_last_digit(item, random) for key, item in value.items()}
    if isinstance(value, Motion):
        return Motion(**in_the_last_digit(vars(value), random))
    if hasattr(value, "_asdict"):
        return type(value)(**in_the_last_digit(value._asdict(), random))
    if isinstance(value, tuple):
        return tuple(in_the_last_digit(item, random) for item in value)
    return value


def test_another_processor_writes_the_same_files(found, written, tmp_path, monkeypatch):
    """Results that differ in the last digit give the same files, so `make figures` on another machine changes no committed file."""
    random = np.random.default_rng(1)
    monkeypatch.setattr(plots, "COLUMN", plots.COLUMN * (1 + EPSILON))
    monkeypatch.setattr(bode, "CURVE", in_the_last_digit(bode.CURVE, random))
    there = write(tmp_path, in_the_last_digit(found, random))
    assert written.keys() == there.keys()
    assert [name for name in written if written[name] != there[name]] == []


def test_the_command(fmu, tmp_path):
    elsewhere = {"cwd": tmp_path}
    run_figures = [sys.executable, ROOT / "dev/tools", "figures", "--fmu", "absent.fmu"]
    result = subprocess.run(run_figures, **elsewhere, capture_output=True, text=True, timeout=120)
    assert result.returncode == 1 and result.stderr.count("\n") == 1 and "absent.fmu: no such FMU" in result.stderr
    result = subprocess.run(
        [sys.executable, ROOT / "dev/tools", "docs"], **elsewhere, capture_output=True, text=True, timeout=120
    )
    assert result.returncode == 1 and result.stderr.count("\n") == 1 and "cannot be read" in result.stderr
