"""Virtual lights: what kernels know of them, and the estimators that they are summed by (R10).

A virtual light is a photon at y that lights a point x as its surface scatters it on. With

    S = f_x·cosθ_x·cosθ_y·V/|x − y|²,   F = S·f_y·Φ,   G = Y(f_x)·cosθ_x·cosθ_y·V/|x − y|²·q

(Y: luminance) the plain estimate of the light that x reflects is L = ΣF. A weighted one is L = C·ΣF/ΣG with C = E[ΣG]:
what q means is the density of gathering over that of shooting, so that ΣG is an estimate of the probability that a
gathering walk from x makes such a path, times the albedo of x. C is measured by such walks
(`pmviewer.render.virtual_lights.walk`), whatever their length.

==================  ===================================================================================  ==============
estimator           q                                                                                    C
==================  ===================================================================================  ==============
single step         1/D, D being the density of virtual lights at y                                      c₁·a_x
full path           (1 − s₁)·(spread/cosθ₁)/N at the first hit, times the chain and Y(f_y) beyond        c₂·a_x
every vertex        the same without 1 − s₁                                                              c'·a_x
modified            full path, times 1/s where a light sample at z₂ … y was blocked                      c₂'·a_x
printed forms       see `docs/virtual.md`                                                                a_x; 1
==================  ===================================================================================  ==============

The chain is the product of gather over shoot densities of the scatterings between (`pmviewer.photons.virtual.trace`).
Lights whose path no gathering walk makes, as those behind a mirror, have q = 0 and are summed unweighted besides.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pmviewer.maps.variant import ABSENT, with_mark

ESTIMATORS: Sequence[str] = (
    "unweighted",
    "clamped",
    "single step",
    "full path",
    "every vertex",
    "modified",
    "printed single step",
    "printed full path",
)
"""Names; an estimator's id is its place here."""
UNWEIGHTED, CLAMPED, SINGLE, FULL, EVERY, MODIFIED, PRINTED_SINGLE, PRINTED_FULL = range(len(ESTIMATORS))
OF_DENSITY = (SINGLE, PRINTED_SINGLE)
"""Those that the density of the lights weighs."""
OF_PATHS = (FULL, EVERY, MODIFIED, PRINTED_FULL)
"""Those that whole light paths weigh."""
PRINTED = (PRINTED_SINGLE, PRINTED_FULL)

_columns = np.arange(32, dtype=np.int64)
COLUMNS = 30
V_P, V_N, V_NS, V_WI, V_PHI, V_F = _columns[[0, 3, 6, 9, 12, 15]]
V_GAP, V_Q, V_FIRST, V_BLOCKED, V_LAMBERTIAN, V_U, V_V, V_PRIM, V_OPACITY, V_BEAMS = _columns[18:28]
"""Columns of a virtual light, float32: point, geometric and shading normal as the surface has them, direction that the
photon came from, power in watts, BRDF where it is Lambertian; how far rays start off the surface, what q is made of
without Y(f_y), whether y is the path's first hit, whether its light sample was blocked, whether it is Lambertian, its
place on the primitive, the primitive's number as the bits of an int32 (or OF_MEDIUM), the surface's opacity, and how
many photons it stands for where it scatters them as beams (0: itself alone)."""

BEAM = 6
"""Floats of such a photon: the direction that it came from, and its share of the light's power in watts."""

OF_MEDIUM = np.uint32(0xFFFFFFFF)
"""In place of the primitive's number: the light has no surface, it is a collision in the medium whose number stands in
V_U. Normals are the direction that the photon came from, the power is what is scattered, and q is 0."""

FLATNESS = np.float32(0.2)
"""Half-thickness of the disc of photons that tells their density, relative to its radius."""

VIRTUAL_DTYPE = np.dtype(
    [
        ("virtual", "i4"),  # tells the record from NO_VIRTUAL
        ("lights", "i8"),  # float32 (n, COLUMNS)
        ("n", "i8"),
        ("beams", "i8"),  # float32 (n, each, BEAM)
        ("each", "i8"),
        ("per_pixel", "i8"),  # lights that a pixel asks for
        ("estimator", "i4"),
        ("normalised", "i4"),  # whether walks are made
        ("walks", "i4"),
        ("gather_rays", "i4"),  # those of glossy surfaces that bring light
        ("k", "i4"),  # photons of the disc where a gather ray ends, 0 where there is no map of them
        ("reach", "f4"),  # its largest radius
        ("clamp", "f4"),  # largest cosθ_x·cosθ_y/|x − y|²
        ("max_bounces", "i4"),
        ("objects", "i8"),  # int32: the object of each stored primitive
        ("n_objects", "i8"),
    ],
    align=True,
)
PATHS_DTYPE = with_mark(VIRTUAL_DTYPE, "paths")
"""Of estimators that whole light paths weigh: their walks alone compile emission."""
TREE_FIELDS: list[tuple[str, Any]] = [("tree", "i8"), ("leaves", "i8")]
"""Of records of virtual lights with the mark `descent`, 1 where pixels choose by the tree, 0 where they ask for all
lights: the address of the nodes and how many leaves there are."""
NODE_COLUMNS = 11
N_CENTRE, N_AXIS = _columns[[0, 3]]
N_RADIUS, N_COS, N_SIN, N_INTENSITY, N_LIGHT = _columns[6:11]
"""Columns of a node of the tree over virtual lights, float32: the sphere around its lights, the axis of the cone around
their normals, the sphere's radius, the cone's cosine and sine, what its lights may bring together, of a leaf the number
of its light."""
NO_VIRTUAL = ABSENT
"""Stands for virtual lights where there are none."""

SUMS = 17
W_INDIRECT, W_SPECULAR, W_SUM, W_SQUARES, W_LIGHTS, W_LOST, W_OBJECT = 0, 6, 12, 13, 14, 15, 16
W_F, W_G, W_A, W_C = 0, 3, 4, 5
"""Sums that a film keeps for each pixel beyond its planes. From W_INDIRECT and W_SPECULAR on, by the term: ΣF (3), ΣG,
Σa_x, ΣC, all of them times the path's throughput. Then ΣY(F), ΣY(F)² and the number of lights asked, the luminance that
clamping took, and the object seen last."""
