"""Polygons cut into triangles: fans where they are convex, ears where they aren't."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel

MOST_EAR_CORNERS = 2048
"""Cutting ears takes time in the square of the corners, or worse: larger polygons are cut as fans, and so is what is
left when a file has used up its steps."""
STEPS = 1 << 30


@device
def _turn(plane, a, b, c):
    """Twice the area of the triangle of three points in the plane, positive to the left."""
    return (plane[b, 0] - plane[a, 0]) * (plane[c, 1] - plane[a, 1]) - (plane[b, 1] - plane[a, 1]) * (
        plane[c, 0] - plane[a, 0]
    )


@device
def _flatten(vertices, corners, begin, n, plane):
    """The polygon in the plane of coordinates that shows most of it, by Newell's normal, counter-clockwise and counted
    from its first corner, so that one far from the origin keeps its digits."""
    o = corners[begin]
    x = y = z = 0.0
    for i in range(n):
        a, b = corners[begin + i], corners[begin + (i + 1) % n]
        ax, ay, az = vertices[a, 0] - vertices[o, 0], vertices[a, 1] - vertices[o, 1], vertices[a, 2] - vertices[o, 2]
        bx, by, bz = vertices[b, 0] - vertices[o, 0], vertices[b, 1] - vertices[o, 1], vertices[b, 2] - vertices[o, 2]
        x += (ay - by) * (az + bz)
        y += (az - bz) * (ax + bx)
        z += (ax - bx) * (ay + by)
    u, v, sign = 1, 2, x
    if abs(y) > abs(x) and abs(y) >= abs(z):
        u, v, sign = 2, 0, y
    elif abs(z) > abs(x):
        u, v, sign = 0, 1, z
    flip = -1.0 if sign < 0 else 1.0
    for i in range(n):
        c = corners[begin + i]
        plane[i, 0] = (vertices[c, u] - vertices[o, u]) * flip
        plane[i, 1] = vertices[c, v] - vertices[o, v]


@device
def _is_ear(plane, after, before, b):
    """Can the corner be cut off: does it turn left, and is no other corner in the triangle?"""
    a, c = before[b], after[b]
    if not _turn(plane, a, b, c) > 0:
        return False
    p = after[c]
    while p != a:
        inside = _turn(plane, a, b, p) >= 0 and _turn(plane, b, c, p) >= 0 and _turn(plane, c, a, p) >= 0
        # A corner in the very place of one of the three doesn't count: holes are cut to the rim by such.
        if inside and not (
            (plane[p, 0] == plane[a, 0] and plane[p, 1] == plane[a, 1])
            or (plane[p, 0] == plane[b, 0] and plane[p, 1] == plane[b, 1])
            or (plane[p, 0] == plane[c, 0] and plane[p, 1] == plane[c, 1])
        ):
            return False
        p = after[p]
    return True


@device
def _cut(begin, n, plane, after, before, steps, out, at):
    """Triangles of a polygon in the plane, as places in the corners; by ears (Meisters 1975) if it isn't convex."""
    convex = True
    for i in range(n):
        if _turn(plane, (i + n - 1) % n, i, (i + 1) % n) < 0:
            convex = False
            break
    if convex or steps[0] <= 0:
        for i in range(1, n - 1):
            out[at, 0], out[at, 1], out[at, 2] = begin, begin + i, begin + i + 1
            at += 1
        return at
    for i in range(n):
        after[i], before[i] = (i + 1) % n, (i + n - 1) % n
    b, left, tried = 1, n, 0
    while left > 3:
        steps[0] -= left
        # Where no ear is found, in polygons that cross themselves, any corner is cut.
        if _is_ear(plane, after, before, b) or tried > left or steps[0] <= 0:
            a, c = before[b], after[b]
            out[at, 0], out[at, 1], out[at, 2] = begin + a, begin + b, begin + c
            at += 1
            after[a], before[c] = c, a
            left -= 1
            tried = 0
            b = after[c]
        else:
            tried += 1
            b = after[b]
    a, c = before[b], after[b]
    out[at, 0], out[at, 1], out[at, 2] = begin + a, begin + b, begin + c
    return at + 1


@kernel
def triangulate(vertices, corners, starts, usable, out, owner):
    """Triangles of the polygons whose corners [starts[i], starts[i + 1]) are indices of vertices (V, 3) float64, where
    usable[i]. `out` (T, 3) int32 gets places in `corners`, `owner` (T,) int32 the polygons; returns T."""
    plane = np.empty((MOST_EAR_CORNERS, 2), np.float64)
    after, before = np.empty(MOST_EAR_CORNERS, np.int32), np.empty(MOST_EAR_CORNERS, np.int32)
    steps = np.full(1, STEPS, np.int64)
    at = 0
    for f in range(len(starts) - 1):
        begin, n = starts[f], starts[f + 1] - starts[f]
        if not usable[f] or n < 3:
            continue
        first = at
        if n == 3:
            out[at, 0], out[at, 1], out[at, 2] = begin, begin + 1, begin + 2
            at += 1
        elif n <= MOST_EAR_CORNERS:
            _flatten(vertices, corners, begin, n, plane)
            at = _cut(begin, n, plane, after, before, steps, out, at)
        else:
            for i in range(1, n - 1):
                out[at, 0], out[at, 1], out[at, 2] = begin, begin + i, begin + i + 1
                at += 1
        owner[first:at] = f
    return at


@kernel
def count_triangles(starts, usable):
    """How many triangles the usable polygons give."""
    total = 0
    for f in range(len(starts) - 1):
        if usable[f]:
            total += max(starts[f + 1] - starts[f] - 2, 0)
    return total
