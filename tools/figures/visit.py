"""README's film of the page in the FMU that runs it, taken in a browser."""

from __future__ import annotations

import io
import shutil
import tempfile
import zipfile
from pathlib import Path

from PIL import Image

from prw.errors import UserError
from prw.files import replacing

#: What is shown: a motion of the page, in so many pictures, each for so many ms.
MOTION, PICTURES, STAY = "tour", 42, 120
#: The window in px, and how much of its width the film has.
WINDOW, WIDTH = (1000, 700), 720
#: What a hand on a slider does, without the mark of the focus.
SEEK = "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('input')); }"


def film(fmu: Path, path: Path) -> None:
    """Open the page in Chromium, go through the motion, and write what is seen as GIF."""
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium")
    if chromium is None:
        raise UserError(f"{path} needs the browser chromium; on Debian: apt install chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        with zipfile.ZipFile(fmu) as archive:
            page_file = Path(archive.extract("documentation/index.html", folder))
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WINDOW[0], "height": WINDOW[1]}, reduced_motion="reduce")
        page.goto(f"{page_file.as_uri()}#try&motion={MOTION}")
        player, time = page.locator(".live-player"), page.get_by_label("Time", exact=True)
        time.wait_for()
        page.wait_for_timeout(2000)  # all of the motion is calculated
        pictures = []
        for number in range(PICTURES):
            time.evaluate(SEEK, str(round(1000 * number / PICTURES)))
            # The picture is drawn with the next one of the screen.
            page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
            picture = Image.open(io.BytesIO(player.screenshot())).convert("RGB")
            height = round(picture.height * WIDTH / picture.width)
            pictures.append(picture.resize((WIDTH, height), Image.Resampling.LANCZOS))
        browser.close()
    # Of one palette, lest colours flicker.
    palette = pictures[PICTURES // 3].quantize(128, kmeans=1, dither=Image.Dither.NONE)
    few = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    with replacing(path) as temporary:
        few[0].save(temporary, format="GIF", save_all=True, append_images=few[1:], duration=STAY, loop=0, optimize=True)
