"""How much any table of emission could save in a view by itself, without splitting (I6).

For photons of a pass's size that start independently of each other, the error of the picture, Σ w_p·Var(pixel p), is
Σ q_s²·V_s/p_s /N: q_s is the share of stratum s in the power, p_s that in the trajectories, V_s the mean of Σ w_p·f_p²
over its trajectories, f_p being what one brings to pixel p with power 1. (The squared mean that would be taken away is
10⁻⁴ of it.) By power, p = q, that is Σ q_s·V_s. The least is that of p_s ∝ q_s·√V_s:

the best table of strata, perfectly known, has (Σ q_s·√V_s)². V_s from some trajectories is noisy, and by Jensen's
inequality its root too small: the saving seems larger than it is. The figure is a bound from above for these strata,
the closer the more trajectories. A bound from below is what the table by one half of the trajectories saves as the
other half judges it, with a share DEFENSIVE by power as guided emission has it: the best table is not worse. Finer
strata could do more, if the test photons of a pass sufficed to know them.

All is measured with photons of the light pass at points seen through the middles of pixels: V of a photon is the sum
over the pixels with it in their look-up disc. A trajectory's photons in one disc are counted apart (few are), and the
noise of camera rays, which no photon mends, is left out: both make the bound larger than the truth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pmviewer.engine.renderer import Renderer
from pmviewer.maps.record import decode_directions, in_classes, unpack
from pmviewer.photons.emission.guided import DEFENSIVE
from pmviewer.photons.emission.strata import Strata, strata_of
from pmviewer.photons.emission.tested import Batch, trace_tests
from pmviewer.photons.light_pass.batch import BATCH
from pmviewer.photons.light_pass.light_pass import testing
from pmviewer.render.diagnostics.diagnostics import seen_places
from pmviewer.render.record import eye_record

Float = NDArray[np.float64]

SEED = 0xB0D1


@dataclass(frozen=True)
class Bound:
    """Photons by power over those of the best table of `n` strata for the same error: at least and at most."""

    n: int
    least: float
    most: float


@dataclass(frozen=True)
class Seen:
    """Pixels' places: `tree` of points, `normals` (n, 3), and what a squared photon power counts there (n, 3)."""

    tree: cKDTree
    normals: NDArray[np.float32]
    weights: Float
    radius: float

    def value(self, photons: NDArray[np.float32]) -> Float:
        """V of photons (m, 6), (m,), power 1 being a trajectory's at its start."""
        said = unpack(photons, 1.0)
        out = np.zeros(len(photons))
        found = self.tree.query_ball_point(said["position"], self.radius, return_sorted=False)
        counts = np.array([len(f) for f in found])
        if counts.sum() == 0:
            return out
        which, pixel = np.repeat(np.arange(len(photons)), counts), np.concatenate([f for f in found if f]).astype(int)
        front = (said["wi"][which] * self.normals[pixel]).sum(axis=1) > 0
        each = (said["Phi"][which].astype(np.float64) ** 2 * self.weights[pixel]).sum(axis=1) * front
        return np.asarray(np.bincount(which, each, len(photons)), np.float64)


def seen_of(renderer: Renderer, weight: Float) -> Seen:
    """weight: (h, w, 3) of pixels' squared errors; the renderer has rendered, at one look-up radius."""
    camera, scene = renderer.camera, renderer.scene.flat
    pixels, radius = camera.width * camera.height, renderer.first_radius
    points, codes = np.empty((pixels, 3), np.float32), np.empty(pixels, np.uint32)
    found = np.empty(pixels, bool)
    seen_places(scene.record, eye_record(camera, renderer.settings, 0), points, codes, found, 0, pixels)
    albedo = renderer.frame(0).image("albedo").astype(np.float64).reshape(pixels, 3)
    share = (albedo / np.pi / (np.pi * radius * radius)) ** 2
    weights = (share * weight.reshape(pixels, 3))[found]
    return Seen(cKDTree(points[found]), decode_directions(codes[found]), weights, radius)


def value_of_strata(renderer: Renderer, seen: Seen, strata: Strata, each: int, first_fold: int) -> Float:
    """V_s (strata,) from `each` trajectories of every stratum, others for each `first_fold`."""
    plan, settings = renderer.plan, renderer.settings
    trace = testing(renderer.scene.flat, settings.photons, 0, bool(plan.caustic_mask))
    total = np.zeros(strata.n)

    def add(batch: Batch) -> Float:
        photons = batch.global_[0]
        wanted = in_classes(photons, plan.global_classes)
        photons = photons if wanted is None else np.ascontiguousarray(photons[wanted])
        number = (photons.view(np.uint32)[:, 5] >> 16).astype(np.int64) - (batch.first & 0xFFFF) + batch.first
        return np.asarray(np.bincount(number % strata.n, seen.value(photons), strata.n), np.float64)

    for first in range(0, each, 4):  # in parts: all photons together would need much memory
        fold, number = first_fold + first, min(4, each - first)
        tests = trace_tests(strata, number, fold, SEED, BATCH, trace, (), renderer.pool.run)
        total += np.sum([add(batch) for batch in tests.batches], axis=0)
    return total / each


def best_saving(strata: Strata, value: Float) -> float:
    """Error by power over the least error of a table of these strata."""
    best = float((strata.power * np.sqrt(value)).sum()) ** 2
    return float((strata.power * value).sum()) / best if best > 0 else 1.0


def saving_of(strata: Strata, known: Float, judged: Float) -> float:
    """Error by power over that of the table by V_s `known`, for strata of V_s `judged`."""
    table = strata.power * np.sqrt(known)
    if not table.any():
        return 1.0
    share = (1 - DEFENSIVE) * table / table.sum() + DEFENSIVE * strata.power
    return float((strata.power * judged).sum() / (strata.power**2 * judged / share).sum())


def bound_of(renderer: Renderer, weight: Float, most: int, trajectories: int) -> Bound:
    """For the view of a renderer and at most so many strata. weight: see `seen_of`."""
    strata = strata_of(renderer.scene.flat, most)
    assert strata is not None
    seen, each = seen_of(renderer, weight), max(trajectories // strata.n // 2, 4)
    a, b = (value_of_strata(renderer, seen, strata, each, half << 20) for half in (0, 1))
    inverse = [1 / saving_of(strata, known, judged) for known, judged in ((a, b), (b, a))]
    return Bound(strata.n, 2 / sum(inverse), best_saving(strata, (a + b) / 2))
