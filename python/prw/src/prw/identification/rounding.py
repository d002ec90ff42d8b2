"""Numbers with as many digits as their standard errors justify."""

from __future__ import annotations

import math


def rounded(value: float, error: float, *others: float) -> list[str]:
    """The value, its standard error with two significant digits, and other values such as the ends of its interval, all with the
    decimals of the error. Small and large numbers have powers of ten. If the value or the error is not finite, or the error is
    not positive, all numbers have five significant digits.

    >>> rounded(2.9491, 1.5)
    ['2.9', '1.5']
    >>> rounded(131.94, 0.317, 131.32, 132.56)
    ['131.94', '0.32', '131.32', '132.56']
    >>> rounded(3.8681e-7, 2.1e-9)
    ['3.868e-07', '2.1e-09']
    """
    if not (math.isfinite(error) and error > 0 and math.isfinite(value)):
        return [f"{number:.5g}" for number in (value, error, *others)]
    # Rounding to two digits may increase the exponent of the error: 0.0996 becomes 0.10.
    place = math.floor(math.log10(float(f"{error:.1e}"))) - 1
    numbers = (value, error, *others)
    if abs(value) >= 1e-4 and place < 5:
        return [f"{_nearest(number, place):.{max(0, -place)}f}" for number in numbers]
    return [f"{number:.{max(0, _exponent(number) - place)}e}" if number else "0" for number in numbers]


def _nearest(number: float, place: int) -> float:
    """The number, rounded to a multiple of 10**place. Adding 0.0 turns -0.0 into 0.0."""
    return round(number, -place) + 0.0


def _exponent(number: float) -> int:
    return math.floor(math.log10(abs(number)))
