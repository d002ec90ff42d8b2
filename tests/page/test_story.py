"""The steps of the page: how they begin, their sentences at other numbers of lobes and rollers, and what stays while a visitor changes
something. test_sentences.py compares every sentence with the trajectories at all values that its numbers can have."""

from __future__ import annotations

import io
import re
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page, expect
from visiting import button, clock, drawn, field, middle, saved, until

STEPS = [
    *("1. The cam", "2. One motor", "3. Both motors", "4. A coupling", "5. Resonance", "6. Stop dead", "7. Controller"),
]


def step(page: Page, number: int) -> None:
    button(page, STEPS[number - 1]).click()


def text(page: Page, part: str = "what") -> str:
    """Returns the paragraph that describes the run of the step ("what") or answers its question ("why"), after the run is calculated."""
    for _ in range(5):
        drawn(page)
    return str(page.locator(f".live-chosen .live-{part}").text_content()).replace("\u00a0", " ").replace("\u2212", "-")


def set_number(page: Page, name: str, value: float) -> None:
    """Sets a number of the paragraph with the keyboard."""
    number = page.locator(".live-chosen").get_by_role("slider", name=name)
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
    """The step says by which angles the wrist pitches and rolls."""
    page = visit()
    expect(page.locator("[aria-pressed=true]")).to_have_text(STEPS[0])
    step(page, 2)
    expect(page.locator(".lead")).to_have_text(
        "Two motors turn one shaft: in the same direction to pitch it, in opposite directions to roll it. Manual"
    )
    expect(page.locator("[aria-pressed=true]")).to_have_text(STEPS[1])
    for angle, counts in [(20, {}), (37, {"M": 6}), (12, {"M": 5, "N": 5})]:
        with_counts(page, **counts)
        set_number(page, "Angle of motor 1", angle)
        rows = np.genfromtxt(io.StringIO(saved(page)), delimiter=",", names=True, skip_header=2)
        found = [float(np.rad2deg(np.interp(1.9, rows["time"], rows[name]))) for name in ("pitch", "roll")]
        numbers = [float(one) for one in re.findall(r"(-?[\d.]+)°", text(page) + text(page, "why"))]
        assert numbers[0] == angle and numbers[1:] == pytest.approx(found, abs=0.06)


def test_mean_and_difference(visit: Any) -> None:
    page = visit()
    step(page, 3)
    for angle, lobes, ratio in [(40, 4, "7/8"), (25, 7, "1/2"), (25, 6, "7/12")]:
        with_counts(page, M=lobes)
        set_number(page, "Angle of the motors", angle)
        assert f"roll is {ratio} times their difference" in text(page, "why")
        roll = float(re.findall(r"only rolls, by ([\d.]+)°", text(page, "why"))[0])
        assert roll == pytest.approx(angle * 7 / lobes, abs=0.06)


def test_resonance_and_stop_dead(visit: Any) -> None:
    """Both steps begin with the FMU's k2. Beyond the range of the number, too, the page states if there is no peak."""
    page = visit("#try&motion=hand", reduced_motion="reduce")
    step(page, 5)
    expect(field(page, "k2")).to_have_value("0.76")
    assert "at 1.00 Hz" in text(page)
    # The field is below the last step.
    field(page, "k2").scroll_into_view_if_needed()
    page.get_by_label("Motion", exact=True).select_option("shake")
    field(page, "k2").fill("0.05")
    field(page, "k2").press("Enter")
    assert "No frequency makes it swing noticeably farther" in text(page, "why")
    assert "At the peak" not in text(page, "why")
    step(page, 6)
    assert "two parts, 14.1° and, half a swing later, 5.9°" in text(page)


def test_the_comparison_stays_while_a_number_is_dragged(visit: Any) -> None:
    """In the motion in two parts, the grey curve is always the motion in one go with the same parameters. In the motion “step”, it is
    the run before the change."""
    page = visit("#try&motion=shaped", reduced_motion="reduce")
    page.wait_for_timeout(300)
    other = page.locator(".live-pane > .live-plots > figure .live-key:last-child:visible")
    for value in ("0.5", "1.5"):
        field(page, "k2").fill(value)
        field(page, "k2").press("Enter")
        page.wait_for_timeout(1100)
        expect(other).to_have_text("in one go")
    page = visit("#try&motion=step", reduced_motion="reduce")
    page.wait_for_timeout(300)
    field(page, "k2").fill("0.3")
    field(page, "k2").press("Enter")
    expect(page.locator(".live-pane > .live-plots > figure .live-key:last-child:visible")).to_have_text(
        "before the change"
    )


def test_steps_loop_until_something_is_touched(visit: Any) -> None:
    page = visit()
    for number in (2, 6):
        step(page, number)
        page.get_by_label("Speed").evaluate("e => { e.value = '2'; e.dispatchEvent(new Event('change')); }")
        until(page, "parseFloat(document.querySelector('.live-clock').textContent) > 1")
        until(page, "parseFloat(document.querySelector('.live-clock').textContent) < 0.9")
        expect(button(page, "Pause")).to_be_visible()
    # A touch of a paragraph only scrolls.
    page.locator(".live-chosen .live-what").click(position={"x": 4, "y": 4})
    assert page.evaluate("document.querySelector('.live-play').textContent") == "Pause"
    x, y = middle(page.locator(".live-scene"))
    page.mouse.click(x, y + 100)
    expect(button(page, "Play")).to_be_visible(timeout=10000)
    assert clock(page) == 2.9


@pytest.mark.parametrize("size", [(390, 844), (1440, 900)])
def test_scrolling_shows_each_step(visit: Any, size: tuple[int, int]) -> None:
    """The image stays in the window, and shows the run of the step that the reader has scrolled to. Numbers keep what the reader has set."""
    page = visit(viewport={"width": size[0], "height": size[1]}, reduced_motion="reduce")
    seen = [page.locator("[aria-pressed=true]").inner_text()]
    for _ in range(400):
        page.mouse.wheel(0, 40)
        drawn(page)
        (chosen,) = page.locator("[aria-pressed=true]").all_inner_texts()
        if chosen != seen[-1]:
            seen.append(chosen)
            scene = page.locator(".live-scene").bounding_box()
            assert scene and scene["y"] > -1 and scene["y"] + scene["height"] < size[1]
            title = page.locator(".live-chosen h3").bounding_box()
            assert title and title["y"] < size[1]
            if chosen == STEPS[1]:
                set_number(page, "Angle of motor 1", 30)
        if page.locator(".live-own h3").evaluate("e => e.getBoundingClientRect().top") < 0.4 * size[1]:
            break
    assert seen == STEPS
    step(page, 2)
    expect(page.locator(".live-chosen .live-dial")).to_have_attribute("aria-valuenow", "30")
    assert "tilts by 15°" in text(page, "why")


def test_an_answer_opens_after_the_reader_has_moved_something(visit: Any) -> None:
    page = visit(reduced_motion="reduce")
    for number in (1, 5):
        step(page, number)
        answer = page.locator(".live-chosen details")
        expect(answer).not_to_have_attribute("open", "")
        page.locator(".live-chosen .live-dial").first.press("ArrowRight")
        expect(answer).to_have_attribute("open", "")
    # The keyboard and a click open it, too.
    step(page, 2)
    page.locator(".live-chosen summary").press("Enter")
    expect(page.locator(".live-chosen details")).to_have_attribute("open", "")


def test_an_impossible_value_is_reported_next_to_the_sentences(visit: Any) -> None:
    page = visit("#try&motion=shake", reduced_motion="reduce")
    field(page, "k2").scroll_into_view_if_needed()
    page.get_by_label("Motion", exact=True).select_option("shake")
    field(page, "k2").fill("0")
    field(page, "k2").press("Enter")
    warning = page.locator(".live-chosen .live-warning")
    expect(warning).to_have_text(
        "k2 must be greater than 0\u00a0N·m/°, but it is 0\u00a0N·m/°. The sentences and the plots still belong to the value before."
    )
    field(page, "k2").fill("0.5")
    field(page, "k2").press("Enter")
    expect(warning).to_have_text("")


def test_without_motion_each_step_shows_its_largest_angle(visit: Any) -> None:
    page = visit(reduced_motion="reduce")
    for number in range(1, len(STEPS) + 1):
        step(page, number)
        rows = np.genfromtxt(io.StringIO(saved(page)), delimiter=",", names=True, skip_header=2)
        far = np.abs(rows["pitch"]) + np.abs(rows["roll"])
        assert far.max() > 0.05 and clock(page) == pytest.approx(rows["time"][far.argmax()], abs=6e-4)
