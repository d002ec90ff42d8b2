"""The testbed in three dimensions: bodies of flat faces, and where they are at an instant.

The frame is that of eq. (4a): X, the pitch axis, along the input shafts from motor 1 to motor 2; Y, the roll axis, up
to the gripper; Z to the viewer. Lengths are to please the eye: the roller-carriers have a radius of 0.8.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import ArrayLike

from prw.plots import BLUE, GREEN, PURPLE, VERMILION

Array = np.ndarray
STEEL, DARK, PALE = "#b9c0c7", "#3a4149", "#f1f3f5"
#: Strands of a coupling, and sides of what is round.
STRANDS, ROUND = 6, 24


class Face(NamedTuple):
    """A flat polygon: corners (k, 3), colour (r, g, b)."""

    corners: Array
    colour: tuple[float, float, float]


class Part(NamedTuple):
    """Faces that turn together, and how: from the angles at an instant to a rotation matrix (3, 3)."""

    faces: Sequence[Face]
    turn: Callable[[Mapping[str, float]], Array]


def about_x(angle: float) -> Array:
    """The rotation by angle (rad) about the pitch axis, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def about_y(angle: float) -> Array:
    """The rotation by angle (rad) about the roll axis, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


class Wrist:
    """All that is drawn. twist: what the twist of the couplings is multiplied with, for the eye to see it."""

    def __init__(self, twist: float):
        self.twist = twist
        self.parts = [*_side(1, -1, BLUE), *_side(2, 1, VERMILION), *_ring(), *_output()]

    def faces(self, at: Mapping[str, float]) -> list[Face]:
        """Everything at the angles `at`: theta1 ... theta6, pitch and roll in rad."""
        turned = [(part.turn(at).T, part.faces) for part in self.parts]
        faces = [Face(face.corners @ turn, face.colour) for turn, bodies in turned for face in bodies]
        for side, angles, colour in (
            (-1, ("theta1", "theta3", "theta5"), BLUE),
            (1, ("theta2", "theta4", "theta6"), VERMILION),
        ):
            motor, middle, carrier = (at[name] for name in angles)
            faces += self._coupling(side * 3.4, side * 2.9, motor, middle, colour)
            faces += self._coupling(side * 2.45, side * 1.95, middle, carrier, colour)
        return faces

    def _coupling(self, x0: float, x1: float, outer: float, inner: float, colour: str) -> list[Face]:
        """Strands from disc to disc: straight at rest, a twisted bundle under torque."""
        phase = 2 * np.pi * np.arange(STRANDS) / STRANDS
        ends = phase + outer, phase + outer + self.twist * (inner - outer)
        width, faces = 0.17, []
        for begin, end in zip(*ends):
            corners = [_around(x0, 0.36, [begin - width, begin + width]), _around(x1, 0.36, [end + width, end - width])]
            faces.append(Face(np.vstack(corners), to_rgb(colour)))
        return faces


def _side(motor: int, side: int, colour: str) -> Iterable[Part]:
    """What turns about the pitch axis on one side, from the motor to its roller-carrier."""
    shaft, middle, carrier = (f"theta{number + motor - 1}" for number in (1, 3, 5))

    def turning(name: str, *bodies: list[Face]) -> Part:
        return Part([face for body in bodies for face in body], lambda at: about_x(at[name]))

    def lathe(x0: float, x1: float, radius: float, colours: Sequence[str]) -> list[Face]:
        return _lathe([(side * x0, 0), (side * x0, radius), (side * x1, radius), (side * x1, 0)], colours)

    yield Part(_lathe([(side * x, r) for x, r in ((3.72, 0), (3.72, 0.66), (4.5, 0.66), (4.5, 0))], [STEEL]), _still)
    marked = [colour] * 3 + [PALE] * 3
    yield turning(
        shaft, lathe(3.52, 3.7, 0.66, marked), lathe(4.52, 4.66, 0.56, marked), lathe(3.4, 3.47, 0.42, [DARK])
    )
    yield turning(
        middle, lathe(2.9, 2.83, 0.42, [DARK]), lathe(2.8, 2.55, 0.5, marked), lathe(2.52, 2.45, 0.42, [DARK])
    )
    rollers = [face for number in range(7) for face in _roller(side, 2 * np.pi * number / 7)]
    yield turning(
        carrier,
        lathe(1.95, 1.88, 0.42, [DARK]),
        lathe(1.88, 0.84, 0.1, [STEEL]),
        lathe(0.84, 0.74, 0.8, marked),
        rollers,
    )


def _ring() -> Iterable[Part]:
    """The central ring, which pitches: of rectangular section, about Z."""
    angle = np.linspace(0, 2 * np.pi, 2 * ROUND + 1)
    section = [(0.97, 0.2), (1.13, 0.2), (1.13, -0.2), (0.97, -0.2)]
    faces = []
    for (r0, z0), (r1, z1) in zip(section, section[1:] + section[:1]):
        for a, b in zip(angle, angle[1:]):
            edge = [(r0, a, z0), (r0, b, z0), (r1, b, z1), (r1, a, z1)]
            corners = np.array([[1.25 * r * np.cos(t), 1.25 * r * np.sin(t), z] for r, t, z in edge])
            faces.append(Face(corners, to_rgb(GREEN)))
    yield Part(faces, lambda at: about_x(at["pitch"]))


def _output() -> Iterable[Part]:
    """The cam shaft with cam, gripper and counterweight, which pitches with the ring and rolls in it."""
    upright = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])  # from a body about X to one about Y

    def stood(profile: Sequence[tuple[float, float]], colours: Sequence[str], lobes: float = 0) -> list[Face]:
        return [Face(face.corners @ upright.T, face.colour) for face in _lathe(profile, colours, lobes)]

    faces = stood([(-1.6, 0.07), (1.7, 0.07)], [STEEL])
    faces += stood([(0.34, 0.1), (0.52, 0.42), (0.74, 0.6), (0.86, 0.6), (0.86, 0.0)], [PURPLE], lobes=0.16)
    faces += stood([(-1.55, 0), (-1.55, 0.4), (-1.85, 0.4), (-1.85, 0)], [PURPLE] * 3 + [PALE] * 3)
    faces += _box((-0.48, 1.6, -0.17), (0.48, 1.78, 0.17), PURPLE)
    for side in (-1, 1):
        faces += _box((side * 0.48, 1.78, -0.17), (side * 0.3, 2.25, 0.17), PURPLE)
    yield Part(faces, lambda at: about_x(at["pitch"]) @ about_y(at["roll"]))


def _still(_: Mapping[str, float]) -> Array:
    return np.eye(3)


def _around(x: float, radius: float, angles: ArrayLike) -> Array:
    """Points at the angles about X, (k, 3)."""
    angle = np.asarray(angles, dtype=float)
    return np.column_stack([np.full_like(angle, x), radius * np.cos(angle), radius * np.sin(angle)])


def _lathe(profile: Sequence[tuple[float, float]], colours: Sequence[str], lobes: float = 0) -> list[Face]:
    """A body turned about X from points (x, radius), in sectors of the colours, with four lobes of the share `lobes` of
    its radius. Long ones are divided, because faces are drawn from the farthest to the nearest as a whole."""
    angle = np.linspace(0, 2 * np.pi, ROUND + 1)
    wave = 1 + lobes * np.cos(4 * angle)
    points = [np.array(profile[0])]
    for begin, end in zip(np.array(profile), np.array(profile[1:])):
        pieces = max(round(abs(end[0] - begin[0]) / 0.25), 1)
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
    axis = np.array([side * 0.72, 0.62, 0.0])
    across = np.array([axis[1], -axis[0], 0.0]) / np.linalg.norm(axis)
    turn = np.linspace(0, 2 * np.pi, 7)
    circle = np.outer(np.cos(turn), across) + np.outer(np.sin(turn), [0, 0, 1])
    outer, inner = axis + 0.15 * circle, 0.62 * axis + 0.1 * circle
    faces = [np.array([outer[k], outer[k + 1], inner[k + 1], inner[k]]) for k in range(6)] + [inner[:-1]]
    return [Face(face @ about_x(angle).T, to_rgb(STEEL)) for face in faces]


def _box(low: tuple[float, float, float], high: tuple[float, float, float], colour: str) -> list[Face]:
    """The box between two corners."""
    corner = np.array([[(low, high)[number >> axis & 1][axis] for axis in range(3)] for number in range(8)])
    sides = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
    return [Face(corner[list(side)], to_rgb(colour)) for side in sides]
