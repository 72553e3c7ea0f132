"""A tree over the virtual lights of a pass, from which a pixel chooses few of very many (R10).

As in lightcuts (Walter et al. 2005) a node stands for all lights below it: a sphere around their points, a cone around
their normals, and what they may bring together. Choosing goes down from a level of nodes, at each node to either child
with a probability by a bound on what it may bring to the point (`pmviewer.render.virtual_lights.descent`); unlike a cut
of clusters that are taken for one light each, this is unbiased.

The tree is complete: node i has the children 2i and 2i + 1, node 1 is the root, and the leaves are the last half of the
rows. Lights that fill the last level up bring nothing and are never chosen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.maps.virtual_lights import (
    N_AXIS,
    N_CENTRE,
    N_COS,
    N_INTENSITY,
    N_LIGHT,
    N_RADIUS,
    N_SIN,
    NODE_COLUMNS,
    OF_DENSITY,
    OF_PATHS,
    V_F,
    V_FIRST,
    V_LAMBERTIAN,
    V_N,
    V_P,
    V_PHI,
    V_Q,
    V_WI,
)
from pmviewer.photons.virtual.choice import mixed, normalised
from pmviewer.scene.description import LUMINANCE

Float = NDArray[np.float32]
TURN = 0.5
"""How far apart two lights count whose normals are opposite, relative to the radius of the scene: walls at a corner
become nodes of their own."""
_LEAST = 1e-6
"""Lights that bring next to nothing are still chosen sometimes, relative to the mean."""


def intensities(rows: Float, estimator: int) -> NDArray[np.float64]:
    """What each of the lights (n, COLUMNS) may bring, (n,), with sum 1: one half by what it scatters on, the other,
    where sums are weighted, by its weight."""
    scattered = np.where(rows[:, V_LAMBERTIAN, None] != 0, rows[:, V_F : V_F + 3], np.float32(1 / np.pi))
    brings = (scattered * rows[:, V_PHI : V_PHI + 3]).astype(np.float64) @ LUMINANCE
    found = normalised(brings)
    if estimator in OF_DENSITY or estimator in OF_PATHS:
        q = rows[:, V_Q].astype(np.float64)
        if estimator in OF_PATHS:
            q = np.where(rows[:, V_FIRST] != 0, q, q * (scattered.astype(np.float64) @ LUMINANCE))
        found = mixed(found, q)
    return np.maximum(found, _LEAST / max(len(rows), 1))


def light_tree(rows: Float, estimator: int, scene_radius: float) -> Float:
    """The nodes (2·2^d, NODE_COLUMNS) of a tree over the lights (n, COLUMNS), n ≥ 1. Row 0 is no node.

    From level to level each node's lights are sorted along the longest side of their box, points and turned normals
    alike, and halved.
    """
    n = len(rows)
    depth = max(int(np.ceil(np.log2(n))), 0)
    leaves = 1 << depth
    order = np.concatenate([np.arange(n), np.arange(leaves - n) % n])
    intensity = np.concatenate([intensities(rows, estimator), np.zeros(leaves - n)])
    p, wi = rows[order, V_P : V_P + 3].astype(np.float64), rows[order, V_WI : V_WI + 3]
    normal = rows[order, V_N : V_N + 3].astype(np.float64)
    normal *= np.where((normal * wi).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    places = np.concatenate([p, 0.5 * TURN * scene_radius * normal], axis=1)
    nodes = np.zeros((2 * leaves, NODE_COLUMNS), np.float32)
    at: NDArray[np.int64] = np.arange(leaves)
    for level in range(depth + 1):
        at = at.reshape(1 << level, leaves >> level)
        first, last = 1 << level, 2 << level
        nodes[first:last] = _nodes(p[at], normal[at], intensity[at])
        if level < depth:
            box = places[at]
            axis = (box.max(axis=1) - box.min(axis=1)).argmax(axis=1)
            keys = np.take_along_axis(box, axis[:, None, None], axis=2)[..., 0]
            at = np.take_along_axis(at, np.argsort(keys, axis=1, kind="stable"), axis=1)
    nodes[leaves:, N_LIGHT] = order[at[:, 0]]
    return nodes


def _nodes(p: NDArray[np.float64], normal: NDArray[np.float64], intensity: NDArray[np.float64]) -> Float:
    """Of lights (m nodes, k lights, …) the nodes (m, NODE_COLUMNS)."""
    made = np.zeros((len(p), NODE_COLUMNS), np.float32)
    centre = 0.5 * (p.max(axis=1) + p.min(axis=1)).astype(np.float32).astype(np.float64)
    radius = np.sqrt(((p - centre[:, None]) ** 2).sum(axis=2).max(axis=1))
    axis = normal.sum(axis=1)
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    axis = np.divide(axis, length, out=normal[:, 0].copy(), where=length > 1e-6)
    cos = (normal * axis[:, None]).sum(axis=2).min(axis=1)
    many = p.shape[1] > 1  # rounding may make neither a sphere nor a cone too small
    cos = np.clip(cos - (1e-5 if many else 0.0), -1.0, 1.0) if many else np.ones(len(p))
    made[:, N_CENTRE : N_CENTRE + 3], made[:, N_AXIS : N_AXIS + 3] = centre, axis
    made[:, N_RADIUS] = radius * (1 + 1e-5) if many else 0.0
    made[:, N_COS], made[:, N_SIN] = cos, np.sqrt(1 - cos * cos)
    made[:, N_INTENSITY] = intensity.sum(axis=1)
    return made
