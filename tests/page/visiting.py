"""Actions of visitors of the page, for the tests."""

from __future__ import annotations

import zipfile
from pathlib import Path

from playwright.sync_api import Locator, Page


def page_of(fmu: Path, directory: Path) -> str:
    """Unpacks the pages of an FMU; returns the address of the first one."""
    with zipfile.ZipFile(fmu) as archive:
        if "documentation/manual.html" in archive.namelist():
            archive.extract("documentation/manual.html", directory)
        return Path(archive.extract("documentation/index.html", directory)).as_uri()


def drawn(page: Page) -> None:
    """Waits until the next frame shows the effect of the last action."""
    page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")


def until(page: Page, condition: str) -> None:
    """Waits for a condition. Playwright cannot wait in the page, because the page's content security policy forbids it."""
    for _ in range(1500):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(20)
    raise AssertionError(f"the condition stays false: {condition}")


def clock(page: Page) -> float:
    drawn(page)
    return float(page.locator(".live-clock").inner_text().split()[0])


def middle(element: Locator) -> tuple[float, float]:
    box = element.bounding_box()
    assert box
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def image(page: Page) -> str:
    drawn(page)
    return str(page.locator(".live-scene").evaluate("canvas => canvas.toDataURL()"))


def button(page: Page, name: str) -> Locator:
    return page.locator(".live").get_by_role("button", name=name, exact=True)


def field(page: Page, name: str) -> Locator:
    return page.locator(f"#live-{name}")


def saved(page: Page) -> str:
    """Returns the CSV file of the run."""
    with page.expect_download() as download:
        button(page, "Save as CSV").evaluate("button => button.click()")
    return Path(download.value.path()).read_text(encoding="utf-8")


def drag(page: Page, start: tuple[float, float], end: tuple[float, float]) -> None:
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*end, steps=4)
    page.mouse.up()


def find_part(page: Page, cursor: str = "ns-resize") -> tuple[float, float]:
    """Returns a position in the image at which the mouse cursor has this shape, and leaves the mouse there. The cursor is "ns-resize"
    on a motor and "move" on the gripper. The search begins at the left, where motor 1 is in the view from the front, or near the middle,
    where the gripper is, because each position takes a frame."""
    scene = page.locator(".live-scene")
    box = scene.bounding_box()
    assert box
    for x in range(int(0.35 * box["width"]) if cursor == "move" else 10, int(0.6 * box["width"]), 10):
        for y in range(20, int(box["height"]), 20):
            page.mouse.move(box["x"] + x, box["y"] + y)
            if scene.evaluate("canvas => canvas.style.cursor") == cursor:
                page.mouse.move(box["x"] + x + 4, box["y"] + y + 4)
                return box["x"] + x + 4, box["y"] + y + 4
    raise AssertionError(f"no part has the cursor {cursor}")
