"""Where little of an image environment is seen, which part of it is (`pmviewer.kernels.lights.sky_seen`).

A room that looks out through its windows sees a hundredth of the sky, and of the rays to samples of all of it the rest
ends at walls. Rays from some points of what the camera sees, and of what is seen from there, tell what arrives. The
tables change the noise of direct light and nothing else, so that few rays are enough, and members of a cluster make
their own. They take 71 MB at most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.radius import seen_from
from pmviewer.kernels import scene as K
from pmviewer.kernels.lights.sky_seen import CUBES, SEEN_FACINGS
from pmviewer.kernels.lights.sky_square import SIDE
from pmviewer.render.camera import resolve_camera
from pmviewer.render.closest_hits import closest_hits
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.scene.arrays.sky_facing import WITHIN, cosines_of, cumulative, shares_of, sky_directions
from pmviewer.scene.description import Scene
from pmviewer.settings.access import Settings

Float = NDArray[np.float64]
Float32 = NDArray[np.float32]
PROBES = 32
"""Places along each side of the picture."""
BOUNCES, RAYS = 2, 2
"""How often what is seen from there is looked at, too, and by how many rays from each place."""
MOST_SEEN = 0.2
"""Of a sky's light, less arrives at a place from which little is seen, counted over all directions."""
ASKED = 1024
"""Rays that tell whether there are such places at all."""
POINTS = 4
"""Of a cube, from which rays go to each cell of the sky."""
BACK = 1e-3
"""Of the way to a place, how far before it rays start."""
AROUND = 0.02
"""Of the places, along each axis, left out on either side of the space that is cut."""
UNSEEN = 0.25
"""Of the samples, as if all light arrived: what the few rays did not find is met rarely otherwise, and counts more."""
LEAST = 0.01
"""Of the samples, spread over the whole sky: lobes may reflect what is below the surface that a table is for."""


@dataclass(frozen=True)
class SeenSky:
    """What the record's `sky_frame`, `sky_cubes` and `sky_seen` point to."""

    frame: NDArray[np.float32]
    cubes: NDArray[np.int32]
    tables: NDArray[np.float32]

    def store(self, record: np.void) -> None:
        """Tell the scene's record."""
        for name, array in (("sky_frame", self.frame), ("sky_cubes", self.cubes), ("sky_seen", self.tables)):
            record[name] = array.ctypes.data


def seen_sky(scene: Scene, flat: FlatScene) -> SeenSky | None:
    """The tables of a scene; None where there is no image environment, or most of it is seen."""
    if "sky_facings" not in flat.arrays:
        return None
    rng = np.random.default_rng(1)
    points = _points(scene, flat, rng)
    if not len(points):
        return None
    axes = flat.lights[int(flat.record["environment"][0])]
    to_world = np.stack([axes[k : k + 3] for k in (K.L_A, K.L_B, K.L_C)], axis=1)
    directions = (sky_directions(flat.arrays["sky_rows"], flat.arrays["sky_cells"]) @ to_world.T).astype(np.float32)
    asked = points[rng.integers(len(points), size=ASKED)], directions[rng.integers(len(directions), size=ASKED)]
    if _sees(flat, *asked).mean() > MOST_SEEN:
        return None
    low, high = np.quantile(points, (AROUND, 1 - AROUND), axis=0)
    size = float((high - low).max()) * 1.02 / CUBES
    if not size > 0:
        return None
    low = (low + high) / 2 - size * CUBES / 2
    cube = np.floor((points - low) / size).astype(int)
    inside = ((cube >= 0) & (cube < CUBES)).all(axis=1)
    number = np.ravel_multi_index(tuple(cube[inside].T[::-1]), (CUBES,) * 3)
    seen = _visibility(flat, points[inside], number, directions, rng)
    return _tables(seen, cosines_of(directions, SEEN_FACINGS).astype(np.float32), low, size)


def sees_as(flat: FlatScene, other: FlatScene) -> bool:
    """Whether as much of the same sky is seen from the same surfaces."""
    if flat.bvh is not other.bvh or ("sky_facings" in flat.arrays) != ("sky_facings" in other.arrays):
        return False
    names = ("sky_rows", "sky_cells", "lights") if "sky_facings" in flat.arrays else ()
    return all(np.array_equal(flat.arrays[name], other.arrays[name]) for name in names)


def _sees(flat: FlatScene, points: Float, directions: Float32) -> NDArray[np.bool_]:
    """Whether rays meet nothing, or something that may let light through."""
    prims = closest_hits(flat.record[0], points, directions).prims
    clear = np.array([m.transparent for m in flat.owner.materials])
    materials = flat.arrays["prim_material"]
    stored = (prims >= 0) & (prims < len(materials))  # not those of instances
    found = prims < 0
    found[stored] = clear[materials[prims[stored]]]
    return found


def _points(scene: Scene, flat: FlatScene, rng: np.random.Generator) -> Float:
    """Places (n, 3) just before what the camera sees, and what is seen from there."""
    origins, directions, t, _ = seen_from(flat, resolve_camera(scene, Settings().camera), PROBES)
    found = [origins + directions * (t * (1 - BACK))[:, None]]
    for _ in range(BOUNCES):
        starts = np.repeat(found[-1], RAYS, axis=0)
        away = rng.standard_normal(starts.shape)
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        hits = closest_hits(flat.record[0], starts, away)
        met = (hits.prims >= 0) & (hits.t > BACK * flat.radius)
        found.append(starts[met] + away[met] * (hits.t[met] * (1 - BACK))[:, None])
    return np.concatenate(found).astype(np.float64)


def _visibility(
    flat: FlatScene, points: Float, number: NDArray[np.int64], directions: Float32, rng: np.random.Generator
) -> Float32:
    """(CUBES³, SIDE²): the share of some points in a cube that see each cell of the sky; NaN without points."""
    order = rng.permutation(len(points))
    order = order[np.argsort(number[order], kind="stable")]
    _, first, counts = np.unique(number[order], return_index=True, return_counts=True)
    chosen = order[np.concatenate([np.arange(f, f + min(c, POINTS)) for f, c in zip(first, counts, strict=True)])]
    cells = np.arange(SIDE * SIDE)
    within = rng.integers(WITHIN * WITHIN, size=(len(chosen), len(cells)))
    ways = directions[(cells * WITHIN * WITHIN + within).ravel()]
    sees = _sees(flat, np.repeat(points[chosen], len(cells), axis=0), ways).reshape(len(chosen), -1)
    sums, times = np.zeros((CUBES**3, len(cells)), np.float32), np.zeros(CUBES**3, np.float32)
    np.add.at(sums, number[chosen], sees)
    np.add.at(times, number[chosen], 1)
    return np.where(times[:, None] > 0, sums / np.maximum(times, 1)[:, None], np.float32(np.nan))


def _tables(seen: Float32, cosines: Float32, low: Float, size: float) -> SeenSky | None:
    """Tables of the cubes from which little is seen, and of those beside them."""
    known = ~np.isnan(seen[:, 0])
    share = _smooth(np.nan_to_num(seen), known)
    little = (share.sum(axis=1) > 0) & (share.mean(axis=1) < MOST_SEEN)
    if not little.any():
        return None
    arriving = share[little][:, None, :] * cosines
    shares = (1 - UNSEEN) * shares_of(arriving) + (UNSEEN - LEAST) * shares_of(cosines)
    shares += np.float32(LEAST / SIDE**2)
    cubes = np.full(CUBES**3, -1, np.int32)
    cubes[little] = np.arange(little.sum())
    frame = np.array([*low, 1 / size], np.float32)
    return SeenSky(frame, cubes, cumulative(shares.reshape(-1, SIDE * SIDE)))


def _smooth(seen: Float32, known: NDArray[np.bool_]) -> Float32:
    """Means over a cube and those beside it, and over a cell of the sky and, by half, those beside it: a window's edge
    lies anywhere between rays."""
    weights: Float32 = known.reshape((CUBES,) * 3).astype(np.float32)
    values: Float32 = np.pad(seen.reshape((CUBES,) * 3 + (SIDE, SIDE)), [(0, 0)] * 3 + [(1, 1)] * 2, mode="edge")
    for axis in (3, 4):
        values = _with_beside(values, axis, 0.5)
    values = values[..., 1:-1, 1:-1] / np.float32(4)
    for axis in range(3):
        values, weights = _with_beside(values, axis, 1.0), _with_beside(weights, axis, 1.0)
    return np.reshape(values / np.maximum(weights, np.float32(1e-30))[..., None, None], (CUBES**3, SIDE * SIDE))


def _with_beside(values: Float32, axis: int, share: float) -> Float32:
    """Each value with that share of those before and after it along an axis, where there are some."""
    here = np.moveaxis(values, axis, 0)
    found = here.copy()
    found[1:] += np.float32(share) * here[:-1]
    found[:-1] += np.float32(share) * here[1:]
    return np.moveaxis(found, 0, axis)
