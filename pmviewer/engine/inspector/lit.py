"""The virtual lights that reach a pixel, with what each adds: the pixel is replayed (R10)."""

from __future__ import annotations

import numpy as np

from pmviewer.engine.inspector.look_ups import Replay
from pmviewer.engine.inspector.report import LitPlace, luminance
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.stages.virtual_lights import VirtualMap, objects_of
from pmviewer.maps.record import unpack
from pmviewer.maps.virtual_lights import V_PHI
from pmviewer.render.virtual_lights.film import WeightedFilm


def lit_places(
    replay: Replay, virtual: VirtualMap, film: WeightedFilm, pixel: int, scene: OpenScene
) -> tuple[LitPlace, ...]:
    """The surfaces of that pixel which virtual lights face, in the order of the eye pass."""
    surfaces = np.unique(replay.lights["surface"])
    return tuple(_place(replay.lights[replay.lights["surface"] == s], virtual, film, pixel, scene) for s in surfaces)


def _place(asked: np.ndarray, virtual: VirtualMap, film: WeightedFilm, pixel: int, scene: OpenScene) -> LitPlace:
    first, rows = asked[0], virtual.lights.rows
    shows = "indirect" if first["depth"] == 0 else "specular"
    quotient = film.quotient(pixel, shows) if film.weighted else 1.0
    weighted = film.weighted & (asked["G"] > 0)
    adds = asked["F"] * np.where(weighted, quotient, 1.0)[:, None]
    seen = np.flatnonzero(asked["seen"] != 0)
    seen = seen[np.argsort(-luminance(adds[seen]), kind="stable")]
    number = asked["light"][seen].astype(np.int64)
    photons = unpack(virtual.lights.photons[number], virtual.lights.power_unit)
    points = rows[:, :3].astype(np.float64)
    objects, names = objects_of(scene.flat, rows[number])
    p = first["p"].astype(np.float64)
    return LitPlace(
        shows=shows,
        depth=int(first["depth"]),
        p=p,
        n=first["n"].astype(np.float64),
        asked=int(first["asked"]),
        quotient=quotient,
        number=number,
        points=points[number],
        Phi=rows[number, V_PHI : V_PHI + 3].astype(np.float64),
        distance=np.linalg.norm(points[number] - p, axis=1),
        adds=adds[seen].astype(np.float64),
        weight=np.where(weighted, asked["G"], 0.0)[seen].astype(np.float64),
        bounces=photons["bounces"].astype(np.int64),
        light=photons["light"].astype(np.int64),
        objects=tuple(names[i] for i in objects),
        blocked=points[asked["light"][asked["seen"] == 0]],
    )
