"""Writes the recordings in this directory: simulated logs of a controller in point-to-point moves of the wrist.

    python make_recordings.py

The motors follow trapezoidal velocity profiles. Angles are the counts of encoders on the motor shafts (2500 lines with
four counts each), converted to radians. The script needs no packages and always writes the same bytes.
"""

import csv
import math
import random
from pathlib import Path

COUNTS_PER_TURN = 4 * 2500
VELOCITY = 2.5  # rad/s, cruise
ACCELERATION = 25.0  # rad/s^2
PAUSE = 0.35  # s, before every move and after the last
START = (20.0, -15.0)  # deg
#: Motor angles at the end of each move, deg. The moves are in pitch, in roll, with one motor, with both motors by
#: different angles, and back to the start.
TARGETS = ((55.0, 20.0), (85.0, -10.0), (85.0, 30.0), (40.0, 10.0), START)

#: Start time (s), angles at the start and at the end (rad), and the longer of the two motors' distances (rad).
Move = tuple[float, list[float], list[float], float]


def trapezoid(length: float, s: float) -> tuple[float, float]:
    """Distance (rad) and speed (rad/s) at s seconds into a rest-to-rest move over `length` (rad)."""
    ramp = min(VELOCITY / ACCELERATION, math.sqrt(length / ACCELERATION))
    top = ACCELERATION * ramp
    duration = length / top + ramp
    s = min(max(s, 0.0), duration)
    if s < ramp:
        return ACCELERATION * s * s / 2, ACCELERATION * s
    if s > duration - ramp:
        left = duration - s
        return length - ACCELERATION * left * left / 2, ACCELERATION * left
    return top * (s - ramp / 2), top


def moves() -> tuple[list[Move], float]:
    """The plan, and its end (s)."""
    plan, time, here = [], PAUSE, [math.radians(a) for a in START]
    for target in TARGETS:
        there = [math.radians(a) for a in target]
        length = max(abs(b - a) for a, b in zip(here, there))
        plan.append((time, here, there, length))
        ramp = min(VELOCITY / ACCELERATION, math.sqrt(length / ACCELERATION))
        time += length / (ACCELERATION * ramp) + ramp + PAUSE
        here = there
    return plan, time


def motors(plan: list[Move], t: float) -> tuple[list[float], list[float]]:
    """Angles (rad) and rates (rad/s) of both motors at time t. In each move, the motors start and stop together."""
    begin, here, there, length = [move for move in plan if move[0] <= t][-1] if t >= plan[0][0] else plan[0]
    distance, speed = trapezoid(length, t - begin)
    angles = [a + (b - a) * distance / length for a, b in zip(here, there)]
    return angles, [(b - a) * speed / length for a, b in zip(here, there)]


def encoder(angle: float) -> float:
    """The angle that the encoder measures, rounded down to a count, in rad."""
    return math.floor(angle * COUNTS_PER_TURN / (2 * math.pi)) * 2 * math.pi / COUNTS_PER_TURN


def write(name: str, times: list[float], with_rates: bool) -> None:
    """Write one recording; `with_rates` adds the drives' velocity, logged to 1 mrad/s."""
    plan, _ = moves()
    with open(Path(__file__).with_name(name), "w", encoding="ascii", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["time", "theta1", "theta2"] + (["omega1", "omega2"] if with_rates else []))
        for t in times:
            angles, rates = motors(plan, t)
            row = [f"{t:.6g}"] + [f"{encoder(a):.6f}" for a in angles]
            table.writerow(row + ([f"{r + 0:.3f}" for r in rates] if with_rates else []))


def main() -> None:
    _, end = moves()
    write("point_to_point.csv", [k / 1000 for k in range(int(end * 1000) + 1)], with_rates=True)
    # Polled over a slow bus: about every 5 ms at uneven times, without velocities.
    jitter = random.Random(2009)
    polled = [round(k / 200 + 0.003 * jitter.random(), 5) for k in range(int(end * 200))]
    write("point_to_point_polled.csv", polled, with_rates=False)


if __name__ == "__main__":
    main()
