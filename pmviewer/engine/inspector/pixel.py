"""The report on a pinned pixel, from the latest pass and the film."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.inspector.fisheye import fisheye_of
from pmviewer.engine.inspector.life import life_of
from pmviewer.engine.inspector.lit import lit_places
from pmviewer.engine.inspector.look_ups import Replay, look_ups_of
from pmviewer.engine.inspector.report import Float, LitPlace, LookUp, PhotonAt, PhotonLife, Pinned, PixelReport, Seen
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.stages.eye import gather_rays_of
from pmviewer.engine.wanted import looked_map
from pmviewer.render.film import Film
from pmviewer.render.planes import PLANES, terms_of
from pmviewer.render.virtual_lights.film import WeightedFilm
from pmviewer.scene.describe import area

if TYPE_CHECKING:
    from pmviewer.engine.diagnose import Looked

Measures = Callable[[str, int], dict[str, float]]
"""Of a map and a pixel's number."""
OTHER_AREA = (
    "The photons and weights are those of the look-up's disc. The estimate divides by another area (convex hull or "
    "differential checking), so that their sum is not its value."
)
SEVERAL = (
    "The pixel has {n} samples a pass (render.mirror_rays, render.edge_rays, render.adaptive): all that they looked up "
    "is listed, each at 1/{n} of its light. The way is that of the first."
)
NO_PHOTONS = "The path tracer looks no photons up."


def pixel_report(looked: Looked, pinned: Pinned, measures: Measures, pool: WorkPool) -> PixelReport | None:
    """What made that pixel in the latest pass; None where it is outside of the picture."""
    film, plan, rendered = looked.film, looked.plan, looked.rendered
    if not (0 <= pinned.x < film.width and 0 <= pinned.y < film.height):
        return None
    number = pinned.y * film.width + pinned.x
    mean = _mean(film, number)
    terms = np.array([mean[PLANES[name]] for name in terms_of(film.channels)])
    look_ups: tuple[LookUp, ...] = ()
    lit: tuple[LitPlace, ...] = ()
    way, prims, samples = np.zeros((0, 3)), np.zeros(0, np.int64), None
    if not plan.path:
        replay = pool.run([lambda: Replay(rendered, film.radii, number, len(looked.scene.flat.light_names))])[0]
        way, prims, samples = replay.way, replay.prims, replay.samples
        look_ups = pool.run([lambda: look_ups_of(replay, rendered, looked.settings, plan.banded)])[0]
        if rendered.virtual is not None and isinstance(film, WeightedFilm):
            lit = lit_places(replay, rendered.virtual, film, number, looked.scene)
    map_ = looked_map(looked.settings, plan)
    return PixelReport(
        of=pinned,
        index=rendered.maps.index,
        N=rendered.maps.N,
        terms=terms,
        way=way,
        objects=tuple(_seen(looked.scene, int(prim), looked.watched.areas) for prim in prims),
        look_ups=look_ups,
        gathered=gather_rays_of(rendered, pinned.x, pinned.y, pool) if plan.gather else None,
        measures=measures(map_, number),
        measured_map=map_,
        history=looked.watched.record((pinned.x, pinned.y), film.passes, terms.sum(axis=0)),
        lights=looked.scene.flat.light_names,
        samples=samples,
        life=_life(looked, pinned.photon),
        notes=_notes(plan, look_ups, rendered.samples(number)),
        fisheye=fisheye_of(rendered, number, way[0], looked.settings.gather, pool) if plan.estimation else None,
        lit=lit,
    )


def _mean(film: Film, number: int) -> Float:
    """The planes of a pixel, (channels,)."""
    if type(film) is Film:
        return film.sums[number, : film.channels] / max(film.samples(number), 1)
    planes: NDArray[np.float32] = film.planes().reshape(-1, film.channels)
    return planes[number].astype(np.float64)


def _seen(scene: OpenScene, prim: int, areas: dict[int, float]) -> Seen:
    """What a primitive belongs to."""
    shape_of, owner = scene.flat.shape_of_prim, scene.flat.owner
    if prim >= len(shape_of) or shape_of[prim] >= len(owner.shapes):
        return Seen("instance")
    number = int(shape_of[prim])
    shape = owner.shapes[number]
    if number not in areas:
        areas[number] = area(shape.geometry)
    return Seen(shape.name, owner.materials[shape.material].name, areas[number])


def _life(looked: Looked, photon: PhotonAt | None) -> PhotonLife | None:
    """Told once for each photon."""
    if photon is None:
        return None
    if looked.watched.life is None or looked.watched.life.of != photon:
        looked.watched.life = life_of(looked.light.tracer, looked.rendered.maps, photon)
    return looked.watched.life


def _notes(plan: Plan, look_ups: tuple[LookUp, ...], n: int) -> tuple[str, ...]:
    """Sentences about what the figures of n samples do not say."""
    if plan.path:
        return (NO_PHOTONS,)
    notes = (OTHER_AREA,) if any(not look_up.exact for look_up in look_ups) else ()
    return (*notes, SEVERAL.format(n=n)) if n > 1 else notes
