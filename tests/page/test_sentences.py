"""Every sentence of the steps is true at 50 values of every number that a visitor can set. The page calculates all runs in one
browser; the sentences are compared with the trajectories and, for the resonance, with the frequency response of the equations."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from built import SCRIPT, script_of
from lagrange import linear_model, table_1
from playwright.sync_api import Browser, Page
from visiting import page_of

#: Sets a number of a step to 50 values of its range. Returns the sentences and the trajectories, rad and N.m, at steps of 1 ms.
READ = """([motion, name]) => {
  const { trial } = window;
  const { low, high, step } = trial.addOn.limits.find((dial) => dial.name === name);
  const values = Array.from({ length: 50 }, (_, k) => low + step * Math.round((k * (high - low)) / 49 / step));
  trial.apply(new URLSearchParams({ motion }));
  const plain = (selector) => document.querySelector(`${selector} .live-chosen`).textContent.replaceAll("\\u00a0", " ").replaceAll("\\u2212", "-");
  return JSON.stringify(values.map((value, index) => {
    trial.change(name, value);
    trial.session.finish(trial.end, trial.move);
    const { table } = trial.session;
    trial.player.now = table.end * ((0.37 * index) % 1);
    trial.write();
    const copy = (run) => Object.fromEntries(["theta1", "theta2", "theta5", "theta6", "pitch", "roll", "tau1", "tau2"].map((one) => [one, [...run.column(one).subarray(0, run.count)]]));
    return { value, what: plain(".live-what"), why: plain(".live-why"), now: table.row(trial.player.now), run: copy(table), other: trial.other && copy(trial.other.table) };
  }));
}"""


@pytest.fixture(scope="module")
def page(browser: Browser, fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """The page, in which `window.trial` is the section that runs the FMU."""
    directory = tmp_path_factory.mktemp("sentences")
    address = page_of(fmu, directory)
    path = directory / "documentation/index.html"
    html = path.read_text(encoding="utf-8")
    script = script_of(html).replace("const trial = new Trial(", "const trial = window.trial = new Trial(")
    assert "window.trial" in script
    # The content security policy allows only the page's own scripts.
    html = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", SCRIPT.sub(lambda _: f"\n{script}", html))
    path.write_text(html, encoding="utf-8")
    page = browser.new_page(viewport={"width": 1000, "height": 900}, reduced_motion="reduce")
    page.goto(address)
    page.locator(".live-clock").wait_for()
    yield page
    page.close()


def numbers(pattern: str, text: str) -> list[float]:
    """Returns the numbers in the groups of a sentence, which must occur once."""
    (found,) = re.findall(pattern, text)
    return [float(one) for one in (found if isinstance(found, tuple) else (found,))]


def gain(frequency: Any, k2: float = 0.76) -> Any:
    """Returns how far the wrist swings in pitch, as a multiple of the swing of both motors. frequency: Hz; k2: N.m/deg."""
    model = linear_model({**table_1(), "k2": np.rad2deg(k2)})
    found = []
    for s in 2j * np.pi * np.atleast_1d(frequency):
        states = np.linalg.solve(s * np.eye(6) - model.a, (model.b_angle + s * model.b_rate) @ np.ones(2))
        found.append(abs(states[2:4].mean()))
    return np.array(found)


BAND = np.arange(0.5, 15.001, 0.05)
PRESET = gain(BAND)


def check_one_motor(found: Any, run: Any) -> None:
    turned, pitch, roll = numbers(
        r"turns by ([\d.]+)°.* tilts by ([\d.]+)° \(pitch\).* axis by ([\d.]+)° \(roll\)", found["what"]
    )
    assert turned == pytest.approx(found["value"], abs=0.51) and not run["theta2"].any()
    assert [pitch, roll] == pytest.approx([np.rad2deg(run[name][1900]) for name in ("pitch", "roll")], abs=0.06)
    # Motor 1 speeds up from 0.2 to 0.55 s.
    assert "τ₁ is negative while motor 1 speeds up" in found["why"] and (run["tau1"][260:550] < 0).all()
    assert "τ₂ is positive although motor 2 stands still" in found["why"] and (run["tau2"][360:800] > 0).all()


def check_both_motors(found: Any, run: Any) -> None:
    what, together = found["what"], np.arange(len(run["pitch"])) < 2500
    assert "the wrist only pitches" in what and np.abs(run["roll"][together]).max() < 1e-9
    assert "it only rolls" in what and np.abs(run["pitch"][~together]).max() < 1e-2
    # The motion is slow, so the wrist turns almost like a rigid one.
    (rolls,) = numbers(r"only rolls, by ([\d.]+)°", what)
    assert rolls == pytest.approx(np.rad2deg(np.abs(run["roll"]).max()), rel=0.05)
    signed = re.sub(r"([+-]) (?=\d)", r"\1", what)
    theta5, theta6, pitch, roll = (
        np.rad2deg(run[name][found["now"]]) for name in ("theta5", "theta6", "pitch", "roll")
    )
    for pattern, expected in [
        (r"pitch = \((\S+)° (\S+)°\) / 2 = (\S+)°", [theta5, theta6, pitch]),
        (r"roll = 7/8 \((\S+)° (\S+)°\) = (\S+)°", [theta5, -theta6, roll]),
    ]:
        assert numbers(pattern, signed) == pytest.approx(expected, abs=0.051)


def check_frequency(found: Any, run: Any) -> None:
    what, frequency = found["what"], found["value"]
    (swings,) = numbers(r"The wrist swings ([\d.]+) times as far as the motors", what)
    assert swings == pytest.approx(gain(frequency)[0], abs=0.006)
    # The last full period of the run.
    last = np.rad2deg(run["pitch"][-round(1000 / frequency) :])
    assert swings == pytest.approx(np.ptp(last) / 4, abs=0.03)
    assert ("This is the peak" in what) == (abs(frequency - BAND[PRESET.argmax()]) < 0.025)
    assert ("Drag the number to the peak" in what) != ("This is the peak" in what)
    check_peak(what, PRESET)


def check_peak(what: str, gains: Any) -> None:
    height, place = numbers(r"At the peak the wrist swings ([\d.]+) times as far, at ([\d.]+) Hz", what)
    assert height == pytest.approx(gains.max(), abs=0.006) and place == pytest.approx(BAND[gains.argmax()], abs=0.051)


def check_resonance(found: Any, run: Any) -> None:
    gains, what, why = gain(BAND, found["value"]), found["what"], found["why"]
    if "No frequency makes it swing noticeably farther" in what:
        assert gains.max() < 1.023 and "At the peak" not in what
        return
    assert gains.max() > 1.017
    check_peak(what, gains)
    # With almost the FMU's own stiffness, the page makes no comparison.
    if abs(found["value"] - 0.76) > 0.05:
        assert "with the FMU’s own values 2.04 times as far, at 5.35 Hz" in what
        is_softer = found["value"] < 0.76
        assert ("the peak is lower, and at a lower frequency" in why) == is_softer
        assert ("the peak is higher, and at a higher frequency" in why) != is_softer
        assert (gains.max() < PRESET.max()) == (gains.argmax() < PRESET.argmax()) == is_softer


def check_stop(found: Any, run: Any) -> None:
    what, pitch = found["what"], np.rad2deg(run["pitch"])
    plain, shaped = pitch[100:1101] - 20, pitch[1900:2901] - 20
    runs_on = re.findall(r"In one go, the wrist runs on to ([\d.]+)°( and swings)?\.", what)
    assert (plain.max() > 0.05) == bool(runs_on) != ("In one go, the wrist does not run on." in what)
    if runs_on:
        assert float(runs_on[0][0]) == pytest.approx(20 + plain.max(), abs=0.06)
        # The wrist swings if it comes back too far.
        assert bool(runs_on[0][1]) == (plain[plain.argmax() :].min() < -0.05)
    only, to = re.findall(r"runs on by ([\d.]+)° only", what), re.findall(r": the wrist runs on to ([\d.]+)°", what)
    assert len(only) + len(to) == (shaped.max() > 0.05)
    assert [float(one) for one in only] == [pytest.approx(shaped.max(), abs=0.06)] * len(only)
    assert [float(one) for one in to] == [pytest.approx(20 + shaped.max(), abs=0.06)] * len(to)
    assert ("the second part stops the swing" in what) <= (
        bool(runs_on and runs_on[0][1]) and shaped.max() < 0.2 * plain.max()
    )
    assert ("The parts fit this stiffness" in what) == (abs(found["value"] - 0.76) < 1e-6)


def check_controller(found: Any, run: Any) -> None:
    pattern = (
        r"a pitch of (\S+)° .* a roll of (\S+)°: motor 1 to (\S+)°, motor 2 to (\S+)°\. At 1.5 s motor 2 slips on its shaft by (\S+)°.*"
        r" At 3.3 s it misses its pitch by (\S+)° and its roll by (\S+)°; without feedback \(grey\) by (\S+)° and (\S+)°\."
    )
    goals, motors, slip, errors = np.split(numbers(pattern, found["what"]), [2, 4, 5])
    held, late = 1450, 3300
    assert motors == pytest.approx([np.rad2deg(run[name][held]) for name in ("theta1", "theta2")], abs=0.11)
    expected = [
        abs(np.rad2deg(one[name][late]) - goal)
        for one in (run, found["other"])
        for name, goal in zip(("pitch", "roll"), goals)
    ]
    assert errors == pytest.approx(expected, abs=0.06)
    slipped = np.rad2deg(found["other"]["theta2"][late] - found["other"]["theta2"][held])
    assert slip[0] == pytest.approx(slipped, abs=0.01)
    # What feedback buys.
    if abs(slip[0]) > 2:
        assert max(errors[:2]) < 0.15 * max(errors[2:])


@pytest.mark.parametrize(
    ("motion", "name", "check"),
    [
        ("one", "alone", check_one_motor),
        ("tour", "angle", check_both_motors),
        ("shake", "frequency", check_frequency),
        ("shake", "k2", check_resonance),
        ("stop", "k2", check_stop),
        ("closed-loop", "pitch_goal", check_controller),
        ("closed-loop", "roll_goal", check_controller),
        ("closed-loop", "slip", check_controller),
    ],
)
def test_each_sentence_is_true(page: Page, motion: str, name: str, check: Any) -> None:
    for found in json.loads(page.evaluate(READ, [motion, name])):
        check(found, {column: np.array(rows) for column, rows in found["run"].items()})
