"""Every sentence of the steps is true at 50 values of every number that a visitor can set, with the FMU's own parameters and with 50
random sets of the others. The page calculates all runs in one browser; the sentences are compared with the trajectories and, for the
resonance, with the frequency response of the equations."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from built import SCRIPT, script_of
from lagrange import REAL, TABLE_1, linear_model, varied
from playwright.sync_api import Browser, Page
from visiting import page_of

#: Sets a number of a step to 50 values of its range, and each time other parameters, in the units of the page. Returns the sentences and
#: the trajectories, rad and N.m, at steps of 1 ms.
READ = """([motion, name, others]) => {
  const { trial } = window;
  const { low, high, step } = trial.addOn.limits.find((dial) => dial.name === name);
  const values = Array.from({ length: 50 }, (_, k) => low + step * Math.round((k * (high - low)) / 49 / step));
  trial.apply(new URLSearchParams({ motion }));
  const plain = (selector) => document.querySelector(`.live-chosen ${selector}`).textContent.replaceAll("\\u00a0", " ").replaceAll("\\u2212", "-");
  return JSON.stringify(values.map((value, index) => {
    for (const [other, set] of Object.entries(others[index] ?? {})) {
      const { factor, offset } = trial.find(other);
      trial.session.start.set(trial.find(other), (set - offset) / factor);
    }
    trial.change(name, value);
    trial.session.finish(trial.end, trial.move);
    const { table } = trial.session;
    trial.player.now = table.end * ((0.37 * index + 0.00012345) % 1);
    trial.player.frame(0);
    const names = ["theta1", "theta2", "theta3", "theta5", "theta6", "pitch", "roll", "pitch_rate", "roll_rate", "tau1", "tau2"];
    const copy = (run) => Object.fromEntries(names.map((one) => [one, [...run.column(one).subarray(0, run.count)]]));
    const legend = Object.fromEntries([...document.querySelectorAll(".live-key")].map((key) => key.textContent.replace("\\u2212", "-").split(/ (?=\\S+$)/)));
    return { value, what: plain(".live-what"), why: plain(".live-why"), now: trial.player.now, legend, run: copy(table), other: trial.other && copy(trial.other.table) };
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
    # The image is drawn for each run, which takes long if it is large.
    page = browser.new_page(viewport={"width": 660, "height": 240}, reduced_motion="reduce")
    page.goto(address)
    page.locator(".live-clock").wait_for()
    yield page
    page.close()


def numbers(pattern: str, text: str) -> list[float]:
    """Returns the numbers in the groups of a sentence, which must occur once."""
    (found,) = re.findall(pattern, text)
    return [float(one) for one in (found if isinstance(found, tuple) else (found,))]


def gain(frequency: Any, parameters: Any) -> Any:
    """Returns how far the wrist swings in pitch, as a multiple of the swing of both motors. frequency: Hz."""
    model = linear_model(parameters)
    found = []
    for s in 2j * np.pi * np.atleast_1d(frequency):
        states = np.linalg.solve(s * np.eye(6) - model.a, (model.b_angle + s * model.b_rate) @ np.ones(2))
        found.append(abs(states[2:4].mean()))
    return np.array(found)


#: The parameters of the FMU, in SI units.
OWN = varied(np.ones(len(REAL)))
BAND = np.arange(0.5, 15.001, 0.05)
PRESET = gain(BAND, OWN)


def check_one_motor(found: Any, run: Any) -> None:
    (turned,) = numbers(r"motor 1 turns by ([\d.]+)°", found["what"])
    pitch, roll = numbers(r" tilts by ([\d.]+)° \(pitch\).* axis by ([\d.]+)° \(roll\)", found["why"])
    assert turned == pytest.approx(found["value"], abs=0.51) and not run["theta2"].any()
    assert [pitch, roll] == pytest.approx([np.rad2deg(run[name][1900]) for name in ("pitch", "roll")], abs=0.06)
    # Motor 1 turns from 0.2 to 0.9 s.
    if "A torque is" not in found["why"]:
        # With a light load on soft springs, the torque changes its sign before it is largest.
        assert found["others"]
        return
    until, at, largest, damping, held = numbers(
        r"τ₁ is negative until ([\d.]+) s, shortly before the motor stops, because the wrist resists\. At ([\d.]+) s it is largest, (\S+) N·m,"
        r" (\d+) % of it by damping and the rest by inertia\. Then τ₂ is (\S+) N·m although motor 2 stands still, because the cam pushes its side"
        r" forward and the motor holds it\.",
        found["why"],
    )
    tau1 = run["tau1"]
    assert (tau1[202 : round(1000 * until) - 6] < 0).all() and tau1[round(1000 * until) + 6] > 0
    assert largest == pytest.approx(tau1[200:901].min(), abs=0.006) and at == pytest.approx(
        tau1[200:901].argmin() / 1000 + 0.2, abs=0.0051
    )
    row = 200 + tau1[200:901].argmin()
    assert held == pytest.approx(run["tau2"][row], abs=0.006) and held > 0
    # The rate of change of the momentum of both carriers and the load, divided between the sides by the virtual work of eq. (1).
    parameters = found["parameters"]
    turns = np.array([[0.5, 0.5], [7 / 8, -7 / 8]])
    inertia = parameters["J2"] * np.eye(2) + turns.T @ np.diag([parameters["H3"], parameters["J3"]]) @ turns
    carriers = np.linalg.solve(turns, np.vstack([run["pitch_rate"], run["roll_rate"]]))
    torque = -(inertia @ np.gradient(carriers, 1e-3, axis=1))[0, row]
    assert damping / 100 == pytest.approx(1 - torque / tau1[row], abs=0.008)


def check_both_motors(found: Any, run: Any) -> None:
    what, why, together = found["what"], found["why"], np.arange(len(run["pitch"])) < 2500
    assert "roll is 7/8 times their difference" in why
    assert "the wrist only pitches" in why and np.abs(run["roll"][together]).max() < 1e-9
    assert "it only rolls" in why and np.abs(run["pitch"][~together]).max() < 1e-2
    # The motion is slow, so the wrist turns almost like a rigid one.
    (rolls,) = numbers(r"only rolls, by ([\d.]+)°", why)
    assert rolls == pytest.approx(np.rad2deg(np.abs(run["roll"]).max()), rel=0.05)
    # The lines and the legend of the plot show the same instant, between two rows of the table.
    now = {
        name: np.interp(found["now"], 1e-3 * np.arange(len(values)), np.rad2deg(values)) for name, values in run.items()
    }
    term = r"(\d\S*°|\(-\d\S*°\))"
    for axis, pattern in [
        ("pitch", rf"pitch = \((\S+°) \+ {term}\) / 2 = (\S+°)"),
        ("roll", rf"roll = 7/8 \((\S+°) - {term}\) = (\S+°)"),
    ]:
        (line,) = re.findall(pattern, what)
        shown = [float(one.strip("()°")) for one in line]
        assert shown == pytest.approx([now["theta5"], now["theta6"], now[axis]], abs=0.051)
        legend = found["legend"][axis]
        assert "-0.0" not in str(line)
        assert shown[2] == pytest.approx(float(legend), abs=0.051 + 0.5 * 10.0 ** -len(legend.partition(".")[2]))


def check_cam(found: Any, run: Any) -> None:
    assert "a cam with 4 lobes between two discs with 7 rollers each" in found["what"]
    (turned,) = numbers(r"both discs turn by ([\d.]+)°", found["what"])
    (rolls,) = numbers(
        r"7 rollers meet 4 lobes, it rolls 7/4 times as far as the discs turn: by ([\d.]+)°", found["why"]
    )
    assert turned == pytest.approx(np.rad2deg(run["theta1"]).max(), rel=1e-3)
    assert rolls == pytest.approx(np.rad2deg(np.abs(run["roll"]).max()), rel=0.05)


def check_coupling(found: Any, run: Any) -> None:
    stiffness, why = found["parameters"]["k2"], found["why"]
    twist = run["theta3"] - run["theta5"]
    # The shaft between the couplings has no inertia, so spring and damper together have the torque of the sensor.
    forces = {"spring": stiffness * twist, "damper": -run["tau1"] - stiffness * twist}
    damping = found["parameters"]["c2"] * np.gradient(twist, 1e-3)
    assert np.abs(forces["damper"] - damping)[2:-2].max() < 0.01 * np.abs(damping).max()
    if "The damper" in why:
        stated = dict(
            zip(
                ("damper", "spring"),
                (
                    numbers(r"The damper: its torque is largest at ([\d.]+) s, (\S+) N·m", why),
                    numbers(r"The spring follows: (\S+) N·m at ([\d.]+) s", why)[::-1],
                ),
            )
        )
        assert forces["damper"].argmax() < forces["spring"].argmax()
    else:
        stated = {"spring": numbers(r"The spring’s torque is largest at ([\d.]+) s, (\S+) N·m", why)}
        stated["damper"] = numbers(r"and the damper’s at ([\d.]+) s, (\S+) N·m", why)
    for name, (time, torque) in stated.items():
        assert [time, torque] == pytest.approx([forces[name].argmax() / 1000, forces[name].max()], abs=0.006)


def check_frequency(found: Any, run: Any) -> None:
    what, frequency = found["what"], found["value"]
    (swings,) = numbers(r"The wrist swings ([\d.]+) times as far as the motors", what)
    assert swings == pytest.approx(gain(frequency, found["parameters"])[0], abs=0.006)
    # The last full period of the run.
    last = np.rad2deg(run["pitch"][-round(1000 / frequency) :])
    assert swings == pytest.approx(np.ptp(last) / 4, abs=0.03)
    gains = gain(BAND, found["parameters"])
    assert ("This is the peak" in what) == (abs(frequency - BAND[gains.argmax()]) < 0.025)
    check_peak(found["why"], gains)


def check_peak(why: str, gains: Any) -> None:
    height, place = numbers(r"At the peak the wrist swings ([\d.]+) times as far, at ([\d.]+) Hz", why)
    assert height == pytest.approx(gains.max(), abs=0.006) and place == pytest.approx(BAND[gains.argmax()], abs=0.051)


def check_resonance(found: Any, run: Any) -> None:
    gains, why = gain(BAND, found["parameters"]), found["why"]
    if "No frequency makes it swing noticeably farther" in why:
        assert gains.max() < 1.023 and "At the peak" not in why
        return
    assert gains.max() > 1.017
    check_peak(why, gains)
    # With almost the FMU's own stiffness, the page makes no comparison. If other parameters differ, too, it names no cause.
    if found["others"]:
        assert ("FMU’s own values" in why) == (
            abs(gains.max() - PRESET.max()) > 0.005 or gains.argmax() != PRESET.argmax()
        )
        assert "spring yields" not in why
    elif abs(found["value"] - 0.76) > 0.05:
        assert "with the FMU’s own values 2.04 times as far, at 5.35 Hz" in why
        is_softer = found["value"] < 0.76
        assert ("the peak is lower, and at a lower frequency" in why) == is_softer
        assert ("the peak is higher, and at a higher frequency" in why) != is_softer
        assert (gains.max() < PRESET.max()) == (gains.argmax() < PRESET.argmax()) == is_softer


def check_stop(found: Any, run: Any) -> None:
    what, pitch = found["why"], np.rad2deg(run["pitch"])
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
    assert ("The parts fit this stiffness" in found["what"]) == (
        not found["others"] and abs(found["value"] - 0.76) < 1e-6
    )


def check_controller(found: Any, run: Any) -> None:
    pattern = (
        r"a pitch of (\S+)° .* a roll of (\S+)°: motor 1 to (\S+)°, motor 2 to (\S+)°\. At 1.5 s motor 2 slips on its shaft by (\S+)°\."
        r".*At 3.3 s it misses its pitch by (\S+)° and its roll by (\S+)°; without feedback \(grey\) by (\S+)° and (\S+)°\."
    )
    goals, motors, slip, errors = np.split(numbers(pattern, found["what"] + found["why"]), [2, 4, 5])
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


@pytest.mark.parametrize("parameters", ["own", "random"])
@pytest.mark.parametrize(
    ("motion", "name", "check"),
    [
        ("cam", "cam", check_cam),
        ("one", "alone", check_one_motor),
        ("tour", "angle", check_both_motors),
        ("move", "k2", check_coupling),
        ("shake", "frequency", check_frequency),
        ("shake", "k2", check_resonance),
        ("stop", "k2", check_stop),
        ("closed-loop", "pitch_goal", check_controller),
        ("closed-loop", "roll_goal", check_controller),
        ("closed-loop", "slip", check_controller),
    ],
)
def test_each_sentence_is_true(page: Page, motion: str, name: str, check: Any, parameters: str) -> None:
    """Random parameters are 0.6 to 1.6 times the FMU's own."""
    factors = np.exp(np.random.default_rng(5).uniform(np.log(0.6), np.log(1.6), (50, len(REAL))))
    others = [
        {one: float(TABLE_1[one]) * factor for one, factor in zip(REAL, row) if one != name}
        for row in factors
        if parameters == "random"
    ]
    for number, found in enumerate(json.loads(page.evaluate(READ, [motion, name, others]))):
        found["others"] = bool(others)
        found["parameters"] = varied(factors[number]) if others else dict(OWN)
        if name == "k2":
            found["parameters"]["k2"] = np.rad2deg(found["value"])
        check(found, {column: np.array(rows) for column, rows in found["run"].items()})
