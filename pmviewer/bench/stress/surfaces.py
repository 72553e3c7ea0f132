"""Surfaces that keep all light or none, that hardly bend it, that are as smooth as nothing, and that lie in each
other; lights that touch them; lights by the ten thousand; powers over sixty orders of magnitude."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pmviewer.bench.stress.lab import METHODS, Case, Lab, Outcome
from pmviewer.bench.stress.scenes import (
    GLASS,
    MIRROR,
    ball,
    furnace,
    grey,
    open_floor,
    panel,
    parallelogram,
    point,
    room,
)
from pmviewer.maps.record import INDIRECT_CAUSTIC, unpack
from pmviewer.photons.light_pass.ledger import E_ABSORBED, E_EMITTED, E_STORED, E_TERMINATED
from pmviewer.scene.description import (
    LUMINANCE,
    Material,
    Parallelogram,
    PointLight,
    Scene,
    Shape,
    Sphere,
    SpotLight,
)
from pmviewer.scene.dispersion import by_abbe

FURNACE = "furnace: radiance 1"
OF_A_ROOM: dict[str, Any] = {"estimate__radius": 0.02, "camera__width": 32, "camera__height": 32}
"""Most noise of a room's mean comes from where pixels are sampled: many of them, and few photons."""


def materials() -> list[Case]:
    """Albedo 0 and 1, ior below 1, 1 and 3, roughness 0, 1e-4 and 1."""
    cases = [
        Case("albedo", f"{albedo:g}, 64 scatterings", "Φ·Σ ρⁱ", partial(_flux, albedo=albedo), albedo == 1)
        for albedo in (0.001, 0.5, 1.0)
    ]
    cases.append(Case("albedo", "1, 50,000,000 photons of 64 scatterings", "", _endless, nonsense=True, long=True))
    for method in METHODS:
        cases.append(Case("albedo", f"0, {method}", "furnace: emission alone", partial(_black, render__method=method)))
    for eta in (0.5, 0.67, 1.0, 1.0001, 3.0):
        for method in METHODS:
            run = partial(_glass, eta=eta, render__method=method, passes=4 if method == "path" else 1)
            cases.append(Case("ior", f"{eta:g}, {method}", FURNACE, run))
    for abbe in (1.0, 25.0, 1e6):
        for method in METHODS:
            run = partial(_split, abbe=abbe, render__method=method, passes=4 if method == "path" else 1)
            cases.append(Case("Abbe number", f"{abbe:g}, {method}", FURNACE, run))
    for kind in ("rough conductor", "rough dielectric", "rough plastic"):
        for alpha in (0.0, 1e-4, 1.0):
            for method in ("gather", "progressive"):
                cases.append(
                    Case(
                        "roughness",
                        f"{kind} {alpha:g}, {method}",
                        "path tracer",
                        partial(_rough, kind=kind, alpha=alpha, render__method=method),
                    )
                )
    cases.append(Case("roughness", "rough conductor 0 is a mirror", FURNACE, _smoothest))
    return cases


def _flux(lab: Lab, albedo: float) -> Outcome:
    """Power that arrives on surfaces over the lights': the sum over 64 scatterings; and the energy ledger's shares."""
    made = [lab.renderer(furnace(albedo=albedo), photons__N=5000, render__seed=seed) for seed in range(1, 9)]
    photons = [m.light.photons for m in made]
    arrived = np.array([p.ledger[E_STORED] / p.ledger[E_EMITTED] for p in photons if p is not None])
    for m in made:
        lab.frame(m)
    expected = 64.0 if albedo == 1 else (1 - albedo**64) / (1 - albedo)
    ledger = np.sum([p.ledger for p in photons if p is not None], axis=0)
    shares = ledger[[E_ABSORBED, E_TERMINATED]] / ledger[E_EMITTED]
    wrong = np.abs(shares - (1 - albedo**64, albedo**64)).max()
    return Outcome(
        float(arrived.mean()),
        float(arrived.std(ddof=1) / math.sqrt(len(arrived))),
        expected,
        samples=len(arrived),
        bias="the sum ends after photons.max_bounces" if albedo == 1 else "",
        problem="" if wrong < 1e-4 else f"ledger off by {wrong:.1e}",
    )


def _endless(lab: Lab) -> Outcome:
    """3.2 billion photons stored, which no machine here has the memory for: refused before they are traced."""
    return lab.measure(furnace(albedo=1.0), None, seeds=1, photons__N=50_000_000)


def _black(lab: Lab, **values: Any) -> Outcome:
    return lab.measure(furnace(albedo=0.0, emission=1.0), 1.0, seeds=4, **values)


def _glass(lab: Lab, eta: float, **values: Any) -> Outcome:
    scene = furnace(extra=(ball(1),), materials=(replace(GLASS, eta=eta),))
    return lab.measure(scene, 1.0, photons__N=20_000, estimate__radius=0.03, **values)


def _split(lab: Lab, abbe: float, **values: Any) -> Outcome:
    """A ball that splits light takes none of it."""
    scene = furnace(extra=(ball(1),), materials=(replace(GLASS, dispersion=by_abbe(1.5, abbe)),))
    return lab.measure(scene, 1.0, photons__N=20_000, estimate__radius=0.03, **values)


def _coated(kind: str, alpha: float) -> Material:
    return Material("coated", kind, (0.9,) * 3, (0.9,) * 3, two_sided=True, alpha=(alpha, alpha))


def _rough(lab: Lab, kind: str, alpha: float, **values: Any) -> Outcome:
    scene = furnace(extra=(ball(1),), materials=(_coated(kind, alpha),))
    return lab.compare(scene, photons__N=20_000, estimate__radius=0.03, **values)


def _smoothest(lab: Lab) -> Outcome:
    """Single scattering loses nothing at roughness 0: the furnace stays 1."""
    metal = Material("metal", "rough conductor", (1.0,) * 3, two_sided=True, alpha=(0.0, 0.0))
    return lab.measure(furnace(extra=(ball(1),), materials=(metal,)), 1.0, photons__N=20_000, estimate__radius=0.03)


def overlaps() -> list[Case]:
    """Surfaces within each other and lights that touch or cut them."""
    cases = [
        Case("overlap", "two equal lights in one place", "", _double_wall, nonsense=True),
        Case("overlap", "two glass balls that cut each other, depth 1000", FURNACE, partial(_two_balls, depth=1000)),
        Case("overlap", "two glass balls, depth 32", "", partial(_two_balls, depth=32), nonsense=True),
        Case("overlap", "glass ball that sticks in the wall", "path tracer", _ball_in_wall),
        Case("overlap", "mirror that touches the wall", FURNACE, _touching_mirror),
    ]
    for method in METHODS:
        values = {"render__method": method, "passes": 4 if method == "path" else 2}
        run = partial(_low_light, gap=0.0, values=values)
        cases.append(Case("light", f"in the ceiling's plane, {method}", "", run, nonsense=True))
        for gap in (1e-7, 1e-5):
            run = partial(_low_light, gap=gap, values=values)
            cases.append(Case("light", f"{gap:g} below the ceiling, {method}", "same, 0.001 lower", run))
    for method in ("gather", "progressive"):
        cases.append(Case("light", f"ball half in the floor, {method}", "path tracer", partial(_sunk, method=method)))
        run = partial(_cutting, method=method)
        cases.append(Case("light", f"panel cut by a wall, {method}", "path tracer", run))
    return cases


def _double_wall(lab: Lab) -> Outcome:
    scene = furnace()
    return lab.measure(replace(scene, shapes=scene.shapes * 2, name="twice"), None, seeds=4, estimate__radius=0.05)


def _two_balls(lab: Lab, depth: int) -> Outcome:
    """Total reflection keeps light in the lens for long: paths that end too early lack it, which has to be said."""
    one, two = (Shape("ball", Sphere((x, 0, 0.5), 0.2), 1) for x in (-0.1, 0.1))
    scene = furnace(extra=(one, two), materials=(GLASS,))
    values: dict[str, Any] = {"photons__N": 20_000, "estimate__radius": 0.03, "passes": 2, "render__max_depth": depth}
    if depth == 32:
        made = lab.measure(scene, None, **values)
        return replace(made, bias=f"{made.value - 1:+.1%} of the light, and said so")
    return lab.measure(scene, 1.0, photons__max_bounces=1000, **values)


def _ball_in_wall(lab: Lab) -> Outcome:
    """The wall inside the glass shines less into it than a furnace filled with glass would: below 1."""
    stuck = Shape("ball", Sphere((0.0, 0, 0.95), 0.2), 1)
    values: dict[str, Any] = {"photons__N": 20_000, "estimate__radius": 0.02}
    return lab.compare(furnace(extra=(stuck,), materials=(GLASS,)), **values)


def _touching_mirror(lab: Lab) -> Outcome:
    """A square whose corners lie on the sphere."""
    z = math.sqrt(1 - 2 * 0.3**2)
    square = Shape("mirror", parallelogram((-0.3, -0.3, z), (0, 0.6, 0), (0.6, 0, 0)), 1)
    return lab.measure(furnace(extra=(square,), materials=(MIRROR,)), 1.0, photons__N=20_000, estimate__radius=0.02)


def _low_light(lab: Lab, gap: float, values: dict[str, Any]) -> Outcome:
    """The room lit from next to the ceiling, or from its plane, where a ray meets the one or the other."""
    options = {**OF_A_ROOM, "terms": ("direct", "indirect", "caustic"), **values}
    one = lab.measure(room(light=panel(1 - gap)), None, **options)
    twice = {**options, "passes": 2 * values["passes"]}
    two = lab.once(("low light", *twice.items()), lambda: lab.measure(room(light=panel(1 - 1e-3)), None, **twice))
    if gap == 0:
        return replace(one, bias=f"{one.value / two.value - 1:+.1%} of the light, and said so")
    return replace(one, expected=two.value, expected_error=two.error)


def _sunk(lab: Lab, method: str) -> Outcome:
    lamp = Shape("lamp", Sphere((0, -1, 0), 0.3), 1, (3.0,) * 3)
    scene = room(light=lamp, materials=(grey(0.0),))
    return lab.compare(scene, 12, render__method=method, passes=2, gather__rays=8, **OF_A_ROOM)


def _cutting(lab: Lab, method: str) -> Outcome:
    lamp = Shape("lamp", Parallelogram((-1.4, 0.3, -0.4), (0.8, 0.1, 0), (0, 0, 0.8)), 0, (5.0,) * 3)
    scene = room(light=lamp)
    return lab.compare(scene, 12, render__method=method, passes=2, gather__rays=8, **OF_A_ROOM)


def lights() -> list[Case]:
    """Many, mighty, feeble and misdirected lights."""
    cases = []
    for choice in ("power", "photons", "Keller-Wald"):
        cases.append(
            Case("lights", f"10,000 points, by {choice}", "inverse square, summed", partial(_many, choice=choice))
        )
    for power in (1e-30, 1e-10, 1e10, 1e30):
        for method in METHODS:
            run = partial(_power, power=power, render__method=method, passes=4 if method == "path" else 1)
            cases.append(Case("power", f"radiance {power:g}, {method}", FURNACE, run))
        cases.append(Case("power", f"point of {power:g} W/sr", "inverse square", partial(_lone_point, power=power)))
    cases.append(Case("power", "1e-30 and 1e30 together", "inverse square", _uneven))
    cases.append(Case("power", "too much for float32", "", _overflow, nonsense=True))
    cases.append(Case("lights", "spot of 1e-4°", "all on one spot: Φ·albedo", _needle))
    cases.append(Case("lights", "all shine past the scene", "", _past, nonsense=True))
    cases.append(Case("lights", "caustic photons 8,000 times weaker", "power of a photon", _small_caustics))
    return cases


def _seen(scene: Scene, lights: list[PointLight]) -> float:
    """Mean radiance of the grey floor that the picture sees, ρ/π·Σ I·cosθ/d²; the camera looks straight down."""
    half = 2 * math.tan(math.radians(20))
    x = (np.arange(96) + 0.5) / 96 * 2 * half - half
    total = np.zeros((96, 96))
    for light in lights:
        px, h, pz = light.position
        total += light.intensity[0] * h / ((x[:, None] - px) ** 2 + (x - pz) ** 2 + h * h) ** 1.5
    return float(total.mean()) * scene.materials[0].reflectance[0] / math.pi


def _many(lab: Lab, choice: str) -> Outcome:
    rng = np.random.default_rng(1)
    places = rng.uniform((-1, 0.3, -1), (1, 1, 1), (10_000, 3))
    powers = rng.exponential(1e-4, 10_000)
    lamps = [
        PointLight(f"{i}", (float(x), float(y), float(z)), (float(p),) * 3)
        for i, ((x, y, z), p) in enumerate(zip(places, powers, strict=True))
    ]
    scene = open_floor(tuple(lamps))
    return lab.measure(scene, _seen(scene, lamps), seeds=8, passes=16, photons__N=20_000, direct__choice=choice)


def _power(lab: Lab, power: float, **values: Any) -> Outcome:
    scene = furnace(emission=0.5 * power, extra=(ball(1),), materials=(GLASS,))
    return lab.measure(scene, 1.0, scale=power, photons__N=20_000, estimate__radius=0.03, **values)


def _overflow(lab: Lab) -> Outcome:
    return lab.measure(furnace(emission=1e39), None, seeds=1)


def _lone_point(lab: Lab, power: float) -> Outcome:
    lamp = point(intensity=(power,) * 3)
    scene = open_floor((lamp,))
    return lab.measure(scene, _seen(scene, [lamp]) / power, scale=power, seeds=8)


def _uneven(lab: Lab) -> Outcome:
    lamps = [point((-0.3, 1, 0), (1e-30,) * 3), point((0.3, 1, 0), (1e30,) * 3)]
    scene = open_floor(tuple(lamps))
    return lab.measure(scene, _seen(scene, lamps) / 1e30, scale=1e30, seeds=8)


def _needle(lab: Lab) -> Outcome:
    """All photons arrive in one point of the floor, with k nearest, too: what arrives is the spot's power."""
    spot = SpotLight("spot", (0, 1, 0), (0, -1, 0), (1.0,) * 3, 1e-4, 1e-4)
    scene = open_floor((spot,))
    found = []
    for lookup in ("radius", "nearest"):
        made = lab.renderer(scene, estimate__lookup=lookup, render__method="global map")
        finite = bool(np.isfinite(lab.frame(made).planes).all())
        found.append(finite)
    assert made.light.photons is not None
    energy = made.light.photons.energy
    return Outcome(float(energy[1] / energy[0]), 0.01, 0.5, samples=4000, finite=all(found))


def _past(lab: Lab) -> Outcome:
    spot = SpotLight("spot", (0, 1, 0), (0, 1, 0), (1.0,) * 3, 20.0, 10.0)
    return lab.measure(open_floor((spot,)), 0.0, seeds=2)


def _small_caustics(lab: Lab) -> Outcome:
    """q = 0.005 with projection maps around a small mirror ball: photons of caustics after a diffuse bounce weigh some
    8,000 times those straight from the light (16 bits of a photon hold 131,072 units). All of them have the same
    luminance: that of the lights' covered power over the trajectories that fill the global map."""
    scene = open_floor((point(),), (Shape("ball", Sphere((0.0, 0.3, 0.0), 0.1), 1),), materials=(MIRROR,))
    values: dict[str, Any] = {"photons__q": 0.005, "photons__projection": "on", "render__method": "caustic map"}
    made = lab.renderer(scene, photons__N=4_000_000, **values)
    photons, projection = made.light.photons, made.light.tracer.projection
    assert photons is not None
    assert projection is not None
    named = unpack(photons.caustic, photons.caustic_unit)
    power = named["Phi"][named["path_class"] == INDIRECT_CAUSTIC].astype(np.float64) @ LUMINANCE
    if not len(power):
        return Outcome(problem="no such photon")
    return Outcome(float(power.mean()) * 20_000 / projection.surface_power, 2.0**-11, 1.0, samples=1000)
