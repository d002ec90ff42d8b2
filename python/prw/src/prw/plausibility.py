"""Plausibility of recorded motor angles: missing rows, wrong units, jumps, and rates that do not match the angles."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from prw.columns import ANGLES, RATES, Columns
from prw.errors import UserError
from prw.motion import Array

#: Motor speed in rad/s that no wrist move reaches. It is usually exceeded if the file is in degrees but is read as radians.
PLAUSIBLE_SPEED = 30.0
#: Motor angle in rad that no wrist move reaches.
PLAUSIBLE_ANGLE = 4 * np.pi
#: Motion of a motor, in rad, below which its rate is not compared with its angle. Near a gap, a tenth of this counts as motion.
SMALL_MOVE = 0.02
#: Mean time between two samples in s above which the unit is probably wrong: milliseconds that are read as seconds.
SLOW_SAMPLING = 0.5
#: Distance of neighbouring floats at the last time, as a fraction of the usual time between two samples, above which it matters for rates.
COARSE = 1e-4
#: Rows are missing if the time between two rows is more than this multiple of the median.
MISSING = 5.0
#: Gap in s above which the motion of a moving motor cannot be interpolated, so that the recording is rejected.
LONGEST_GAP = 0.04
#: Number of rows before and after a gap in which a motor must be at rest, so that it is assumed to rest in the gap, too.
REST = 5
#: Change of a motor angle between two samples in rad that is probably a jump by a turn.
JUMP = 0.9 * np.pi


def notes_on_gaps(path: Path, time: Array, theta: Array) -> list[str]:
    """Returns a note on missing rows. Raises UserError if rows are missing for too long while the motors move."""
    steps = np.diff(time)
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > MISSING * usual)
    long = [int(k) for k in gaps if steps[k] > LONGEST_GAP and _moves(theta, int(k))]
    if long:
        worst = int(max(long, key=lambda k: float(steps[k])))
        raise UserError(
            f"{path}: no rows from {time[worst]:.6g} to {time[worst + 1]:.6g} s, {steps[worst]:.3g} s instead of the usual {usual:.3g} s, while "
            "the motors move; their motion is not known. Cut the recording there, into separate files"
        )
    if not len(gaps):
        return []
    k = int(gaps[np.argmax(steps[gaps])])
    count = "rows are missing once" if len(gaps) == 1 else f"rows are missing {len(gaps)} times"
    return [f"{count}, for up to {steps[k]:.3g} s after {time[k]:.6g} s; a smooth path bridges that"]


def _moves(theta: Array, k: int) -> bool:
    """Returns whether the motors move in the rows near k and k + 1, between which rows are missing."""
    near = theta[max(k - REST, 0) : k + 2 + REST]
    return bool(np.ptp(near, axis=0).max() > max(SMALL_MOVE / 10, 0.002 * float(np.ptp(theta, axis=0).max())))


def notes_on_values(path: Path, time: Array, theta: Array, omega: Array | None, columns: Columns) -> list[str]:
    """Returns notes on values that are possible but are probably mistakes. Raises UserError for an implausible motion of which
    nobody has said that it is in radians."""
    notes = []
    if len(time) > 1 and (step := (time[-1] - time[0]) / (len(time) - 1)) > SLOW_SAMPLING:
        notes.append(f"a sample every {step:.3g} s; if time is in ms, call its column time [ms]")
    latest = np.abs(time).max()
    if (share := float(np.spacing(latest) / np.median(np.diff(time)))) > COARSE:
        notes.append(
            f"time reaches {latest:.4g} s, where it can only be resolved to {np.spacing(latest):.2g} s, {share:.2g} of a step; subtract the "
            "first time from all times"
        )
    for side, name in enumerate(ANGLES):
        # A percentile, because a single step of a coarse encoder is not a speed.
        speed = np.percentile(np.abs(np.diff(theta[:, side]) / np.diff(time)), 99)
        reach = np.abs(theta[:, side]).max()
        steps = np.abs(np.diff(theta[:, side]))
        if len(steps) and (jump := steps.max()) > JUMP:
            notes.append(
                f"{name} jumps by {jump:.3g} rad after {time[steps.argmax()]:.6g} s; angles must continue past a full turn and "
                "not restart (numpy.unwrap removes such jumps)"
            )
        if speed > PLAUSIBLE_SPEED:
            implausible = f"turns at {speed:.4g} rad/s ({speed * 30 / np.pi:.4g} rpm)"
        elif reach > PLAUSIBLE_ANGLE:
            implausible = f"reaches {reach:.4g} rad ({reach / (2 * np.pi):.3g} turns)"
        else:
            continue
        # A jump alone is another mistake.
        if name in columns.assumed and (reach > PLAUSIBLE_ANGLE or not (len(steps) and steps.max() > JUMP)):
            raise UserError(
                f"{path}: {name} {implausible} if it is in radians, but its header names no unit; add --degrees or --radians "
                f"(in Python prw.read(path, degrees=True) or False), or call it {name} [deg] or {name} [rad]"
            )
        notes.append(f"{name} {implausible}; are these the right units?")
    if omega is None:
        notes.append(
            "no omega1, omega2: the rates come from the angles, so if the angles are quantised or noisy, the torques "
            "are noisy, too; record omega1 and omega2 if you can"
        )
        return notes
    notes += [note for side in (0, 1) if (note := _mismatch(time, theta[:, side], omega[:, side], side))]
    return notes


def _mismatch(time: Array, theta: Array, omega: Array, side: int) -> str:
    """Returns a note if the integral of the rate omega (n,) clearly differs from the motion of theta (n,), else an empty string."""
    turned = theta - theta.mean()
    if np.ptp(theta) < SMALL_MOVE:
        return ""
    by_rate = np.concatenate([[0], np.cumsum(np.diff(time) * (omega[1:] + omega[:-1]) / 2)])
    ratio = turned @ by_rate / (turned @ turned)
    if 0.8 < ratio < 1.25:
        return ""
    return f"{RATES[side]} adds up to {ratio:.3g} times the motion of {ANGLES[side]}; check units and sign"
