"""A scene by our methods: independent runs of all terms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.agree.xml import MAX_DEPTH
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.photons.projection.aim import standing
from pmviewer.render.planes import PLANES, terms_of
from pmviewer.render.virtual_lights.film import WeightedFilm
from pmviewer.settings.access import Settings, with_values

_LIGHTS = {"render.method": "virtual lights", "virtual.number": 400, "virtual.per_pixel": 25}
"""Each pixel asks for others, so that blocks of pixels know their mean by many lights."""
METHODS: Mapping[str, Mapping[str, object]] = {
    "path": {"render.method": "path"},
    "gather": {"render.method": "gather"},
    "progressive": {"render.method": "progressive"},
    "nearest": {"render.method": "progressive", "estimate.lookup": "nearest", "estimate.k": 10},
    "estimation": {
        "render.method": "gather",
        "gather.estimation": "on",
        "gather.estimation_spacing": 8,
        "gather.reprojection": "on",
    },
    "virtual": {"virtual.estimator": "unweighted", **_LIGHTS},
    "single step": {"virtual.estimator": "single step", "virtual.gather_rays": 0, **_LIGHTS},
    "every vertex": {"virtual.estimator": "every vertex", **_LIGHTS},
}
"""Settings by method; "nearest" is `progressive` with the other look-up, "estimation" the gather by few pixels, with
reprojection, on a grid that fits the small pictures; the last three are virtual lights by estimator, without gather
rays, whose discs lose light at edges."""
VIRTUAL = ("virtual", "single step", "every vertex")
WEIGHTED = ("single step", "every vertex")
"""Those that divide sums. What is compared of them is not divided: the quotient of means has a bias, they have none."""
THIN_GLASS: Mapping[str, Mapping[str, object]] = {
    "thin glass": {"render.method": "gather", "render.thin_glass": "tinted and reflecting"},
}
"""A method of scenes with thin glass alone: its light is all there, under the names of other terms."""
PHOTON_METHODS = tuple(name for name in METHODS if name != "path")
NEAREST_REACH = 4.0
"""Largest radius of a nearest look-up relative to that of a fixed one."""
AROUND = 2.0
"""Of a stage, how far beyond what stands there radii are relative to."""
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


class Rendered(NamedTuple):
    """`terms`, (runs, h, w, 15) of `pmviewer.render.planes`, a run a seed; with media 21, theirs behind. `weights`, of
    weighted virtual lights, (runs, h, w, 4): ΣG and then ΣC of light as it is and in mirrors."""

    terms: NDArray[np.float32]
    weights: NDArray[np.float64] | None = None


def _seen(opened: OpenScene) -> float:
    """The part of a scene, by radius, that a camera sees from amid its shapes: of a wide stage what stands there. A
    look-up that is narrow for a dome reaches over all of that."""
    small = standing(opened.scene, opened.flat.radius)
    return 1.0 if small is None else min(AROUND * small.radius / opened.flat.radius, 1.0)


def our_runs(
    opened: OpenScene, method: str, effort: Effort, seeds: list[int], pool: WorkPool, max_depth: int = MAX_DEPTH
) -> Rendered:
    """What independent runs of a method give, one with each seed."""
    values: dict[str, object] = {**DEPTH, **{**METHODS, **THIN_GLASS}[method], "render.max_depth": max_depth}
    passes = effort.spp
    if method != "path":
        passes = effort.passes
        radius = effort.radius * _seen(opened)
        values |= {"photons.N": effort.photons, "estimate.radius": radius}
        values["estimate.max_radius"] = NEAREST_REACH * radius
    images, weights = [], []
    prepare(opened, with_values(Settings(), values), pool, lambda text, share: None)
    for seed in seeds:
        renderer = Renderer(opened, with_values(Settings(), values | {"render.seed": seed}), pool, StageStore(0))
        for _ in range(passes):
            renderer.step()
        film = renderer.film
        planes = film.undivided() if isinstance(film, WeightedFilm) else film.planes()
        if method in WEIGHTED and isinstance(film, WeightedFilm):
            weights.append(np.concatenate(film.sums_of_weights(), axis=-1))
        parts = [planes[..., PLANES[name]] for name in terms_of(planes.shape[-1])]
        images.append(np.concatenate(parts, axis=-1))
    return Rendered(np.array(images), np.array(weights) if weights else None)


def picture(terms: NDArray[np.float32]) -> NDArray[np.float64]:
    """(runs, h, w, 3): the sum of (runs, h, w, 15 or 21)."""
    parts = terms.astype(np.float64).reshape(*terms.shape[:3], -1, 3)
    return np.asarray(parts.sum(axis=3))


def term(terms: NDArray[np.float32], *names: str) -> NDArray[np.float64]:
    """(runs, h, w, 3): the sum of some terms."""
    return sum((terms[..., PLANES[name]].astype(np.float64) for name in names), np.zeros((*terms.shape[:3], 3)))
