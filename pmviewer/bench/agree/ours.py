"""A scene by our methods: independent runs of all terms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.agree.xml import MAX_DEPTH
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.render.planes import PLANES, terms_of
from pmviewer.settings.access import Settings, with_values

METHODS: Mapping[str, Mapping[str, object]] = {
    "path": {"render.method": "path"},
    "gather": {"render.method": "gather"},
    "progressive": {"render.method": "progressive"},
    "nearest": {"render.method": "progressive", "estimate.lookup": "nearest", "estimate.k": 10},
}
"""Settings by method; "nearest" is `progressive` with the other look-up."""
THIN_GLASS: Mapping[str, Mapping[str, object]] = {
    "thin glass": {"render.method": "gather", "render.thin_glass": "tinted and reflecting"},
}
"""A method of scenes with thin glass alone: its light is all there, under the names of other terms."""
PHOTON_METHODS = tuple(name for name in METHODS if name != "path")
NEAREST_REACH = 4.0
"""Largest radius of a nearest look-up relative to that of a fixed one."""
DEPTH = {"render.max_depth": MAX_DEPTH, "photons.max_bounces": 1000}


@dataclass(frozen=True)
class Effort:
    """Samples a pixel of a run of the path tracers; passes, photons a pass and first radius (× scene) of the others.
    Where it `adds`, its runs are looked at with those of the stage before."""

    runs: int
    spp: int
    passes: int
    photons: int
    radius: float
    adds: bool = False


def our_runs(
    opened: OpenScene, method: str, effort: Effort, seeds: list[int], pool: WorkPool, max_depth: int = MAX_DEPTH
) -> NDArray[np.float32]:
    """(runs, h, w, 15): the terms of `pmviewer.render.planes`, a run a seed; with media 21, theirs behind."""
    values: dict[str, object] = {**DEPTH, **{**METHODS, **THIN_GLASS}[method], "render.max_depth": max_depth}
    passes = effort.spp
    if method != "path":
        passes = effort.passes
        values |= {"photons.N": effort.photons, "estimate.radius": effort.radius}
        values["estimate.max_radius"] = NEAREST_REACH * effort.radius
    images = []
    prepare(opened, with_values(Settings(), values), pool, lambda text, share: None)
    for seed in seeds:
        renderer = Renderer(opened, with_values(Settings(), values | {"render.seed": seed}), pool, StageStore(0))
        for _ in range(passes):
            renderer.step()
        planes = renderer.film.planes()
        parts = [planes[..., PLANES[name]] for name in terms_of(planes.shape[-1])]
        images.append(np.concatenate(parts, axis=-1))
    return np.array(images)


def picture(terms: NDArray[np.float32]) -> NDArray[np.float64]:
    """(runs, h, w, 3): the sum of (runs, h, w, 15 or 21)."""
    parts = terms.astype(np.float64).reshape(*terms.shape[:3], -1, 3)
    return np.asarray(parts.sum(axis=3))


def term(terms: NDArray[np.float32], *names: str) -> NDArray[np.float64]:
    """(runs, h, w, 3): the sum of some terms."""
    return sum((terms[..., PLANES[name]].astype(np.float64) for name in names), np.zeros((*terms.shape[:3], 3)))
