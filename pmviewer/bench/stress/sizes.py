"""Scenes of every size and place, and settings from one end of their range to the other."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pmviewer.bench.stress.lab import METHODS, Case, Lab, Outcome
from pmviewer.bench.stress.scenes import GLASS, ball, furnace, panel, room, tiled
from pmviewer.scene.description import Camera, Mesh, Scene, Shape

FURNACE = "furnace: radiance 1"
BOUND = 3**0.5
"""Radius of the furnace's bounding sphere, which radii are relative to."""


def _furnace(lab: Lab, size: float, at: float, **values: Any) -> Outcome:
    place = (at * size, -at * size, 0.5 * at * size)
    scene = furnace(size, place, extra=(ball(1, size, place),), materials=(GLASS,))
    return lab.measure(scene, 1.0, **{"estimate__radius": 0.03, **values})


def scales() -> list[Case]:
    """A furnace with a glass ball in it at all sizes; and far from the origin."""
    cases = []
    for size in (1e-6, 1e-3, 1.0, 1e3, 1e6):
        for method in METHODS:
            run = partial(_furnace, size=size, at=0.0, render__method=method, passes=4 if method == "path" else 1)
            cases.append(Case("scale", f"size {size:g}, {method}", FURNACE, run))
    nearest: dict[str, Any] = {"render__method": "progressive", "estimate__lookup": "nearest"}
    nearest |= {"photons__N": 50_000, "estimate__k": 20}
    for size in (1e-6, 1e6):
        cases.append(Case("scale", f"size {size:g}, nearest", FURNACE, partial(_furnace, size=size, at=0.0, **nearest)))
    for at in (10.0, 1e3, 1e6):
        for method in METHODS:
            run = partial(_furnace, size=1.0, at=at, render__method=method, passes=4 if method == "path" else 1)
            cases.append(Case("far", f"{at:g} sizes from the origin, {method}", FURNACE, run))
    run = partial(_furnace, size=1e-3, at=1e6, render__method="progressive")
    cases.append(Case("far", "size 0.001, 1e+06 sizes away, progressive", FURNACE, run))
    cases.append(Case("far", "camera 1e6 sizes away, 1e-4° wide", "", _far_camera, nonsense=True))
    return cases


def _far_camera(lab: Lab) -> Outcome:
    scene = room()
    away = Camera((0, 0, 1e6), (0, 0, 0), (0, 1, 0), 1e-4)
    return lab.measure(replace(scene, camera=away), None, seeds=2)


def kept(r: float, flatness: float = 0.2) -> float:
    """Share of the photons of a uniformly lit sphere of radius 1 that a disc of radius r finds: those no farther than
    r, no farther off the tangent plane than flatness·r (a chord d is d²/2 off it), whose normal is at most 120° from
    the disc's, and from the front: light that arrives around a normal with cosines c = 1 − d²/2 to the disc's comes
    (1 + c)/2 from its front."""
    d2 = min(r * r, 2 * flatness * r, 3.0)
    return (d2 - d2 * d2 / 8) / (r * r)


def _radius(lab: Lab, radius: float) -> Outcome:
    """Indirect light is 1/4 in the furnace, times the share of the photons that the disc finds."""
    r = BOUND * radius
    bias = "" if kept(r) > 0.999 else f"discs on a sphere keep {kept(r):.4f}, by geometry"
    size = 16 if radius < 1e-3 else 8
    passes = 4 if radius < 1e-3 else 1
    N = 4000 if radius > 0.02 else 40_000
    outcome = lab.measure(
        furnace(),
        0.25 * kept(r),
        bias,
        seeds=8 if radius < 1e-4 else None,
        terms=("indirect",),
        estimate__radius=radius,
        estimate__floor=1e-7,
        photons__N=N,
        camera__width=size,
        camera__height=size,
        passes=passes,
    )
    if outcome.value == 0 and lab.said:  # nothing found, and said so
        return replace(outcome, expected=None, bias="no photon found: noise without bound")
    return outcome


def radii() -> list[Case]:
    """Cases of `estimate.radius` from far below what finds photons to beyond the scene."""
    truth = "furnace: indirect 1/4, by geometry"
    values = (1e-7, 1e-5, 1e-3, 0.01, 0.1, 0.4, 1.0, 2.0, 10.0)
    return [
        Case("radius", f"{radius:g} of the scene", truth, partial(_radius, radius=radius), radius < 1e-6)
        for radius in values
    ]


def counts() -> list[Case]:
    """Photons from one to 20 million, k from one to all, q from a thousandth to one, α from 0 to 1."""
    cases = []
    shown: dict[str, Any] = {"estimate__radius": 0.1, "terms": ("indirect",)}
    expected = 0.25 * kept(BOUND * 0.1)
    for N, seeds in ((1, 400), (10, 100), (100, 32), (100_000, 8), (2_000_000, 3), (20_000_000, 2)):
        size = 16 if N < 100_000 else 8
        values: dict[str, Any] = {"photons__N": N, "seeds": seeds, "camera__width": size, "camera__height": size}
        run = partial(_shown, expected=expected, bias="", **shown, **values)
        cases.append(Case("N", f"{N:,} photons", FURNACE, run, long=N > 1_000_000))
    for k in (1, 2, 50, 1000):
        for N in (300, 20_000):
            knn = {"estimate__lookup": "nearest", "estimate__k": k, "photons__N": N, "estimate__max_radius": 0.1}
            cases.append(_nearest(k, N, knn))
    for q in (0.001, 0.1, 1.0):
        for rule in ("trajectories", "photons"):
            values = {"photons__q": q, "photons__q_rule": rule, "photons__N": 20_000}
            if q < 0.1:
                values["seeds"] = 400  # few caustic photons, of which a seed has none or very strong ones
            cases.append(Case("q", f"{q:g} of {rule}", FURNACE, partial(_furnace, size=1.0, at=0.0, **values)))
    for alpha in (0.0, 1e-3, 0.999, 1.0):
        run = partial(_alpha, alpha=alpha)
        cases.append(Case("alpha", f"{alpha:g}, 30 passes", FURNACE, run))
    return cases


def _shown(lab: Lab, expected: float | None, bias: str, **values: Any) -> Outcome:
    return lab.measure(furnace(), expected, bias, **values)


def _nearest(k: int, N: int, values: dict[str, Any]) -> Case:
    """k nearest with the k-th left out are exact for independent photons, up to the largest radius, where fewer are
    all that the disc holds."""
    stored, r = 1.0 * N, BOUND * 0.1  # a trajectory of albedo ½ is stored twice; half of the photons are indirect
    radius = min(r, 2 * np.sqrt(k / stored))
    bias = "discs on a sphere, by geometry" if kept(radius) < 0.999 else ""
    name = f"k = {k} of {N:,} trajectories"
    if k == 1:
        return Case("k", name, "", partial(_shown, expected=None, bias="finds none", **values), True)
    more = {"terms": ("indirect",), "seeds": 32, **values}
    low = partial(_between, low=0.25 * kept(radius) * 0.999, high=0.25, bias=bias, values=more)
    return Case("k", name, FURNACE, low)


def _between(lab: Lab, low: float, high: float, bias: str, values: dict[str, Any]) -> Outcome:
    """Radii vary from look-up to look-up: the mean lies between what the widest finds and the truth."""
    outcome = lab.measure(furnace(), None, bias, **values)
    return replace(outcome, expected=min(max(outcome.value, low), high))


def _alpha(lab: Lab, alpha: float) -> Outcome:
    """Radii shrink from 0.1 as r²·Π (i + α)/(i + 1): the mean of the shares that their discs keep."""
    squares = np.cumprod([1.0] + [(i + alpha) / (i + 1) for i in range(1, 30)])
    expected = 0.25 * float(np.mean([kept(BOUND * 0.1 * np.sqrt(s)) for s in squares]))
    return lab.measure(
        furnace(),
        expected,
        terms=("indirect",),
        passes=30,
        seeds=8,
        estimate__alpha=alpha,
        estimate__radius=0.1,
        photons__N=3000,
    )


def meshes() -> list[Case]:
    """Triangles of all kinds in a room; the truth is the room of six squares, seen by the same method."""
    return [
        Case("meshes", "floor of 100,000 slivers", "same room of squares", partial(_floor, kind="slivers")),
        Case("meshes", "floor with coincident vertices", "same room of squares", partial(_floor, kind="coincident")),
        Case("meshes", "every wall twice", "same room of squares", partial(_floor, kind="twice")),
        Case("meshes", "floor of 5,000,000 triangles", "same room of squares", partial(_floor, kind="many"), long=True),
        Case("meshes", "all triangles degenerate", "", partial(_floor, kind="degenerate"), nonsense=True),
    ]


def _floor(lab: Lab, kind: str) -> Outcome:
    plain = room()
    walls = list(plain.shapes)
    corner, u, v = (-1.0, -1.0, -1.0), (0.0, 0.0, 2.0), (2.0, 0.0, 0.0)
    if kind == "slivers":
        walls[2] = Shape("floor", tiled(corner, u, v, 50_000, 1), 0)
    elif kind == "many":
        walls[2] = Shape("floor", tiled(corner, u, v, 1000, 2500), 0)
    elif kind == "twice":
        walls += walls[:6]
    else:
        mesh = tiled(corner, u, v, 20, 20)
        faces = mesh.faces
        if kind == "coincident":  # each triangle with corners of its own, and others of no area between them
            vertices = mesh.vertices[faces].reshape(-1, 3)
            own = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
            flat = np.concatenate([own[:, [0, 0, 1]], own[:, [2, 1, 2]]])
            mesh = Mesh(vertices, np.concatenate([own, flat]).astype(np.int32))
        else:
            mesh = Mesh(mesh.vertices, np.repeat(faces[:, :1], 3, axis=1))
        walls[2] = Shape("floor", mesh, 0)
    made = cleaned(replace(plain, shapes=tuple(walls)))
    few: dict[str, Any] = {"seeds": 8, "photons__N": 20_000, "estimate__radius": 0.05}
    opened = lab.open(made)
    one = lab.measure(opened, None, **few)
    two = lab.measure(plain, None, **few)
    truth = None if kind == "degenerate" else two.value
    return replace(one, expected=truth, expected_error=two.error)


def cleaned(scene: Scene) -> Scene:
    """As loaders clean it: without shapes, triangles and lights that can't be."""
    from pmviewer.scene.clean import clean_lights, clean_shapes
    from pmviewer.scene.diagnostics import Diagnostics

    diagnostics = Diagnostics()
    shapes = clean_shapes(list(scene.shapes), diagnostics)
    lights = clean_lights(list(scene.lights), diagnostics)
    warnings = (*scene.warnings, *diagnostics.warnings())
    return replace(scene, shapes=shapes, lights=lights, dropped=dict(diagnostics.dropped), warnings=warnings)


def pictures() -> list[Case]:
    """One pixel and 8K, and cameras where pictures end."""
    return [
        Case("picture", "1 × 1", FURNACE, partial(_picture, width=1, height=1, seeds=64)),
        Case("picture", "1 × 16384", FURNACE, partial(_picture, width=1, height=16384, seeds=2)),
        Case("picture", "8K: 7680 × 4320", "furnace: direct and emission 3/4", _eight_k, long=True),
        Case("picture", "16384 × 16384", "", partial(_picture, width=16384, height=16384, seeds=2), nonsense=True),
        Case("picture", "170° wide", FURNACE, partial(_picture, width=16, height=16, seeds=8, camera__fov=170.0)),
        Case("picture", "1° wide", FURNACE, partial(_picture, width=16, height=16, seeds=8, camera__fov=1.0)),
        Case("picture", "grazing, 1e-5 above the floor", "path tracer", partial(_grazing, height=1e-5)),
        Case("picture", "grazing, in the plane of the floor", "path tracer", partial(_grazing, height=0.0)),
        Case("picture", "eye on a wall", "", _eye_on_wall),
    ]


def _picture(lab: Lab, width: int, height: int, seeds: int, **values: Any) -> Outcome:
    return lab.measure(
        furnace(), 1.0, seeds=seeds, estimate__radius=0.02, camera__width=width, camera__height=height, **values
    )


def _eight_k(lab: Lab) -> Outcome:
    """One pass; the standard error is that of the pixels, whose light samples are their own."""
    frame = lab.renderer(furnace(), estimate__radius=0.02, camera__width=7680, camera__height=4320).frame(0)
    light = frame.image("direct").mean(axis=2) + frame.image("emission").mean(axis=2)
    error = float(light.std()) / math.sqrt(light.size)
    finite = bool(np.isfinite(frame.planes.max()) and np.isfinite(frame.planes.min()))
    return Outcome(float(light.mean(dtype=np.float64)), error, 0.75, samples=light.size, finite=finite)


def _grazing(lab: Lab, height: float) -> Outcome:
    scene = room()
    camera = Camera((0, -1 + height, 0.9), (0, -1 + height, -1), (0, 1, 0), 60.0)
    values: dict[str, Any] = {"seeds": 8, "photons__N": 20_000, "estimate__radius": 0.02}
    return lab.compare(replace(scene, camera=camera), bias="", render__method="gather", **values)


def _eye_on_wall(lab: Lab) -> Outcome:
    camera = Camera((0, 0, 1), (0, 0, -1), (0, 1, 0), 60.0)
    return lab.measure(replace(room(light=panel()), camera=camera), None, seeds=2)
