"""Numbers as text, many at a time: what "%r" and "%.12g" write of each, to the letter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from prw.motion import Array

#: Digits of a number that is to be read back unchanged, and of others.
ALL, SOME = 17, 12
#: The longest text of a number, -2.2250738585072014e-308.
WIDTH = 24
#: Powers of ten without an error.
POWERS = np.array([10.0**k for k in range(22)])
#: 0000 to 9999.
FOURS = np.array([f"{n:04d}" for n in range(10_000)], "S4").view(np.uint32)
SPLITTER = 2.0**27 + 1
#: The place of the point where there is an exponent, or Python is asked to be sure.
OTHERS = 99
ZERO, POINT, MINUS, COMMA, LINE = b"0.-,\n"

Text = NDArray[np.uint8]


def lines_of(table: Array, whole: int) -> bytes:
    """Rows (n, c) as lines of CSV: the first `whole` columns with all digits, as "%r" has them, others as "%.12g"."""
    cells = np.zeros((*table.shape, WIDTH + 1), np.uint8)
    cells[:, :, WIDTH], cells[:, -1, WIDTH] = COMMA, LINE
    for columns, digits in ((slice(whole), ALL), (slice(whole, None), SOME)):
        values = table[:, columns]
        cells[:, columns, :WIDTH] = _texts(values.ravel(), digits).reshape(*values.shape, WIDTH)
    return cells.tobytes().translate(None, b"\0")


def _texts(values: Array, digits: int) -> Text:
    """The texts (n, WIDTH) of values (n,), with zeros where there is nothing."""
    size = np.abs(values)
    # Where there is no exponent in the text, neither of "%r" nor of "%.12g".
    quick = (size >= 1e-4) & (size < (1e16 if digits == ALL else 1e12))
    size = np.where(quick, size, 1.0)
    place = np.floor(np.log10(size)).astype(np.int8)
    number, sure = _digits(size, place, digits)
    # Those with the point at the same place stand together, and those that Python writes behind them.
    place[~quick | ~sure | (place >= digits)] = OTHERS
    order = np.argsort(place, kind="stable")
    place, number, values = place[order], number[order], values[order]
    figures = _figures(number // 10 ** (ALL - digits), digits)
    # Without zeros at the end; but all before the point, and one behind it in 7.0, while 7 has none.
    ends = figures[:, -1] == ZERO
    kept = np.where(ends, digits - 1, digits)
    more = np.flatnonzero(ends & ((figures[:, -2] == ZERO) | (place > digits - 3)))
    longer = figures[more]
    least = place[more].astype(np.int64) + (2 if digits == ALL else 1)
    kept[more] = np.maximum(digits - (longer[:, ::-1] != ZERO).argmax(axis=1), least)
    figures[ends, -1] = 0
    figures[more] = np.where(np.arange(digits) < kept[more, None], longer, 0)
    texts = np.zeros((len(values), WIDTH), np.uint8)
    texts[values < 0, 0] = MINUS
    bounds = [0, *(np.flatnonzero(np.diff(place)) + 1), len(values)]
    for start, stop in zip(bounds, bounds[1:]):
        rows, at = slice(start, stop), int(place[start]) if stop > start else OTHERS
        if at == OTHERS:
            form = "%r" if digits == ALL else "%.12g"
            said = np.array([form % value for value in values[rows].tolist()], f"S{WIDTH}")
            texts[rows] = said.view(np.uint8).reshape(-1, WIDTH)
        elif at < 0:
            begin = 2 - at
            texts[rows, 1:begin] = np.frombuffer(b"0." + b"0" * (-at - 1), np.uint8)
            texts[rows, begin : begin + digits] = figures[rows]
        else:
            texts[rows, 1 : at + 2] = figures[rows, : at + 1]
            texts[rows, at + 2] = np.where(kept[rows] > at + 1, POINT, 0)
            texts[rows, at + 3 : digits + 2] = figures[rows, at + 1 :]
    found = np.empty(len(values), f"V{WIDTH}")
    found[order] = texts.view(f"V{WIDTH}")[:, 0]
    return found.view(np.uint8).reshape(-1, WIDTH)


def _digits(size: Array, place: NDArray[np.int8], digits: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Numbers of 17 digits, the first before the point: those with the fewest that are not 0 which are read back as
    `size`, or those that are next to it with fewer digits. And whether that is sure."""
    power = POWERS[16 - place]
    # Dekker's product: high + low is size * power without an error.
    high = size * power
    (a, b), (c, d) = _halves(size), _halves(power)
    low = ((a * c - high) + a * d + b * c) + b * d
    floor = high.astype(np.int64)
    number = floor + np.rint(low).astype(np.int64)
    if digits == ALL:
        room = np.spacing(np.nextafter(size, 0.0)) * power * (0.5 - 1e-9)
        best = number
        for unit in (10, 100):
            below = number // unit * unit
            over = (floor - below) + low
            up = np.where(over == unit / 2, below // unit % 2 == 1, over > unit / 2)
            best = np.where(np.where(up, unit - over, over) < room, below + unit * up, best)
        sure = np.ones(len(size), dtype=bool)
    else:
        unit = 10 ** (ALL - digits)
        below = number // unit * unit
        best, sure = below + unit * (number - below > unit // 2), number - below != unit // 2
    return best, sure & (best >= 10**16) & (best < 10**17)


def _halves(values: Array) -> tuple[Array, Array]:
    """Two numbers of 26 bits at most, the sum of which the values are."""
    shifted = SPLITTER * values
    high = shifted - (shifted - values)
    return high, values - high


def _figures(number: NDArray[np.int64], digits: int) -> Text:
    """The digits (n, digits) of numbers (n,)."""
    count = -(-digits // 4)
    fours = np.empty((len(number), count), np.uint32)
    for at in reversed(range(count)):
        rest = number // 10_000
        fours[:, at] = FOURS[number - rest * 10_000]
        number = rest
    return fours.view(np.uint8)[:, -digits:]
