"""`animate`: a run as an animation. prw.frames draws it with matplotlib."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from prw.errors import UserError, need

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation

    from prw.simulation import Run

#: Frames per second, by the file's suffix; "" is for a notebook.
RATES = {".gif": 10, ".html": 10, ".mp4": 15, "": 10}
#: Shortest and longest duration of an animation without a given speed, s.
SHORTEST, LONGEST = 6.0, 40.0
#: Maximum number of frames; more take long to draw and to open.
MAX_FRAMES = 1500


def animate(
    run: Run,
    path: str | os.PathLike[str] | None = None,
    *,
    speed: float | None = None,
    captions: Sequence[tuple[float, str]] = (),
) -> FuncAnimation:
    """Animate `run`, and write it to `path`: a GIF, an MP4 (with the package imageio-ffmpeg) or an HTML page.

    Parameters
    ----------
    path
        The file (default: none is written).
    run
        From `prw.simulate`, with the outputs theta3, theta4, pitch, roll, tau1 and tau2.
    speed
        Seconds of the run per second of the animation (default: 1, or the speed at which the animation lasts 6 s
        or 40 s if it would be shorter or longer).
    captions
        (time, line) each, in order: the line is shown from that time (s) of the run on.

    Returns
    -------
    FuncAnimation
        The animation, for a notebook to show.

    Raises
    ------
    UserError
        The run lacks an output, `path` has another suffix or cannot be written, a package is missing, the speed is not positive, or the
        animation would be too long.
    """
    suffix = "" if path is None else suffix_of(Path(path))
    need("matplotlib")
    rate = RATES[suffix]
    length = float(run.time[-1] - run.time[0])
    if speed is None:
        speed = length / min(max(length, SHORTEST), LONGEST)
    if not 0 < speed < np.inf:
        raise UserError(f"the speed of the animation must be positive, it is {speed:g}")
    count = round(length / speed * rate) + 1
    if count > MAX_FRAMES:
        raise UserError(
            f"an animation of {count / rate:.0f} s is too long; choose a speed of {1.1 * speed * count / MAX_FRAMES:.2g}"
        )
    from prw.frames import drawn

    return drawn(run, speed, count, rate, None if path is None else Path(path), captions)


def suffix_of(path: Path) -> str:
    """The suffix of the file. Raises UserError if it is not a suffix of an animation, or if a package is missing."""
    suffix = path.suffix.lower()
    if not suffix or suffix not in RATES:
        raise UserError(f"{path}: an animation is a .gif, an .mp4 or an .html")
    need("matplotlib")
    if suffix == ".mp4":
        need("imageio_ffmpeg")
    return suffix
