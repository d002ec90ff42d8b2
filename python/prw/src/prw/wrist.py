"""The testbed in 3D: bodies with flat faces, and their positions at an instant.

wrist.json defines the bodies, also for the pages that show the wrist. The frame is the frame of eq. (4a). X is the pitch
axis, along the input shafts from motor 1 to motor 2. Y is the roll axis, up to the gripper. Z points to the viewer. Lengths
are not to scale and have no unit; the roller-carriers have a radius of 0.8.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import ArrayLike

from prw.files import page_file
from prw.plots import BLUE, GREEN, VERMILION

Array = np.ndarray
#: The definition of the bodies.
PARTS: dict[str, Any] = json.loads(page_file("wrist.json").read_text(encoding="utf-8"))
COLOURS: dict[str, str] = PARTS["colours"]
STEEL, DARK, PALE = COLOURS["steel"], COLOURS["dark"], COLOURS["pale"]
#: Maximum number of corners of a face; the end of a roller has six.
CORNERS = 6
#: Number of sides of a round body; the ring has twice as many.
ROUND: int = PARTS["round"]


class Face(NamedTuple):
    """A flat polygon: corners (k, 3), colour (r, g, b)."""

    corners: Array
    colour: tuple[float, float, float]


class Part(NamedTuple):
    """Faces that turn together, and a function from the angles at an instant to their rotation matrix (3, 3)."""

    faces: Sequence[Face]
    turn: Callable[[Mapping[str, float]], Array]

    def corners(self) -> Array:
        """Corners of all faces, (n, CORNERS, 3); a face with fewer repeats the last one."""
        return np.array([face.corners[np.minimum(range(CORNERS), len(face.corners) - 1)] for face in self.faces])


def about_x(angle: float) -> Array:
    """The rotation by angle (rad) about the pitch axis, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def about_y(angle: float) -> Array:
    """The rotation by angle (rad) about the roll axis, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


class Wrist:
    """All bodies. twist: factor on the couplings' twist, which makes it visible."""

    def __init__(self, twist: float):
        self.twist = twist
        parts = [*_side(1, -1, BLUE), *_side(2, 1, VERMILION), *_ring(), *_output()]
        self._parts = [(part.turn, part.corners()) for part in parts]
        self._colours = [face.colour for part in parts for face in part.faces]

    def faces(self, at: Mapping[str, float]) -> tuple[Array, Array]:
        """Everything at the angles `at`, theta1 ... theta6, pitch and roll in rad: corners (n, CORNERS, 3), colours (n, 3)."""
        faces: list[Face] = []
        for side, angles, colour in (
            (-1, ("theta1", "theta3", "theta5"), BLUE),
            (1, ("theta2", "theta4", "theta6"), VERMILION),
        ):
            angle = {turns: at[name] for turns, name in zip(("motor", "middle", "carrier"), angles)}
            for coupling in PARTS["couplings"]:
                x0, x1 = (side * x for x in coupling["x"])
                faces += self._coupling(x0, x1, angle[coupling["from"]], angle[coupling["to"]], colour)
        corners = [corners @ turn(at).T for turn, corners in self._parts]
        colours = np.array([*self._colours, *(face.colour for face in faces)])
        return np.concatenate([*corners, Part(faces, _still).corners()]), colours

    def _coupling(self, x0: float, x1: float, outer: float, inner: float, colour: str) -> list[Face]:
        """Strands from disc to disc: straight at rest, a twisted bundle under torque."""
        count, radius, width = (PARTS["coupling"][name] for name in ("strands", "radius", "width"))
        phase = 2 * np.pi * np.arange(count) / count
        ends = phase + outer, phase + outer + self.twist * (inner - outer)
        faces = []
        for begin, end in zip(*ends):
            corners = [
                _around(x0, radius, [begin - width, begin + width]),
                _around(x1, radius, [end + width, end - width]),
            ]
            faces.append(Face(np.vstack(corners), to_rgb(colour)))
        return faces


def _side(motor: int, side: int, colour: str) -> Iterable[Part]:
    """The parts of one side, from the motor to its roller-carrier. They turn about the pitch axis or are fixed."""
    shaft, middle, carrier = (f"theta{number + motor - 1}" for number in (1, 3, 5))

    def turning(name: str, *bodies: list[Face]) -> Part:
        return Part([face for body in bodies for face in body], lambda at: about_x(at[name]))

    turns = {"motor": shaft, "middle": middle, "carrier": carrier}
    for shape in PARTS["side"]:
        profile = [(side * x, radius) for x, radius in shape["lathe"]]
        body = _lathe(profile, [colour if name == "side" else COLOURS[name] for name in shape["colours"]])
        yield turning(turns[shape["turns"]], body) if shape["turns"] else Part(body, _still)
    count = PARTS["rollers"]["count"]
    yield turning(carrier, [face for k in range(count) for face in _roller(side, 2 * np.pi * k / count)])


def _ring() -> Iterable[Part]:
    """The central ring, which pitches. It has a rectangular section and the axis Z."""
    angle = np.linspace(0, 2 * np.pi, 2 * ROUND + 1)
    ring = PARTS["ring"]
    section = [(ring["radius"] * radius, z) for radius, z in ring["section"]]
    faces = []
    for (r0, z0), (r1, z1) in zip(section, section[1:] + section[:1]):
        for a, b in zip(angle, angle[1:]):
            edge = [(r0, a, z0), (r0, b, z0), (r1, b, z1), (r1, a, z1)]
            corners = np.array([[r * np.cos(t), r * np.sin(t), z] for r, t, z in edge])
            faces.append(Face(corners, to_rgb(GREEN)))
    yield Part(faces, lambda at: about_x(at["pitch"]))


def _output() -> Iterable[Part]:
    """The cam shaft with cam, gripper and counterweight, which pitches with the ring and rolls in it."""
    upright = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])  # from a body about X to one about Y

    def stood(profile: Sequence[tuple[float, float]], colours: Sequence[str], lobes: float = 0) -> list[Face]:
        return [Face(face.corners @ upright.T, face.colour) for face in _lathe(profile, colours, lobes)]

    faces: list[Face] = []
    for shape in PARTS["output"]:
        colours = [COLOURS[name] for name in shape["colours"]]
        if "box" in shape:
            low, high = shape["box"]
            faces += _box(low, high, colours[0])
        else:
            faces += stood(shape["lathe"], colours, shape.get("lobes", 0))
    yield Part(faces, lambda at: about_x(at["pitch"]) @ about_y(at["roll"]))


def _still(_: Mapping[str, float]) -> Array:
    return np.eye(3)


def _around(x: float, radius: float, angles: ArrayLike) -> Array:
    """Points at the angles about X, (k, 3)."""
    angle = np.asarray(angles, dtype=float)
    return np.column_stack([np.full_like(angle, x), radius * np.cos(angle), radius * np.sin(angle)])


def _lathe(profile: Sequence[tuple[float, float]], colours: Sequence[str], lobes: float = 0) -> list[Face]:
    """A solid of revolution about X from points (x, radius), with sectors in the colours, and with four lobes whose
    height is the fraction `lobes` of the radius. Long bodies are divided, because faces are drawn as a whole, from the
    farthest to the nearest."""
    angle = np.linspace(0, 2 * np.pi, ROUND + 1)
    wave = 1 + lobes * np.cos(4 * angle)
    points = [np.array(profile[0])]
    for begin, end in zip(np.array(profile), np.array(profile[1:])):
        pieces = max(round(abs(end[0] - begin[0]) / PARTS["piece"]), 1)
        points += [begin + (end - begin) * k / pieces for k in range(1, pieces + 1)]
    rings = [_around(x, 1, angle) * np.column_stack([np.ones_like(wave), r * wave, r * wave]) for x, r in points]
    shades = [to_rgb(colours[k * len(colours) // ROUND]) for k in range(ROUND)]
    return [
        Face(np.array([a[k], a[k + 1], b[k + 1], b[k]]), shades[k])
        for a, b in zip(rings, rings[1:])
        for k in range(ROUND)
    ]


def _roller(side: int, angle: float) -> list[Face]:
    """A conical roller on the carrier of a side, pointing at the centre of the wrist."""
    rollers = PARTS["rollers"]
    axis = np.array([side * rollers["axis"][0], rollers["axis"][1], 0.0])
    across = np.array([axis[1], -axis[0], 0.0]) / np.linalg.norm(axis)
    turn = np.linspace(0, 2 * np.pi, 7)
    circle = np.outer(np.cos(turn), across) + np.outer(np.sin(turn), [0, 0, 1])
    outer, inner = axis + rollers["radius"][0] * circle, rollers["inner"] * axis + rollers["radius"][1] * circle
    faces = [np.array([outer[k], outer[k + 1], inner[k + 1], inner[k]]) for k in range(6)] + [inner[:-1]]
    return [Face(face @ about_x(angle).T, to_rgb(STEEL)) for face in faces]


def _box(low: tuple[float, float, float], high: tuple[float, float, float], colour: str) -> list[Face]:
    """The box between two corners."""
    corner = np.array([[(low, high)[number >> axis & 1][axis] for axis in range(3)] for number in range(8)])
    sides = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
    return [Face(corner[list(side)], to_rgb(colour)) for side in sides]
