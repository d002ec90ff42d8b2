"""Disturbances in the residuals that are not faults of the model: hum of the mains, spikes, and jitter of the sampling times."""

from __future__ import annotations

import numpy as np
from scipy.signal import medfilt

from prw.columns import si_unit
from prw.identification.experiment import Experiment
from prw.motion import Array

#: Frequencies of the mains, Hz, the range around them whose power is compared, and the ratio of the power that counts as hum.
MAINS, AROUND, HUM = (50.0, 60.0), (0.7, 8.0), 30.0
#: A spike differs from the median of NEIGHBOURS rows by this number of standard deviations.
SPIKE, NEIGHBOURS = 9.0, 7
#: Standard errors by which the squares of the residuals must follow the squares of the rates, if the sampling times jitter.
JITTER = 6.0


def notes_on_residuals(experiment: Experiment, modelled: Array) -> list[str]:
    """Notes for the user on the residuals of one experiment. modelled: (s, c), the FMU's outputs at the samples, SI."""
    assert experiment.values is not None
    if unsteady := note_on_times(experiment, modelled):
        return [unsteady]
    residual, notes = experiment.values - modelled, []
    for name, column, power in zip(experiment.channels, residual.T, experiment.channel_power.T):
        keep = np.isfinite(column)
        time, values = experiment.sampled[keep], column[keep]
        # Neighbours show what else the residual contains.
        sudden = values - medfilt(values, NEIGHBOURS)
        spread = max(float(np.median(np.abs(values))) * 1.4826, float(np.sqrt(power.mean())))
        spikes = np.abs(sudden) > SPIKE * spread
        if spikes.any():
            worst = int(np.abs(sudden).argmax())
            notes.append(
                f"{name} has spikes in {spikes.sum()} rows, the largest of {abs(sudden[worst]):.2g} {si_unit(name)} at {time[worst]:.6g} s; "
                "empty these cells, which are then skipped"
            )
            values = np.where(spikes, 0.0, values)
        notes += [f"{name} contains {hum}" for hum in [_hum(time, values, si_unit(name))] if hum]
    return notes


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
            return f"hum of {mains:g} Hz with an amplitude of {amplitude:.2g} {unit}; shield the cable or ground the sensor"
    return ""


def _jitter(experiment: Experiment, residual: Array, modelled: Array) -> float:
    """Standard deviation in s of the sampling times' errors, if the residuals show it, else 0: an error of the time adds its product
    with the rate to every channel."""
    score = information = 0.0
    for i in range(len(experiment.channels)):
        squares = np.gradient(modelled[:, i], experiment.sampled) ** 2
        keep = np.isfinite(residual[:, i])
        # Neighbouring differences of white residuals, without slow errors of the model.
        high = np.full(len(keep), np.nan)
        high[1:-1] = (residual[1:-1, i] - (residual[:-2, i] + residual[2:, i]) / 2) ** 2 / 1.5
        keep &= np.isfinite(high)
        if keep.sum() < 100:
            continue
        y, x = high[keep] - high[keep].mean(), squares[keep] - squares[keep].mean()
        variance = float(np.var(y))
        if variance > 0:
            score += float(x @ y) / variance
            information += float(x @ x) / variance
    return float(np.sqrt(score / information)) if information and score > JITTER * np.sqrt(2 * information) else 0.0
