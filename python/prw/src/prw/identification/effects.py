"""Effects of real rigs that the FMU does not model: friction, backlash, unequal sides, changes over time, and errors of sensors.

The FMU is linear, so an effect adds its size times a pattern to the outputs. The pattern follows a law, for example the sign of a
rate. It depends on the motion, and so weakly on the parameters and the sizes: the fit holds the patterns and repeats them at its
result until both agree. Backlash, clearance and other properties of a coupling act like a shift of the angle at the spring's end.
If the law is linear and does not depend on time, as for unequal sides, the fit uses an exact linear model with the effect instead.

With backlash, only the spring has play. With clearance, the whole coupling does, and it lets go when its torque would pull the sides
apart: for a twist e above half of the clearance, the torque k (e - clearance / 2) + c e' is at least 0. The shift is then -e - c e' / k plus
the reaction of the massless shaft, so the part of the effect during which the coupling is open does not grow with the clearance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

from prw.columns import CHANNELS
from prw.identification.experiment import Experiment, spectra
from prw.identification.kinds import KINDS, LINEAR
from prw.identification.response import Distortion, Response
from prw.motion import Array
from prw.state_space import Complex, StateSpace

#: Share of a rate's greatest magnitude in which the sign of the rate changes smoothly, as the hyperbolic tangent.
TURNING = 0.02
#: Shares of a spring's torque up to which the cubic part grows, if it is positive and if it is negative; without these limits, wrong data
#: could make the motion unstable.
LARGEST, LARGEST_NEGATIVE = 2.0, 0.5
#: Clearance in rad at which the pattern of a clearance is calculated that the motion does not contain.
SMALL = 1e-4
#: Longest step in s with which effects are followed; longer sampling steps are divided. The torque of a coupling with clearance changes within
#: about a tenth of the 5 ms in which the massless shafts follow.
LONGEST_STEP = 5e-4
#: A sampling step may exceed it by this share, because times have rounding errors.
INEXACT = 0.01
#: Time in s after which the states have forgotten how they began.
SETTLED = 1.0
#: Rounds in which a smooth effect and the state at the end of a step are adjusted to each other.
CORRECTED = 2
#: Rounds in which the frictions of two shafts are adjusted to each other within a step.
ADJUSTED = 3


class Law(NamedTuple):
    """How an effect follows the motion.

    Attributes
    ----------
    drive
        (6, m), rates of the states per unit of the effect at m places.
    direct
        (8, m), change of CHANNELS per unit.
    follows
        (q, 6) and (q, 4), the signals that the effect follows, from the states and from the motors' angles and rates; (q, 5) if they
        also depend on the time, which increases from 0 to 1 during the recording.
    of
        Effect (..., m) per unit of its size, from the signals (..., q) and the size. None for dry friction.
    once
        The same for the signals [q] of one instant, as a list [m], because numpy is slow for single numbers.
    during
        Mean of the effect during a step, from the signals at its beginning and at its end; default: the mean of `once` at both.
    smooth
        Whether the effect has no kinks, so that its mean during a step follows from more than the two ends of the step.
    fixed
        The part (..., m) of the effect that does not depend on its size, from the same arguments; None if there is none.
    reacts
        (q, 6), change of the signals with the rates of the states that the effect itself causes. Only for the kinds LINEAR, which are
        their signals times their size.
    """

    drive: Array
    direct: Array
    follows: tuple[Array, Array]
    of: Callable[[Array, float], Array] | None = None
    once: Callable[[list[float], float], list[float]] | None = None
    during: Callable[[list[float], list[float], float], list[float]] | None = None
    fixed: Callable[[Array, float], Array] | None = None
    smooth: bool = False
    reacts: Array | None = None

    def signals(self, states: Array, motors: Array) -> Array:
        """The signals (n, q). states: (n, 6). motors: see `_motors`."""
        of_states, of_motors = self.follows
        found: Array = states @ of_states.T + motors[:, : of_motors.shape[1]] @ of_motors.T
        return found


def law(distortion: Distortion, model: StateSpace, values: Mapping[str, float]) -> Law | None:
    """The law of a mechanical effect, None for other distortions. values: parameters of the model in SI."""
    kind, place = distortion
    rates, none = np.eye(6)[4:], np.zeros((2, 4))
    if (kind == "friction" and not place.startswith("motor")) or (kind, place) == ("viscous", "shafts"):
        turns = model.C[[CHANNELS.index("pitch_rate"), CHANNELS.index("roll_rate")]][:, 4:]
        inertia = values["J2"] * np.eye(2) + turns.T @ np.diag([values["H3"], values["J3"]]) @ turns
        braked = {"shafts": np.eye(2), "shaft1": np.eye(2)[:1], "shaft2": np.eye(2)[1:], "output": turns}[place]
        drive = rates.T @ np.linalg.solve(inertia, braked.T)
        signals, direct = (braked @ rates, none[: len(braked)]), np.zeros((len(CHANNELS), len(braked)))
        if kind == "viscous":
            return Law(drive, direct, (-signals[0], signals[1]), _same, reacts=np.zeros((len(braked), 6)))
        return Law(drive, direct, signals)
    if kind not in ("asymmetry", "backlash", "clearance", "cubic", "softening", "viscous") or place == "motors":
        return None
    shafts, first = np.eye(6)[:2], place in ("k1", "c1", "between")
    if first:
        drive, direct, twist = model.B[:, :2], model.D[:, :2], (-shafts, np.eye(2, 4))
        rate = -model.A[:2], np.eye(2, 4, 2) - model.B[:2]
    else:
        # Angles 5 and 6 occur in the equations of motion and of the torques only as the ends of the springs k2.
        direct = np.where(np.char.startswith(CHANNELS, "tau")[:, None], -model.C[:, 2:4], 0.0)
        drive, twist = -model.A[:, 2:4], (shafts - np.eye(6)[2:4], none)
        rate = model.A[:2] - rates, model.B[:2]
    if kind == "viscous":
        # A torque on these shafts moves them as a shift of the springs k1 does, but does not act on the motors.
        own = np.array([[name == f"tau{i}" for i in (1, 2)] for name in CHANNELS], dtype=float)
        turning = -model.A[:2], -model.B[:2]
        return Law(drive / values["k1"], direct / values["k1"] + own, turning, _same, reacts=-shafts)
    if kind == "asymmetry":
        # Only side 2 differs. The torque of a damper is the torque of the spring beside it with another twist.
        share, at = (1.0, twist) if place[0] == "k" else (values[place] / values[f"k{place[1]}"], rate)
        reacts = share * (at is rate) * (-shafts if first else shafts)
        return Law(drive[:, 1:], direct[:, 1:], (share * at[0][1:], share * at[1][1:]), _same, reacts=reacts[1:])
    if kind == "softening":
        with_time = np.zeros((3, 5))
        with_time[:2, :4], with_time[2, 4] = twist[1], 1.0
        return Law(drive, direct, (np.vstack([twist[0], np.zeros(6)]), with_time), _softer, _softer_once, smooth=True)
    if kind == "cubic":
        return Law(drive, direct, twist, _cubed, _cubed_once, smooth=True)
    if kind == "backlash":
        return Law(drive, direct, twist, _free, _free_once)
    other = {"k1": "c2", "k2": "c1"}[place]
    reaction = (values["c1"] + values["c2"]) / values[other]
    opening = [reaction * (e + values[f"c{place[1]}"] / values[place] * de) for e, de in zip(twist, rate)]
    follows = np.vstack([twist[0], opening[0]]), np.vstack([twist[1], opening[1]])
    return Law(drive, direct, follows, _let_go, _let_go_once, _struck, _open)


def including(model: StateSpace, values: Mapping[str, float], sizes: Mapping[Distortion, float]) -> StateSpace:
    """The linear model with the effects of the kinds LINEAR among `sizes`."""
    laws = [(found, size) for d, size in sizes.items() if d.kind in LINEAR and (found := law(d, model, values))]
    if not laws:
        return model
    scale = np.concatenate([np.full((len(each.follows[0]), 1), size) for each, size in laws])
    drive, direct = (np.hstack([getattr(each, name) for each, _ in laws]) for name in ("drive", "direct"))
    follows = np.vstack([np.hstack(each.follows) for each, _ in laws])
    reacts = np.vstack([each.reacts for each, _ in laws if each.reacts is not None])
    gain = np.linalg.solve(np.eye(len(scale)) - scale * (reacts @ drive), scale * follows)
    of_states, of_motors = gain[:, :6], gain[:, 6:]
    return replace(
        model,
        A=model.A + drive @ of_states,
        B=model.B + drive @ of_motors,
        C=model.C + direct @ of_states,
        D=model.D + direct @ of_motors,
    )


def _same(signals: Array, size: float) -> Array:
    return signals


def _softer(signals: Array, size: float) -> Array:
    """Shift of a spring's end per unit of softening. signals: the twists, then the time from 0 to 1."""
    found: Array = -signals[..., :-1] * signals[..., -1:]
    return found


def _softer_once(signals: list[float], size: float) -> list[float]:
    return [-e * signals[-1] for e in signals[:-1]]


def _free(twist: Array, size: float) -> Array:
    """Shift of a spring's end per unit of backlash: the spring transmits no torque in a range of twist of this size."""
    return -np.clip(twist / size, -0.5, 0.5) if size > 0 else -sign(twist) / 2


def _free_once(twist: list[float], size: float) -> list[float]:
    return [-min(max(e / size, -0.5), 0.5) for e in twist]


def _let_go(signals: Array, size: float) -> Array:
    """Shift of a spring's end per unit of clearance. signals: the twists (..., m), and minus the shifts with which the torques are 0."""
    size = size if size > 0 else SMALL
    twist, opening = np.split(signals, 2, axis=-1)
    held = np.where(twist > 0, np.maximum(-opening, -size / 2), np.minimum(-opening, size / 2))
    found: Array = np.where(np.abs(twist) > size / 2, held, -opening) / size
    return found


def _let_go_once(signals: list[float], size: float) -> list[float]:
    m, half = len(signals) // 2, size / 2
    return [
        (max(-f, -half) if e > half else min(-f, half) if e < -half else -f) / size
        for e, f in zip(signals[:m], signals[m:])
    ]


def _struck(before: list[float], after: list[float], size: float) -> list[float]:
    """Mean shift during a step. If the parts of a coupling strike each other, the shift jumps, so the time before and the time after count
    according to their shares of the step."""
    m, half, found = len(before) // 2, size / 2, []
    for x, y, e0, e1, f0, f1 in zip(
        _let_go_once(before, size), _let_go_once(after, size), before[:m], after[:m], before[m:], after[m:]
    ):
        shut = 0.5 if e1 > 0 else -0.5
        if abs(e0) <= half < abs(e1) and y == -shut:
            # Parts that cross the whole clearance within a step touch only the side that they reach.
            share = (half * 2 * shut - e0) / (e1 - e0)
            found.append(share * (-f0 - share * (f1 - f0) / 2) / size - (1 - share) * shut)
        else:
            found.append((x + y) / 2)
    return found


def _open(signals: Array, size: float) -> Array:
    """The shift of `_let_go` where the coupling is open, else 0."""
    shift = size * _let_go(signals, size)
    found: Array = np.where(np.abs(shift) == size / 2, 0.0, shift)
    return found


def _cubed(twist: Array, size: float) -> Array:
    """Shift of a spring's end for a torque k (twist + size twist^3)."""
    reach = _reach(size) if size else np.inf
    found: Array = np.clip(twist, -reach, reach) ** 3
    return found


def _cubed_once(twist: list[float], size: float) -> list[float]:
    reach = _reach(size)
    return [min(max(e, -reach), reach) ** 3 for e in twist]


def _reach(size: float) -> float:
    """Twist up to which the cubic part of a torque grows."""
    return float(((LARGEST if size > 0 else LARGEST_NEGATIVE) / abs(size)) ** 0.5)


def sign(signal: Array) -> Array:
    """The sign of a signal (n, m), smooth near 0."""
    found: Array = np.tanh(signal / np.maximum(TURNING * np.abs(signal).max(axis=0), 1e-6))
    return found


def columns(
    model: StateSpace,
    values: Mapping[str, float],
    experiment: Experiment,
    response: Response,
    initial: Array,
    sizes: Mapping[Distortion, float],
    wanted: Iterable[Distortion],
) -> tuple[dict[Distortion, Complex], Complex]:
    """Contribution (f, c) of each wanted effect per unit of its size to the channels, at the frequencies of `response`; and the sum of
    the parts that do not depend on the sizes.

    initial: (6,), see Comparison. sizes: of all effects that the motion contains; wanted ones without a size count as small."""
    count = len(experiment.time)
    states = np.fft.irfft(response.moving(initial), count, axis=0, norm="ortho")
    motion = _motion_without(states, experiment)
    laws = {d: found for d in {**sizes, **dict.fromkeys(wanted)} if (found := law(d, model, values)) is not None}
    present = {
        d: size for d, size in sizes.items() if d in laws and (size > 0 or (size and not KINDS[d.kind].positive))
    }
    moved, strengths = _moved(model.A * motion.step, laws, present, motion)
    contributions: dict[Distortion, Complex] = {}
    constant: Complex = np.zeros_like(response.outputs)
    stepped = _held(model.A * motion.step, np.zeros((6, 0)))[0]
    rows = [CHANNELS.index(name) for name in experiment.channels]
    for d in wanted:
        if d not in laws:
            contributions[d] = _of_sensors(d, experiment, response, initial, sizes)
            continue
        signals = laws[d].signals(moved, motion.motors)
        of, fixed, size = laws[d].of, laws[d].fixed, sizes.get(d, 0.0)
        at = -sign(signals) if of is None else of(signals, size)
        during = _mean_of_cubic(at) if laws[d].smooth else strengths[d] if d in strengths else _mean(at)
        _, gain = _held(model.A * motion.step, laws[d].drive * motion.step)

        def driven(during: Array, at: Array, gain: Array = gain, direct: Array = laws[d].direct[rows]) -> Complex:
            # The states at the end of a sampling step, from the effect in all parts of the step.
            added = np.zeros((count, 6))
            for part in range(motion.parts):
                added = added @ stepped.T + during[part :: motion.parts] @ gain.T
            return response.driven(spectra(added), spectra(at[:: motion.parts]) @ direct.T)

        if fixed is not None and d in present:
            growing = np.where(fixed(signals, size) == 0, at, 0.0)
            constant += driven(size * (during - _mean(growing)), size * (at - growing))
            at, during = growing, _mean(growing)
        contributions[d] = driven(during, at)
    return contributions, constant


def _motors(experiment: Experiment) -> Array:
    """The motors' angles and rates, and the time from 0 to 1: (n, 5)."""
    return np.hstack([experiment.theta, experiment.omega, np.linspace(0, 1, len(experiment.time))[:, None]])


class _Motion(NamedTuple):
    """The motion without effects.

    Attributes
    ----------
    states, motors
        (n, 6), and (n, 5) as in `_motors`.
    step
        s.
    parts
        Number of steps in a sampling step.
    """

    states: Array
    motors: Array
    step: float
    parts: int


def _motion_without(states: Array, experiment: Experiment) -> _Motion:
    """The motion without effects. If the sampling steps are long, it is interpolated. states: (n, 6), at the samples."""
    rows, parts = np.hstack([states, _motors(experiment)]), max(1, math.ceil(experiment.step / LONGEST_STEP - INEXACT))
    if parts > 1:
        at = np.arange((len(rows) - 1) * parts + 1) / parts
        # The spectra count the recording as periodic, so the first row follows the last one.
        ends = np.linspace(rows[-1], rows[0], parts, endpoint=False)[1:]
        rows = np.vstack([CubicSpline(np.arange(len(rows)), rows)(at), ends])
    return _Motion(rows[:, :6], rows[:, 6:], experiment.step / parts, parts)


def _mean(values: Array) -> Array:
    """Mean of the values (n, m) at the beginning and the end of each step."""
    return (values + np.roll(values, -1, axis=0)) / 2


def _mean_of_cubic(values: Array) -> Array:
    """Mean (n, m) of the cubic through the values (n, m) around each step."""
    last, next_, after = (np.roll(values, k, axis=0) for k in (1, -1, -2))
    found: Array = (13 * (values + next_) - last - after) / 24
    return found


def _of_sensors(
    d: Distortion, experiment: Experiment, response: Response, initial: Array, sizes: Mapping[Distortion, float]
) -> Complex:
    """The contribution of friction or backlash at the motors, or of an error of sensors, as in `columns`."""
    outputs, channels = response.outputs + response.transients @ initial, experiment.channels
    column: Complex = np.zeros_like(outputs)
    turning = sign(experiment.omega)
    if d.kind == "backlash":
        size = sizes.get(d, 0.0)
        played = _played(experiment.theta, size) if size > 0 else -turning / 2
        return np.asarray((response.transfer @ spectra(played)[: len(outputs), :, None])[..., 0], dtype=complex)
    if d.kind == "friction" and f"tau{d.channel[-1]}" in channels:
        # A torque that drives the wrist is negative (eq. 9).
        column[:, channels.index(f"tau{d.channel[-1]}")] = -spectra(turning)[: len(outputs), int(d.channel[-1]) - 1]
    if d.kind == "fading" and d.channel in channels:
        time, i = _motors(experiment)[:, -1], channels.index(d.channel)
        exact = np.fft.irfft(outputs[:, i], len(time), norm="ortho") / (1 - sizes.get(d, 0.0) * time)
        column[:, i] = -spectra(time * exact)[: len(outputs)]
    mixed = {"crosstalk": (("tau1", "tau2"),), "turned": (("pitch", "roll"), ("pitch_rate", "roll_rate"))}
    for pair in mixed.get(d.kind, ()):
        if set(pair) <= set(channels):
            size, indices = sizes.get(d, 0.0), [channels.index(name) for name in pair]
            # The change of both channels per unit of the effect, from the exact values. The outputs contain this change.
            sine, cosine = np.sinc(size / np.pi), -size / 2 * np.sinc(size / 2 / np.pi) ** 2
            shares = np.array([[cosine, sine], [-sine, cosine]]) if d.kind == "turned" else np.eye(2)[::-1].copy()
            if d.channel in pair:
                shares[pair.index(d.channel) - 1] = 0.0
            column[:, indices] = outputs[:, indices] @ np.linalg.solve((np.eye(2) + size * shares).T, shares.T)
    return column


def _played(theta: Array, size: float) -> Array:
    """Difference (n, 2) of the angle behind a play of `size` from the angle theta (n, 2), per unit of the size."""
    half = size / 2
    behind = [
        list(accumulate(angles, lambda behind, angle: min(max(behind, angle - half), angle + half)))
        for angles in theta.T.tolist()
    ]
    played: Array = (np.transpose(behind) - theta) / size
    return played


def _held(A: Array, drive: Array) -> tuple[Array, Array]:
    """The matrices (6, 6) and (6, m) of one step with a constant drive. A, drive: times the step."""
    whole = np.zeros((6 + drive.shape[1],) * 2)
    whole[:6, :6], whole[:6, 6:] = A, drive
    solved = expm(whole)[:6]
    return solved[:, :6], solved[:, 6:]


def _moved(
    A: Array,
    laws: Mapping[Distortion, Law],
    sizes: Mapping[Distortion, float],
    motion: _Motion,
) -> tuple[Array, dict[Distortion, Array]]:
    """The states (n, 6) with the effects in `sizes`, and the mean of each of these effects during every step per unit of its size
    (n, m). A: times the step."""
    states = motion.states
    if not sizes:
        return states, {}
    stepped = _held(A, np.zeros((6, 0)))[0]
    towards, ends = np.vstack([np.eye(6), *(laws[d].follows[0] for d in sizes)]), [6]
    steps = []
    for d, size in sizes.items():
        ends.append(ends[-1] + len(laws[d].follows[0]))
        gain = towards @ (size * _held(A, laws[d].drive * motion.step)[1])
        signals = laws[d].signals(states, motion.motors)
        part = slice(*ends[-2:])
        steps.append((size, gain, gain[part], part, laws[d], signals.tolist(), np.zeros((len(states), gain.shape[1]))))
    # The shift of the states and of all signals at the end of a step, from the shift of the states at its beginning.
    advance, shifts = towards @ stepped, np.zeros_like(states)

    def follow(first: int, shift: Array) -> Array:
        """Follows the effects from row `first`, where they have shifted the states by `shift`, to the end. Returns the last shift."""
        ahead, last = towards @ shift, dict[int, list[float]]()
        shifts[first] = shift
        for k in range(first, len(states) - 1):
            now, ahead = ahead.tolist(), advance @ ahead[:6]
            for i, (size, gain, own, part, law, signals, found) in enumerate(steps):
                before = [x + y for x, y in zip(signals[k], now[part])]
                expected = [x + y for x, y in zip(signals[k + 1], ahead[part].tolist())]
                if law.once is None:
                    found[k] = _braked(before, expected, own)
                else:
                    # During the step, the effect is about as large as in the step before, or it continues to change as before.
                    guess = 2 * found[k - 1] - found[k - 2] if law.smooth and k > first + 1 else found[k - 1]
                    linear, expected = expected, [x + y for x, y in zip(expected, (own @ guess).tolist())]
                    if law.during is not None:
                        found[k] = law.during(before, expected, size)
                    elif law.smooth:
                        # Adams and Moulton: the mean of the parabola through the last three instants.
                        at = law.once(before, size)
                        for _ in range(CORRECTED):
                            then = law.once(expected, size)
                            found[k] = [(5 * z + 8 * y - x) / 12 for x, y, z in zip(last.get(i, at), at, then)]
                            expected = [x + y for x, y in zip(linear, (own @ found[k]).tolist())]
                        last[i] = at
                    else:
                        found[k] = [(x + y) / 2 for x, y in zip(law.once(before, size), law.once(expected, size))]
                ahead = ahead + gain @ found[k]
            shifts[k + 1] = ahead[:6]
        end: Array = shifts[-1]
        return end

    # The spectra count the recording as periodic, so the first row follows the last one.
    end = follow(max(len(states) - int(SETTLED / motion.step) - 1, 0), np.zeros(6))
    follow(0, stepped @ end)
    moved: Array = states + shifts
    return moved, {d: found for d, (*_, found) in zip(sizes, steps)}


def _braked(before: list[float], rate: list[float], gain: Array) -> list[float]:
    """Mean dry friction [m] of unit size during a step. before: rates [m] at its start; rate: rates at its end without friction;
    gain: (m, m), change of these rates by the friction."""
    m, change = len(before), gain.tolist()
    force = [0.0] * m
    for _ in range(ADJUSTED if m > 1 else 1):
        for i in range(m):
            free = rate[i] + sum(change[i][j] * force[j] for j in range(m) if j != i)
            force[i] = min(max(-free / change[i][i], -1.0), 1.0)
    for i in range(m):
        after = rate[i] + sum(change[i][j] * force[j] for j in range(m))
        # A rate that passes through 0 within the step has each sign during a part of the step.
        if abs(force[i]) == 1 and before[i] * after < 0:
            force[i] *= (abs(after) - abs(before[i])) / (abs(after) + abs(before[i]))
    return force
