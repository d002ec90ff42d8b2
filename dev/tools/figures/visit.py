"""README's film of the page in the FMU that runs it, taken in a browser."""

from __future__ import annotations

import io
import shutil
import tempfile
import zipfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageSequence

from prw.errors import UserError
from prw.files import replacing

#: A motion of the page, the number of frames, and the duration of each, ms.
MOTION, FRAMES, STAY = "tour", 42, 120
#: Size of the window and width of the film, px.
WINDOW, WIDTH = (1000, 700), 720
#: Moves a slider as a user does, without the focus mark.
SEEK = "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('input')); }"


def film(fmu: Path, path: Path) -> None:
    """Films the motion on the page in Chromium, and writes the film as GIF unless `path` already shows it."""
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium")
    if chromium is None:
        raise UserError(f"{path} needs the browser chromium; on Debian: apt install chromium")
    with tempfile.TemporaryDirectory() as directory, sync_playwright() as playwright:
        with zipfile.ZipFile(fmu) as archive:
            page_file = Path(archive.extract("documentation/index.html", directory))
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WINDOW[0], "height": WINDOW[1]}, reduced_motion="reduce")
        page.goto(f"{page_file.as_uri()}#try&motion={MOTION}")
        player, time = page.locator(".live-player"), page.get_by_label("Time", exact=True)
        time.wait_for()
        # Calculates the whole motion first: a frame of the page calculates only for a limited time.
        with page.expect_download():
            page.get_by_role("button", name="Save as CSV").evaluate("button => button.click()")
        frames = []
        for number in range(FRAMES):
            time.evaluate(SEEK, str(round(1000 * number / FRAMES)))
            # The page draws with the next frame of the screen.
            page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
            frame = Image.open(io.BytesIO(player.screenshot())).convert("RGB")
            height = round(frame.height * WIDTH / frame.width)
            frames.append(frame.resize((WIDTH, height), Image.Resampling.LANCZOS))
        browser.close()
    # One palette for all frames avoids flicker.
    palette = frames[FRAMES // 3].quantize(128, kmeans=1, dither=Image.Dither.NONE)
    few = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    if path.exists() and _look_alike(path, few):
        return
    with replacing(path) as temporary:
        few[0].save(temporary, format="GIF", save_all=True, append_images=few[1:], duration=STAY, loop=0, optimize=True)


def _look_alike(path: Path, frames: list[Image.Image]) -> bool:
    """Whether a GIF has these frames. Chromium draws a few edge pixels differently in each run."""
    with Image.open(path) as kept:
        before = [np.asarray(frame.convert("RGB"), dtype=int) for frame in ImageSequence.Iterator(kept)]
    after = [np.asarray(frame.convert("RGB"), dtype=int) for frame in frames]
    if [frame.shape for frame in before] != [frame.shape for frame in after]:
        return False
    return all((np.abs(old - new).max(axis=2) > 16).sum() <= 10 for old, new in zip(before, after))
