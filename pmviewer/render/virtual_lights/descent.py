"""Which of very many virtual lights a pixel asks: ways down the tree over them (R10, `pmviewer.photons.virtual.tree`).

At each node one child is chosen, by

    intensity · cos⁺(θ_y − θ_o − θ_u) · max(cos⁺(θ_x − θ_u), LEAST) / max(d², r²)

d from the point to the centre of the node's sphere of radius r, θ_u the angle that the sphere covers, θ_o that of its
cone: a bound on both cosines, so that no light that may bring something has the probability 0. All ways of a point
begin at the same CUT nodes, which are asked once. Below a node that is small from where the point is, and whose lights
look one way, children are chosen by their intensity alone: what they bring differs by little else. (Each way by all its
nodes took six times as long as the shadow rays of a small room.) What the i-th of m ways goes by is (i + u)/m, one
number for all levels: neighbours among the ways end at different lights.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.memory import load_f4, stack_get_f4, stack_put_f4
from pmviewer.kernels.scene import load3
from pmviewer.kernels.vector import dot, sub
from pmviewer.maps.virtual_lights import (
    N_AXIS,
    N_CENTRE,
    N_COS,
    N_INTENSITY,
    N_LIGHT,
    N_RADIUS,
    N_SIN,
    NODE_COLUMNS,
)

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
LEAST = _f4(0.02)
"""Of the cosine at the point: shading normals turn it."""
_NEVER = _f4(1e-12)
CUT = 64
"""Nodes that all ways of a point begin at, a power of two; those of one level."""
CUT_WORDS = 2 * CUT
MOST = 1.0 - 1e-12
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
def bound(virtual, node, p, n):
    """What the lights of a node may bring to the point p with the normal n, up to a factor, and whether they are
    alike."""
    row = node * NODE_COLUMNS
    intensity = load_f4(virtual.tree, row + N_INTENSITY)
    if not intensity > _f4(0.0):
        return _f4(0.0), False
    to = sub(load3(virtual.tree, row + N_CENTRE), p)
    d2, r = dot(to, to), load_f4(virtual.tree, row + N_RADIUS)
    if not d2 > r * r:
        return intensity / max(r * r, _NEVER), False
    over_d = _f4(1.0) / _f4(math.sqrt(d2))
    sin_u = r * over_d
    cos_u = _f4(math.sqrt(max(_f4(1.0) - sin_u * sin_u, _f4(0.0))))
    cone = load_f4(virtual.tree, row + N_COS)
    cos_y = max(min(-dot(to, load3(virtual.tree, row + N_AXIS)) * over_d, _f4(1.0)), _f4(-1.0))
    cos_y = less(less(cos_y, cone, load_f4(virtual.tree, row + N_SIN)), cos_u, sin_u)
    if not cos_y > _f4(0.0):
        return _f4(0.0), False
    cos_x = less(max(min(dot(to, n) * over_d, _f4(1.0)), _f4(-1.0)), cos_u, sin_u)
    return intensity * cos_y * max(cos_x, LEAST) / d2, sin_u < SMALL and cone > ALIKE


@device
def intensity_of(virtual, node):
    """What the lights of a node may bring anywhere."""
    return load_f4(virtual.tree, node * NODE_COLUMNS + N_INTENSITY)


@device
def ask_cut(virtual, p, n, cut):
    """The bounds of the nodes of the cut for the point p with the normal n, summed up one after the other, and whether
    the lights of each are alike, into `cut`, a pointer to CUT_WORDS words."""
    nodes, total = min(_i8(CUT), virtual.leaves), _f4(0.0)
    for k in range(nodes):
        one, alike = bound(virtual, nodes + k, p, n)
        total += one
        stack_put_f4(cut, _i8(k), total)
        stack_put_f4(cut, _i8(CUT + k), _f4(1.0) if alike else _f4(0.0))


@device
def descend(virtual, p, n, cut, u):
    """The light at the end of the way by u in [0, 1) (float64), and its probability; −1 and 0 where none may bring
    anything. `cut`: of `ask_cut`."""
    nodes = min(_i8(CUT), virtual.leaves)
    total = _f8(stack_get_f4(cut, nodes - 1))
    if not total > 0.0:
        return _i8(-1), _f8(0.0)
    at, low, high = u * total, _i8(0), nodes - 1
    while low < high:  # the first whose sum is above it
        middle = (low + high) // 2
        if _f8(stack_get_f4(cut, middle)) > at:
            high = middle
        else:
            low = middle + 1
    before = _f8(0.0)
    if low > 0:
        before = _f8(stack_get_f4(cut, low - 1))
    share = _f8(stack_get_f4(cut, low)) - before
    if not share > 0.0:
        return _i8(-1), _f8(0.0)
    return below(
        virtual,
        nodes + low,
        stack_get_f4(cut, CUT + low) > _f4(0.0),
        p,
        n,
        min((at - before) / share, MOST),
        share / total,
    )


@device
def below(virtual, node, alike, p, n, u, probability):
    """`descend` from a node on, whose probability is given and whose lights are alike or not."""
    while node < virtual.leaves:
        node *= 2
        alike_left, alike_right = alike, alike
        if alike:
            left, right = intensity_of(virtual, node), intensity_of(virtual, node + 1)
        else:
            left, alike_left = bound(virtual, node, p, n)
            right, alike_right = bound(virtual, node + 1, p, n)
        total = _f8(left) + _f8(right)
        if not total > 0.0:
            return _i8(-1), _f8(0.0)
        share = _f8(left) / total
        if u < share:
            u /= share
            probability *= share
            alike = alike_left
        else:
            u = min((u - share) / (1.0 - share), MOST)
            probability *= 1.0 - share
            alike = alike_right
            node += 1
    return _i8(load_f4(virtual.tree, node * NODE_COLUMNS + N_LIGHT)), probability
