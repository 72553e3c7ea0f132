"""The unit disc of a look-up, and the triangle that its middle lies on: what of the disc lies beyond which edge.

All is in the plane of the triangle, around the middle of the disc and relative to its radius.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.jit import device

NEAR = 0.85
"""How near an edge is to cut something off: beyond are less than 3.4 % of the disc, which are taken to be covered."""

_f4 = np.float32
_ACOS = _f4(1.5707288), _f4(-0.2121144), _f4(0.0742610), _f4(-0.0187293)


class Triangle(NamedTuple):
    """Corners of the triangle that a look-up is made on, in its plane's coordinates around the point, relative to the
    radius; `known`: whether it is one, whose corners the scene has as they are, and that stops all rays."""

    known: Any
    a: Any
    b: Any
    c: Any


@device
def turn_of(a, b, x, y):
    """Twice the area of the triangle from a to b to (x, y)."""
    return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])


@device
def clears(a, b):
    """Whether hardly anything of the unit disc lies beyond the line through a and b."""
    turn = turn_of(a, b, _f4(0.0), _f4(0.0))
    x, y = b[0] - a[0], b[1] - a[1]
    return turn * turn >= _f4(NEAR * NEAR) * (x * x + y * y)


@device
def holds(triangle, x, y):
    """Whether the triangle holds (x, y)."""
    first, second = turn_of(triangle.a, triangle.b, x, y), turn_of(triangle.b, triangle.c, x, y)
    third = turn_of(triangle.c, triangle.a, x, y)
    low, high = min(first, min(second, third)), max(first, max(second, third))
    return triangle.known and (low >= _f4(0.0) or high <= _f4(0.0))


class Cut(NamedTuple):
    """What of the unit disc around the origin lies beyond an edge of a triangle that holds the origin, as seen from
    there: its share of the disc's area; its angles, from `low` to `high`, around the edge's normal; the edge's distance
    d, unit direction (x, y) and normal outwards."""

    share: Any
    low: Any
    high: Any
    d: Any
    x: Any
    y: Any
    outx: Any
    outy: Any


@device
def _angle(s, d):
    """atan(s/d) of d ≥ 0, to 7e-5 (Abramowitz and Stegun, 4.4.45)."""
    x = d / _f4(math.sqrt(s * s + d * d)) if d > _f4(0.0) else _f4(0.0)
    polynomial = _ACOS[0] + x * (_ACOS[1] + x * (_ACOS[2] + x * _ACOS[3]))
    return _f4(math.copysign(_f4(math.sqrt(max(_f4(1.0) - x, _f4(0.0)))) * polynomial, s))


@device
def cut_by(a, b, turn):
    """By the edge from a to b; turn: 1 of a polygon that is seen anticlockwise, −1 of others."""
    no = _f4(0.0)
    x, y = b[0] - a[0], b[1] - a[1]
    if clears(a, b):
        return Cut(no, no, no, no, no, no, no, no)
    away, length2 = turn * (a[0] * y - a[1] * x), x * x + y * y
    one = _f4(1.0) / _f4(math.sqrt(length2))
    x, y, d = one * x, one * y, max(one * away, no)
    start = a[0] * x + a[1] * y
    half = _f4(math.sqrt(max(_f4(1.0) - d * d, no)))
    first, last = max(start, -half), min(start + length2 * one, half)
    if first >= last:
        return Cut(no, no, no, no, no, no, no, no)
    low, high = _angle(first, d), _angle(last, d)
    share = (high - low - d * (last - first)) * _f4(0.5 / math.pi)
    return Cut(share, low, high, d, x, y, turn * y, -turn * x)
