"""Animations: bodies turn as in eq. (1), and files have the format of their suffix; the animation of the README loops."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from built import ROOT
from matplotlib.colors import to_rgb
from PIL import Image, ImageSequence

from prw import UserError, animate, simulate
from prw.animation import RATES
from prw.frames import MEASURED, angles_and_torques
from prw.motion import Motion
from prw.plots import GREEN, PURPLE
from prw.simulation import Run
from prw.wrist import Wrist, about_x, about_y


def swing(**changed: np.ndarray | None) -> Run:
    """Returns a run in which both sides turn rigidly by the same angle. changed: replaces outputs; None removes one."""
    time = np.linspace(0, 0.5, 51)
    angle = 0.3 * np.sin(2 * np.pi * time) ** 2
    outputs = {name: angle if name not in ("tau1", "tau2", "roll") else 0 * angle for name in MEASURED} | changed
    kept = {name: signal for name, signal in outputs.items() if signal is not None}
    return Run(Motion(time, np.column_stack([angle, angle])), kept, {"M": 4, "N": 7})


def corners(at: dict[str, float], colour: str) -> np.ndarray:
    """Returns the corners (k, 3) of all faces of a colour. at: angles; the others are 0."""
    everything = dict.fromkeys((f"theta{k}" for k in range(1, 7)), 0.0) | {"pitch": 0.0, "roll": 0.0} | at
    found, colours = Wrist(1.0).faces(everything)
    return np.reshape(found[(colours == to_rgb(colour)).all(axis=1)], (-1, 3))


def frames_of(path: Path) -> list[np.ndarray]:
    """Returns the frames of a GIF, (height, width, 3) each."""
    with Image.open(path) as animation:
        return [np.asarray(image.convert("RGB")).astype(int) for image in ImageSequence.Iterator(animation)]


def test_pitch_swings_ring_and_gripper_from_up_to_the_viewer() -> None:
    quarter = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    for colour in (GREEN, PURPLE):
        turned = corners({}, colour) @ quarter.T
        np.testing.assert_allclose(corners({"pitch": np.pi / 2}, colour), turned, atol=1e-12)


def test_roll_turns_the_gripper_in_the_ring() -> None:
    np.testing.assert_array_equal(corners({"roll": 1.0}, GREEN), corners({}, GREEN))
    quarter = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    np.testing.assert_allclose(corners({"roll": np.pi / 2}, PURPLE), corners({}, PURPLE) @ quarter.T, atol=1e-12)


@pytest.mark.parametrize("carrier, side, roll", [("theta5", -1, 1), ("theta6", 1, -1)])
def test_cam_moves_with_the_rollers_that_touch_it(carrier: str, side: int, roll: int) -> None:
    """At the contact above the input shaft of a side, carrier and cam both move to the viewer, as in eq. (1)."""
    contact, small = np.array([side * 0.6, 0.6, 0.0]), 1e-3
    assert (about_x(small) @ contact)[2] > 0, carrier
    assert (about_y(roll * small) @ contact)[2] > 0, carrier


def test_carriers_follow_from_pitch_and_roll(fmu: Path) -> None:
    run = simulate(fmu=fmu, outputs=(*MEASURED, "theta5", "theta6"))
    shown = angles_and_torques(run)
    for name in ("theta5", "theta6"):
        np.testing.assert_allclose(shown[name], run[name], rtol=0, atol=1e-14)


def test_gif_has_all_frames_and_ends_at_the_first_position(tmp_path: Path) -> None:
    animate(swing(), tmp_path / "run.gif", speed=1.0)
    with Image.open(tmp_path / "run.gif") as animation:
        assert animation.info["duration"] == 1000 / RATES[".gif"]
    images = frames_of(tmp_path / "run.gif")
    assert len(images) == round(0.5 * RATES[".gif"]) + 1
    height = images[0].shape[0]
    scene = [image[int(0.08 * height) : int(0.66 * height)] for image in images]
    assert np.array_equal(scene[0], scene[-1])
    assert np.abs(scene[0] - scene[2]).max() > 100


def test_page_has_the_run_and_needs_nothing_else(tmp_path: Path) -> None:
    run = swing()
    animate(run, tmp_path / "run.html", speed=0.5, captions=[(0.0, "</script>")])
    page = (tmp_path / "run.html").read_text()
    assert len(page) < 100_000 and page.count("</script>") == 1
    assert not re.search(r"https?:|<link|@import| src=", page)
    noted = json.loads(re.findall(r"^animation\((.*)\);$", page, flags=re.M)[0])
    assert noted["speed"] == 0.5 and noted["captions"] == [[0.0, "</script>"]]
    columns = {name: np.frombuffer(base64.b64decode(content)) for name, content in noted["columns"].items()}
    np.testing.assert_array_equal(columns["time"], run.time)
    for name, signal in angles_and_torques(run).items():
        np.testing.assert_array_equal(columns[name], signal)


def test_movie(tmp_path: Path) -> None:
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    animate(swing(), tmp_path / "run.mp4", speed=1.0)
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "run.mp4"))
    assert frames == round(0.5 * RATES[".mp4"]) + 1
    assert seconds == pytest.approx(frames / RATES[".mp4"], abs=0.05)


@pytest.mark.parametrize(
    "change, path, speed, message",
    [
        ({}, "run", 1.0, "run: an animation is a .gif, an .mp4 or an .html"),
        ({}, "run.avi", 1.0, "a .gif, an .mp4 or an .html"),
        ({}, "run.gif", 0.0, "must be positive"),
        ({}, "run.gif", 1e-4, "too long; choose a speed of 0.0037"),
        ({"theta3": None}, "run.gif", 1.0, "the run has no theta3"),
        ({"pitch": np.full(51, np.nan)}, "run.gif", 1.0, "pitch of the run has values that are not finite"),
    ],
)
def test_runs_and_files_that_are_rejected(
    tmp_path: Path, change: dict[str, Any], path: str, speed: float, message: str
) -> None:
    run = swing(**change)
    with pytest.raises(UserError, match=message):
        animate(run, tmp_path / path, speed=speed)
    assert not list(tmp_path.iterdir())


def test_command(prw: Any, tmp_path: Path) -> None:
    (tmp_path / "motors.csv").write_text("time,theta1,theta2\n" + "".join(f"{k / 10},{k / 9},0\n" for k in range(5)))
    done = prw("simulate", "motors.csv", "--animate", "wrist.gif")
    assert done.returncode == 0 and "wrist.gif" in done.stdout, done.stderr
    assert len(frames_of(tmp_path / "wrist.gif")) > 1


def test_the_animation_of_the_readme() -> None:
    """The animation is small, its first and last positions look equal, and the axes do not move."""
    path = ROOT / "docs" / "wrist.gif"
    assert path.stat().st_size < 500_000
    images = frames_of(path)
    height, width, _ = images[0].shape
    scene = slice(int(0.08 * height), int(0.66 * height))
    assert np.mean(np.abs(images[0][scene] - images[-1][scene]).max(axis=2) > 40) < 0.002
    axis_below = (slice(int(0.94 * height), height), slice(0, width))
    assert all(np.array_equal(image[axis_below], images[0][axis_below]) for image in images)
