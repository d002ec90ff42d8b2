"""The layout of the pages in windows of several sizes and on paper, and the contrast of their colours."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from playwright.sync_api import Page, expect
from visiting import button, drawn

SIZES = [(320, 640), (360, 740), (683, 384), (768, 1024), (1366, 768), (1920, 1080)]
#: Adds up the layout shifts since the page was opened.
SHIFTS = """window.shift = 0; new PerformanceObserver((list) => list.getEntries().forEach((entry) => window.shift += entry.value))
.observe({ type: "layout-shift", buffered: true });"""


def box(page: Page, selector: str) -> dict[str, float]:
    found = page.locator(selector).first.bounding_box()
    assert found, selector
    return {**found, "bottom": found["y"] + found["height"], "right": found["x"] + found["width"]}


@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize("which", ["testbed", "controller"])
def test_the_machine_comes_first(
    visit: Any, address: str, controller_address: str, which: str, width: int, height: int
) -> None:
    """A part of the machine is visible without scrolling, on the testbed's page at least half. Its plots are below it, on the controller's
    page next to it in a wide window. Hardly anything shifts while the page opens, and nothing is wider than the window."""
    page = visit(
        at=address if which == "testbed" else controller_address,
        script=SHIFTS,
        viewport={"width": width, "height": height},
    )
    button(page, "Pause").wait_for()
    page.wait_for_timeout(1200)
    assert page.evaluate("window.shift") < 0.1
    assert page.evaluate("document.documentElement.scrollWidth") == width
    for number in range(1, 8 if which == "testbed" else 0):
        page.locator(".live-steps button").nth(number - 1).click()
        drawn(page)
        assert page.evaluate("document.documentElement.scrollWidth") == width
    page.evaluate("scrollTo(0, 0)")
    scene, plots = box(page, ".live-scene"), box(page, ".live-player .live-plots")
    if which == "testbed":
        control = box(page, ".live-steps button")
        assert control["bottom"] < height and scene["y"] + 0.5 * scene["height"] < height
    assert scene["y"] < 0.75 * height
    if width < 832 or which == "testbed":
        # The time slider and one row of buttons are between the machine and its plots.
        assert 0 < plots["y"] - scene["bottom"] < 130
    else:
        assert abs(plots["y"] - scene["y"]) < 5 and plots["x"] > scene["right"]
    below = {"testbed": ("main nav", "#testbed"), "controller": (".live-about", "main nav", "#interface")}
    for later in below[which]:
        assert box(page, later)["y"] > plots["bottom"], later


def test_number_machine_and_plot_fit_on_a_phone(visit: Any) -> None:
    """On a phone, the number that a visitor drags, the machine and the first plot fit into one window."""
    page = visit("#try", viewport={"width": 360, "height": 740}, reduced_motion="reduce")
    for number in range(7):
        page.locator(".live-steps button").nth(number).click()
        page.wait_for_timeout(200)
        dial, scene = box(page, ".live-chosen .live-dial"), box(page, ".live-scene")
        plot = box(page, ".live-plots figure:visible canvas")
        assert -1 < scene["y"] < scene["bottom"] < plot["y"] < plot["bottom"] < dial["y"] < dial["bottom"] < 740, number


def test_plots_next_to_each_other(visit: Any) -> None:
    """If a step has one plot more, the others are drawn again for their new width, so that no label is squeezed. All have their axes at one
    height."""
    page = visit(viewport={"width": 1440, "height": 900}, reduced_motion="reduce")
    for number in range(7):
        page.locator(".live-steps button").nth(number).click()
        page.wait_for_timeout(300)
        sizes = page.locator(".live-plots figure:visible canvas").evaluate_all(
            "all => all.map(e => [e.width - e.clientWidth, e.getBoundingClientRect().bottom])"
        )
        assert len(sizes) == (4 if number == 4 else 3)
        assert all(abs(wider) <= 1 and bottom == sizes[0][1] for wider, bottom in sizes), (number, sizes)


def test_without_scripts_and_on_paper(visit: Any) -> None:
    """Without scripts the page has no gap. On paper it has no controls, and long lines of code wrap."""
    page = visit(java_script_enabled=False)
    first = box(page, "main section h2")
    assert first["y"] < 500
    page = visit()
    button(page, "Pause").click()
    page.emulate_media(media="print")
    expect(page.locator(".live")).to_be_hidden()
    expect(page.locator("main nav")).to_be_hidden()
    wide = page.evaluate(
        "[...document.querySelectorAll('pre, .scroll, .equation')].filter(e => e.scrollWidth > e.clientWidth + 1).map(e => e.className || e.tagName)"
    )
    page.set_viewport_size({"width": 700, "height": 1000})
    assert page.evaluate(
        "[...document.querySelectorAll('pre')].every(e => getComputedStyle(e).whiteSpace === 'pre-wrap' && e.scrollWidth <= e.clientWidth)"
    ), wide


def luminance(colour: str) -> float:
    """Returns the relative luminance of WCAG 2.2."""
    numbers = [int(part) for part in re.findall(r"\d+", colour)[:3]]
    linear = [value / 3294.6 if value <= 10 else ((value / 255 + 0.055) / 1.055) ** 2.4 for value in numbers]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


#: Records the colours of all texts on canvases, with the class of the canvas.
RECORD = """
window.painted = {};
const fill = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, ...more) {
  window.painted[`${this.canvas.className}|${text}`] = this.fillStyle;
  fill.call(this, text, ...more);
};"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_colours_contrast_with_their_background(visit: Any, scheme: str) -> None:
    """The contrast with the background is at least 4.5 for labels, and 3 for borders of controls and for curves (WCAG 2.2, 1.4.3
    and 1.4.11)."""
    page = visit("#try&motion=shake", script=RECORD, color_scheme=scheme, reduced_motion="reduce")
    page.wait_for_timeout(300)
    button(page, "Look inside").click()
    page.wait_for_timeout(200)

    def colour(name: str) -> str:
        script = f"(() => {{ const e = document.createElement('i'); e.style.color = 'var(--{name})'; document.querySelector('.live').append(e); const c = getComputedStyle(e).color; e.remove(); return c; }})()"
        return str(page.evaluate(script))

    hexadecimal = {
        key: "rgb(" + ",".join(str(int(value[k : k + 2], 16)) for k in (1, 3, 5)) + ")"
        for key, value in json.loads(page.evaluate("JSON.stringify(window.painted)")).items()
    }
    assert len(hexadecimal) > 20
    for key, value in hexadecimal.items():
        ground = (
            colour("tint")
            if key.startswith("live-scene")
            else page.evaluate("getComputedStyle(document.body).backgroundColor")
        )
        assert contrast(value, ground) >= 4.5, (key, value)
    for control in ("button", "select", "input[type=number]"):
        border, ground = page.evaluate(
            f"(e => [getComputedStyle(e).borderTopColor, getComputedStyle(document.body).backgroundColor])(document.querySelector('.live-controls {control}'))"
        )
        assert contrast(border, ground) >= 3, control
    for curve in range(1, 7):
        assert contrast(colour(f"curve-{curve}"), page.evaluate("getComputedStyle(document.body).backgroundColor")) >= 3
