"""The steps of the page: how they begin, their sentences at other numbers of lobes and rollers, and what stays while a visitor changes
something. test_sentences.py compares every sentence with the trajectories at all values that its numbers can have."""

from __future__ import annotations

import io
import re
from typing import Any

import numpy as np
import pytest
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


def with_counts(page: Page, **counts: int) -> None:
    """Sets the numbers of lobes or rollers."""
    page.locator(".live-parameters").evaluate("e => e.open = true")
    for name, count in counts.items():
        field(page, name).fill(str(count))
        field(page, name).press("Enter")


def test_one_motor_does_both(visit: Any) -> None:
    """The page opens with this step, and says by which angles the wrist pitches and rolls."""
    page = visit()
    expect(page.locator(".lead")).to_have_text(
        "Two motors turn one shaft: in the same direction to pitch it, in opposite directions to roll it."
    )
    expect(page.locator("[aria-pressed=true]")).to_have_text(STEPS[0])
    for angle, counts in [(20, {}), (37, {"M": 6}), (12, {"M": 5, "N": 5})]:
        with_counts(page, **counts)
        set_number(page, "Angle of motor 1", angle)
        rows = np.genfromtxt(io.StringIO(saved(page)), delimiter=",", names=True, skip_header=2)
        found = [float(np.rad2deg(np.interp(1.9, rows["time"], rows[name]))) for name in ("pitch", "roll")]
        numbers = [float(one) for one in re.findall(r"(-?[\d.]+)°", text(page))]
        assert numbers[0] == angle and numbers[1:] == pytest.approx(found, abs=0.06)


def test_mean_and_difference(visit: Any) -> None:
    page = visit()
    step(page, 2)
    for angle, lobes, ratio in [(40, 4, "7/8"), (25, 7, "1/2"), (25, 6, "7/12")]:
        with_counts(page, M=lobes)
        set_number(page, "Angle of the motors", angle)
        assert f"roll is {ratio} times their difference" in text(page)
        roll = float(re.findall(r"only rolls, by ([\d.]+)°", text(page))[0])
        assert roll == pytest.approx(angle * 7 / lobes, abs=0.06)
        assert f"7 rollers each, which push the {lobes} lobes" in text(page, "why")


def test_resonance_and_stop_dead(visit: Any) -> None:
    """Both steps begin with the FMU's k2. Beyond the range of the number, too, the page states if there is no peak."""
    page = visit(reduced_motion="reduce")
    step(page, 3)
    expect(field(page, "k2")).to_have_value("0.76")
    assert "at 1.00 Hz" in text(page)
    field(page, "k2").fill("0.05")
    field(page, "k2").press("Enter")
    assert "No frequency makes it swing noticeably farther" in text(page) and "At the peak" not in text(page)
    step(page, 4)
    assert "two parts, 14.1° and, half a swing later, 5.9°" in text(page)


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
