"""Pictures into a file that moves: GIF, MP4, or a page that loads nothing."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from prw.errors import UserError
from prw.extras import need

PAGE = """<!DOCTYPE html>
<html lang="en">
<meta charset="utf-8">
<title>The pitch-roll wrist testbed</title>
<style>
body { max-width: WIDTHpx; margin: auto; } img { width: 100%; } input { width: 85%; } button { width: 12%; }
</style>
<img id="picture" alt="The testbed, moving"><button id="play">pause</button>
<input id="place" type="range" max="LAST" value="0">
<script>
const pictures = PICTURES;
const [picture, play, place] = ["picture", "play", "place"].map((id) => document.getElementById(id));
let playing = true;
const show = () => { picture.src = pictures[place.value]; };
const pause = (wanted) => { playing = !wanted; play.textContent = playing ? "pause" : "play"; };
play.onclick = () => pause(playing);
place.oninput = () => { pause(true); show(); };
setInterval(() => { if (playing) { place.value = (Number(place.value) + 1) % pictures.length; show(); } }, WAIT);
show();
</script>
</html>
"""


def write_gif(path: Path, pictures: Iterable[Image.Image], rate: int, colours: Iterable[ArrayLike]) -> None:
    """Write a GIF of `rate` pictures a second in the colours (red, green, blue: 0 ... 1).

    All pictures share them, without dithering: nothing flickers, and what stays takes no room.
    """
    table = Image.new("P", (1, 1))
    table.putpalette(np.rint(255 * np.array(list(colours))).astype(int).ravel().tolist())
    reduced = [one.convert("RGB").quantize(palette=table, dither=Image.Dither.NONE) for one in pictures]
    first, *others = reduced
    first.save(
        path, format="GIF", save_all=True, append_images=others, duration=round(1000 / rate), loop=0, optimize=True
    )


def write_page(path: Path, pictures: Iterable[Image.Image], rate: int) -> None:
    """Write an HTML page with all pictures, `rate` a second, a button and a slider."""
    parts, width = [], 0
    for one in pictures:
        file, width = io.BytesIO(), one.width
        one.convert("RGB").quantize(128, dither=Image.Dither.NONE).save(file, format="PNG", optimize=True)
        parts.append("data:image/png;base64," + base64.b64encode(file.getvalue()).decode())
    # The pictures last: nothing in them is taken for a name.
    values = {"WIDTH": width, "LAST": len(parts) - 1, "WAIT": 1000 / rate, "PICTURES": json.dumps(parts)}
    page = PAGE
    for name, value in values.items():
        page = page.replace(name, str(value))
    path.write_text(page, encoding="utf-8")


def write_movie(path: Path, pictures: Iterable[Image.Image], rate: int) -> None:
    """Write an MP4 of `rate` pictures a second. Raises UserError where a package is missing."""
    need("movie", "imageio_ffmpeg")
    import imageio_ffmpeg

    try:
        imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError:
        raise UserError(
            f"{path.suffix}: imageio-ffmpeg has no ffmpeg for this machine; install ffmpeg, or write a .gif"
        ) from None
    writer = None
    # Players want even sides.
    options = ["-vf", "crop=floor(iw/2)*2:floor(ih/2)*2", "-crf", "20"]
    for one in pictures:
        if writer is None:
            writer = imageio_ffmpeg.write_frames(
                str(path), one.size, fps=rate, quality=None, macro_block_size=1, output_params=options
            )
            writer.send(None)
        writer.send(one.convert("RGB").tobytes())
    if writer is not None:
        writer.close()
