"""Dispersion (T10): a prism's photons against Snell's law, white that stays white, and paths against photons.

The angles are NumPy's own: Schott's coefficients as they stand here, Snell's law at both faces. Pictures are of a glass
ball over a floor under a lamp; their means over runs with other seeds are compared by channel. The same ball under a
sky of radiance 1 can't be seen.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.report import BenchResult, Cell, Target
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.maps.record import bands, unpack
from pmviewer.scene.description import (
    Camera,
    ConstantEnvironment,
    Material,
    Mesh,
    Parallelogram,
    Scene,
    Shape,
    Sphere,
    SpotLight,
)
from pmviewer.scene.dispersion import Dispersion, glass_named
from pmviewer.scene.spectrum import of_bands
from pmviewer.settings.access import Settings, with_values

F8 = NDArray[np.float64]
SCHOTT = {
    "BK7": ((1.03961212, 0.231792344, 1.01046945), (0.00600069867, 0.0200179144, 103.560653)),
    "F2": ((1.34533359, 0.209073176, 0.937357162), (0.00997743871, 0.0470450767, 111.886764)),
    "SF11": ((1.73759695, 0.313747346, 1.89878101), (0.013188707, 0.0623068142, 155.23629)),
}
"""B and C of Sellmeier's equation, λ in µm."""
INCIDENCE = 60.0
"""In degrees, on the prism's first face. Its second faces +x, where the light goes: it leaves under its deviation."""
LEAST_NM, MOST_NM = 435.0, 660.0
"""Of photons that are compared: bands farther out are wide."""
FLAT = Dispersion("cauchy", (1.5, 0.0))
"""The same for all light, by the kernels that disperse."""
METHODS = ("path", "progressive", "gather")
EDGE, WHITE, AGREE = 1.0, 0.5, 1.0
"""Per cent that angles, white means and means of two methods may be off."""
QUICK, FULL = 32, 256
"""Passes of a run."""
COLUMNS = ("what", "case", "measured", "expected", "off %", "standard error %")


def prism_scene(glass: Dispersion) -> Scene:
    """A prism of 60°, upright, in light along +x; a screen for what goes straight through its first and second face."""
    ring = 0.5 * np.array([[0.5, np.sqrt(3) / 2], [-1.0, 0.0], [0.5, -np.sqrt(3) / 2]])  # (x, z)
    vertices = np.concatenate([np.insert(ring, 1, y, axis=1) for y in (-0.5, 0.5)])
    sides = [f for i in range(3) for j in [(i + 1) % 3] for f in ((i, j, 3 + j), (i, 3 + j, 3 + i))]
    faces = np.array([*sides, (0, 2, 1), (3, 4, 5)])
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    outwards = (np.cross(b - a, c - a) * (a + b + c)).sum(axis=1) > 0
    faces = np.where(outwards[:, None], faces, faces[:, ::-1]).astype(np.int32)
    angle = np.radians(58)
    to_screen, across = np.array([np.cos(angle), 0, np.sin(angle)]), np.array([-np.sin(angle), 0, np.cos(angle)])
    x, y, z = (3 * to_screen - 1.4 * across - [0, 0.6, 0]).tolist()
    u, v, w = (2.8 * across).tolist()
    shapes = (
        Shape("screen", Parallelogram((x, y, z), (u, v, w), (0.0, 1.2, 0.0)), 0),
        Shape("prism", Mesh(vertices, faces), 1),
    )
    materials = (
        Material("screen", "diffuse", (0.5,) * 3, two_sided=True),
        Material("glass", "dielectric", (1.0,) * 3, eta=glass.n_d, dispersion=glass),
    )
    light = SpotLight("sun", (-100.0, 0.0, -0.12), (1.0, 0.0, 0.0), (1e5,) * 3, 0.06, 0.06)
    return Scene("prism", None, shapes, materials, (light,), Camera((0, 5, 0), (0, 0, 0), (1, 0, 0), 40.0), 16, 16)


def deviation(name: str, nm: F8) -> F8:
    """In degrees, of light of wavelengths in nm through the prism of that glass."""
    (b1, b2, b3), (c1, c2, c3) = SCHOTT[name]
    x = (nm / 1000) ** 2
    n = np.sqrt(1 + b1 * x / (x - c1) + b2 * x / (x - c2) + b3 * x / (x - c3))
    inside = np.arcsin(np.sin(np.radians(INCIDENCE)) / n)
    found: F8 = np.degrees(np.arcsin(n * np.sin(np.radians(60) - inside)))
    return found


def photons_through(name: str, N: int, pool: WorkPool) -> tuple[F8, F8]:
    """Wavelengths (n,) in nm, and directions (n,) in degrees in which photons left the second face."""
    glass = glass_named(name)
    assert glass is not None
    settings = with_values(Settings(), {"photons.N": N})
    made = Renderer(open_scene(prism_scene(glass)), settings, pool, StageStore(0)).photons_alone(1)
    assert made is not None
    found, nm = unpack(made.caustic, 1.0), of_bands(bands(made.caustic))
    d = -found["wi"].astype(np.float64)
    through = (found["bounces"] == 2) & (found["position"][:, 0] > 0.5) & (nm > LEAST_NM) & (nm < MOST_NM)
    return nm[through], np.degrees(np.arctan2(d[through, 2], d[through, 0]))


def ball(glass: Dispersion | None, sky: bool = False) -> Scene:
    """A glass ball over a floor under a lamp; or under a sky of 1, where nothing else is seen."""
    materials = (
        Material("floor", "diffuse", (0.6,) * 3, two_sided=True),
        Material("glass", "dielectric", (1.0,) * 3, eta=glass.n_d if glass else 1.5, dispersion=glass),
        Material("black", "diffuse", (0.0,) * 3),
    )
    sphere = Shape("ball", Sphere((0, 0.5, 0), 0.45), 1)
    if sky:
        camera = Camera((0.0, 0.5, -3.0), (0.0, 0.5, 0.0), (0, 1, 0), 20.0)
        floor = Shape("floor", Parallelogram((-1, 50, -1), (0, 0, 2), (2, 0, 0)), 0)
        light = ConstantEnvironment("sky", (1.0, 1.0, 1.0))
        return Scene("furnace", None, (sphere, floor), materials, (light,), camera, 32, 32)
    shapes = (
        Shape("floor", Parallelogram((-2, 0, -2), (0, 0, 4), (4, 0, 0)), 0),
        sphere,
        Shape("lamp", Parallelogram((0.2, 2.4, -0.7), (1.4, 0, 0), (0, 0, 1.4)), 2, (6.0,) * 3),
    )
    camera = Camera((0.0, 1.4, -3.0), (0.0, 0.25, 0.0), (0, 1, 0), 42.0)
    return Scene("ball", None, shapes, materials, (), camera, 32, 32)


class Lab:
    """Mean pictures of scenes over runs with other seeds."""

    def __init__(self, pool: WorkPool, runs: int, effort: int) -> None:
        self.pool, self.runs, self.effort = pool, runs, effort
        self.white = WHITE if effort >= FULL else 3 * WHITE  # a quick run can't tell more
        self.passes = {"path": 4 * effort, "progressive": effort, "gather": effort}

    def means(self, scene: OpenScene, method: str, **values: Any) -> tuple[F8, float]:
        """(runs, 3), and the least CPU seconds of a pass."""
        found, seconds = [], []
        for seed in range(1, self.runs + 1):
            wanted = {"photons.N": 10_000, "gather.rays": 16, "render.method": method, "render.seed": seed, **values}
            renderer = Renderer(scene, with_values(Settings(), wanted), self.pool, StageStore(0))
            for _ in range(self.passes[method]):
                renderer.step()
            found.append(renderer.frame(0).image().astype(np.float64).mean(axis=(0, 1)))
            seconds.append(renderer.tally.cpu_seconds / self.passes[method])
        return np.array(found), min(seconds)


def off(a: F8, b: F8) -> tuple[float, float]:
    """How far two sets of means (runs, 3) are apart in the worst channel, and that channel's standard error, both in
    per cent."""
    relative = 100 * np.abs(a.mean(axis=0) / b.mean(axis=0) - 1)
    error = 100 * np.sqrt(a.var(axis=0, ddof=1) / len(a) + b.var(axis=0, ddof=1) / len(b)) / b.mean(axis=0)
    worst = int(relative.argmax())
    return float(relative[worst]), float(error[worst])


def run(quick: bool = False) -> BenchResult:
    """Measure all of it."""
    pool = WorkPool()
    rows: list[list[Cell]] = []
    targets: list[Target] = []
    try:
        for name in SCHOTT:
            angles(name, 20_000 if quick else 200_000, pool, rows, targets)
        pictures(Lab(pool, 6, QUICK if quick else FULL), rows, targets)
    finally:
        pool.close()
    notes = [
        f"angles: of photons of {LEAST_NM:.0f} to {MOST_NM:.0f} nm, by the middle of their bands",
        "pictures: the worst channel's mean; a method's bias by its radius is in it",
        "seconds: CPU time of a pass with an index that is the same for all light, over one without dispersion",
    ]
    return BenchResult("Dispersion", COLUMNS, rows, targets, notes)


def angles(name: str, N: int, pool: WorkPool, rows: list[list[Cell]], targets: list[Target]) -> None:
    """The edges of a prism's spectrum, and the worst of its photons."""
    nm, angle = photons_through(name, N, pool)
    expected = deviation(name, nm)
    for edge, at in (("red", int(nm.argmax())), ("blue", int(nm.argmin()))):
        same = np.abs(nm - nm[at]) < 0.5
        measured, wanted = float(angle[same].mean()), float(expected[at])
        rows.append(
            ["angle °", f"{name}, {edge}, {nm[at]:.0f} nm", measured, wanted, 100 * abs(measured / wanted - 1), ""]
        )
    worst = 100 * float(np.abs(angle / expected - 1).max())
    rows.append(["angle", f"{name}, worst of {len(nm):,} photons", "", "", worst, ""])
    targets.append(Target("T10", worst, EDGE, "%", False, f"{name}: each photon's angle against Snell's law"))


def pictures(lab: Lab, rows: list[list[Cell]], targets: list[Target]) -> None:
    """White means, agreement of methods, the furnace."""
    plain, flat, flint = (open_scene(ball(glass)) for glass in (None, FLAT, glass_named("SF11")))
    split = {}
    for method in METHODS:
        (with_waves, slow), (without, fast) = lab.means(flat, method), lab.means(plain, method)
        value, error = off(with_waves, without)
        rows.append(["same index for all", method, "", "", value, error])
        rows.append(["seconds, ratio", method, slow / fast, "", "", ""])
        note = f"{method}: the same index for all, against none"
        targets.append(Target("T10", value, lab.white, "%", False, note))
        split[method] = lab.means(flint, method)[0]
    for method in METHODS[1:]:
        value, error = off(split[method], split["path"])
        rows.append(["SF11, against path", method, "", "", value, error])
        targets.append(Target("T10", value, AGREE, "%", False, f"SF11, {method}: mean against path"))
    means, _ = lab.means(open_scene(ball(glass_named("SF11"), sky=True)), "path")
    value = 100 * float(np.abs(means.mean(axis=0) - 1).max())
    error = 100 * float(means.std(axis=0, ddof=1).max()) / np.sqrt(lab.runs)
    rows.append(["furnace", "SF11, path", float(means.mean()), 1.0, value, error])
    targets.append(Target("T10", value, WHITE, "%", False, "SF11 under a sky of 1"))
