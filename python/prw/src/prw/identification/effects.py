"""Effects of real rigs that the FMU does not model: friction, backlash, cubic stiffness, and crosstalk of the torques.

The FMU is linear, so an effect adds its size times a pattern to the outputs. The pattern follows a law, for example the sign of a
rate. It depends on the motion, and so weakly on the parameters and the sizes: the fit holds the patterns and repeats them at its
result until both agree. Backlash and cubic stiffness of a spring act like a shift of the angle at the spring's end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from prw.identification.experiment import Experiment, spectra
from prw.identification.response import Distortion, Response
from prw.motion import Array
from prw.state_space import Complex, StateSpace
from prw.testbed import OUTPUTS

#: Share of a rate's greatest magnitude in which the sign of the rate changes smoothly, as the hyperbolic tangent.
TURNING = 0.02
#: Share of a spring's torque up to which the cubic part grows; without this limit, wrong data could make the motion unstable.
LARGEST = 0.5
#: Time in s after which the states have forgotten how they began.
SETTLED = 1.0
#: Rounds in which the frictions of two shafts are adjusted to each other within a step.
ADJUSTED = 3


class Law(NamedTuple):
    """How an effect follows the motion.

    Attributes
    ----------
    drive
        (6, m), rates of the states per unit of the effect at m places.
    direct
        (8, m), change of OUTPUTS per unit.
    follows
        (m, 6) and (m, 2), the signals that the effect follows, from the states and the motors' angles.
    of
        Effect (..., m) per unit of its size, from the signals (..., m) and the size. None for dry friction.
    """

    drive: Array
    direct: Array
    follows: tuple[Array, Array]
    of: Callable[[Array, float], Array] | None


def law(distortion: Distortion, model: StateSpace, values: Mapping[str, float]) -> Law | None:
    """The law of a mechanical effect, None for other distortions. values: parameters of the model in SI."""
    kind, place = distortion
    rates, none = np.eye(6)[4:], np.zeros((2, 2))
    if kind == "friction" and not place.startswith("motor"):
        turns = model.C[[OUTPUTS.index("pitch_rate"), OUTPUTS.index("roll_rate")]][:, 4:]
        inertia = values["J2"] * np.eye(2) + turns.T @ np.diag([values["H3"], values["J3"]]) @ turns
        braked = {"shafts": np.eye(2), "shaft1": np.eye(2)[:1], "shaft2": np.eye(2)[1:], "output": turns}[place]
        drive = rates.T @ np.linalg.solve(inertia, braked.T)
        return Law(drive, np.zeros((len(OUTPUTS), len(braked))), (braked @ rates, none[: len(braked)]), None)
    if place not in ("k1", "k2"):
        return None
    of = _free if kind == "backlash" else _cubed
    if place == "k1":
        return Law(model.B[:, :2], model.D[:, :2], (-np.eye(6)[:2], np.eye(2)), of)
    # Angles 5 and 6 occur in the equations of motion and of the torques only as the ends of the springs k2.
    direct = np.where(np.char.startswith(OUTPUTS, "tau")[:, None], -model.C[:, 2:4], 0.0)
    return Law(-model.A[:, 2:4], direct, (np.eye(6)[:2] - np.eye(6)[2:4], none), of)


def _free(twist: Array, size: float) -> Array:
    """Shift of a spring's end per unit of backlash: the spring transmits no torque in a range of twist of this size."""
    return -np.clip(twist / size, -0.5, 0.5) if size > 0 else -sign(twist) / 2


def _cubed(twist: Array, size: float) -> Array:
    """Shift of a spring's end for a torque k (twist + size twist^3)."""
    reach = np.sqrt(LARGEST / abs(size)) if size else np.inf
    found: Array = np.clip(twist, -reach, reach) ** 3
    return found


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
) -> dict[Distortion, Complex]:
    """Contribution (f, c) of each wanted effect per unit of its size to the channels, at the frequencies of `response`.

    initial: (6,), see Comparison. sizes: of all effects that the motion contains; wanted ones without a size count as small."""
    count = len(experiment.time)
    states = np.fft.irfft(response.moving(initial), count, axis=0, norm="ortho")
    laws = {d: found for d in {**sizes, **dict.fromkeys(wanted)} if (found := law(d, model, values)) is not None}
    present = {d: size for d, size in sizes.items() if d in laws and (size > 0 or (size and d.kind == "cubic"))}
    moved, strengths = _moved(model.A * experiment.step, laws, present, states, experiment)
    contributions: dict[Distortion, Complex] = {}
    for d in wanted:
        if d not in laws:
            contributions[d] = _of_sensors(d, experiment, response, initial, sizes)
            continue
        signals = moved @ laws[d].follows[0].T + experiment.theta @ laws[d].follows[1].T
        of = laws[d].of
        at = -sign(signals) if of is None else of(signals, sizes.get(d, 0.0))
        during = strengths[d] if d in strengths else (at + np.roll(at, -1, axis=0)) / 2
        _, gain = _held(model.A * experiment.step, laws[d].drive * experiment.step)
        rows = [OUTPUTS.index(name) for name in experiment.channels]
        contributions[d] = response.driven(spectra(during) @ gain.T, spectra(at) @ laws[d].direct[rows].T)
    return contributions


def _of_sensors(
    d: Distortion, experiment: Experiment, response: Response, initial: Array, sizes: Mapping[Distortion, float]
) -> Complex:
    """The contribution of friction or backlash at the motors, or of crosstalk, as in `columns`."""
    outputs, channels = response.outputs + response.transients @ initial, experiment.channels
    column: Complex = np.zeros_like(outputs)
    turning = sign(experiment.omega)
    if d.kind == "backlash":
        size = sizes.get(d, 0.0)
        played = _played(experiment.theta, size) if size > 0 else -turning / 2
        return np.asarray((response.transfer @ spectra(played)[: len(outputs), :, None])[..., 0], dtype=complex)
    for name, other, i in (("tau1", "tau2", 0), ("tau2", "tau1", 1)):
        if d.kind == "friction" and d.channel == f"motor{i + 1}" and name in channels:
            # A torque that drives the wrist is negative (eq. 9).
            column[:, channels.index(name)] = -spectra(turning)[: len(outputs), i]
        if d.kind == "crosstalk" and d.channel in (name, "torques") and {name, other} <= set(channels):
            column[:, channels.index(name)] = outputs[:, channels.index(other)]
    return column


def _played(theta: Array, size: float) -> Array:
    """Difference (n, 2) of the angle behind a play of `size` from the angle theta (n, 2), per unit of the size."""
    behind, played = theta[0], np.empty_like(theta)
    for k, angle in enumerate(theta):
        behind = np.clip(behind, angle - size / 2, angle + size / 2)
        played[k] = behind - angle
    return played / size


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
    states: Array,
    experiment: Experiment,
) -> tuple[Array, dict[Distortion, Array]]:
    """The states (n, 6) with the effects in `sizes`, and the mean of each of these effects during every step per unit of its size
    (n, m). A: times the step. states: (n, 6) without effects."""
    if not sizes:
        return states, {}
    steps, moved = {}, states.copy()
    for d, size in sizes.items():
        stepped, gain = _held(A, laws[d].drive * experiment.step)
        towards, of = laws[d].follows[0], laws[d].of
        signals = states @ towards.T + experiment.theta @ laws[d].follows[1].T
        steps[d] = size, size * gain, size * (towards @ gain), towards, of, signals
    found = {d: np.zeros_like(signals) for d, (*_, signals) in steps.items()}

    def follow(first: int, shift: Array) -> Array:
        """Follows the effects from row `first`, where they have shifted the states by `shift`, to the end. Returns the last shift."""
        before = {d: signals[first] + towards @ shift for d, (*_, towards, _, signals) in steps.items()}
        moved[first] = states[first] + shift
        for k in range(first, len(states) - 1):
            ahead = stepped @ shift
            for d, (size, gain, own, towards, of, signals) in steps.items():
                expected = signals[k + 1] + towards @ ahead
                if of is None:
                    found[d][k] = _braked(before[d], expected, own)
                else:
                    # During the step, the effect is about as large as in the step before.
                    expected = expected + own @ found[d][k - 1]
                    found[d][k] = (of(before[d], size) + of(expected, size)) / 2
                ahead = ahead + gain @ found[d][k]
            for d, (*_, towards, _, signals) in steps.items():
                before[d] = signals[k + 1] + towards @ ahead
            shift = ahead
            moved[k + 1] = states[k + 1] + shift
        return shift

    # The spectra count the recording as periodic, so the first row follows the last one.
    last = follow(max(len(states) - int(SETTLED / experiment.step) - 1, 0), np.zeros(6))
    follow(0, stepped @ last)
    return moved, found


def _braked(before: Array, expected: Array, gain: Array) -> Array:
    """Mean dry friction (m,) of unit size during a step. before: rates (m,) at its start; expected: rates at its end without
    friction; gain: (m, m), change of these rates by the friction."""
    m = len(before)
    force, rate = [0.0] * m, expected.tolist()
    for _ in range(ADJUSTED if m > 1 else 1):
        for i in range(m):
            free = rate[i] + sum(gain[i, j] * force[j] for j in range(m) if j != i)
            force[i] = min(max(-free / gain[i, i], -1.0), 1.0)
    for i in range(m):
        after = rate[i] + sum(gain[i, j] * force[j] for j in range(m))
        # A rate that passes through 0 within the step has each sign during a part of the step.
        if abs(force[i]) == 1 and before[i] * after < 0:
            force[i] *= (abs(after) - abs(before[i])) / (abs(after) + abs(before[i]))
    return np.array(force)
