"""Disturbances in the residuals that are not faults of the model: hum of the mains, spikes, and jitter of the sampling times.

An encoder rounds, so its errors are constant at rest and change from row to row in motion. Spikes are therefore compared with rows of equal
speed, and jitter with the errors that rounding causes in the same motion.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import medfilt

from prw.columns import si_unit
from prw.identification.experiment import Experiment
from prw.identification.path import quantum_of, rounding
from prw.motion import Array

#: Frequencies of the mains, Hz, the range around them whose power is compared, and the ratio of the power that counts as hum.
MAINS, AROUND, HUM = (50.0, 60.0), (0.7, 8.0), 30.0
#: A spike differs from the median of NEIGHBOURS rows by this number of standard deviations of the residuals in rows of equal speed, and by
#: more than COUNTS steps of an encoder. After it, the residual returns to its value before, within this share of the spike, and the model
#: is smooth there: the parts of a coupling with clearance also strike each other, but that changes the torque or the model, too.
SPIKE, NEIGHBOURS, COUNTS, RETURNS = 9.0, 7, 3.0, 0.25
#: Number of groups of rows by speed, and minimum number of rows of a group.
GROUPS, LEAST_ROWS = 20, 50
#: Number of draws of the rounding errors of an encoder.
DRAWS = 20
#: Standard errors by which the squares of the residuals must follow the squares of the rates, if the sampling times jitter.
JITTER = 6.0


def notes_on_residuals(experiment: Experiment, modelled: Array) -> list[str]:
    """Notes for the user on the residuals of one experiment. modelled: (s, c), the FMU's outputs at the samples, SI."""
    assert experiment.values is not None
    unsteady = note_on_times(experiment, modelled)
    residual, notes = experiment.values - modelled, [unsteady] if unsteady else []
    for i, (name, column) in enumerate(zip(experiment.channels, residual.T)):
        keep = np.isfinite(column)
        time, values = experiment.sampled[keep], column[keep]
        # A jitter looks like spikes where a channel moves fast.
        size = np.zeros(len(values))
        if not unsteady and not experiment.limited:
            size = _spikes(values, modelled[keep, i], time, quantum_of(experiment.values[keep, i]))
        spikes = size > 0
        if spikes.any():
            worst = int(size.argmax())
            notes.append(
                f"{name} has spikes in {spikes.sum()} rows, the largest of {size[worst]:.2g} {si_unit(name)} at {time[worst]:.6g} s; "
                "let them count less (robust), or empty these cells"
            )
            values = np.where(spikes, 0.0, values)
        notes += [f"{name} contains {hum}" for hum in [_hum(time, values, si_unit(name))] if hum]
    return notes


def _spikes(values: Array, modelled: Array, time: Array, quantum: float) -> Array:
    """Sizes (n,) of the spikes in the residuals (n,) of a channel, 0 in rows without. quantum: step of its encoder, or 0."""
    speed, bend = np.abs(np.gradient(modelled, time)), np.abs(np.diff(modelled, 2))
    # Neighbours show what else the residual contains.
    sudden, spread = np.abs(values - medfilt(values, NEIGHBOURS)), np.empty(len(values))
    for group in np.array_split(np.argsort(speed), min(GROUPS, max(len(values) // LEAST_ROWS, 1))):
        spread[group] = np.median(np.abs(values[group])) * 1.4826
    high = np.concatenate([[False], sudden > np.maximum(SPIKE * spread, COUNTS * quantum), [False]])
    edges = np.flatnonzero(np.diff(high.astype(int)))
    found = np.zeros(len(values))
    for first, last in edges.reshape(-1, 2):
        before, after = values[max(first - 1, 0)], values[min(last, len(values) - 1)]
        size = np.abs(values[first:last] - (before + after) / 2)
        around = bend[max(first - NEIGHBOURS, 0) : last + NEIGHBOURS - 2]
        # At an end of the recording, nothing shows that the residual returns.
        if first > 0 and last < len(values) and max(abs(after - before), around.max()) < RETURNS * size.max():
            found[first:last] = size
    return found


def note_on_times(experiment: Experiment, modelled: Array) -> str:
    """A note if the sampling times jitter, else an empty string. Arguments as for `notes_on_residuals`."""
    assert experiment.values is not None
    jitter = _jitter(experiment, experiment.values - modelled, modelled)
    if not jitter:
        return ""
    return (
        f"the sampling times seem to jitter by about {1e3 * jitter:.2g} ms, because residuals are larger where the channels move "
        "faster; record the time of each row with a better clock"
    )


def _hum(time: Array, values: Array, unit: str) -> str:
    """The hum in the values (n,), in words; empty if there is none."""
    step = float(time[-1] - time[0]) / max(len(time) - 1, 1)
    frequency = np.fft.rfftfreq(len(values), step)
    power = np.abs(np.fft.rfft(values * np.hanning(len(values)))) ** 2
    for mains in MAINS:
        away = np.abs(frequency - mains)
        line, near = away < AROUND[0], (away > AROUND[0]) & (away < AROUND[1])
        there = frequency[-1] > mains + AROUND[1] and line.any() and near.sum() > 10
        if there and power[line].max() > HUM * power[near].mean():
            amplitude = 4 * float(np.sqrt(power[line].max())) / len(values)
            return (
                f"hum of {mains:g} Hz with an amplitude of {amplitude:.2g} {unit}; shield the cable or ground the sensor, or let it be "
                "subtracted (hum)"
            )
    return ""


def _jitter(experiment: Experiment, residual: Array, modelled: Array) -> float:
    """Standard deviation in s of the sampling times' errors, if the residuals show it, else 0: an error of the time adds its product
    with the rate to every channel."""
    assert experiment.values is not None
    score = information = 0.0
    for i in range(len(experiment.channels)):
        squares, high = np.gradient(modelled[:, i], experiment.sampled) ** 2, _differences(residual[:, i])
        keep = np.isfinite(high)
        if keep.sum() < 100:
            continue
        rounded = np.zeros(len(high))
        if quantum := quantum_of(experiment.values[np.isfinite(residual[:, i]), i]):
            random = np.random.default_rng(0)
            drawn = [_differences(rounding(modelled[:, i], quantum, random)) for _ in range(DRAWS)]
            rounded = np.mean(drawn, axis=0)
        # The squares of white noise have a variance of twice the square of their expectation. A slow angle jumps by a step of the encoder
        # from time to time, with the square `jump`. It may jump once more in all draws.
        jump = quantum**2 / 6
        weight = 1 / np.sqrt(
            2 * np.median(high[keep]) ** 2 + jump * (rounded[keep] + jump / DRAWS) + np.finfo(float).tiny
        )
        one = weight / np.linalg.norm(weight)
        y, x = (column - one * (one @ column) for column in (weight * (high - rounded)[keep], weight * squares[keep]))
        variance = float(np.var(y))
        if variance > 0:
            score += float(x @ y) / variance
            information += float(x @ x) / variance
    return float(np.sqrt(score / information)) if information and score > JITTER * np.sqrt(2 * information) else 0.0


def _differences(values: Array) -> Array:
    """Squares (n,) of the differences of neighbouring values (n,), which do not contain slow errors of the model; white values of variance
    1 have the expectation 1. NaN at the ends and at gaps."""
    found = np.full(len(values), np.nan)
    found[1:-1] = (values[1:-1] - (values[:-2] + values[2:]) / 2) ** 2 / 1.5
    return found
