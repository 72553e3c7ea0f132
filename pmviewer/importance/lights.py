"""How much of a picture each light lights, from photons and the importance where they arrive.

A photon of power Φ that arrives where the importance is Γ brings Φ·Γ: summed over a light's photons that is the
irradiance that it causes, summed over the pixels that look. Photons count as the method looks them up; those straight
from a light count too where the camera itself sees them arrive, since its direct light is in the picture as well.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.importance.rules import density_of
from pmviewer.maps.importance.importance_map import ImportanceMap
from pmviewer.maps.power import luminances
from pmviewer.photons.emission.light_importance import LightImportance
from pmviewer.tasks import Runner

Arrived = tuple[NDArray[np.float32], NDArray[np.uint32], float, ImportanceMap]
"""Photons (n, 6) with normal codes (n,), their unit of power in watts, and the importance where they are looked up."""
CHUNK = 8192


def importance_of_lights(
    names: tuple[str, ...], power: NDArray[np.float64], arrived: list[Arrived], run: Runner
) -> LightImportance:
    """Importance of lights of luminous powers (n,) from photons as they arrived, all stored alike."""
    flux = np.zeros(len(names))

    def part(photons: NDArray[np.float32], normals: NDArray[np.uint32], unit: float, map_: ImportanceMap) -> Any:
        gamma = density_of(map_, 1.0)(photons[:, :3], normals)
        rows = np.ascontiguousarray(photons)
        brought = np.empty(len(rows), np.float32)
        luminances(rows.view(np.uint32), brought)
        lights = rows.view(np.uint32)[:, 5] >> 16
        return np.bincount(lights, brought.astype(np.float64) * gamma * unit, minlength=len(names))

    tasks: list[Callable[[], Any]] = []
    for photons, normals, unit, map_ in arrived:
        for i in range(0, len(photons), CHUNK):
            some = slice(i, i + CHUNK)
            tasks.append(partial(part, photons[some], normals[some], unit, map_))
    for sums in run(tasks):
        flux += sums
    per_watt = np.divide(flux, power, out=np.zeros(len(names)), where=power > 0)
    highest = per_watt.max(initial=0.0)
    share = power / power.sum()
    return LightImportance(names, share, share, per_watt / highest if highest > 0 else per_watt)
