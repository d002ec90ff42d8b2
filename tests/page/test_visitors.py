"""Visitors of the pages in FMUs: with a mouse, a finger or only the keyboard, and with blocked scripts or without WebAssembly."""

from __future__ import annotations

import base64
import csv
import io
import os
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from built import ROOT
from fmu_run import Fmu
from PIL import Image
from playwright.sync_api import Browser, CDPSession, Page, expect
from visiting import button, clock, drag, drawn, field, find_part, image, middle, page_of, saved, until

PHONE = {"width": 360, "height": 740}


def test_with_a_mouse(visit: Any, tmp_path: Path) -> None:
    """Settings take effect, are saved, and are included in the link."""
    page = visit()
    page.get_by_label("Speed").select_option("0.05")
    page.get_by_label("Motion", exact=True).select_option("step")
    until(page, "parseFloat(document.querySelector('.live-clock').textContent) > 0.005")
    assert clock(page) < 0.5
    button(page, "Pause").click()
    stiffness = page.locator(".live-row", has_text=re.compile("^k1"))
    expect(stiffness).to_contain_text("N·m/° > 0")
    stiffness.get_by_role("spinbutton").fill("1.5")
    stiffness.get_by_role("spinbutton").press("Enter")
    # Sets the time by its slider and by a click on a plot.
    time = page.get_by_label("Time", exact=True)
    box = time.bounding_box()
    assert box
    page.mouse.click(box["x"] + 0.75 * box["width"], box["y"] + box["height"] / 2)
    assert clock(page) == pytest.approx(0.75, abs=0.03)
    page.mouse.click(*middle(page.locator(".live-plots canvas:visible").first))
    # The labels of the axis are on the left.
    assert clock(page) == pytest.approx(0.45, abs=0.05)
    expect(button(page, "Play")).to_be_visible()
    with page.expect_download() as download:
        button(page, "Save as CSV").click()
    download.value.save_as(tmp_path / "run.csv")
    with (tmp_path / "run.csv").open(newline="") as file:
        about, parameters, *lines = file
    assert re.fullmatch(r"# prw_testbed [\d.]+, guid \{[-0-9a-f]{36}\}\n", about)
    values = dict(one.split(" = ") for one in parameters.removeprefix("# ").strip().split(", "))
    assert values["use_omega"] == "1" and values["M"] == "4" and float(values["k1"]) == pytest.approx(np.rad2deg(1.5))
    rows = list(csv.reader(lines))
    assert rows[0][:3] == ["time", "theta1", "theta2"] and len(rows) == 1002
    page.get_by_text("Parts", exact=True).click()
    page.get_by_label("twist of the couplings").select_option("5")
    page.get_by_label("ring").uncheck()
    button(page, "Link to this").click()
    expect(page.locator(".live-status")).to_contain_text("contains these settings")
    again = visit(page.evaluate("location.hash"))
    expect(again.get_by_label("Motion", exact=True)).to_have_value("step")
    expect(again.locator("#live-k1")).to_have_value("1.5")
    expect(again.get_by_label("Speed")).to_have_value("0.05")
    again.get_by_text("Parts", exact=True).click()
    expect(again.get_by_label("twist of the couplings")).to_have_value("5")
    expect(again.get_by_label("ring")).not_to_be_checked()
    button(again, "Default parameters").click()
    expect(again.locator("#live-k1")).not_to_have_value("1.5")
    expect(again.locator("#live-use_omega")).not_to_be_checked()
    # A drag on a motor turns the motor; a drag next to it turns the view of the wrist.
    button(again, "Pause").click()
    before = image(again)
    x, y = middle(again.locator(".live-scene"))
    drag(again, (x, y + 120), (x + 80, y + 120))
    assert image(again) != before
    again.get_by_label("Motion", exact=True).select_option("hand")
    find_part(again)
    again.mouse.down()
    again.mouse.move(*(100, 100), steps=4)
    again.mouse.up()
    expect(again.locator("#live-theta1")).not_to_have_value("0")


def swipe(touch: CDPSession, start: tuple[float, float], shift: tuple[float, float]) -> None:
    def points(share: float) -> list[dict[str, float]]:
        return [{"x": start[0] + share * shift[0], "y": start[1] + share * shift[1]}]

    touch.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": points(0)})
    for step in range(1, 9):
        touch.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": points(step / 8)})
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def test_with_a_finger_on_a_phone(visit: Any) -> None:
    page = visit("#try&motion=hand", viewport=PHONE, has_touch=True, is_mobile=True)
    touch = page.context.new_cdp_session(page)
    assert page.evaluate("document.documentElement.scrollWidth") == PHONE["width"]
    scene = page.locator(".live-scene")
    x, y = middle(scene)
    before = image(page)
    swipe(touch, (x, y + 80), (120, 0))
    expect(page.locator("#live-theta1")).to_have_value("0")
    assert image(page) != before
    swipe(touch, (x, y + 80), (-120, 0))
    # A finger on a motor turns the motor, and the page does not scroll.
    motor, scrolled = find_part(page), page.evaluate("scrollY")
    swipe(touch, motor, (0, 60))
    until(page, "document.querySelector('#live-theta1').value > 10")
    assert page.evaluate("scrollY") == scrolled
    slider = page.get_by_role("slider", name="Motor 2", exact=True)
    slider.evaluate("slider => slider.scrollIntoView()")
    swipe(touch, middle(slider), (40, 0))
    until(page, "document.querySelector('#live-theta2').value > 10")


def test_with_the_keyboard_only(visit: Any) -> None:
    """Every control gets the focus, in order and visibly. A menu, a button, sliders and the image react to keys."""
    page = visit("#try&motion=chirp&speed=0.01")
    button(page, "Pause").wait_for()
    page.keyboard.press("Tab")
    focused = "document.activeElement"
    reached: dict[str, None] = {}
    name = (
        f"(e => e.id || e.getAttribute('aria-labelledby') || e.getAttribute('aria-label') || e.textContent)({focused})"
    )
    while page.evaluate(f"!{focused}.closest('.live')"):
        page.keyboard.press("Tab")
    while page.evaluate(f"!!{focused}.closest('.live')"):
        reached[page.evaluate(name)] = None
        assert page.evaluate(f"getComputedStyle({focused}).outlineStyle") != "none", list(reached)[-1]
        page.keyboard.press("Tab")
    expected = page.evaluate(
        "[...document.querySelectorAll('.live :is(a, button, input, select, summary, [tabindex])')]"
        ".filter(e => e.checkVisibility({visibilityProperty: true})).map(e => e.id || e.getAttribute('aria-labelledby') || e.getAttribute('aria-label') || e.textContent)"
    )
    # A step that comes into the window plays its run.
    assert [name.replace("Pause", "Play") for name in reached] == [
        name.replace("Pause", "Play") for name in dict.fromkeys(expected)
    ]
    page.get_by_label("Motion", exact=True).select_option("chirp")
    page.get_by_label("Motion", exact=True).focus()
    page.keyboard.press("ArrowDown")
    expect(page.get_by_label("Motion", exact=True)).to_have_value("stop")
    until(page, "parseFloat(document.querySelector('.live-clock').textContent) > 0")
    button(page, "Pause").focus()
    page.keyboard.press("Space")
    expect(button(page, "Play")).to_be_focused()
    before = clock(page)
    page.get_by_label("Time", exact=True).focus()
    page.keyboard.press("Home")
    assert clock(page) == 0 < before
    before_turn = image(page)
    page.locator(".live-scene").focus()
    page.keyboard.press("ArrowLeft")
    assert image(page) != before_turn
    page.get_by_role("slider", name="Motor 1", exact=True).focus()
    page.keyboard.press("PageUp")
    expect(page.get_by_label("Motion", exact=True)).to_have_value("hand")


def test_with_reduced_motion(visit: Any) -> None:
    page = visit(reduced_motion="reduce")
    button(page, "Play").wait_for()
    page.get_by_label("Motion", exact=True).select_option("move")
    page.wait_for_timeout(400)
    # The finished run is shown at its largest angle, and plays again on request.
    assert 0.1 < clock(page) < 0.4
    button(page, "Play").click()
    until(page, "parseFloat(document.querySelector('.live-clock').textContent) > 0.9")


def test_without_scripts_only_the_page_is_shown(visit: Any, address: str) -> None:
    page = visit(java_script_enabled=False)
    assert page.locator("noscript > p").bounding_box(), "the page must report that scripts are missing"
    assert page.locator(".live, canvas").count() == 0
    expect(page.locator("main > section h2").first).to_have_text("The testbed")


@pytest.mark.parametrize(
    ("script", "reason"),
    [
        ("delete window.WebAssembly", "this browser has no WebAssembly"),
        ("delete window.DecompressionStream", "this browser has no DecompressionStream"),
        ("WebAssembly.compile = () => Promise.reject(new Error('it is forbidden'))", "it is forbidden"),
    ],
)
def test_the_page_reports_why_it_cannot_run_the_fmu(visit: Any, script: str, reason: str) -> None:
    page = visit(script=script)
    expect(page.locator("main > :first-child")).to_contain_text(reason)
    assert page.locator("canvas").count() == 0
    expect(page.locator("main h2").first).to_have_text("The testbed")


def test_a_field_can_be_filled_in_while_a_motion_plays(visit: Any) -> None:
    page = visit("#try&motion=chirp&speed=0.2")
    field(page, "theta1").press_sequentially("30", delay=150)
    expect(field(page, "theta1")).to_have_value("30")
    field(page, "theta1").press("Enter")
    expect(page.get_by_label("Motion", exact=True)).to_have_value("hand")
    until(page, "document.querySelector('.live-pane > .live-plots > figure .live-number').textContent > 29")


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("k1", "-1", "k1 must be greater than 0 N·m/°, but it is −1 N·m/°"),
        ("c1", "-0.5", "c1 must be at least 0 N·m·s/°, but it is −0.5 N·m·s/°"),
        ("theta1", "1e308", "Motor 1 must be from −36000 to 36000°, but it is 1e308°"),
        ("M", "2.5", "M must be an integer below 2³¹, but it is 2.5"),
        ("M", "0", "M must be at least 1, but it is 0"),
        ("J2", "", ""),
    ],
)
def test_an_impossible_value(visit: Any, name: str, value: str, message: str) -> None:
    """The message states the name, the range and, if the field has one, the unit; an empty field has no message. The run continues
    with the previous value."""
    page = visit("#try&motion=chirp&speed=0.2", viewport={"width": 1300, "height": 900})
    page.locator(".live-parameters").evaluate("e => e.open = true")
    before = saved(page).splitlines()[1]
    field(page, name).fill(value)
    field(page, name).press("Enter")
    expect(page.locator(f"#live-{name}-message")).to_have_text(message)
    assert field(page, name).get_attribute("aria-invalid") == ("true" if message else None)
    expect(page.locator(".live-rejected")).to_have_count(0)
    assert saved(page).splitlines()[1] == before
    start = clock(page)
    until(page, f"parseFloat(document.querySelector('.live-clock').textContent) > {start + 0.02}")
    if message:
        field(page, name).fill("2")
        field(page, name).press("Enter")
        expect(page.locator(f"#live-{name}-message")).to_have_text("")
        expect(field(page, name)).not_to_have_attribute("aria-invalid", "true")


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("speed=1e9", "speed must be from 0.001 to 100, but it is 1e9"),
        ("speed=fast", "speed must be from 0.001 to 100, but it is fast"),
        ("frequency=-5", "Frequency must be from 0.5 to 15\u00a0Hz, but it is −5"),
        ("k1=-5", "k1 must be greater than 0\u00a0N·m/°, but it is −0.0872665\u00a0N·m/°"),
        ("M=99999999999", "M must be an integer below 2³¹, but it is 1e11"),
        ("theta1=1e300", "Motor 1 must be from −36000 to 36000°, but it is 5.72958e301°"),
        ("motion=dance", "motion must be one of the list below, but it is dance"),
        ("twist=3", "twist cannot be 3"),
        ("off=wheels", "off cannot be wheels"),
        ("k9=1", "there is no k9"),
    ],
)
def test_an_impossible_value_in_a_link(visit: Any, setting: str, message: str) -> None:
    name, _, _ = setting.partition("=")
    page = visit(f"#try&{'' if name == 'motion' else 'motion=shake&'}{setting}")
    expect(page.locator(".live-status.live-error")).to_have_text(
        f"The link is applied without these values: {message}."
    )
    expect(page.get_by_label("Speed")).to_have_value("1")
    assert saved(page).count("\n") > 1000


#: Changes the module, so that it rejects motor angles above 1 rad.
REJECTING = """
const { Instance } = WebAssembly;
WebAssembly.Instance = function (...all) {
  const { exports } = new Instance(...all);
  return { exports: { ...exports,
    fmi2SetReal: (fmu, references, count, values) => count === 4 && [...new Float64Array(exports.memory.buffer, values, 2)].some((angle) => angle > 1)
      ? 3 : exports.fmi2SetReal(fmu, references, count, values),
  } };
};
"""


def test_a_value_that_the_fmu_rejects(visit: Any) -> None:
    """The run stops until another value is set, and then continues from there."""
    page = visit("#try&motion=hand&theta1=0.5&speed=1", script=REJECTING)
    page.locator(".live-clock").wait_for()
    until(page, "parseFloat(document.querySelector('.live-clock').textContent) > 0.1")
    field(page, "theta1").fill("80")
    field(page, "theta1").press("Enter")
    expect(field(page, "theta1")).to_have_attribute("aria-invalid", "true")
    expect(page.locator("#live-theta1-message")).to_have_text("The FMU rejects this value of Motor 1.")
    expect(page.locator(".live-status")).to_contain_text("The FMU rejects this value of Motor 1")
    expect(page.locator(".live-rejected")).to_have_count(1)
    stopped = clock(page)
    page.wait_for_timeout(300)
    assert clock(page) == stopped
    field(page, "theta1").fill("20")
    field(page, "theta1").press("Enter")
    expect(page.locator(".live-rejected")).to_have_count(0)
    expect(field(page, "theta1")).not_to_have_attribute("aria-invalid", "true")
    button(page, "Pause").wait_for()
    until(page, f"parseFloat(document.querySelector('.live-clock').textContent) > {stopped + 0.05}")


def test_the_cam_has_as_many_lobes_as_the_fmu(visit: Any) -> None:
    page = visit("#try&motion=fig4", reduced_motion="reduce")
    page.locator(".live-parameters").evaluate("e => e.open = true")
    before = image(page)
    field(page, "M").fill("6")
    field(page, "M").press("Enter")
    assert image(page) != before


def motors_and_wrist(page: Page) -> tuple[float, float, float, float]:
    """Returns the motor angles of the sliders, and pitch and roll at the end of the run, in deg."""
    rows = np.genfromtxt(io.StringIO(saved(page)), delimiter=",", names=True, skip_header=2)
    motors = (float(field(page, name).input_value()) for name in ("theta1", "theta2"))
    return (*motors, *(float(np.rad2deg(rows[name][-1])) for name in ("pitch", "roll")))


def test_the_gripper_follows_the_hand(visit: Any) -> None:
    """A drag to the side rolls the wrist, a drag down pitches it, and the motors turn to the angles of the inverse of eq. (1)."""
    for turns in (0, 36):
        page = visit("#try&motion=hand")
        page.locator(".live-scene").focus()
        for _ in range(turns):
            page.keyboard.press("ArrowLeft")
        gripper = find_part(page, "move")
        drag(page, gripper, (gripper[0] + 25, gripper[1]))
        page.wait_for_timeout(2500)
        theta1, theta2, pitch, roll = motors_and_wrist(page)
        assert (pitch, roll) == pytest.approx(((theta1 + theta2) / 2, 7 / 8 * (theta1 - theta2)), abs=0.5)
        # The side of the gripper that faces the viewer moves to the right, from the front and from behind.
        assert abs(pitch) < 0.5 and roll > 20
        gripper = find_part(page, "move")
        drag(page, gripper, (gripper[0], gripper[1] + 30))
        page.wait_for_timeout(2500)
        theta1, theta2, pitch, roll_after = motors_and_wrist(page)
        # The gripper comes towards the viewer, so in the view from behind the pitch is negative.
        assert (pitch > 10) if turns == 0 else (pitch < -10)
        assert roll_after == pytest.approx(roll, abs=0.5)
        says = page.locator(".live-own .live-what").inner_text().replace("−", "-")
        assert [float(one) for one in re.findall(r"(-?[\d.]+)°", says)] == pytest.approx(
            [pitch, roll_after, theta1, theta2], abs=0.3
        )


def test_a_motor_at_its_end_stops_the_gripper(visit: Any) -> None:
    """A drag down only pitches the wrist, also if a motor reaches its end, and the page names this motor. Until then, the gripper stays
    under the pointer."""
    page = visit("#try&motion=hand&theta1=1.3&theta2=0.6")
    page.wait_for_timeout(1500)
    _, _, pitch, roll = motors_and_wrist(page)
    gripper = find_part(page, "move")
    page.mouse.down()
    page.mouse.move(gripper[0], gripper[1] + 10, steps=4)
    page.wait_for_timeout(1000)
    page.mouse.up()
    page.mouse.move(gripper[0], gripper[1] + 9)
    assert page.locator(".live-scene").evaluate("canvas => canvas.style.cursor") == "move"
    drag(page, (gripper[0], gripper[1] + 9), (gripper[0], gripper[1] + 200))
    page.wait_for_timeout(2500)
    theta1, theta2, pitch_after, roll_after = motors_and_wrist(page)
    assert theta1 == pytest.approx(90) and theta2 < 85
    assert pitch_after > pitch + 10 and roll_after == pytest.approx(roll, abs=0.5)
    expect(page.locator(".live-own .live-what")).to_contain_text("Motor 1 is at its end")


def test_numbers_are_as_large_as_a_finger(visit: Any) -> None:
    """On a touch screen, a number can be grabbed 21 px above and below its middle, in any font, and the image does not cover it."""
    page = visit(viewport=PHONE, has_touch=True, is_mobile=True, reduced_motion="reduce")
    for font in ("", "serif", "monospace"):
        page.evaluate(f"document.body.style.fontFamily = '{font}'")
        page.locator(".live-steps button").nth(1).click()
        x, y = middle(page.locator(".live-chosen .live-dial"))
        for shift in (-21, 21):
            assert page.evaluate(f"document.elementFromPoint({x}, {y + shift}).className") == "live-dial", (font, shift)
        above = page.locator(".live-pane").bounding_box()
        assert above and above["y"] + above["height"] <= y - 22, font


def test_a_run_by_hand_continues(visit: Any) -> None:
    """After two minutes a new run begins where the last one ended, and the page says so."""
    page = visit("#try&motion=hand&theta1=0.3&speed=100")
    expect(page.locator(".live-status")).to_contain_text("a new one has begun where the last one ended", timeout=60000)
    expect(button(page, "Pause")).to_be_visible()
    button(page, "Pause").click()
    expect(field(page, "theta1")).to_have_value("17.19")
    rows = np.genfromtxt(io.StringIO(saved(page)), delimiter=",", names=True, skip_header=2)
    assert np.abs(rows["theta1"] - 0.3).max() < 1e-6 and np.abs(rows["pitch"] - 0.15).max() < 1e-6


def test_the_address_and_back(visit: Any) -> None:
    """Each address in the history shows its own motion and parameters. Making a link does not restart the run."""
    page = visit("#try&motion=chirp&speed=0.2")
    button(page, "Pause").wait_for()
    until(page, "parseFloat(document.querySelector('.live-clock').textContent) > 0.1")
    stiffness = field(page, "k1")
    stiffness.fill("1.5")
    stiffness.press("Enter")
    entries, before = page.evaluate("history.length"), clock(page)
    button(page, "Link to this").click()
    assert "motion=chirp" in page.evaluate("location.hash") and "k1=85.9" in page.evaluate("location.hash")
    assert page.evaluate("history.length") == entries and before <= clock(page) < before + 2
    expect(button(page, "Pause")).to_be_visible()
    button(page, "5. Resonance").click()
    button(page, "3. Both motors").click()
    for motion, pressed, value in [("shake", 1, "2.11"), ("chirp", 0, "1.5")]:
        page.go_back()
        expect(page.get_by_label("Motion", exact=True)).to_have_value(motion)
        expect(page.locator("[aria-pressed=true]")).to_have_count(pressed)
        expect(stiffness).to_have_value(value)
    page.go_forward()
    expect(page.get_by_label("Motion", exact=True)).to_have_value("shake")
    # A link within the page leaves the run as it is.
    frequency = page.get_by_role("slider", name="Frequency")
    frequency.press("ArrowRight")
    page.get_by_role("link", name="The testbed").click()
    page.go_back()
    expect(frequency).to_have_text("1.05\u00a0Hz")


def test_the_controllers_page_runs_the_loop(visit: Any, controller_address: str) -> None:
    """The testbed runs next to the controller, and the wrist reaches its goals, also if they are set by hand."""
    page = visit(at=controller_address)
    button(page, "Pause").click()
    rows = np.genfromtxt(io.StringIO(saved(page)), delimiter=",", names=True, skip_header=2)
    late = np.searchsorted(rows["time"], 1.85)
    assert np.rad2deg([rows["pitch"][late], rows["roll"][late]]) == pytest.approx([25, 50], abs=0.1)
    page.get_by_label("Goals", exact=True).select_option("hand")
    field(page, "pitch_ref").fill("12")
    field(page, "pitch_ref").press("Enter")
    page.wait_for_timeout(1500)
    button(page, "Pause").click()
    rows = np.genfromtxt(io.StringIO(saved(page)), delimiter=",", names=True, skip_header=2)
    assert np.rad2deg(rows["pitch"][-1]) == pytest.approx(12, abs=0.3)


def test_a_motor_follows_the_hand(visit: Any) -> None:
    """The motor's surface moves with the mouse, also in the view from behind."""
    page = visit("#try&motion=hand")
    scene = page.locator(".live-scene")
    for turns, sign in [(0, 1), (36, -1)]:
        button(page, "Start again").click()
        scene.focus()
        for _ in range(turns):
            page.keyboard.press("ArrowLeft")
        motor = find_part(page)
        drag(page, motor, (motor[0], motor[1] + 40))
        page.wait_for_timeout(500)
        moved = [float(field(page, name).input_value()) for name in ("theta1", "theta2")]
        assert sign * sum(moved) > 5, moved


def test_the_depth_buffer_draws_the_same_wrist(visit: Any) -> None:
    """With WebGL, even if it is slow, and without WebGL, the images clearly differ in less than 10 % of the wrist's area, mainly at
    edges."""
    slow = "const get = HTMLCanvasElement.prototype.getContext; HTMLCanvasElement.prototype.getContext = function (kind, options) { return "
    images = []
    for context in (
        "get.call(this, kind, {...options, failIfMajorPerformanceCaveat: false})",
        "kind === 'webgl' ? null : get.call(this, kind, options)",
    ):
        page = visit("#try&motion=fig4", script=f"{slow}{context} }};", reduced_motion="reduce")
        button(page, "Play").wait_for()
        data = image(page).partition(",")[2]
        images.append(np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGBA"), dtype=float))
    differs = (np.abs(images[0] - images[1]).max(axis=2) > 60).mean()
    drawn = (images[1][:, :, 3] > 0).mean()
    assert drawn > 0.05 and differs < 0.1 * drawn


#: Changes the module, so that it ends its run at 0.5 s.
ENDING = """
const { Instance } = WebAssembly;
WebAssembly.Instance = function (...all) {
  const { exports } = new Instance(...all);
  return { exports: { ...exports,
    fmi2DoStep: (fmu, time, ...more) => time < 0.5 - 1e-9 ? exports.fmi2DoStep(fmu, time, ...more) : 2,
    fmi2GetBooleanStatus: (_, kind, pointer) => (new Int32Array(exports.memory.buffer, pointer, 1)[0] = kind === 3, 0),
  } };
};
"""


def test_a_run_that_the_fmu_ends(visit: Any) -> None:
    """If the FMU ends the run, this is not an error, and the time stays at the last result."""
    page = visit("#try&motion=tour&speed=2", script=ENDING)
    expect(page.locator(".live-status")).to_have_text("The FMU has ended the run at 0.5 s.")
    expect(page.locator(".live-error")).to_have_count(0)
    expect(button(page, "Play")).to_be_visible()
    assert clock(page) == 0.5


def make_model(directory: Path, name: str) -> Path:
    """Creates a model with `cargo fmu new` and builds it; returns its FMU."""
    cargo_fmu = [ROOT / "target/debug/cargo-fmu", "fmu"]
    subprocess.run([*cargo_fmu, "new", name, "--from", name], cwd=directory, check=True, capture_output=True)
    environment = {**os.environ, "CARGO_TARGET_DIR": str(ROOT / "target/models")}
    subprocess.run([*cargo_fmu, "build"], cwd=directory / name, env=environment, check=True, capture_output=True)
    return directory / name / "target/fmu" / f"{name}.fmu"


#: Counts the line segments of curves on the canvas `window.kept`: slanted ones, and level or vertical ones.
LINES = """
const { moveTo, lineTo, stroke } = CanvasRenderingContext2D.prototype;
let path = [];
CanvasRenderingContext2D.prototype.moveTo = function (x, y) { path = [[x, y]]; moveTo.call(this, x, y); };
CanvasRenderingContext2D.prototype.lineTo = function (x, y) { path.push([x, y]); lineTo.call(this, x, y); };
CanvasRenderingContext2D.prototype.stroke = function () {
  for (let k = 1; this.canvas === window.kept && this.lineWidth > 1.5 && k < path.length; k++) {
    const [right, down] = [0, 1].map((axis) => Math.abs(path[k][axis] - path[k - 1][axis]));
    right > 0.51 && down > 0.01 ? window.slanted++ : window.level++;
  }
  stroke.call(this);
};"""


def test_a_model_reads_its_resources(browser: Browser, tmp_path: Path) -> None:
    """The page of `cargo fmu build` contains the resources, and its results equal the results of the library."""
    fmu = make_model(tmp_path, "house")
    path = page_of(fmu, tmp_path)
    page = browser.new_page(viewport=PHONE)
    page.goto(f"{path}#try&motion=run")
    with page.expect_download() as download:
        button(page, "Save as CSV").click()
    assert page.evaluate("document.documentElement.scrollWidth") == PHONE["width"]
    download.value.save_as(tmp_path / "run.csv")
    page.close()
    run = np.genfromtxt(
        tmp_path / "run.csv", delimiter=",", names=True, skip_header=2, usecols=("time", "room", "outside")
    )
    with Fmu(fmu) as loaded:
        house = loaded.instances()
        for row in run:
            assert tuple(house.get(("room", "outside"))[0]) == (row["room"], row["outside"])
            house.step(to=row["time"] + 60)
    assert np.ptp(run["outside"]) == pytest.approx(8.5)


def test_a_link_in_the_page_leads_there(visit: Any) -> None:
    """The link finds its section in the manual, although the browser lays out lower sections only when they become visible."""
    page = visit()
    button(page, "Pause").click()
    page.get_by_role("link", name="The equations").click()
    page.wait_for_url("**/manual.html#equations")
    page.wait_for_timeout(300)
    assert page.locator("#equations").evaluate("e => Math.abs(e.getBoundingClientRect().top)") < 60


def test_time_goes_on_while_a_motor_is_dragged(visit: Any) -> None:
    page = visit("#try&motion=hand", reduced_motion="reduce")
    button(page, "Play").wait_for()
    motor = find_part(page)
    page.clock.install(time=0)
    page.clock.pause_at(1000)
    page.mouse.down()
    before = float(page.locator(".live-clock").inner_text().split()[0])
    for number in range(40):
        page.mouse.move(motor[0], motor[1] + number)
        page.clock.run_for(25)
    page.mouse.up()
    assert float(page.locator(".live-clock").inner_text().split()[0]) - before == pytest.approx(1, abs=0.1)


def test_generated_pages(browser: Browser, tmp_path: Path) -> None:
    """Discrete signals are drawn as steps, a table lists the variables, and fields show the inputs at the current time."""
    pages = {}
    for name in ("ball", "lag"):
        address = page_of(make_model(tmp_path, name), tmp_path / name)
        pages[name] = browser.new_page(viewport=PHONE, reduced_motion="reduce")
        pages[name].add_init_script(LINES)
        pages[name].goto(f"{address}#try")
        button(pages[name], "Play").wait_for()
        assert pages[name].evaluate("document.documentElement.scrollWidth") == PHONE["width"]
        expect(pages[name].locator(".live-variables tbody tr")).not_to_have_count(0)
    ball, lag = pages["ball"], pages["lag"]
    saved(ball)
    for panel, is_stepwise in [("bounces", True), ("height", False)]:
        canvas = ball.locator(f".live-plots canvas[aria-label*='{panel}']")
        canvas.evaluate("canvas => { window.kept = canvas; window.slanted = 0; window.level = 0; }")
        ball.get_by_label("Time", exact=True).evaluate(
            "e => { e.value = '1000'; e.dispatchEvent(new Event('input')); }"
        )
        drawn(ball)
        assert ball.evaluate("window.level + window.slanted") > 0
        assert (ball.evaluate("window.slanted") == 0) == is_stepwise, panel
    row = lag.locator(".live-variables tbody tr").first
    expect(row.locator("td")).to_have_text(["u", "input", "0", "", "Input"])
    lag.get_by_label("Time", exact=True).evaluate("e => { e.value = '1000'; e.dispatchEvent(new Event('input')); }")
    drawn(lag)
    expect(field(lag, "u")).to_have_value("1")
    for page in pages.values():
        page.close()
