"""Couplings with clearance, in which neither spring nor damper acts, and with large cubic stiffness, on a rig that is integrated by itself:
contact is unilateral."""

from __future__ import annotations

import numpy as np
import pytest

import prw
from prw.identification import effects
from prw.identification.model import Model
from prw.identification.response import Distortion

DEGREE = np.pi / 180
TRUE = {"k1": 2.5 / DEGREE, "k2": 0.7 / DEGREE, "c1": 9e-3 / DEGREE, "c2": 8e-3 / DEGREE, "c3": 6e-3 / DEGREE}
#: Inertias of Table 1, and the ratio N / 2M of eq. (1).
J2, J3, H3, RATIO = 3.8681291e-3, 1.2750004e-2, 4.2363841e-2, 7 / 8
#: Integration steps per second.
FINE = 4000


def torque(k: float, c: float, twist: np.ndarray, rate: np.ndarray, clearance: float) -> np.ndarray:
    """The torque of a coupling whose sides press against each other, but do not pull."""
    pressing = k * (twist - np.sign(twist) * clearance / 2) + c * rate
    return np.where((np.abs(twist) > clearance / 2) & (pressing * twist > 0), pressing, 0.0)


def rig(duration: float, clearance: float = 0.0, cubic: float = 0.0, rate: int = 1000) -> dict[str, np.ndarray]:
    """What the sensors record at `rate` Hz of a rig with clearance in the couplings k1 and cubic stiffness of the couplings k2, 1/rad2, and
    motors that follow sines of 0.3 to 18 Hz."""
    random, count, each = np.random.default_rng(1), int(duration * rate), FINE // rate
    half = np.arange(2 * each * count + 1) / (2 * FINE)
    frequency = random.uniform(0.3, 18, (2, 12))
    waves = 0.25 * np.minimum(1, 2 / frequency) ** 1.3 * np.exp(2j * np.pi * random.random((2, 12)))
    turning = waves * np.exp(2j * np.pi * half[:, None, None] * frequency)
    theta, omega = turning.sum(axis=2).imag, (turning * 2j * np.pi * frequency).sum(axis=2).imag
    k1, k2, c1, c2, c3 = TRUE.values()

    def slope(x: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        twist, second = theta[k] - x[0], k2 * (x[0] - x[1] + cubic * (x[0] - x[1]) ** 3)
        # The shaft between the couplings has no inertia: either both transmit the same torque, or the first one is open.
        shaft = (k1 * (twist - np.sign(twist) * clearance / 2) + c1 * omega[k] - second + c2 * x[2]) / (c1 + c2)
        first = k1 * twist + c1 * (omega[k] - shaft)
        if clearance:
            first = torque(k1, c1, twist, omega[k] - shaft, clearance)
            shaft = np.where(first == 0, x[2] - second / c2, shaft)
        pitching, rolling = c3 * (x[2, 0] + x[2, 1]) / 2, c3 * RATIO * (x[2, 0] - x[2, 1])
        together = (first[0] + first[1] - pitching) / (J2 + H3 / 2)
        apart = (first[0] - first[1] - 2 * RATIO * rolling) / (J2 + 2 * RATIO**2 * J3)
        return np.array([shaft, x[2], [(together + apart) / 2, (together - apart) / 2]]), -first

    x, h = np.array([theta[0], theta[0], [0.0, 0.0]]), 1 / FINE
    states, tau = np.empty((count + 1, 3, 2)), np.empty((count + 1, 2))
    for k in range(each * count + 1):
        first, tau_now = slope(x, 2 * k)
        if k % each == 0:
            states[k // each], tau[k // each] = x, tau_now
        if k < each * count:
            second = slope(x + h / 2 * first, 2 * k + 1)[0]
            third = slope(x + h / 2 * second, 2 * k + 1)[0]
            x = x + h / 6 * (first + 2 * second + 2 * third + slope(x + h * third, 2 * k + 2)[0])
    quantum = 2 * np.pi / 10_000
    exact = {
        **{f"theta{i + 1}": theta[:: 2 * each, i] for i in (0, 1)},
        **{f"theta{i + 3}": states[:, 0, i] for i in (0, 1)},
    }
    found = {name: quantum * np.round(angle / quantum + random.uniform()) for name, angle in exact.items()}
    found |= {f"tau{i + 1}": tau[:, i] + random.normal(0, 0.02, count + 1) for i in (0, 1)}
    pitch, roll = states[:, 1].mean(axis=1), RATIO * (states[:, 1, 0] - states[:, 1, 1])
    found |= {"pitch": pitch + random.normal(0, 1e-3, count + 1), "roll": roll + random.normal(0, 1e-3, count + 1)}
    return {"time": np.arange(count + 1) / rate, **found}


@pytest.mark.parametrize("place, first, last", [("k1", "c1", "c2"), ("k2", "c2", "c1")])
def test_the_law_of_clearance_is_unilateral_contact(fmu, place, first, last):
    """With the shift of the spring's end, the coupling transmits the torque of contact. The massless shaft between the couplings transmits
    that torque to the other coupling, whose torque also depends on the rate of the shaft."""
    random, clearance = np.random.default_rng(2), 1e-3
    with Model(fmu) as model:
        values = dict(model.known.starts)
        linear = model.at({})
    law = effects.law(Distortion("clearance", place), linear, values)
    assert law is not None and law.of is not None and law.once is not None and law.fixed is not None
    k, c = values[place], values[first]
    seen = set()
    for _ in range(300):
        x, motors = random.normal(0, 2e-3, 6), random.normal(0, 2e-3, 4)
        x[4:], motors[2:] = random.normal(0, 0.3, 2), random.normal(0, 0.3, 2)
        signals = law.follows[0] @ x + law.follows[1] @ motors
        shift = clearance * law.of(signals, clearance)
        np.testing.assert_allclose(clearance * np.array(law.once(signals.tolist(), clearance)), shift, rtol=1e-14)
        shaft = (linear.A @ x + linear.B @ motors + law.drive @ shift)[:2]
        ends = (motors[:2] - x[:2], motors[2:] - shaft) if place == "k1" else (x[:2] - x[2:4], shaft - x[4:])
        transmitted = k * (ends[0] + shift) + c * ends[1]
        np.testing.assert_allclose(transmitted, torque(k, c, *ends, clearance), atol=1e-9)
        seen |= {"open" if abs(t) < 1e-9 else "closed" for t in transmitted}
        part = clearance * law.of(signals, clearance) - law.fixed(signals, clearance)
        assert set(np.abs(part)) <= {0.0, clearance / 2}
    assert seen == {"open", "closed"}


def test_the_mean_of_the_shift_counts_both_sides_of_an_impact():
    """Over a step in which the parts strike each other, the mean of the shift is that of many small steps."""
    random, size, fine = np.random.default_rng(4), 1e-3, np.linspace(0, 1, 20001)
    struck = 0
    for _ in range(200):
        before, after = random.uniform(-0.4e-3, 0.4e-3, 2), random.uniform(0.6e-3, 3e-3, 2) * random.choice([-1, 1], 2)
        signals = before + fine[:, None] * (after - before)
        # The torque with which the shift is 0 presses the parts together.
        opening = signals + fine[:, None] * 0.1 * (after - before)
        at = effects._let_go(np.hstack([signals, opening]), size)
        exact = at.mean(axis=0)
        first, last = ([*signals[k].tolist(), *opening[k].tolist()] for k in (0, -1))
        np.testing.assert_allclose(effects._struck(first, last, size), exact, atol=2e-4)
        struck += int(np.abs(np.mean([at[0], at[-1]], axis=0) - exact).max() > 0.05)
    assert struck > 100, "the mean of both ends is not exact"


@pytest.mark.parametrize("duration, rate, clearance", [(2.0, 1000, 6e-4), (4.0, 200, 2e-3)])
def test_clearance_is_distinguished_from_backlash(fmu, duration, rate, clearance):
    """With backlash, for which the damper acts in the gap, c1 would be several per cent too small. With 200 rows per second, the parts
    strike each other between two rows."""
    found = prw.identify(rig(duration, clearance=clearance, rate=rate), fmu=fmu)
    assert_contains(found, "clearance of the couplings k1", clearance, 0.1 * clearance)


def test_a_cubic_part_that_is_as_large_as_the_linear_part(fmu):
    """With 500 rows per second, the torque of the springs changes much from row to row."""
    found = prw.identify(rig(3.0, cubic=10.0, rate=500), starts=1, fmu=fmu)
    assert_contains(found, "cubic stiffness of the couplings k2", 10.0, 0.1)


def assert_contains(found, name: str, size: float, off: float) -> None:
    """Asserts that the fit includes only the property, with this size within `off`, and the true parameters."""
    assert found.fits and len(found.additions) == 1, found.misfits
    assert abs(found.distortions[name][0] - size) < off
    for parameter, true in TRUE.items():
        low, high = found.parameters[parameter].interval
        assert low - 0.25 * (high - low) < true < high + 0.25 * (high - low), (parameter, true, low, high)
