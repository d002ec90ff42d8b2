"""Draws the frames of an animation, the testbed in 3D with plots of its angles and torques below, and writes them as GIF or
MP4. Also writes an HTML page that draws the animation itself and loads no other file."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import ArrayLike
from PIL import Image

from prw.errors import UserError
from prw.files import page_file, replacing
from prw.motion import Array
from prw.plots import BLUE, GREEN, PURPLE, STYLE, VERMILION
from prw.wrist import DARK, PALE, STEEL, Wrist

if TYPE_CHECKING:
    from prw.simulation import Run

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


def write_gif(path: Path, frames: Iterable[Image.Image], rate: int, colours: Iterable[ArrayLike]) -> None:
    """Write a GIF of `rate` frames per second in the colours (red, green, blue: 0 ... 1).

    All frames share the colours, without dithering, so that unchanged areas do not flicker and compress well.
    """
    table = Image.new("P", (1, 1))
    table.putpalette(np.rint(255 * np.array(list(colours))).astype(int).ravel().tolist())
    reduced = [one.convert("RGB").quantize(palette=table, dither=Image.Dither.NONE) for one in frames]
    first, *others = reduced
    first.save(
        path, format="GIF", save_all=True, append_images=others, duration=round(1000 / rate), loop=0, optimize=True
    )


def write_page(path: Path, title: str, signals: Mapping[str, Array], speed: float, captions: Sequence[Any]) -> None:
    """Write an HTML page with plots of the signals, (n,) by name, among them `time`, and the wrist in 3D, which the user can turn."""
    files = {name: page_file(name).read_text(encoding="utf-8") for name in (*SCRIPTS, "live.css", "wrist.json")}
    columns = {name: base64.b64encode(np.asarray(one, "<f8").tobytes()).decode() for name, one in signals.items()}
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


def write_movie(path: Path, frames: Iterable[Image.Image], rate: int) -> None:
    """Write an MP4 of `rate` frames per second. Raises UserError if there is no ffmpeg."""
    import imageio_ffmpeg

    try:
        imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError:
        raise UserError(
            f"{path.suffix}: imageio-ffmpeg has no ffmpeg for this machine; install ffmpeg, or write a .gif"
        ) from None
    # Players need even widths and heights.
    options = {"output_params": ["-vf", "crop=floor(iw/2)*2:floor(ih/2)*2", "-crf", "20"], "macro_block_size": 1}
    writer = imageio_ffmpeg.write_frames(str(path), SIZE, fps=rate, quality=None, **options)
    writer.send(None)
    for one in frames:
        writer.send(one.convert("RGB").tobytes())
    writer.close()


#: The outputs of a run that are shown.
MEASURED = ("theta3", "theta4", "pitch", "roll", "tau1", "tau2")
#: Size of a frame in pixels, and in inches at DPI.
SIZE, DPI = (720, 405), 92
#: Twist at which the largest coupling twist of a run is drawn, rad.
SHOWN_TWIST = 0.9
#: Largest factor on the twist.
MAX_TWIST_FACTOR = 100.0
#: Direction of the viewer, deg: in front of the testbed, on the side of motor 2, and above.
AZIMUTH, ELEVATION = -64, 20
#: Directions to the viewer and to the lamp in matplotlib's axes.
VIEWER = np.array([np.cos(np.deg2rad(AZIMUTH)), np.sin(np.deg2rad(AZIMUTH)), np.tan(np.deg2rad(ELEVATION))])
LAMP = np.array([0.15, -0.62, 0.77])
#: Number of brightness levels above the darkest; few, so that a GIF needs few colours.
LEVELS = 2
#: Opacity of a curve after the present instant.
FAINT = 0.25
#: Labels of fixed parts: position in the figure, string, colour.
LABELS = (
    (0.14, 0.585, "motor 1", BLUE),
    (0.86, 0.40, "motor 2", VERMILION),
    (0.68, 0.86, "gripper: roll", PURPLE),
    (0.68, 0.80, "ring: pitch", GREEN),
)


class Panel(NamedTuple):
    """A plot below the testbed: title, factor from SI, digits and format of numbers, and label and colour of each variable."""

    title: str
    factor: float
    digits: int
    number: str
    curves: dict[str, tuple[str, str]]


PANELS = (
    Panel("Motors (°)", 180 / np.pi, 0, "{:.0f}°", {"theta1": ("θ₁", BLUE), "theta2": ("θ₂", VERMILION)}),
    Panel("Wrist (°)", 180 / np.pi, 0, "{:.0f}°", {"pitch": ("pitch", GREEN), "roll": ("roll", PURPLE)}),
    Panel("Torque (N m)", 1.0, 1, "{:.1f}", {"tau1": ("τ₁", BLUE), "tau2": ("τ₂", VERMILION)}),
)


class Moving(NamedTuple):
    """The parts of a plot that change for one variable: the line up to the instant, the dot at its end, and the value
    as a number."""

    name: str
    panel: Panel
    line: Line2D
    dot: Line2D
    shown: Text


class _Animation(FuncAnimation):
    def __del__(self) -> None:
        """Omits matplotlib's warning about animations that were not shown, because they may have been written to a file."""


def drawn(
    run: Run, speed: float, count: int, rate: int, target: Path | None, captions: Sequence[tuple[float, str]]
) -> FuncAnimation:
    """The animation of `count` frames, `rate` per second, `speed` times as fast as the run, written to `target` if that
    is given; see `prw.animate`."""
    time = run.time
    signals = angles_and_torques(run)
    frame = _Frame(time, signals, speed, captions)
    instants = np.linspace(time[0], time[-1], max(count, 2))

    def draw(number: int) -> list[Any]:
        frame.draw(float(instants[number]))
        return []

    animation = _Animation(frame.figure, draw, frames=len(instants), interval=1000 / rate, init_func=list)
    if target is not None:
        with matplotlib.rc_context(STYLE), replacing(target) as temporary:
            frames = (frame.at(float(instant)) for instant in instants)
            if target.suffix.lower() == ".gif":
                write_gif(temporary, frames, rate, _colours())
            elif target.suffix.lower() == ".html":
                write_page(temporary, "The pitch-roll wrist testbed", {"time": time} | signals, speed, captions)
            else:
                write_movie(temporary, frames, rate)
    return animation


def angles_and_torques(run: Run) -> dict[str, Array]:
    """The moving variables, (n,) each by name. Raises UserError if one is missing or has values that are not finite."""
    for name in MEASURED:
        if name not in run:
            raise UserError(f"the run has no {name}, which an animation shows; ask for it with `outputs=`")
    signals = dict(zip(("theta1", "theta2"), run.motion.theta.T)) | {name: run[name] for name in MEASURED}
    for name, signal in signals.items():
        if not np.isfinite(signal).all():
            raise UserError(f"{name} of the run has values that are not finite and cannot be shown")
    turned = run.parameters["M"] / run.parameters["N"] * run["roll"]  # eq. (1), solved for the carriers
    return signals | {"theta5": run["pitch"] + turned, "theta6": run["pitch"] - turned}


class _Frame:
    """The figure of one run, drawn for one instant after the other."""

    def __init__(
        self,
        time: Array,
        signals: Mapping[str, Array],
        speed: float,
        captions: Sequence[tuple[float, str]],
    ):
        self.time, self.signals, self.captions = time, signals, captions
        self._ground: Any = None
        pairs = (("theta1", "theta3"), ("theta3", "theta5"), ("theta2", "theta4"), ("theta4", "theta6"))
        twist = max(float(np.abs(signals[a] - signals[b]).max()) for a, b in pairs)
        factor = _round_below(min(SHOWN_TWIST / max(twist, 1e-6), MAX_TWIST_FACTOR))
        self.wrist = Wrist(factor)
        with matplotlib.rc_context({**STYLE, "font.size": 9, "axes.titlesize": 9}):
            self.figure = Figure(figsize=(SIZE[0] / DPI, SIZE[1] / DPI), dpi=DPI, facecolor="white", edgecolor="0.7")
            FigureCanvasAgg(self.figure)
            self._scene(factor, speed)
            self.moving = [one for number, panel in enumerate(PANELS) for one in self._panel(number, panel)]

    def _scene(self, factor: float, speed: float) -> None:
        """Axes as high as the figure is wide, because matplotlib keeps them square; most of their height is empty."""
        square = SIZE[0] / SIZE[1]
        axes: Any = self.figure.add_axes((0, 0.616 - square / 2, 1, square), projection="3d")
        axes.set_axis_off()
        axes.view_init(elev=ELEVATION, azim=AZIMUTH)
        axes.set_proj_type("persp", focal_length=1.0)
        # The limits are the sides of the box, so that a length is the same in each direction.
        box = np.array([10.0, 4.0, 4.0])
        axes.set(**{f"{axis}lim": (-side / 2, side / 2) for axis, side in zip("xyz", box)})
        axes.set_box_aspect(box, zoom=0.97)
        self.scene = axes
        self.bodies: Any = None
        self.caption = self.figure.text(0.02, 0.955, "", fontsize=11.5, fontweight="bold", va="center")
        note = f"couplings' twist × {factor:g}"
        if abs(speed - 1) > 1e-3:
            note = f"{speed:.2g} × real time, {note}"
        self.note = self.figure.text(0.98, 0.955, note, fontsize=8, color="0.35", ha="right", va="center")
        self.labels = [
            self.figure.text(x, y, label, color=colour, ha="center", va="center") for x, y, label, colour in LABELS
        ]

    def _panel(self, number: int, panel: Panel) -> list[Moving]:
        """Adds axes with the whole curves in pale colours. Returns the parts that move on them."""
        axis = self.figure.add_axes((0.055 + 0.328 * number, 0.105, 0.265, 0.18))
        axis.set_title(panel.title)
        values = {name: panel.factor * self.signals[name] for name in panel.curves}
        moving = []
        for (name, (label, colour)), position, style in zip(panel.curves.items(), (0.71, 1.03), ("-", (0, (3, 1.5)))):
            axis.plot(self.time, values[name], color=colour, alpha=FAINT, linewidth=1)
            (line,) = axis.plot([], [], color=colour, linewidth=1.8, linestyle=style)
            (dot,) = axis.plot([], [], "o", color=colour, markersize=5)
            axis.text(position - 0.19, 1.07, label, color=colour, ha="right", transform=axis.transAxes)
            number_shown = axis.text(position, 1.07, "", color=colour, ha="right", transform=axis.transAxes)
            moving.append(Moving(name, panel, line, dot, number_shown))
        peak = max(10.0**-panel.digits, *(float(np.abs(signal).max()) for signal in values.values()))
        axis.set(xlim=(self.time[0], self.time[-1]), ylim=(-1.15 * peak, 1.15 * peak))
        axis.locator_params(axis="y", nbins=4)
        axis.tick_params(labelsize=8, length=2)
        axis.set_xlabel("time (s)", fontsize=8, labelpad=1)
        return moving

    def draw(self, instant: float) -> None:
        """Show the instant (s)."""
        at = {name: float(np.interp(instant, self.time, signal)) for name, signal in self.signals.items()}
        if self.bodies is not None:
            self.bodies.remove()
        # matplotlib's axes have the depth second and the height third: Y, the roll axis, is up.
        corners, colours = self.wrist.faces(at)
        corners = corners[:, :, [0, 2, 1]] * (1, -1, 1)
        colours = _lit(corners, colours)
        self.bodies = Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.8)
        self.scene.add_collection3d(self.bodies, autolim=False)
        passed = [caption for begin, caption in self.captions if begin <= instant + 1e-9]
        self.caption.set_text(passed[-1] if passed else "")
        before = self.time <= instant
        for name, panel, line, dot, shown in self.moving:
            value = panel.factor * at[name]
            line.set_data(
                np.append(self.time[before], instant), np.append(panel.factor * self.signals[name][before], value)
            )
            dot.set_data([instant], [value])
            # Adding 0 turns -0.0 into 0.0.
            shown.set_text(panel.number.format(round(value, panel.digits) + 0.0).replace("-", "\N{MINUS SIGN}"))

    def at(self, instant: float) -> Image.Image:
        """The frame at the instant (s), with transparency."""
        self.draw(instant)
        canvas: Any = self.figure.canvas
        moved = [self.bodies, *(artist for one in self.moving for artist in one[2:]), self.caption]
        if self._ground is None:
            # Axes and whole curves never move and take most of the time, so they are drawn once.
            for artist in moved:
                artist.set_visible(False)
            canvas.draw()
            self._ground = canvas.copy_from_bbox(self.figure.bbox)
            for artist in moved:
                artist.set_visible(True)
        canvas.restore_region(self._ground)
        self.bodies.do_3d_projection()
        for artist in moved:
            self.figure.draw_artist(artist)
        return Image.fromarray(np.array(canvas.buffer_rgba()))


def _colours() -> Iterator[ArrayLike]:
    """All colours except the mixed colours of smooth edges: bodies in every brightness, pale curves, text and grid."""
    for name in (BLUE, VERMILION, GREEN, PURPLE, STEEL, DARK, PALE):
        yield from (_bright(to_rgb(name), level) for level in range(LEVELS + 1))
    for name in (BLUE, VERMILION, GREEN, PURPLE):
        yield 1 - FAINT * (1 - np.array(to_rgb(name)))
    yield from ((grey, grey, grey) for grey in (0.0, 0.35, 0.63, 0.9, 1.0))


def _lit(corners: Array, colours: Array) -> Array:
    """The colours (n, 3) of faces (n, k, 3) under the lamp, for the sides of the faces that the viewer sees."""
    first, second, third = np.moveaxis(corners[:, :3], 1, 0)
    normal = np.cross(second - first, third - second)
    normal *= (np.sign(normal @ VIEWER) / np.maximum(np.linalg.norm(normal, axis=1), 1e-12))[:, None]
    return _bright(colours, np.rint(LEVELS * np.maximum(normal @ LAMP, 0.0))[:, None])


def _bright(colour: ArrayLike, level: ArrayLike) -> Array:
    """The colour at one of the brightness levels 0 ... LEVELS."""
    bright: Array = (0.6 + 0.4 * np.asarray(level) / LEVELS) * np.asarray(colour)
    return bright


def _round_below(value: float) -> float:
    """The largest number up to value that is 1, 2 or 5 times a power of ten, but at least 1."""
    power = 10.0 ** float(np.floor(np.log10(max(value, 1))))
    return max(float(step * power) for step in (1.0, 2.0, 5.0) if step * power <= max(value, 1))
