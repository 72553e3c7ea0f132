"""When a caustic map under density control is good enough (Suykens and Willems 2000, §3.2; course guide, appendix).

At a place with D_c photons per unit area where D_r are required the map has converged if

    (D_c / D_r) · (L_g / L_c)^m ≥ 1,

L_c being the radiance by the caustic map, L_g that by all light, caustics included: where other light outshines a
caustic, a coarser caustic does. The exponent m is 2 or 3. Three states come of it:

- DENSE, the figure's blue: D_c ≥ D_r, further photons are not stored, here memory is saved;
- CONVERGED, green: thinner than required, and good enough all the same;
- MORE, red: photons are missing.

Radiances are compared as luminances of irradiance: the albedo of a diffuse surface cancels. L_c and D_c are those of
the M nearest caustic photons. Other light is estimated from a sample of the photons that arrived, of all other path
classes, for the maps need not have them (direct light is sampled, gather rays find the rest). D_r is the density at
which density control stops storing by the step.

"All is converged" is said by light: when no more than UNFINISHED of the map's power lies at places that need MORE. A
stray photon far from all others would otherwise keep the map from ever being finished.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.vector import luminance
from pmviewer.maps.density.control import FLATNESS, needs_of
from pmviewer.maps.density.growing_tree import M
from pmviewer.maps.estimate.estimate import RIM_LEFT_OUT, irradiance_knn
from pmviewer.maps.estimate.filters import CONSTANT, Filter
from pmviewer.maps.estimate.nearest import Neighbours
from pmviewer.maps.record import decode_directions, in_classes
from pmviewer.maps.search.disc import Place
from pmviewer.maps.search.kdtree import PhotonKdTree, build_kdtree
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.tasks import Runner

MORE, CONVERGED, DENSE = 0, 1, 2
NO_CAUSTIC = -1
"""State of places without a caustic photon near."""
OTHERS = 50
"""Photons that an estimate of the other light takes."""
MOST_OTHERS = 1 << 18
"""Photons of other light that are kept."""
PLACES = 4096
"""Stored photons at which a map is judged, evenly chosen."""
FEWEST = 200
"""A map of fewer photons is never called converged."""
UNFINISHED = 0.01
WIDEST = 0.25
"""Largest disc of the estimate of other light, relative to the scene's radius."""
SPARSEST = 10.0
"""Largest disc of the estimate of caustics, relative in area to that of M photons at the required density."""
CHUNK = 1024

Float = NDArray[np.float32]

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_PI = _f8(np.pi)


@dataclass(frozen=True)
class Criterion:
    """`exponent` m; `scene_radius` in scene units; `classes`: bit set of the path classes that are caustics."""

    exponent: int
    scene_radius: float
    classes: int


@dataclass(frozen=True)
class Converged:
    """Shares of the map's power at places of each state, all 0 for a map without photons, the number of these, and
    trajectories that the pass was `spared` for it."""

    dense: float = 0.0
    converged: float = 0.0
    more: float = 0.0
    photons: int = 0
    spared: int = 0

    @property
    def done(self) -> bool:
        """Whether no more caustic photons are needed: enough have arrived to tell, and hardly any power lies where more
        are."""
        return self.photons >= FEWEST and self.more <= UNFINISHED


@kernel
def _classify(caustics, others, points, normals, needs, own, m, widest, i0, i1, states):
    """States of points i0 … i1−1, (n, 3) with unit normals (n, 3) and needed densities (n,), into int8 (n,). own: 1
    where a photon of the map lies at each point, which says nothing about the density around it, else 0."""
    caustic, other = caustics[0], others[0]
    k, rim, whole = _i4(M) + _i4(own), _i4(RIM_LEFT_OUT), _f4(1.0)
    even = Filter(_i4(CONSTANT), _f4(1.0))
    for i in range(i0, i1):
        p, n = (points[i, 0], points[i, 1], points[i, 2]), (normals[i, 0], normals[i, 1], normals[i, 2])
        place = Place(p, n, FLATNESS, _i4(ALL_CLASSES))
        reach = _f4(math.sqrt(_f8(SPARSEST * M) / (_PI * _f8(needs[i]))))
        r, g, b, count, radius = irradiance_knn(caustic, place, Neighbours(k, reach, rim, whole), even)
        if count == 0:
            states[i] = NO_CAUSTIC
            continue
        density = _f8(count - own if count == k else count) / (_PI * _f8(radius) * _f8(radius))
        rho = density / _f8(needs[i])
        states[i] = DENSE if rho >= 1.0 else MORE
        if rho >= 1.0:
            continue
        of_caustic = _f8(luminance((r, g, b)))
        r, g, b, _, _ = irradiance_knn(other, place, Neighbours(_i4(OTHERS), widest, rim, whole), even)
        of_all = of_caustic + _f8(luminance((r, g, b)))
        if rho * of_all**m >= of_caustic**m:  # also where the caustic photons have no power
            states[i] = CONVERGED


class Convergence:
    """The criterion at any place, for a caustic map: its photons (n, 6) with their unit of power in watts, and those
    of the other light, as `other_light` makes them."""

    def __init__(self, criterion: Criterion, photons: Float, unit: float, others: PhotonKdTree) -> None:
        self.criterion, self.others = criterion, others
        self.tree = build_kdtree(photons, unit)

    def states(self, points: Float, normals: Float, required: Float, own: bool, run: Runner) -> NDArray[np.int8]:
        """NO_CAUSTIC, MORE, CONVERGED or DENSE at points (n, 3) with unit normals (n, 3) and densities required (n,) in
        photons per unit area; own: whether each is the place of a photon of the map."""
        criterion, n = self.criterion, len(points)
        points, normals = np.ascontiguousarray(points, np.float32), np.ascontiguousarray(normals, np.float32)
        needs = needs_of(required)
        states, widest = np.empty(n, np.int8), np.float32(WIDEST * criterion.scene_radius)
        trees = self.tree.record, self.others.record

        def task(i0: int) -> Callable[[], None]:
            i1 = min(i0 + CHUNK, n)
            return lambda: _classify(
                *trees, points, normals, needs, int(own), criterion.exponent, widest, i0, i1, states
            )

        run([task(i0) for i0 in range(0, n, CHUNK)])
        return states

    def of_map(
        self, photons: Float, normals: NDArray[np.uint32], weights: NDArray[np.float64], required: Float, run: Runner
    ) -> Converged:
        """How much of the map has converged: its photons (n, 6) with normal codes (n,), luminances (n,) in any unit and
        required densities (n,)."""
        some = np.linspace(0, len(photons) - 1, min(PLACES, len(photons))).astype(np.int64)
        weights = weights[some]
        total = float(weights.sum())
        if not total > 0:
            return Converged(photons=len(photons))
        states = self.states(photons[some, :3], decode_directions(normals[some]), required[some], True, run)
        shares = [float(weights[states == state].sum() / total) for state in (DENSE, CONVERGED, MORE)]
        return Converged(shares[0], shares[1], shares[2], len(photons))


def other_light(criterion: Criterion, sample: Float, unit: float) -> PhotonKdTree:
    """Photons that are no caustics, of those that arrived: sample (n, 6), a map by itself in units of `unit` watts."""
    wanted = in_classes(sample, ALL_CLASSES & ~criterion.classes)
    others = sample if wanted is None else sample[wanted]
    kept = others[:MOST_OTHERS]
    return build_kdtree(np.ascontiguousarray(kept), unit * (len(others) / max(len(kept), 1)))
