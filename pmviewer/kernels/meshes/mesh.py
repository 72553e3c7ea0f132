"""Passes over all triangles of a mesh: which of them can be shown, what box they fill, what they use."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel

WHOLE, NOT_FINITE, FLAT = 0, 1, 2
"""What is wrong with a triangle."""


@device
def _usable(vertices, i, largest):
    # A comparison with a NaN fails.
    return abs(vertices[i, 0]) <= largest and abs(vertices[i, 1]) <= largest and abs(vertices[i, 2]) <= largest


@device
def _rounded(x):
    return np.float64(np.float32(x))


@device
def _edge(vertices, a, b):
    """From vertex a to vertex b, both rounded to float32."""
    return (
        _rounded(vertices[b, 0]) - _rounded(vertices[a, 0]),
        _rounded(vertices[b, 1]) - _rounded(vertices[a, 1]),
        _rounded(vertices[b, 2]) - _rounded(vertices[a, 2]),
    )


@kernel
def judge(vertices, faces, begin, end, largest, flattest, verdict, number):
    """For the faces [begin, end): NOT_FINITE where a coordinate of vertices (V, 3) float64 is no number up to `largest`
    in size, FLAT where the height of what float32 makes of the triangle is `flattest` of its longest edge or less.
    number (V,) int32 becomes 0 for the vertices of those that are WHOLE. Returns how many are not."""
    bad = 0
    for f in range(begin, end):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        verdict[f] = WHOLE
        if not (_usable(vertices, a, largest) and _usable(vertices, b, largest) and _usable(vertices, c, largest)):
            verdict[f] = NOT_FINITE
            bad += 1
            continue
        px, py, pz = _edge(vertices, a, b)
        qx, qy, qz = _edge(vertices, a, c)
        rx, ry, rz = qx - px, qy - py, qz - pz
        longest = max(px * px + py * py + pz * pz, qx * qx + qy * qy + qz * qz, rx * rx + ry * ry + rz * rz)
        nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
        area = np.sqrt(nx * nx + ny * ny + nz * nz)
        if not (area > flattest * longest and longest > 0):
            verdict[f] = FLAT
            bad += 1
            continue
        # Other threads write the same number.
        number[a] = number[b] = number[c] = 0
    return bad


@kernel
def mark_used(faces, number):
    """number (V,) int32 becomes 0 for the vertices that faces use."""
    for f in range(len(faces)):
        for k in range(3):
            number[faces[f, k]] = 0


@kernel
def number_marked(vertices, number, low, high):
    """number (V,) int32, 0 for vertices (V, 3) that are used and −1 for others, becomes 0, 1, 2 … for those that are,
    in their own order; low and high (3,) the corners of the box around them. Returns how many they are."""
    x0, y0, z0, x1, y1, z1 = np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf
    used = np.int32(0)
    for i in range(len(number)):
        if number[i] == 0:
            number[i] = used
            used += 1
            x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
            x0, y0, z0 = min(x0, x), min(y0, y), min(z0, z)
            x1, y1, z1 = max(x1, x), max(y1, y), max(z1, z)
    low[0], low[1], low[2] = x0, y0, z0
    high[0], high[1], high[2] = x1, y1, z1
    return used


@kernel
def renumber(faces, number, out):
    """out (F, 3) int32, which may be the faces themselves, = number (V,) at the corners of the faces."""
    for f in range(len(faces)):
        for k in range(3):
            out[f, k] = number[faces[f, k]]


@kernel
def keep_whole(faces, verdict, begin, end, out):
    """Those of the faces [begin, end) whose verdict is WHOLE become the first rows of out (≥ that many, 3) int32."""
    row = 0
    for f in range(begin, end):
        if verdict[f] == WHOLE:
            out[row, 0], out[row, 1], out[row, 2] = faces[f, 0], faces[f, 1], faces[f, 2]
            row += 1


@kernel
def keep_used(vertices, number, out):
    """out (V', 3) float64 = those of vertices (V, 3) that have a number in number (V,), in its order."""
    for i in range(len(number)):
        row = number[i]
        if row >= 0:
            out[row, 0], out[row, 1], out[row, 2] = vertices[i, 0], vertices[i, 1], vertices[i, 2]


@kernel
def at_corners(values, faces, begin, end, out):
    """out (F, 3, 3) float32 = values (V, 3) float64 at the corners of the faces [begin, end)."""
    for f in range(begin, end):
        for k in range(3):
            i = faces[f, k]
            for axis in range(3):
                out[f, k, axis] = values[i, axis]


@device
def _across(vertices, faces, f):
    """Along the normal of face f, as long as twice its area."""
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    px, py, pz = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2]
    qx, qy, qz = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1], vertices[c, 2] - vertices[a, 2]
    return py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx


@kernel
def face_normals(vertices, faces, out):
    """The unit normal of each face three times over, (F, 3, 3) float32; zero where the face has no area."""
    for f in range(len(faces)):
        nx, ny, nz = _across(vertices, faces, f)
        length = max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-300)
        for k in range(3):
            out[f, k, 0], out[f, k, 1], out[f, k, 2] = nx / length, ny / length, nz / length


@kernel
def across(vertices, faces, chosen, out):
    """out (n, 3) float64 = along the normals of the chosen (n,) of the faces, as long as twice their areas."""
    for i in range(len(chosen)):
        out[i, 0], out[i, 1], out[i, 2] = _across(vertices, faces, chosen[i])
