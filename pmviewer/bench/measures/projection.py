"""Projection maps (T7): caustic photons per traced trajectory and per second, and a z-test of their power.

The scene is a Cornell-like room with one small glass sphere, closed, so that the gain is that of the caustic map alone.
"""

from __future__ import annotations

import math
import time

import numpy as np

from pmviewer.bench.report import BenchResult, Target
from pmviewer.maps.record import CAUSTIC, unpack
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.photons.projection.projection import Projection, projection_of
from pmviewer.scene.arrays.flatten import LUMINANCE, FlatScene, flatten
from pmviewer.scene.description import (
    Camera,
    ConstantEnvironment,
    Light,
    Material,
    Parallelogram,
    PointLight,
    Scene,
    Shape,
    Sphere,
)
from pmviewer.settings.access import Photons

WHITE = Material("white", "diffuse", (0.7, 0.7, 0.7), two_sided=True)
GLASS = Material("glass", "dielectric", (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), eta=1.5)
BALL = Shape("glass ball", Sphere((0.2, -0.8, 0.1), 0.12), 1)
PANEL = Parallelogram((-0.1, 0.98, -0.1), (0.2, 0.0, 0.0), (0.0, 0.0, 0.2))
SHARE = 0.1
"""q: nine of ten trajectories are for the caustic map alone."""


def room(light: Light | Parallelogram, closed: bool = True) -> Scene:
    """The room [−1, 1]³, or its floor alone, with the ball and one light."""
    sides = [
        ((-1, -1, -1), (0, 0, 2), (2, 0, 0)),
        ((-1, -1, -1), (0, 2, 0), (0, 0, 2)),
        ((1, -1, -1), (0, 0, 2), (0, 2, 0)),
        ((-1, 1, -1), (2, 0, 0), (0, 0, 2)),
        ((-1, -1, -1), (2, 0, 0), (0, 2, 0)),
        ((-1, -1, 1), (0, 2, 0), (2, 0, 0)),
    ]
    shapes = [Shape(f"wall {i}", Parallelogram(*side), 0) for i, side in enumerate(sides if closed else sides[:1])]
    lights: tuple[Light, ...] = ()
    if isinstance(light, Parallelogram):
        shapes.append(Shape("panel", light, 0, (10.0, 10.0, 10.0)))
    else:
        lights = (light,)
    camera = Camera((0.0, 0.0, 0.95), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 75.0)
    return Scene("room", None, (*shapes, BALL), (WHITE, GLASS), lights, camera, 64, 64)


SCENES = {
    "room, point light": lambda: room(PointLight("point", (0.0, 0.6, 0.0), (1.0, 1.0, 1.0))),
    "room, small panel": lambda: room(PANEL),
    "floor, point light": lambda: room(PointLight("point", (0.0, 0.6, 0.0), (1.0, 1.0, 1.0)), closed=False),
    "floor, sky": lambda: room(ConstantEnvironment("sky", (1.0, 1.0, 1.0)), closed=False),
}


def _caustic(maps: PhotonMaps) -> tuple[int, float, float]:
    """Photons straight from lights over glass, their power in watts, and its standard error for independent ones."""
    found = unpack(maps.caustic, maps.caustic_unit)
    power = found["Phi"][found["path_class"] == CAUSTIC].astype(np.float64) @ LUMINANCE
    return len(power), float(power.sum()), math.sqrt(float((power**2).sum()))


def _traced(flat: FlatScene, projection: Projection | None, N: int, seed: int) -> tuple[PhotonMaps, float]:
    settings = Photons(q=SHARE, sequence="independent")
    before = time.process_time()
    maps = trace_pass(flat, settings, seed, 0, N, True, lambda tasks: [task() for task in tasks], projection=projection)
    return maps, time.process_time() - before


def run(quick: bool = False) -> BenchResult:
    """Trace each scene with maps and without, from independent numbers."""
    N = 200_000 if quick else 2_000_000
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    for name, make in SCENES.items():
        flat = flatten(make())
        start = time.perf_counter()
        projection = projection_of(flat)
        build = time.perf_counter() - start
        results = []
        for seed, maps_used in ((1, None), (2, projection)):
            _traced(flat, maps_used, 100, seed)  # compiles
            results.append(_traced(flat, maps_used, N, seed))
        (plain, plain_s), (mapped, mapped_s) = results
        (n0, power0, error0), (n1, power1, error1) = _caustic(plain), _caustic(mapped)
        gain = n1 / mapped.emitted * plain.emitted / max(n0, 1)
        per_second = n1 / mapped_s * plain_s / max(n0, 1)
        z = (power1 - power0) / math.hypot(error0, error1)
        share = projection.caustic_power / flat.total_luminance
        rows.append([name, share, n0, n1, gain, per_second, power0, power1, z, build * 1e3])
        if name == "room, point light":
            targets.append(
                Target("T7", gain, 5.0, "×", True, "caustic photons per traced trajectory, small glass ball")
            )
        targets.append(Target("T7", abs(z), 4.0, "σ", False, f"caustic power with maps and without: {name}"))
    columns = ["scene", "covered", "photons, plain", "with maps", "gain per trajectory", "gain per CPU s", "W, plain",
               "W, with maps", "z", "maps ms"]  # fmt: skip
    return BenchResult(
        "Projection maps", columns, rows, targets, [f"{N} trajectories, q = {SHARE}, caustics L S⁺ D alone"]
    )
