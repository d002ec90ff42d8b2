"""Writes animations: GIF, MP4, or an HTML page that loads no other file."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from prw.errors import UserError
from prw.extras import need
from prw.files import page_file
from prw.motion import Array

#: The scripts of the page, in this order.
SCRIPTS = ("plot.js", "player.js", "wrist.js", "animation.js")
PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
:root {{ color-scheme: light dark; }}
body {{ margin: 0 auto; padding: 0 1rem; max-width: 90rem; background: Canvas; color: CanvasText; font: 1rem/1.5 system-ui, sans-serif; }}
{style}</style>
</head>
<body>
<script>
(() => {{
"use strict";
{scripts}WRIST = {parts};
animation({run});
}})();
</script>
</body>
</html>
"""


def write_gif(path: Path, pictures: Iterable[Image.Image], rate: int, colours: Iterable[ArrayLike]) -> None:
    """Write a GIF of `rate` frames per second in the colours (red, green, blue: 0 ... 1).

    All frames share the colours, without dithering, so that unchanged areas do not flicker and compress well.
    """
    table = Image.new("P", (1, 1))
    table.putpalette(np.rint(255 * np.array(list(colours))).astype(int).ravel().tolist())
    reduced = [one.convert("RGB").quantize(palette=table, dither=Image.Dither.NONE) for one in pictures]
    first, *others = reduced
    first.save(
        path, format="GIF", save_all=True, append_images=others, duration=round(1000 / rate), loop=0, optimize=True
    )


def write_page(path: Path, title: str, courses: Mapping[str, Array], speed: float, captions: Sequence[Any]) -> None:
    """Write an HTML page with plots of the columns, among them `time`, and the wrist in 3D, which the reader can turn."""
    files = {name: page_file(name).read_text(encoding="utf-8") for name in (*SCRIPTS, "live.css", "wrist.json")}
    columns = {name: base64.b64encode(np.asarray(one, "<f8").tobytes()).decode() for name, one in courses.items()}
    run = {"title": title, "columns": columns, "speed": speed, "captions": [list(one) for one in captions]}
    page = PAGE.format(
        title=html.escape(title),
        style=files["live.css"],
        scripts="".join(files[name] for name in SCRIPTS),
        parts=files["wrist.json"].strip(),
        # A caption must not end the script.
        run=json.dumps(run).replace("<", "\\u003c"),
    )
    path.write_text(page, encoding="utf-8")


def write_movie(path: Path, pictures: Iterable[Image.Image], rate: int) -> None:
    """Write an MP4 of `rate` frames per second. Raises UserError if a package is missing."""
    need("imageio_ffmpeg")
    import imageio_ffmpeg

    try:
        imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError:
        raise UserError(
            f"{path.suffix}: imageio-ffmpeg has no ffmpeg for this machine; install ffmpeg, or write a .gif"
        ) from None
    writer = None
    # Players need even widths and heights.
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
