"""Which of very many virtual lights a pixel asks: a way down the tree over them (R10, `pmviewer.photons.virtual.tree`).

At each node one child is chosen, by

    worth · cos⁺(θ_y − θ_o − θ_u) · max(cos⁺(θ_x − θ_u), LEAST) / max(d², r²)

d from the point to the centre of the node's sphere of radius r, θ_u the angle that the sphere covers, θ_o that of its
cone: a bound on both cosines, so that no light that may bring something has the probability 0. Below a node that is
small from where the point is, and whose lights look one way, children are chosen by their worth alone: what they bring
differs by little else, and asking costs more than a shadow ray. What the i-th of m ways
goes by is (i + u)/m, one number for all levels: neighbours among the ways end at different lights.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.scene import load3
from pmviewer.kernels.vector import dot, sub
from pmviewer.maps.virtual_lights import (
    N_AXIS,
    N_CENTRE,
    N_COS,
    N_LIGHT,
    N_RADIUS,
    N_SIN,
    N_WORTH,
    NODE_COLUMNS,
)

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
LEAST = _f4(0.02)
"""Of the cosine at the point: shading normals turn it."""
_NEVER = _f4(1e-12)
SMALL, ALIKE = _f4(0.25), _f4(0.9)
"""Largest sine of the angle that a node's sphere covers and least cosine of its cone for its lights to be alike."""


@device
def less(cos, cos_a, sin_a):
    """cos(max(θ − a, 0)) by cos θ; a in [0, π]."""
    if cos >= cos_a:
        return _f4(1.0)
    sin = _f4(math.sqrt(max(_f4(1.0) - cos * cos, _f4(0.0))))
    return cos * cos_a + sin * sin_a


@device
def promise(virtual, node, p, n):
    """What the lights of a node may bring to the point p with the normal n, up to a factor, and whether they are
    alike."""
    row = node * NODE_COLUMNS
    worth = load_f4(virtual.tree, row + N_WORTH)
    if not worth > _f4(0.0):
        return _f4(0.0), False
    to = sub(load3(virtual.tree, row + N_CENTRE), p)
    d2, r = dot(to, to), load_f4(virtual.tree, row + N_RADIUS)
    if not d2 > r * r:
        return worth / max(r * r, _NEVER), False
    over_d = _f4(1.0) / _f4(math.sqrt(d2))
    sin_u = r * over_d
    cos_u = _f4(math.sqrt(max(_f4(1.0) - sin_u * sin_u, _f4(0.0))))
    cone = load_f4(virtual.tree, row + N_COS)
    cos_y = max(min(-dot(to, load3(virtual.tree, row + N_AXIS)) * over_d, _f4(1.0)), _f4(-1.0))
    cos_y = less(less(cos_y, cone, load_f4(virtual.tree, row + N_SIN)), cos_u, sin_u)
    if not cos_y > _f4(0.0):
        return _f4(0.0), False
    cos_x = less(max(min(dot(to, n) * over_d, _f4(1.0)), _f4(-1.0)), cos_u, sin_u)
    return worth * cos_y * max(cos_x, LEAST) / d2, sin_u < SMALL and cone > ALIKE


@device
def by_worth(virtual, node):
    """What the lights of a node may bring anywhere."""
    return load_f4(virtual.tree, node * NODE_COLUMNS + N_WORTH)


@device
def descend(virtual, p, n, u):
    """The light at the end of the way by u in [0, 1) (float64), and its probability; −1 and 0 where none may bring
    anything."""
    node, probability, alike = _i8(1), _f8(1.0), False
    while node < virtual.leaves:
        node *= 2
        likes = (alike, alike)
        if alike:
            left, right = by_worth(virtual, node), by_worth(virtual, node + 1)
        else:
            left, alike_left = promise(virtual, node, p, n)
            right, alike_right = promise(virtual, node + 1, p, n)
            likes = (alike_left, alike_right)
        total = _f8(left) + _f8(right)
        if not total > 0.0:
            return _i8(-1), _f8(0.0)
        share = _f8(left) / total
        if u < share:
            u /= share
            probability *= share
            alike = likes[0]
        else:
            u = min((u - share) / (1.0 - share), 1.0 - 1e-12)
            probability *= 1.0 - share
            alike = likes[1]
            node += 1
    return _i8(load_f4(virtual.tree, node * NODE_COLUMNS + N_LIGHT)), probability
