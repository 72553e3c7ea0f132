"""Settings and small scenes drawn at random from all that the schema allows, and what must hold of any of them:
the same film for any number of threads and again, finite views, and an energy ledger that balances.

What compiles code of its own (method, kind of look-up, importance …) is drawn from a list of structures, so that the
number of compiled kernels is bounded; every other setting has its whole range, cut where it would only cost time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from pmviewer.bench.stress.lab import Case, Lab, Outcome
from pmviewer.bench.stress.scenes import MIRROR, furnace, grey, open_floor, panel, room
from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.energy import ENTRIES
from pmviewer.engine.inspection import Wanted
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.diagnostic_views import DIAGNOSTICS
from pmviewer.scene.description import Material, PointLight, Scene, Shape, Sphere
from pmviewer.settings.access import SETTINGS, SettingInfo, Settings, with_values

STRUCTURAL = {
    "render.method",
    "photons.projection",
    "estimate.lookup",
    "estimate.area",
    "estimate.differential",
    "direct.shadow_photons",
    "gather.directions",
    "gather.secondary",
    "gather.radiance_photons",
    "gather.cache",
    "gather.estimation",
    "gather.reprojection",
    "importance.map",
    "importance.deposition",
    "importance.convergence",
    "importance.emission",
    "virtual.estimator",
    "virtual.choice",
}
"""Settings that kernels are compiled for."""
MOST = {
    "photons.N": 2000,
    "photons.max_bounces": 100,
    "importance.N": 1000,
    "importance.neighbours": 100,
    "importance.tests": 16,
    "direct.samples": 4,
    "direct.con_samples": 4,
    "direct.noncon_samples": 4,
    "direct.shadow_N": 2000,
    "gather.rays": 4,
    "gather.cache_samples": 16,
    "gather.estimation_samples": 16,
    "render.outline_rays": 8,
    "render.max_depth": 100,
    "virtual.number": 100,
    "virtual.per_pixel": 100,
    "virtual.photons": 1000,
    "virtual.walks": 8,
    "virtual.gather_rays": 8,
    "virtual.window": 8.0,
}
"""Upper ends where the schema's only cost time."""

SIGNED = ("Mitchell-Netravali", "Catmull-Rom", "Lanczos")
"""Filters that are negative somewhere: beside bright edges a picture of few samples may be so too."""

PLAIN: dict[str, dict[str, Any]] = {
    "progressive": {},
    "gather": {"render.method": "gather"},
    "path": {"render.method": "path"},
    "nearest": {"estimate.lookup": "nearest"},
    "global map": {"render.method": "global map"},
    "caustic map": {"render.method": "caustic map"},
}
"""Structures whose kernels other tests use, too."""
_IMPORTANCE = {"importance.map": "screen"}
STRUCTURES: dict[str, dict[str, Any]] = PLAIN | {
    "convex hull": {"estimate.area": "convex hull"},
    "differential": {"estimate.differential": True},
    "projection": {"photons.projection": "on"},
    "radiance photons": {"render.method": "gather", "gather.radiance_photons": "1/4"},
    "photon cones": {"render.method": "gather", "gather.directions": "photon cones", "gather.rays": 4},
    "secondary": {"render.method": "gather", "gather.secondary": 2.0},
    "irradiance cache": {"render.method": "gather", "gather.cache": "on"},
    "gather estimation": {"render.method": "gather", "gather.estimation": "on"},
    "gather reprojection": {"render.method": "gather", "gather.estimation": "on", "gather.reprojection": "on"},
    "shadow photons": {"direct.shadow_photons": True},
    "virtual lights": {"render.method": "virtual lights"},
    "virtual lights, tree": {"render.method": "virtual lights", "virtual.choice": "light tree"},
    "virtual lights, paths": {"render.method": "virtual lights", "virtual.estimator": "every vertex"},
    "Keller-Wald": {**_IMPORTANCE, "importance.deposition": "Keller-Wald"},
    "density control": {**_IMPORTANCE, "importance.deposition": "density control", "importance.convergence": "cube"},
    "constant density": {"importance.deposition": "constant density"},
    "Peter-Pietrek": {**_IMPORTANCE, "importance.emission": "Peter-Pietrek"},
    "Christensen keep": {**_IMPORTANCE, "importance.emission": "Christensen keep"},
}


def drawable() -> list[SettingInfo]:
    """Settings of photons, maps and image that compile nothing; the camera's are drawn with the scene."""
    stages = ("photons", "maps", "image")
    return [
        info
        for info in SETTINGS.values()
        if info.stage in stages
        and info.path not in STRUCTURAL
        and not info.path.startswith(("camera.", "free_camera."))
    ]


def value_of(info: SettingInfo, u: float) -> Any:
    """The setting's value at u in [0, 1]: its ends at the ends, its scale in between; "auto" below 0.2 where it is
    one."""
    if info.auto:
        if u < 0.2:
            return "auto"
        u = (u - 0.2) / 0.8
    if info.kind is bool:
        return u >= 0.5
    if info.choices:
        return info.choices[min(int(u * len(info.choices)), len(info.choices) - 1)]
    if info.kind is dict:
        return {} if u < 0.5 else {"light.1.power": (2 * u,)}
    assert info.lower is not None
    assert info.upper is not None
    low, high = info.lower, min(info.upper, MOST.get(info.path, math.inf))
    value = low * (high / low) ** u if info.scale == "log" and low > 0 else low + (high - low) * u
    return min(max(round(value), int(low)), int(high)) if info.kind is int else min(max(value, low), high)


@dataclass(frozen=True)
class Spec:
    """A small scene: `kind` of FURNACE, ROOM or FLOOR, its size and brightness as powers of ten, its albedo, balls of
    diffuse stuff, mirror or glass, so many point lights, the camera's field of view and the picture's size."""

    kind: int = 0
    size: float = 0.0
    brightness: float = 0.0
    albedo: float = 0.5
    balls: tuple[tuple[float, float, float, float, int], ...] = ()
    """Each with x, y, z in (−0.6, 0.6), radius in (0.01, 0.4), material 0, 1 or 2."""
    eta: float = 1.5
    points: int = 1
    fov: float = 60.0
    width: int = 9
    height: int = 7


FURNACE, ROOM, FLOOR = range(3)


def scene_of(spec: Spec) -> Scene:
    """The scene of a spec."""
    s, L = 10.0**spec.size, 10.0**spec.brightness
    glass = Material("glass", "dielectric", (0.9, 1.0, 0.8), (1.0, 0.8, 0.9), eta=spec.eta)
    materials = (grey(spec.albedo), MIRROR, glass)
    used = tuple(
        Shape(f"ball {i}", Sphere((x * s, y * s, z * s), r * s), m) for i, (x, y, z, r, m) in enumerate(spec.balls)
    )
    if spec.kind == FURNACE:
        return furnace(s, albedo=spec.albedo, emission=L, extra=used, materials=materials[1:])
    if spec.kind == ROOM:
        return room(s, spec.albedo, extra=used, materials=materials[1:], light=panel(radiance=L, s=s))
    rng = np.random.default_rng(spec.points)
    lights = tuple(
        PointLight(f"point {i}", tuple(s * rng.uniform((-1, 0.7, -1), (1, 1.5, 1))), (L * s * s,) * 3)
        for i in range(max(spec.points, 1))
    )
    floor = open_floor(lights, used, grey(spec.albedo), materials[1:], s)
    return replace(floor, camera=replace(floor.camera, origin=(0.0, 2 * s, 0.0)))


def settings_of(structure: Mapping[str, Any], drawn: Mapping[str, Any], spec: Spec) -> Settings:
    """The drawn values under those of the structure."""
    view = {"camera.width": spec.width, "camera.height": spec.height, "camera.fov": spec.fov}
    return with_values(Settings(), {**drawn, **structure, **view})


def check(scene: Scene | OpenScene, settings: Settings, views: bool = True, passes: int = 2) -> str:
    """What does not hold, "" for nothing."""
    opened = scene if isinstance(scene, OpenScene) else open_scene(scene)
    films = []
    for threads in (1, 3):
        pool = WorkPool(threads)
        try:
            made = Renderer(opened, settings, pool, StageStore(0))
            for _ in range(passes):
                made.step()
            films.append(made.film.sums.tobytes())
            problem = _problem(made, views) if threads == 1 else ""
        finally:
            pool.close()
        if problem:
            return problem
    return "" if films[0] == films[1] else "one thread and three make different films"


def _problem(made: Renderer, views: bool) -> str:
    frame = made.frame(0)
    if not np.isfinite(frame.planes).all():
        return "a plane is not finite"
    if (frame.beauty < 0).any() and made.settings.render.filter not in SIGNED:
        return "a radiance is negative"
    energy = frame.statistics.energy
    if energy is not None:
        lights = made.scene.flat.total_luminance
        if not abs(energy.missing) <= 1e-4 * lights:
            return f"the ledger misses {energy.missing / lights:.1e} of the light: {dict(zip(ENTRIES, energy.watts))}"
        # Photons that aim have the power that their chance asks for: it adds up in the mean.
        even = made.plan.emission == "off" and not made.scene.traits.aims
        if even and not math.isclose(energy.watts[0], lights, rel_tol=1e-5):
            return f"the ledger starts with {energy.watts[0] / lights:.6f} of the light"
    for view in DIAGNOSTICS if views else ():
        if inactive_reason(f"display.view={view}", made.settings, made.scene.traits) is not None:
            continue
        maps = ("global", "caustic") if made.plan.caustic_mask and made.plan.global_classes else ("",)
        for name in maps:
            name = name or ("global" if made.plan.global_classes else "caustic")
            planes = made.inspect(Wanted(DIAGNOSTICS[view].family, name)).planes
            if any(not np.isfinite(plane).all() for plane in planes.values()):
                return f"the view '{view}' of the {name} map is not finite"
    return ""


def random_spec(rng: np.random.Generator) -> Spec:
    """A spec from all that there are."""
    balls = tuple(
        (*(float(x) for x in rng.uniform(-0.6, 0.6, 3)), float(rng.uniform(0.01, 0.4)), int(rng.integers(0, 3)))
        for _ in range(int(rng.integers(0, 4)))
    )
    return Spec(
        kind=int(rng.integers(0, 3)),
        size=float(rng.uniform(-5, 5)),
        brightness=float(rng.uniform(-15, 15)),
        albedo=float(rng.choice([0.0, 0.2, 0.8, 1.0])),
        balls=balls,  # type: ignore[arg-type]
        eta=float(rng.choice([0.5, 1.0, 1.3, 3.0])),
        points=int(rng.choice([1, 3, 20])),
        fov=float(rng.uniform(1, 170)),
    )


def drawn() -> list[Case]:
    """For each structure settings and scenes at random."""
    return [
        Case("drawn", f"{name}, 60 scenes", "1 and 3 threads, ledger", partial(_drawn, name=name, count=60))
        for name in STRUCTURES
    ]


def _drawn(lab: Lab, name: str, count: int) -> Outcome:
    rng = np.random.default_rng(sum(map(ord, name)))
    for _ in range(count):
        spec = random_spec(rng)
        values = {info.path: value_of(info, float(rng.uniform())) for info in drawable()}
        problem = check(scene_of(spec), settings_of(STRUCTURES[name], values, spec))
        if problem:
            return Outcome(problem=f"{problem}; {spec}; {values}")
    return Outcome()
