"""Shadow photons (T8; Jensen & Christensen 1995, Jensen 1996 §3): which places a light reaches and which it does not.

A photon leaves the light and flies straight through the whole scene. Where it first meets a surface it is lit; every
later surface on its way that faces the light lies in shadow there. Mirrors and glass cast shadows as everything else
does: what passes them is not direct light. Surfaces whose direct light nobody samples (smooth mirrors and glass) keep
no photons.

The photons tell nothing but visibility. Each pass has its own: what a set misses between its photons is another thing
in the next, so that the mean over passes keeps the bias of a pass and loses the chance in it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.bsdf.scattering import NOTHING, bsdf_at, keeps
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.dimensions import EMISSION, SHADOW_EMITTER
from pmviewer.kernels.lights.light import emit_photon
from pmviewer.kernels.memory import row_of
from pmviewer.kernels.random import SOBOL, draw1, draw4
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.surface import face, leave, surface_at
from pmviewer.maps.photon_words import write_photon
from pmviewer.maps.shadow import SHADOW_FLAGS
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.tasks import Runner

MOST_HITS = 16
"""Surfaces after which a photon is dropped: what lies behind so many is traced."""
BATCH = 4096

_f4 = np.float32
_u4 = np.uint32
_INF = _f4(np.inf)


@dataclass(frozen=True)
class ShadowPhotons:
    """`photons` (n, 6) float32 as in `pmviewer.maps.record`: of class DIRECT where the light arrives, with
    SHADOW_FLAGS where it does not. `rays`: cast to find them."""

    photons: NDArray[np.float32]
    rays: int

    @property
    def bytes(self) -> int:
        """Of the photons, without their grid."""
        return self.photons.nbytes


@kernel
def trace_shadows(scenes, seed, glossy, i0, i1, out, counts):
    """Follow photons i0 … i1−1 from the lights through the scene.

    scenes: SCENE_DTYPE (1,); glossy: roughness from which lobes are looked up; out: float32 (MOST_HITS·(i1 − i0), 6);
    counts: int64 (2,), photons stored and rays cast, added to.
    """
    scene = scenes[0]
    for i in range(i0, i1):
        u0, u1, u2, u3 = draw4(SOBOL, seed, _u4(i), EMISSION)
        p, d, beta, light = emit_photon(scene, draw1(SOBOL, seed, _u4(i), SHADOW_EMITTER), (u2, u3), (u0, u1))
        wi = (-d[0], -d[1], -d[2])
        flags = _u4(0)
        for _ in range(MOST_HITS):
            t, prim, u, v = closest_hit(scene, p[0], p[1], p[2], d[0], d[1], d[2], _f4(0.0), _INF)
            counts[1] += 1
            if prim < 0:
                break
            q, ng, ns, gap = surface_at(scene, prim, u, v, p[0], p[1], p[2], d[0], d[1], d[2], t)
            material = material_of(scene, prim)
            bsdf = bsdf_at(scene, prim, material, u, v, q, ng, ns, wi, glossy, None)
            if keeps(scene, material, bsdf, ng, wi, glossy) != NOTHING:
                write_photon(row_of(out, 0), counts[0], q, wi, face(ng, wi), beta, flags, light)
                counts[0] += 1
            flags = _u4(SHADOW_FLAGS)
            p = leave(q, face(ng, wi), gap, d[0], d[1], d[2])


def shadow_pass(scene: FlatScene, seed: int, first: int, N: int, glossy: float, run: Runner) -> ShadowPhotons:
    """Shadow photons of the N photons from the lights that begin with number `first`, the same for any number of
    threads."""

    def batch(i0: int) -> Callable[[], Any]:
        def task() -> tuple[NDArray[np.float32], int]:
            i1 = min(i0 + BATCH, first + N)
            out, counts = np.empty((MOST_HITS * (i1 - i0), 6), np.float32), np.zeros(2, np.int64)
            trace_shadows(scene.record, np.uint32(seed & 0xFFFFFFFF), np.float32(glossy), i0, i1, out, counts)
            return out[: counts[0]].copy(), int(counts[1])

        return task

    results = run([batch(i0) for i0 in range(first, first + N, BATCH)])
    return ShadowPhotons(np.concatenate([photons for photons, _ in results]), sum(rays for _, rays in results))
