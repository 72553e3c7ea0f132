"""Corners of triangles that name position, texture coordinate and normal apart, as vertices that hold all three."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import kernel

_LONGEST_LIST = 64
"""Vertices at one position that are compared; a file with more of them gets some twice."""


@kernel
def merge(v, t, n, head, follower, keys, out):
    """Number the different triples (v[i], t[i], n[i]) int32 in the order of their first appearance.

    `head` (positions,) int32 is −1 everywhere, `follower` (m,) and `keys` (m, 3) int32 scratch and result: row k of
    `keys` is the k-th triple, `out` (m,) which of them each corner is. `t` and `n` may be empty. Returns their number.
    """
    used = np.int32(0)
    with_t, with_n = len(t) > 0, len(n) > 0
    for i in range(len(v)):
        a = v[i]
        b, c = t[i] if with_t else np.int32(-1), n[i] if with_n else np.int32(-1)
        k, length = head[a], 0
        while k >= 0 and length < _LONGEST_LIST and not (keys[k, 1] == b and keys[k, 2] == c):
            k = follower[k]
            length += 1
        if k < 0 or length == _LONGEST_LIST:
            k = used
            keys[k, 0], keys[k, 1], keys[k, 2] = a, b, c
            follower[k], head[a] = head[a], k
            used += 1
        out[i] = k
    return used


@kernel
def compact(faces, starts, number, last, ids, id_starts):
    """Give each part faces[starts[p] : starts[p + 1]] (T, 3) vertices of its own, numbered from 0 on in the order in
    which it uses them; `ids`[id_starts[p] : id_starts[p + 1]] are which these are.

    `last` (vertices,) int32 is −1 everywhere, `number` as long, `ids` (3 T,) int32."""
    at = 0
    for p in range(len(starts) - 1):
        first = at
        for f in range(starts[p], starts[p + 1]):
            for k in range(3):
                i = faces[f, k]
                if last[i] != p:
                    last[i], number[i] = p, at - first
                    ids[at] = i
                    at += 1
                faces[f, k] = number[i]
        id_starts[p + 1] = at


@kernel
def add_normals(vertices, v, group, sums):
    """Add to sums[group[i]] (n, 3) the normal of corner i's triangle (corners 3k … 3k + 2 of vertices v), weighted by
    its angle there (Thürmer and Wüthrich 1998), where group[i] >= 0."""
    for i in range(len(v)):
        if group[i] < 0:
            continue
        first = i - i % 3
        a, b, c = v[i], v[first + (i + 1) % 3], v[first + (i + 2) % 3]
        px, py, pz = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2]
        qx, qy, qz = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1], vertices[c, 2] - vertices[a, 2]
        nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        if not 0 < length < np.inf:
            continue
        weight = np.arctan2(length, px * qx + py * qy + pz * qz) / length
        g = group[i]
        sums[g, 0] += nx * weight
        sums[g, 1] += ny * weight
        sums[g, 2] += nz * weight
