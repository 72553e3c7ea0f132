"""Whole photon paths, for showing them: the light pass itself writes down where its first photons went (V2).

`trace_photons` calls `begin_path` and `extend_path`. They compile to nothing when it is given None for the paths, so
that the light pass pays nothing, and what is shown are the photons of the pass and not those of a second tracer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, specialised
from pmviewer.kernels.memory import row_of
from pmviewer.photons.light_pass.banded import write_of_wave

MOST_VERTICES = 64
"""Longer paths are cut: roulette ends nearly all of them long before."""
ESCAPE = 0.25
"""A photon that leaves the scene is drawn this far, relative to the scene's radius."""

_f4 = np.float32
_u4 = np.uint32


@dataclass(frozen=True, eq=False)
class PhotonPaths:
    """`vertices` (n, MOST_VERTICES, 6) float32: photon records (`pmviewer.maps.record`) of where a photon left its
    light and of each surface that it met, with its power on the way there; `counts` (n,) int32 of them are used.

    A photon that left the scene ends with a point a little way out. `power_unit` is that of the global map.
    """

    vertices: NDArray[np.float32]
    counts: NDArray[np.int32]
    reach: np.float32
    power_unit: float = 1.0

    @property
    def n(self) -> int:
        """Paths, one a trajectory."""
        return len(self.counts)

    @property
    def arguments(self) -> tuple[NDArray[np.float32], NDArray[np.int32], np.float32]:
        """For the kernel."""
        return self.vertices, self.counts, self.reach


def empty_paths(n: int, scene_radius: float) -> PhotonPaths:
    """Room for the paths of the first n photons of a pass."""
    vertices = np.zeros((n, MOST_VERTICES, 6), np.float32)
    return PhotonPaths(vertices, np.zeros(n, np.int32), np.float32(ESCAPE * scene_radius))


@device
def _put(paths, i, p, wi, beta, flags, light, wave):
    vertices, counts, _ = paths
    row = counts[i]
    if row >= MOST_VERTICES:
        return
    write_of_wave(row_of(vertices[i], 0), row, p, wi, None, beta, flags, light, wave)
    counts[i] = row + 1


@specialised
def begin_path(paths, i, p, d, beta, light):
    """Photon i of the pass leaves its light at p in direction d. `paths`: None, or `PhotonPaths.arguments`."""
    if absent(paths):

        def nothing(paths, i, p, d, beta, light):
            pass

        return nothing

    def begin(paths, i, p, d, beta, light):
        if i < len(paths[1]):
            paths[1][i] = 0
            _put(paths, i, p, d, beta, _u4(0), light, None)

    return begin


@specialised
def extend_path(paths, i, prim, p, d, beta, flags, light, wave):
    """With that wave it flew in direction d to the surface point p, or, where prim < 0, from p out of the scene."""
    if absent(paths):

        def nothing(paths, i, prim, p, d, beta, flags, light, wave):
            pass

        return nothing

    def extend(paths, i, prim, p, d, beta, flags, light, wave):
        if i < len(paths[1]):
            if prim < 0:
                reach = paths[2]
                p = (p[0] + reach * d[0], p[1] + reach * d[1], p[2] + reach * d[2])
            _put(paths, i, p, (-d[0], -d[1], -d[2]), beta, flags, light, wave)

    return extend
