"""The animation: bodies turn as eq. (1) says, files are what they are called, the film loops and is small."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image
from prw.animate import COURSES, RATES, animate, still
from prw.errors import UserError
from prw.plots import GREEN, PURPLE
from prw.wrist import Wrist, about_x, about_y

ROOT = Path(__file__).resolve().parents[2]


@dataclass
class Run:
    """A motion without dynamics: both sides turn stiffly."""

    time: np.ndarray
    courses: dict[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.courses[name]


def swing(samples: int = 51) -> Run:
    time = np.linspace(0, 0.5, samples)
    angle = 0.3 * np.sin(2 * np.pi * time) ** 2
    return Run(time, {name: angle if name not in ("tau1", "tau2", "roll") else 0 * angle for name in COURSES})


def corners(at: dict[str, float], colour: str) -> np.ndarray:
    """Where the corners of all faces of a colour are, (k, 3)."""
    everything = dict.fromkeys((f"theta{k}" for k in range(1, 7)), 0.0) | {"pitch": 0.0, "roll": 0.0} | at
    return np.vstack([face.corners for face in Wrist(1.0).faces(everything) if face.colour == to_rgb(colour)])


def test_pitch_swings_ring_and_gripper_from_up_to_the_viewer():
    quarter = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    for colour in (GREEN, PURPLE):
        turned = corners({}, colour) @ quarter.T
        np.testing.assert_allclose(corners({"pitch": np.pi / 2}, colour), turned, atol=1e-12)


def test_roll_turns_the_gripper_in_the_ring():
    np.testing.assert_array_equal(corners({"roll": 1.0}, GREEN), corners({}, GREEN))
    quarter = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    np.testing.assert_allclose(corners({"roll": np.pi / 2}, PURPLE), corners({}, PURPLE) @ quarter.T, atol=1e-12)


@pytest.mark.parametrize("carrier, side, roll", [("theta5", -1, 1), ("theta6", 1, -1)])
def test_cam_moves_with_the_rollers_that_touch_it(carrier, side, roll):
    """Where they touch, above the input shaft of a side, both go to the viewer when eq. (1) says so."""
    contact, small = np.array([side * 0.6, 0.6, 0.0]), 1e-3
    assert (about_x(small) @ contact)[2] > 0, carrier
    assert (about_y(roll * small) @ contact)[2] > 0, carrier


def test_gif_has_its_pictures_and_ends_as_it_began(tmp_path):
    animate(swing(), tmp_path / "run.gif", speed=1.0)
    with Image.open(tmp_path / "run.gif") as film:
        assert film.n_frames == round(0.5 * RATES[".gif"]) + 1
        assert film.info["duration"] == 1000 / RATES[".gif"]
        pictures = []
        for number in range(film.n_frames):
            film.seek(number)
            pictures.append(np.asarray(film.convert("RGB")).astype(int))
    height = pictures[0].shape[0]
    scene = [picture[int(0.08 * height) : int(0.66 * height)] for picture in pictures]
    assert np.array_equal(scene[0], scene[-1])
    assert np.abs(scene[0] - scene[2]).max() > 100


def test_still_stands_on_no_ground():
    pixels = np.asarray(still(swing(), 0.25))
    assert (pixels[0, :, 3] == 0).all()
    assert 0.15 < np.mean(pixels[:, :, 3] == 255) < 0.6


def test_page_needs_nothing_else(tmp_path):
    animate(swing(), tmp_path / "run.html", speed=1.0)
    page = (tmp_path / "run.html").read_text()
    assert page.count("data:image/png;base64") == round(0.5 * RATES[".html"]) + 1
    assert not re.search(r"https?:|<link|@import| src=", page)


def test_movie(tmp_path):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    animate(swing(), tmp_path / "run.mp4", speed=1.0)
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "run.mp4"))
    assert frames == round(0.5 * RATES[".mp4"]) + 1
    assert seconds == pytest.approx(frames / RATES[".mp4"], abs=0.05)


@pytest.mark.parametrize(
    "change, path, speed, complaint",
    [
        ({}, "run.avi", 1.0, "a .gif, an .mp4 or an .html"),
        ({}, "run.gif", 0.0, "must be positive"),
        ({}, "run.gif", 1e-4, "too long; choose a speed of 0.0037"),
        ({"theta5": None}, "run.gif", 1.0, "the run has no theta5"),
        ({"pitch": np.full(51, np.nan)}, "run.gif", 1.0, "pitch of the run must be 51 finite numbers"),
    ],
)
def test_what_cannot_be_shown_is_said(tmp_path, change, path, speed, complaint):
    run = swing()
    run.courses.update(change)
    run.courses = {name: course for name, course in run.courses.items() if course is not None}
    with pytest.raises(UserError, match=complaint):
        animate(run, tmp_path / path, speed=speed)
    assert not list(tmp_path.iterdir())


def test_command(fmu, tmp_path):
    recording = tmp_path / "motors.csv"
    recording.write_text("time,theta1,theta2\n" + "".join(f"{k / 10},{k / 100},{k / 100}\n" for k in range(5)))
    command = [sys.executable, "-m", "prw", "simulate", "--fmu", fmu, "--input", recording, "--out", tmp_path / "out"]
    done = subprocess.run([*command, "--animate", tmp_path / "wrist.gif"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert f"{tmp_path / 'wrist.gif'}" in done.stdout
    with Image.open(tmp_path / "wrist.gif") as film:
        assert film.is_animated


def test_film_of_the_readme():
    """Small enough for a README; begins where it ends; panels stand still."""
    path = ROOT / "docs" / "wrist.gif"
    assert path.stat().st_size < 500_000
    with Image.open(path) as film:
        pictures = []
        for number in range(film.n_frames):
            film.seek(number)
            pictures.append(np.asarray(film.convert("RGB")).astype(int))
    height, width, _ = pictures[0].shape
    scene = slice(int(0.08 * height), int(0.66 * height))
    assert np.mean(np.abs(pictures[0][scene] - pictures[-1][scene]).max(axis=2) > 40) < 0.002
    axis_below = (slice(int(0.94 * height), height), slice(0, width))
    assert all(np.array_equal(picture[axis_below], pictures[0][axis_below]) for picture in pictures)
