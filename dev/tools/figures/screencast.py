"""The screencast in the README: in a browser, the mouse drags the gripper on the page that runs the FMU."""

from __future__ import annotations

import io
import shutil
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageSequence

from prw.errors import UserError
from prw.files import replacing

#: Duration of each frame, ms, and the number of mouse movements in a frame.
STAY, SUBSTEPS = 100, 5
#: Size of the window and width of the GIF, px.
WINDOW, WIDTH = (1280, 760), 640
#: Movements of the mouse: number of frames, whether the button is down, and the distance to the right and down, px.
GESTURES = (
    (4, False, (0, 0)),
    (11, True, (22, 0)),
    (5, True, (0, 0)),
    (9, True, (0, 26)),
    (5, True, (0, 0)),
    (14, True, (-22, -26)),
    (6, False, (46, 12)),
)
#: Corners of the pointer, px.
POINTER = ((0, 0), (0, 19), (4.5, 15), (8, 22.5), (11, 21), (7.7, 14), (13.5, 14))
#: Waits until the page has drawn.
DRAWN = "new Promise(done => { const { port1, port2 } = new MessageChannel(); port1.onmessage = done; port2.postMessage(0); })"


def record(fmu: Path, path: Path) -> None:
    """Records how the mouse drags the gripper on the page in Chromium, and writes a GIF unless `path` already shows the
    same."""
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium")
    if chromium is None:
        raise UserError(f"{path} needs the browser chromium; on Debian: apt install chromium")
    with tempfile.TemporaryDirectory() as directory, sync_playwright() as playwright:
        with zipfile.ZipFile(fmu) as archive:
            page_file = Path(archive.extract("documentation/index.html", directory))
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WINDOW[0], "height": WINDOW[1]})
        # The page's clock moves only between frames, so that the screencast is the same on slow machines.
        page.clock.install(time=0)
        page.goto(f"{page_file.as_uri()}#try&motion=hand")
        page.locator(".live-scene").wait_for()
        page.clock.pause_at(1000)
        page.clock.run_for(500)
        frames = _frames(page)
        browser.close()
    # One palette for all frames avoids flicker.
    palette = frames[len(frames) // 3].quantize(64, kmeans=1, dither=Image.Dither.NONE)
    few = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    if path.exists() and _look_alike(path, few):
        return
    with replacing(path) as temporary:
        few[0].save(temporary, format="GIF", save_all=True, append_images=few[1:], duration=STAY, loop=0, optimize=True)


def _frames(page: Any) -> list[Image.Image]:
    """The frames of the gestures, with the pointer."""
    boxes = [page.locator(selector).first.bounding_box() for selector in (".live-scene", ".live-pane > .live-plots")]
    left, top = (min(box[axis] for box in boxes) - 6 for axis in ("x", "y"))
    right, bottom = (
        max(box[axis] + box[size] for box in boxes) + 6 for axis, size in (("x", "width"), ("y", "height"))
    )
    clip = {"x": left, "y": top, "width": right - left, "height": bottom - top}
    x, y = _gripper(page, boxes[0])
    frames, is_down = [], False
    for count, holds, (across, down) in GESTURES:
        if holds != is_down:
            (page.mouse.down if holds else page.mouse.up)()
            is_down = holds
        for _ in range(count):
            for _ in range(SUBSTEPS):
                x, y = x + across / count / SUBSTEPS, y + down / count / SUBSTEPS
                page.mouse.move(x, y)
                page.clock.run_for(STAY // SUBSTEPS)
            page.evaluate(DRAWN)
            frame = Image.open(io.BytesIO(page.screenshot(clip=clip))).convert("RGB")
            _draw_pointer(frame, x - left, y - top, holds)
            height = round(frame.height * WIDTH / frame.width)
            frames.append(frame.resize((WIDTH, height), Image.Resampling.LANCZOS))
    return frames


def _gripper(page: Any, box: Any) -> tuple[float, float]:
    """A position at which the mouse is on the gripper. Leaves the mouse there."""
    scene = page.locator(".live-scene")
    for y in range(10, int(box["height"]), 8):
        x, height = box["x"] + 0.47 * box["width"], box["y"] + y
        page.mouse.move(x, height)
        if scene.evaluate("canvas => canvas.style.cursor") == "move":
            page.mouse.move(x, height + 24)
            return float(x), float(height + 24)
    raise UserError("the page shows no gripper that the mouse can drag")


def _draw_pointer(frame: Image.Image, x: float, y: float, holds: bool) -> None:
    """Draws the pointer, with a ring while the button is down."""
    draw = ImageDraw.Draw(frame)
    if holds:
        draw.ellipse((x - 11, y - 11, x + 11, y + 11), outline=(28, 33, 38), width=2)
    draw.polygon([(x + right, y + down) for right, down in POINTER], fill="white", outline=(28, 33, 38), width=2)


def _look_alike(path: Path, frames: list[Image.Image]) -> bool:
    """Whether a GIF has these frames. Up to 10 pixels of each may differ clearly, because Chromium draws a few edge pixels
    differently in each run."""
    with Image.open(path) as kept:
        before = [np.asarray(frame.convert("RGB"), dtype=int) for frame in ImageSequence.Iterator(kept)]
    after = [np.asarray(frame.convert("RGB"), dtype=int) for frame in frames]
    if [frame.shape for frame in before] != [frame.shape for frame in after]:
        return False
    return all((np.abs(old - new).max(axis=2) > 16).sum() <= 10 for old, new in zip(before, after))
