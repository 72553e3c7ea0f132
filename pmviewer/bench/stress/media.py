"""Media at the ends of their range: hardly there, thick as a wall, scattering straight on or straight back, empty, and
with the camera on their boundary."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pmviewer.bench.stress.lab import METHODS, Case, Lab, Outcome
from pmviewer.bench.stress.scenes import box_walls, furnace
from pmviewer.scene.description import Material, Medium, Scene
from pmviewer.scene.grid import Grid
from pmviewer.scene.medium import Phase

FURNACE = "furnace: radiance 1"
NULL = Material("boundary", "null", (0.0, 0.0, 0.0))
HALF = 0.3
"""Of the cube's edge that the medium fills, in a furnace of radius 1."""
KNOWN_UP_TO = 10.0
"""Extinction up to which paths get out of a white medium before they are cut."""


def media() -> list[Case]:
    """The same everywhere and on a lattice, by every method, and by ray marching. Paths find radiance 1 wherever they
    get out; the photon methods' look-ups lose light at boundaries, so that of them it is only asked to be finite."""
    cases = []
    kinds: list[tuple[str, dict[str, Any]]] = [(f"extinction {s:g}", {"sigma": s}) for s in (1e-6, 1.0, 1e6)]
    kinds += [(f"g = {g:g}", {"g": g}) for g in (0.999, -0.999)]
    kinds += [("empty", {"empty": True}), ("camera on the boundary", {"z": 0.0})]
    for lattice in (False, True):
        for name, values in kinds:
            if values.get("empty") and not lattice:
                continue
            ways = [*(("beam", method) for method in METHODS), *((by, "progressive") for by in ("point", "nearest"))]
            for look_up, method in ways:
                known = method == "path" and values.get("sigma", 1.0) <= KNOWN_UP_TO
                run = partial(_measured, known=known, lattice=lattice, method=method, look_up=look_up, **values)
                where = "on a lattice" if lattice else "the same everywhere"
                how = method if look_up == "beam" else f"{method} by {look_up}"
                cases.append(Case("media", f"{name}, {where}, {how}", FURNACE if known else "", run))
    return cases


def in_furnace(medium: Medium, z: float) -> Scene:
    """A white cube of the medium in a furnace, `z` before the camera."""
    low = z if z > 0 else 0.0
    scene = furnace()
    walls = tuple(replace(wall, media=(-1, 0)) for wall in box_walls(HALF, 1))
    moved = [replace(w, geometry=_moved(w.geometry, low + HALF)) for w in walls]
    return replace(scene, shapes=(*scene.shapes, *moved), materials=(*scene.materials, NULL), media=(medium,))


def _moved(g: Any, z: float) -> Any:
    x, y, low = g.corner
    return replace(g, corner=(x, y, low + z))


def _measured(
    lab: Lab,
    known: bool,
    lattice: bool,
    method: str,
    sigma: float = 1.0,
    g: float = 0.0,
    empty: bool = False,
    z: float = 0.2,
    look_up: str = "beam",
) -> Outcome:
    density = None
    if lattice:
        values = np.random.default_rng(1).random((9, 10, 11, 1)).astype(np.float32)
        values[:3] = 0
        place = np.diag([2 * HALF, 2 * HALF, 2 * HALF, 1.0])
        place[:3, 3] = (-HALF, -HALF, max(z, 0.0))
        density = Grid(np.zeros_like(values) if empty else values, place)
    medium = Medium("milk", (sigma,) * 3, (1.0,) * 3, phase=Phase(g), density=density)
    values_: dict[str, Any] = {"render__method": method, "render__max_depth": 1000, "passes": 4}
    if method != "path":
        values_ |= {"estimate__radius": 0.03, "estimate__in_media": look_up, "passes": 1}
    return lab.measure(in_furnace(medium, z), 1.0 if known else None, **values_)
