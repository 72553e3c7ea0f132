"""Irradiance and its gradients from a stratified hemisphere (Ward and Heckbert 1992).

The hemisphere around a normal is cut into M rings and N sectors of equal projected area; cell (j, k) has one direction
with θ = asin √((j + u)/M) and φ = 2π(k + v)/N, the radiance L_jk from there and the distance r_jk of what sent it. With
the sectors' middle directions û_k in the tangent plane, v̂_k a quarter turn further, minus signs for the cells'
lower boundaries:

E     = π/(MN) Σ L_jk
∇_r E = π/(MN) Σ_k v̂_k Σ_j tan θ_j L_jk
∇_t E = Σ_k { û_k (2π/N) Σ_{j≥1} sin θ_j₋ cos² θ_j₋ (L_jk − L_{j−1,k})/min(r_jk, r_{j−1,k})
            + v̂_k₋ Σ_j (sin θ_j₊ − sin θ_j₋) (L_jk − L_{j,k−1})/min(r_jk, r_{j,k−1}) }

Turned from the normal n to m, irradiance is E + (n × m)·∇_r E; moved by d, it is E + d·∇_t E. A boundary between two
cells moves with the nearer of the surfaces seen in them, which is the one that hides the other. With 64 cells ∇_t E is
some fifth too small on average for a bright patch of a few cells; it gets exact as cells get small.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.vector import along, basis, scale

_f4 = np.float32
_f8 = np.float64
PI = math.pi
STEEPEST = _f4(0.999)
"""tan θ of a direction near the horizon is taken at this sine at most: one sample must not make the gradient."""


def strata(samples: int) -> tuple[int, int]:
    """Rings M and sectors N of about that many cells, N ≈ πM, so that cells are about as long as wide."""
    rings = max(2, round(math.sqrt(samples / math.pi)))
    return rings, max(4, round(samples / rings))


@device
def cell_direction(n, rings, sectors, j, k, u, v):
    """Unit direction in cell (j, k) around the normal n, at (u, v) in [0, 1)² of it."""
    sin2 = (_f4(j) + u) / _f4(rings)
    sin, cos = _f4(math.sqrt(sin2)), _f4(math.sqrt(max(_f4(1.0) - sin2, _f4(0.0))))
    phi = _f4(2.0 * PI) * (_f4(k) + v) / _f4(sectors)
    s, t = basis(n)
    return along(along(scale(s, sin * _f4(math.cos(phi))), t, sin * _f4(math.sin(phi))), n, cos)


@device
def irradiance_and_gradients(cells, rings, sectors, n, E, rotation, translation):
    """From `cells` (rings·sectors, 5) float32, cell (j, k) at j + rings·k with red, green, blue, distance (inf: none)
    and sin² θ, fill E (3,), rotation (3, 3) and translation (3, 3) [channel, axis]. Returns the harmonic mean of the
    distances."""
    s, t = basis(n)
    E[:] = _f8(0.0)
    rotation[:, :] = _f8(0.0)
    translation[:, :] = _f8(0.0)
    inverse = _f8(0.0)
    equal = _f8(PI) / _f8(rings * sectors)
    for k in range(sectors):
        middle = _f8(2.0 * PI) * (_f8(k) + _f8(0.5)) / _f8(sectors)
        lower = _f8(2.0 * PI) * _f8(k) / _f8(sectors)
        um = _in_plane(s, t, middle)
        vm = _in_plane(s, t, middle + _f8(PI / 2))
        vl = _in_plane(s, t, lower + _f8(PI / 2))
        before = rings * (k - 1 if k > 0 else sectors - 1)
        for j in range(rings):
            here = j + rings * k
            inverse += _f8(1.0) / _f8(cells[here, 3])
            sin = math.sqrt(_f8(j) / _f8(rings))
            above = math.sqrt(_f8(j + 1) / _f8(rings))
            sin2 = min(_f8(cells[here, 4]), _f8(STEEPEST) * _f8(STEEPEST))
            tan = math.sqrt(sin2 / (_f8(1.0) - sin2))
            r_side = min(cells[here, 3], cells[j + before, 3])
            side = (above - sin) / _f8(r_side)
            ring = _f8(0.0)
            if j > 0:
                r_ring = min(cells[here, 3], cells[here - 1, 3])
                ring = _f8(2.0 * PI) / _f8(sectors) * sin * (_f8(1.0) - sin * sin) / _f8(r_ring)
            for c in range(3):
                L = _f8(cells[here, c])
                E[c] += equal * L
                around = side * (L - _f8(cells[j + before, c]))
                outwards = _f8(0.0)
                if j > 0:
                    outwards = ring * (L - _f8(cells[here - 1, c]))
                for axis in range(3):
                    rotation[c, axis] += equal * tan * L * vm[axis]
                    translation[c, axis] += outwards * um[axis] + around * vl[axis]
    if not inverse > _f8(0.0):
        return _f8(np.inf)
    return _f8(rings * sectors) / inverse


@device
def _in_plane(s, t, phi):
    cos, sin = math.cos(phi), math.sin(phi)
    return _f8(s[0]) * cos + _f8(t[0]) * sin, _f8(s[1]) * cos + _f8(t[1]) * sin, _f8(s[2]) * cos + _f8(t[2]) * sin
