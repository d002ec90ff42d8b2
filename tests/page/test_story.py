"""The numbers in the sentences of the page's steps agree with the FMU in FMPy, or in the last step with the saved run, at several
values that a visitor can set."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import simulate_fmu
from playwright.sync_api import Page, expect
from visiting import button, clock, drawn, field, saved, until

STEPS = ["1. One motor", "2. Both motors", "3. Resonance", "4. Stop dead", "5. Controller"]


def step(page: Page, number: int) -> None:
    button(page, STEPS[number - 1]).click()


def text(page: Page, part: str = "what") -> str:
    """Returns the paragraph that explains the step ("what") or gives the reason ("why"), after the run is calculated."""
    for _ in range(5):
        drawn(page)
    return str(page.locator(f".live-{part} .live-chosen").inner_text()).replace("\u00a0", " ").replace("\u2212", "-")


def set_number(page: Page, name: str, value: float) -> None:
    """Sets a number of the paragraph with the keyboard."""
    number = page.locator(".live-what p.live-chosen").get_by_role("slider", name=name)
    for _ in range(400):
        gap = value - float(number.get_attribute("aria-valuenow") or "")
        if abs(gap) < 1e-9:
            return
        number.press("ArrowRight" if gap > 0 else "ArrowLeft")
    raise AssertionError(f"{name} does not reach {value}")


def run(fmu: Path, time: Any, theta1: Any, theta2: Any, rates: tuple[Any, Any], **start: float) -> Any:
    """Simulates the testbed with these motor angles and rates (rad, rad/s) in FMPy."""
    names = ("time", "theta1", "theta2", "omega1", "omega2")
    table = np.zeros(len(time), dtype=[(name, float) for name in names])
    for name, values in zip(names, (time, theta1, theta2, *rates)):
        table[name] = values
    return simulate_fmu(
        str(fmu),
        start_values={"use_omega": True, **start},
        input=table,
        stop_time=float(time[-1]),
        step_size=1e-3,
        output_interval=1e-3,
        output=["pitch", "roll"],
        fmi_type="CoSimulation",
    )


def replayed(fmu: Path, csv: str, **start: float) -> Any:
    """Simulates the motor motion of a saved run with FMPy. Returns the results and the rows of the saved run."""
    rows = np.genfromtxt(io.StringIO(csv), delimiter=",", names=True, skip_header=2)
    return run(fmu, rows["time"], rows["theta1"], rows["theta2"], (rows["omega1"], rows["omega2"]), **start), rows


def gain(fmu: Path, frequency: float, **start: float) -> float:
    """Returns how far the wrist swings in pitch in FMPy, as a multiple of the swing of both motors."""
    turn = 2 * np.pi * frequency
    time = np.arange(0, 3 + 4 / frequency, 1e-3)
    theta, omega = 0.02 * (1 - np.cos(turn * time)), 0.02 * turn * np.sin(turn * time)
    pitch = run(fmu, time, theta, theta, (omega, omega), **start)["pitch"][time > 3]
    return float(np.ptp(pitch) / 0.04)


def test_one_motor_does_both(visit: Any, fmu: Path) -> None:
    """The page opens with this step, and says by which angles the wrist pitches and rolls."""
    page = visit()
    expect(page.locator(".lead")).to_have_text(
        "Two motors turn one shaft: in the same direction to pitch it, in opposite directions to roll it."
    )
    expect(page.locator("[aria-pressed=true]")).to_have_text(STEPS[0])
    for angle, counts in [(20, {}), (37, {}), (37, {"M": 6}), (12, {"M": 5, "N": 5})]:
        for name, count in counts.items():
            page.locator(".live-parameters").evaluate("e => e.open = true")
            field(page, name).fill(str(count))
            field(page, name).press("Enter")
        set_number(page, "Angle of motor 1", angle)
        found, rows = replayed(fmu, saved(page), **counts)
        numbers = [float(one) for one in re.findall(r"(-?[\d.]+)°", text(page))]
        assert numbers[0] == angle and not rows["theta2"].any()
        assert numbers[1:] == pytest.approx(
            [float(np.rad2deg(np.interp(1.9, found["time"], found[name]))) for name in ("pitch", "roll")], abs=0.06
        )


def test_mean_and_difference(visit: Any, fmu: Path) -> None:
    page = visit()
    step(page, 2)
    for angle, lobes, ratio in [(40, 4, "7/8"), (25, 4, "7/8"), (25, 7, "1/2"), (25, 6, "7/12")]:
        page.locator(".live-parameters").evaluate("e => e.open = true")
        field(page, "M").fill(str(lobes))
        field(page, "M").press("Enter")
        set_number(page, "Angle of the motors", angle)
        assert f"roll is {ratio} times their difference" in text(page)
        found, rows = replayed(fmu, saved(page), M=lobes)
        together = rows["time"] < 2.5
        assert np.abs(found["roll"][together]).max() < 1e-9 and np.abs(found["pitch"][~together]).max() < 1e-2
        roll = float(re.findall(r"only rolls, by ([\d.]+)°", text(page))[0])
        assert roll == pytest.approx(angle * 7 / lobes, abs=0.06)
        # The motion is slow, so the wrist turns like a rigid one.
        assert np.rad2deg(np.abs(found["roll"]).max()) == pytest.approx(roll, rel=0.05)
        assert f"7 rollers each, which push the {lobes} lobes" in text(page, "why")


def test_resonance(visit: Any, fmu: Path) -> None:
    """The step begins at 1 Hz with the FMU's k2; the peak is where FMPy finds it, also with softer and stiffer couplings."""
    page = visit(reduced_motion="reduce")
    step(page, 3)
    expect(field(page, "k2")).to_have_value("0.76")
    assert "at 1.00 Hz" in text(page)
    for softness, peak in [(0.76, (5.35, 2.04)), (0.3, (3.31, 1.375)), (1.5, (6.85, 2.70))]:
        set_number(page, "Stiffness k2", softness)
        height, place = map(float, re.findall(r"([\d.]+) times as far, at ([\d.]+) Hz", text(page))[0])
        k2 = np.rad2deg(softness)
        assert (place, height) == pytest.approx(peak, abs=0.06)
        assert height == pytest.approx(gain(fmu, place, k2=k2), abs=0.006)
        assert all(gain(fmu, place + shift, k2=k2) < height + 0.005 for shift in (-0.4, 0.4))
        assert ("with the FMU’s own values 2.04 times as far, at 5.35 Hz" in text(page)) == (softness != 0.76)
        assert ("the peak is lower" in text(page, "why")) == (softness < 0.76)
        assert ("the peak is higher" in text(page, "why")) == (softness > 0.76)
    for frequency in (5.0, 6.9):
        set_number(page, "Frequency", frequency)
        says = float(re.findall(r"The wrist swings ([\d.]+) times", text(page))[0])
        assert says == pytest.approx(gain(fmu, frequency, k2=np.rad2deg(1.5)), abs=0.006)
        assert ("This is the peak" in text(page)) == (frequency == 6.9)
    # Without a peak, the page states that there is none.
    field(page, "k2").fill("0.05")
    field(page, "k2").press("Enter")
    assert "No frequency makes it swing noticeably farther" in text(page) and "At the peak" not in text(page)


def test_stop_dead(visit: Any, fmu: Path) -> None:
    """The move in one go comes first, then the move in two parts of 14.1 and 5.9 degrees. Both overshoots equal FMPy's."""
    page = visit(reduced_motion="reduce")
    step(page, 4)
    assert "two parts, 14.1° and, half a swing later, 5.9°" in text(page)
    for softness in (0.76, 0.4, 2.0, 0.1):
        set_number(page, "Stiffness k2", softness)
        found, rows = replayed(fmu, saved(page), k2=np.rad2deg(softness))
        first = np.searchsorted(rows["time"], 1.9 + 0.095)
        assert np.rad2deg(rows["theta1"][first]) == pytest.approx(14.1, abs=0.2)
        parts = [(rows["time"] >= begin) & (rows["time"] <= end) for begin, end in ((0.1, 1.1), (1.9, 2.9))]
        plain, shaped = (float(np.rad2deg(found["pitch"][part].max())) - 20 for part in parts)
        says = text(page)
        runs_on = re.findall(r"In one go, the wrist runs on to ([\d.]+)°", says)
        assert [float(one) for one in runs_on] == ([pytest.approx(20 + plain, abs=0.06)] if plain > 0.05 else [])
        by, to = re.findall(r"runs on by ([\d.]+)° only", says), re.findall(r": the wrist runs on to ([\d.]+)°", says)
        if by:
            assert float(by[0]) == pytest.approx(shaped, abs=0.06) and shaped < 0.2 * plain
        if to:
            assert float(to[0]) == pytest.approx(20 + shaped, abs=0.06)
        assert ("because the second part stops the swing" in says) <= (shaped < 0.2 * plain)
        assert ("The parts fit this stiffness" in says) == (softness == 0.76)


def test_the_comparison_stays_while_a_number_is_dragged(visit: Any) -> None:
    """In the motion in two parts, the grey curve is always the motion in one go with the same parameters. In the motion “step”, it is
    the run before the change."""
    page = visit("#try&motion=shaped", reduced_motion="reduce")
    page.wait_for_timeout(300)
    other = page.locator(".live-player > .live-plots > figure .live-key:last-child:visible")
    for value in ("0.5", "1.5"):
        field(page, "k2").fill(value)
        field(page, "k2").press("Enter")
        page.wait_for_timeout(1100)
        expect(other).to_have_text("in one go")
    page = visit("#try&motion=step", reduced_motion="reduce")
    page.wait_for_timeout(300)
    field(page, "k2").fill("0.3")
    field(page, "k2").press("Enter")
    expect(page.locator(".live-player > .live-plots > figure .live-key:last-child:visible")).to_have_text(
        "before the change"
    )


def test_steps_loop_until_something_is_touched(visit: Any) -> None:
    page = visit()
    for number in (1, 4):
        step(page, number)
        page.get_by_label("Speed").evaluate("e => { e.value = '2'; e.dispatchEvent(new Event('change')); }")
        until(page, "parseFloat(document.querySelector('.live-clock').textContent) > 1")
        until(page, "parseFloat(document.querySelector('.live-clock').textContent) < 0.9")
        expect(button(page, "Pause")).to_be_visible()
    page.locator(".live-what p.live-chosen").click(position={"x": 4, "y": 4})
    expect(button(page, "Play")).to_be_visible(timeout=10000)
    assert clock(page) == 2.9
