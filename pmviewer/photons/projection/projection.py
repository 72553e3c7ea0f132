"""Projection maps (T7) of all lights, or what else makes photons denser where they are needed, and what kernels are
given of them.

A light's own map is made by `pmviewer.photons.projection.light_map`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.photons.projection.aim import LEAST_GAIN, aim_of, standing
from pmviewer.photons.projection.bounds import enclosing, spheres_of
from pmviewer.photons.projection.light_map import (
    MODES,
    ProjectionMap,
    described_light,
    map_of,
    slack,
    whole,
)
from pmviewer.photons.projection.projected import PROJECTION_DTYPE, WHOLE
from pmviewer.photons.projection.scales import scales
from pmviewer.photons.projection.small import Small
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.scene.description import LUMINANCE

Float = NDArray[np.float64]
MOST_FACTOR = 16.0
"""Of a photon's power, over what photons aimed at the small have, with which it aims there again from surfaces."""
WORTHWHILE = 0.7
"""`auto` uses maps that cover less than this share of the power."""
MOST_GAIN = 2.0**10
"""Times that photons start more densely for what is small, and have more power where they don't: stored powers end at
2¹⁷."""


@dataclass(frozen=True)
class Projection:
    """Maps of all lights for the trajectories that fill the global map (`surfaces`), and for the others (`caustic`).

    `surface_power` and `caustic_power` are what photons share, luminance in watts: what the maps cover, less that of
    lights that are denser for what is small by as much; 0 when nothing can be met. `gain` is the most of these,
    `covered` is what the maps of surfaces cover. `records` is for kernels.
    """

    records: NDArray[np.void]
    arrays: tuple[NDArray, ...]
    surfaces: tuple[ProjectionMap, ...]
    caustic: tuple[ProjectionMap, ...]
    surface_power: float
    caustic_power: float
    covered: float
    gain: float

    @property
    def maps(self) -> dict[str, tuple[ProjectionMap, ...]]:
        """By what they show."""
        return {"surfaces": self.surfaces, "caustic": self.caustic}

    @property
    def spares(self) -> bool:
        """Whether any light's photons are confined."""
        return any(m.mode != MODES[WHOLE] for m in self.surfaces + self.caustic)


def projection_of(
    scene: FlatScene, always: bool = True, with_caustics: bool = True, confined: bool = True, aiming: bool = True
) -> Projection:
    """Projection maps of the scene's lights. Unless `always`, those that spare little are replaced by none at all;
    `with_caustics` says whether there are trajectories for the caustic map alone. Unless `confined`, photons start
    anywhere, and are at most denser for what is small: media that scatter are met where no surface is. Unless `aiming`,
    none are."""
    records = np.zeros(2, PROJECTION_DTYPE)
    arrays: list[NDArray] = []
    charted: list[tuple[tuple[ProjectionMap, ...], float, float]] = []
    total = scene.total_luminance
    most_gain = 1.0
    small = standing(scene.owner, scene.radius) if aiming else None
    covering = spheres_of(scene.owner)
    for record, for_caustics in zip(records, (False, True), strict=True):
        spheres = covering.around[covering.caustic] if for_caustics else covering.around
        if with_caustics or not for_caustics:
            maps = [_denser_or_map(scene, i, spheres, small, confined) for i in range(len(scene.light_names))]
        else:
            maps = [whole(scene, light) for light in range(len(scene.light_names))]
        covered = scene.light_power @ LUMINANCE * [c for _, c in maps]
        if not always and covered.sum() > WORTHWHILE * total:
            maps = [old if old[0].denser else whole(scene, i) for i, old in enumerate(maps)]
            covered = scene.light_power @ LUMINANCE
        gains = np.array([m.gain for m, _ in maps])
        powers, most_gain = covered / gains, max(most_gain, float(gains.max(initial=1.0)))
        cells = [np.flatnonzero(m.on) if m.mode in _CELLED else np.zeros(0, np.int64) for m, _ in maps]
        mode_of = {name: mode for mode, name in MODES.items()}
        tables = {
            "cdf": np.concatenate([[0.0], np.cumsum(powers) / max(powers.sum(), 1e-300)]).astype(np.float32),
            "modes": np.array([mode_of[m.mode] for m, _ in maps], np.int32),
            "first": np.concatenate([[0], np.cumsum([len(c) for c in cells])]).astype(np.int32),
            "gains": gains.astype(np.float32),
            "cells": np.concatenate(cells).astype(np.int32),
        }
        for name, array in tables.items():
            arrays.append(array)
            record[name] = array.ctypes.data
        if len(spheres):
            center, radius = enclosing(spheres)
            record["center_x"], record["center_y"], record["center_z"] = center
            record["radius"] = radius + slack(scene)
        if small is not None:
            record["small_x"], record["small_y"], record["small_z"] = small.center
            record["small_radius"], record["scales"] = small.radius, scales(small.radius, scene.radius)
            record["most_factor"] = MOST_FACTOR * gains.max() if gains.max(initial=1.0) > 1 else 0.0
        charted.append((tuple(m for m, _ in maps), float(powers.sum()), float(covered.sum())))
    (surfaces, surface_power, covered), (caustic, caustic_power, _) = charted
    return Projection(records, tuple(arrays), surfaces, caustic, surface_power, caustic_power, covered, most_gain)


def aimed(scene: FlatScene, confined: bool = True) -> Projection | None:
    """The maps by default, without trajectories for the caustic map alone, of a scene whose photons aim at what is
    small; None of others. What makes caustics is a part of all surfaces: its photons aim nowhere else."""
    made = projection_of(scene, always=False, with_caustics=False, confined=confined)
    return made if made.gain > 1.0 else None


_CELLED = ("directions", "places", "world directions")


def _denser_or_map(
    scene: FlatScene, light: int, spheres: Float, small: Small | None, confined: bool
) -> tuple[ProjectionMap, float]:
    """What makes photons denser at what is small: more of them that start near it or aim at it, or the light's map.
    With c, the share of its power that its photons bring."""
    found, c = map_of(scene, light, spheres) if confined else whole(scene, light)
    if small is None or c <= 0:
        return found, c
    mode, times = aim_of(described_light(scene, light), scene.radius, small)
    if times * c <= LEAST_GAIN[mode]:
        return found, c
    everywhere, c = whole(scene, light)
    return replace(everywhere, mode=MODES[mode], origin=small.center, gain=min(times, MOST_GAIN)), c
