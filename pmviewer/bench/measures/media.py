"""Participating media: formulas, agreement with Mitsuba 3's `volpath`, and error against time (T9, E7).

Formulas: absorption (Beer and Lambert), also in a density that rises linearly, light that a slab scatters once, and a
white medium under a white sky, which vanishes. Mitsuba renders the same files; they are compared block by block as in
`pmviewer.bench.measures.mitsuba`, and in the mean as the radius shrinks. On the scenes fog_sphere and cornell_smoke
every method's error against the scene's reference is measured over its CPU time, Mitsuba's too: `progressive` by the
beam estimate, by ray marching (point) and by the k nearest photons. Mitsuba's error is measured against a further
picture of its own: on cornell_smoke it converges to another one than the reference (a length that it does not scale
with the scene, docs/media.md). On fog_sphere no path tracer's reference is much better than what is to be measured:
there our error is the product of the differences from two independent ones (`crossed_relmse`), the scene's and
Mitsuba's.
"""

from __future__ import annotations

import math
import struct
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench import peer
from pmviewer.bench.agreement import agreement
from pmviewer.bench.measures.error import PEER, Curve, measure
from pmviewer.bench.measures.mitsuba import SIGNIFICANCE, Case, compare, our_runs
from pmviewer.bench.report import BenchResult, Cell, Target
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.metric import metrics
from pmviewer.scene.description import (
    Camera,
    ConstantEnvironment,
    DirectionalLight,
    Light,
    Material,
    Medium,
    Parallelogram,
    Scene,
    Shape,
    Sphere,
)
from pmviewer.scene.grid import Grid
from pmviewer.settings.access import Settings, with_values

NULL = Material("boundary", "null", (0.0, 0.0, 0.0))
CAMERA = Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), 2.0)
WIDE = 200.0
"""Half the width of slabs: what is seen of them knows no edge."""
BEER, SLAB, FURNACE = 0.1, 1.0, 0.5
"""Percent."""
OVER_TIME = (("fog_sphere", 1e-2, 0.5, True), ("cornell_smoke", 1e-2, 1.0, False))
"""Scene, relMSE to reach, our time over Mitsuba's at most, and whether ours is crossed with Mitsuba's reference."""
METHODS: dict[str, dict[str, object]] = {
    "progressive, beam": {},
    "progressive, point": {"estimate.in_media": "point"},
    "progressive, nearest": {"estimate.in_media": "nearest"},
    "gather": {},
    "path": {},
}
QUICK_METHODS = ("progressive, beam", "path")
"""The default, and the path tracer."""
OWN_SPP, QUICK_OWN_SPP, OWN_SEED = 256, 32, 100_000
"""Samples per pixel of the picture of Mitsuba's that its error is measured against, and the first of its seeds."""
BUDGET, QUICK_BUDGET, PEER_BUDGET = 60.0, 6.0, 2.5
DEPTH = 1000
"""Of all paths, Mitsuba's too: light leaves marble after hundreds of collisions. With 64 for Mitsuba and 32, the
default, for ours the pictures differ by 0.3 %."""
UNCUT: dict[str, object] = {"render.max_depth": DEPTH}
AS_LONG = f"render.max_depth={DEPTH} for both"
SPP, QUICK_SPP = 128, 64
"""Of Mitsuba and of our path tracer, block by block."""
RADII = (0.01, 0.003, 0.001)
"""Of look-ups, relative to the scene: the mean over Mitsuba's comes near 1 as they shrink. Told by the whole bench
alone: less noise than half a percent takes minutes."""
MEAN_RADIUS, MEAN, MEAN_SPP = 0.003, 0.5, 512
"""The radius with which it must be within so many percent, and Mitsuba's samples for it. With the next smaller one the
noise in fog is above that."""
GRID = "uneven.vol"
COLUMNS = ("what", "method", "passes or runs", "CPU s", "measured or ratio", "expected", "error %, relMSE or p")


def slab(medium: Medium, light: Light) -> Scene:
    """The medium between z = −1 and 0, seen from above."""
    bottom = Parallelogram((-WIDE, -WIDE, -1), (0, 2 * WIDE, 0), (2 * WIDE, 0, 0))
    top = Parallelogram((-WIDE, -WIDE, 0), (2 * WIDE, 0, 0), (0, 2 * WIDE, 0))
    shapes = tuple(Shape(name, geometry, 0, media=(0, -1)) for name, geometry in (("bottom", bottom), ("top", top)))
    return Scene("slab", None, shapes, (NULL,), (light,), CAMERA, 32, 32, media=(medium,))


def formulas() -> Iterator[tuple[str, Scene, str, float, float]]:
    """Name, scene, view, its mean by the formula, and the percent by which it may differ."""
    sky = ConstantEnvironment("sky", (1.0, 1.0, 1.0))
    for sigma in (0.3, 3.0):
        ink = Medium("ink", (sigma,) * 3, (0.0,) * 3)
        yield f"absorption, depth {sigma:g}", slab(ink, sky), "beauty", math.exp(-sigma), BEER
    rising = ((np.arange(256).reshape(-1, 1, 1, 1) + 0.5) / 256).astype(np.float32)
    box = np.array([[2 * WIDE, 0, 0, -WIDE], [0, 2 * WIDE, 0, -WIDE], [0, 0, 1, -1], [0, 0, 0, 1.0]])
    for sigma in (1.0, 6.0):
        ink = Medium("ink", (sigma,) * 3, (0.0,) * 3, density=Grid(rising, box))
        yield f"absorption, density rising to {sigma:g}", slab(ink, sky), "beauty", math.exp(-sigma / 2), BEER
    for mu0, tau in ((1.0, 0.2), (0.6, 1.0), (0.3, 5.0)):
        sun = DirectionalLight("sun", (math.sqrt(1 - mu0 * mu0), 0.0, -mu0), (math.pi,) * 3)
        expected = 0.8 / 4 * mu0 / (1 + mu0) * (1 - math.exp(-tau * (1 + 1 / mu0)))
        name = f"single scattering of a slab, depth {tau:g}, sun at {mu0:g}"
        yield name, slab(Medium("slab", (tau,) * 3, (0.8,) * 3), sun), "volume", expected, SLAB
    ball = Shape("ball", Sphere((0.0, 0.0, 0.0), 1.0), 0, media=(0, -1))
    milk, camera = Medium("milk", (1.0,) * 3, (1.0,) * 3), Camera((0, 0, 4), (0, 0, 0), (0, 1, 0), 20.0)
    scene = Scene("furnace", None, (ball,), (NULL,), (sky,), camera, 32, 32, media=(milk,))
    yield "white medium under a white sky", scene, "beauty", 1.0, FURNACE
    milk = Medium("milk", (3.0,) * 3, (1.0,) * 3, density=Grid(uneven(), cube()))
    yield "uneven white medium under a white sky", replace(scene, media=(milk,)), "beauty", 1.0, FURNACE


def cube() -> NDArray[np.float64]:
    """From the unit cube to [−1, 1]³."""
    return np.array([[2, 0, 0, -1], [0, 2, 0, -1], [0, 0, 2, -1], [0, 0, 0, 1.0]])


def uneven() -> NDArray[np.float32]:
    """Densities (16, 16, 16, 1) in 0 … 1, a quarter of them and the border 0."""
    values = np.random.default_rng(2).random((16, 16, 16, 1), np.float32) ** 2
    values[:4] = values[-1] = values[:, 0] = values[:, -1] = values[:, :, 0] = values[:, :, -1] = 0
    return values


def scene_file(inside: str) -> str:
    """A floor under a lamp, and on it a sphere with what is `inside`."""
    return f"""<scene version="3.0.0">
  <integrator type="volpath"><integer name="max_depth" value="{DEPTH}"/>
    <integer name="rr_depth" value="8"/></integrator>
  <medium type="homogeneous" id="fog"><rgb name="sigma_t" value="0.2 0.25 0.3"/><float name="albedo" value="0.9"/>
    <phase type="hg"><float name="g" value="0.3"/></phase></medium>
  <medium type="homogeneous" id="marble"><rgb name="sigma_t" value="0.6 0.7 0.9"/><float name="scale" value="8"/>
    <rgb name="albedo" value="0.98 0.95 0.9"/></medium>
  <medium type="heterogeneous" id="plume"><volume name="sigma_t" type="gridvolume">
    <string name="filename" value="{GRID}"/><transform name="to_world"><translate value="-0.5, -0.5, -0.5"/>
    <rotate y="1" angle="25"/><scale value="1.2"/><translate y="0.75"/></transform></volume>
    <float name="scale" value="12"/><rgb name="albedo" value="0.95 0.9 0.8"/>
    <phase type="hg"><float name="g" value="0.4"/></phase></medium>
  <sensor type="perspective"><float name="fov" value="36"/>
    <transform name="to_world"><lookat origin="0, 1, 4.4" target="0, 0.5, 0" up="0, 1, 0"/></transform>
    <sampler type="independent"/>
    <film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="64"/>
      <rfilter type="box"/></film>
    {'<ref id="fog"/>' if "fog" in inside else ""}</sensor>
  <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform>
    <bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="1.2"/><rotate x="1" angle="90"/>
    <translate y="3" z="0.5"/></transform><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
    <emitter type="area"><rgb name="radiance" value="7 6.5 6"/></emitter></shape>
  {inside}
</scene>
"""


FILES = {
    "uneven smoke in a sphere": '<shape type="sphere"><point name="center" value="0 0.76 0"/>'
    '<float name="radius" value="0.75"/><bsdf type="null"/><ref name="interior" id="plume"/></shape>',
    "smoke in a cube": '<shape type="cube"><transform name="to_world"><scale value="0.6"/><translate y="0.7"/>'
    '</transform><bsdf type="null"/><ref name="interior" id="marble"/></shape>',
    "fog around a glass sphere": '<shape type="cube"><transform name="to_world"><scale value="6"/></transform>'
    '<bsdf type="null"/><ref name="interior" id="fog"/></shape><shape type="sphere"><point name="center" '
    'value="0 0.7 0"/><float name="radius" value="0.6"/><bsdf type="dielectric"/><ref name="exterior" id="fog"/>'
    "</shape>",
    "marble": '<shape type="sphere"><point name="center" value="0 0.7 0"/><float name="radius" value="0.6"/>'
    '<bsdf type="dielectric"><float name="int_ior" value="1.3"/></bsdf><ref name="interior" id="marble"/></shape>',
}


def by_formula(quick: bool, pool: WorkPool) -> Iterator[tuple[list[Cell], Target]]:
    """A row and a target for each formula and method."""
    for name, scene, view, expected, most in formulas():
        for method in ("path", "progressive"):
            passes = (64 if quick else 256) if method == "path" else (16 if quick else 64)
            values: dict[str, object] = {"render.method": method, "photons.N": 300_000, **UNCUT}
            values["estimate.radius"] = 0.05 if view == "beauty" else 2e-4
            renderer = Renderer(open_scene(scene), with_values(Settings(), values), pool, StageStore(0))
            for _ in range(passes):
                renderer.step()
            found = float(renderer.frame(0).image(view).mean())
            error = 100 * abs(found / expected - 1)
            spent = renderer.tally.cpu_seconds
            note = f"{name}, {method}: {found:.5f} of {expected:.5f}"
            yield [name, method, passes, spent, found, expected, error], Target("T9", error, most, "%", False, note)


def against_mitsuba(quick: bool, pool: WorkPool) -> Iterator[tuple[list[Cell], Target | None]]:
    """A row and a target for each file and method, and of the whole bench a row for each radius."""
    runs = 4 if quick else 16
    with tempfile.TemporaryDirectory() as folder:
        sides = uneven().shape[2::-1]
        head = struct.pack("<3sB5i6f", b"VOL", 3, 1, *sides, 1, 0, 0, 0, 1, 1, 1)
        (Path(folder) / GRID).write_bytes(head + uneven().tobytes())
        for i, (name, inside) in enumerate(FILES.items()):
            file = Path(folder) / f"{i}.xml"
            file.write_text(scene_file(inside), "utf-8")
            methods = ("path", "progressive") if quick else ("path", "progressive", "gather")
            for method, passes, tolerance, same, _ in compare(
                Case(name, {}, QUICK_SPP if quick else SPP, 16, 32, 0.03, file, settings=UNCUT), methods, runs, pool
            ):
                within = f" within {tolerance:.0%} of a block" if tolerance else ""
                note = (
                    f"p of {name}, {method}, and Mitsuba 3 being equal{within}; mean ratio {same.ratio:.4f}; {AS_LONG}"
                )
                row: list[Cell] = [name, method, f"{runs} × {passes}", "", f"{same.ratio:.4f}", 1, same.p_value]
                yield row, Target("T9", same.p_value, SIGNIFICANCE, "", True, note)
            if not quick:
                yield from shrinking(name, file, runs, pool)


def shrinking(name: str, file: Path, runs: int, pool: WorkPool) -> Iterator[tuple[list[Cell], Target | None]]:
    """A row for each radius of `progressive`, with the mean over Mitsuba's, and a target for MEAN_RADIUS."""
    opened, passes = open_scene(str(file)), 16
    theirs = peer.independent_images(file, {}, runs, MEAN_SPP)
    for radius in RADII:
        ours = our_runs(opened, "progressive", passes, runs, pool, {**UNCUT, "estimate.radius": radius})
        same = agreement(ours, theirs, 32)
        text = f"{same.ratio:.4f} ± {same.ratio_error:.4f}"
        note = f"{name}, progressive, estimate.radius={radius:g} {AS_LONG}: mean over Mitsuba 3's, {text}"
        row: list[Cell] = [f"{name}, radius {radius:g}", "progressive", f"{runs} × {passes}", "", text, 1, same.p_value]
        yield row, Target("T9", 100 * abs(same.ratio - 1), MEAN, "%", False, note) if radius == MEAN_RADIUS else None


def against_itself(scene: str, budget: float, converged: NDArray[np.float64], N: int) -> Curve:
    """Mitsuba's curve against an independent picture of its own of N samples. Of n samples the difference has the
    variance V/n + V/N, so that N/(N + n) of it is the error."""
    spp, cpu, images = peer.error_images(scene, budget)
    found = [metrics(image.astype(np.float64), converged) for image in images]
    error = [m.relmse_all * N / (N + n) for m, n in zip(found, spp, strict=True)]
    return Curve(scene, PEER, spp, cpu, error, [m.mean_ratio for m in found])


def over_time(scene: str, goal: float, share: float, crossed: bool, quick: bool) -> tuple[list[list[Cell]], Target]:
    """Error against CPU time, and our best time to the relMSE `goal` over Mitsuba's, `share` at most.

    The path tracer is never `crossed`: so noisy a picture in the denominator makes the product too small.
    """
    budget, N = (QUICK_BUDGET, QUICK_OWN_SPP) if quick else (BUDGET, OWN_SPP)
    converged = peer.independent_images(scene, {}, 1, N, OWN_SEED).astype(np.float64)[0]
    other = converged if crossed else None
    curves = []
    for name in QUICK_METHODS if quick else METHODS:
        values = METHODS[name]
        method = name.partition(",")[0]
        second = None if method == "path" else other
        curves.append(replace(measure(open_scene(scene), method, budget, values=values, other=second), method=name))
    peer_budget = PEER_BUDGET * budget
    theirs = against_itself(scene, peer_budget, converged, N)
    rows: list[list[Cell]] = []
    for curve in (*curves, theirs):
        name = "Mitsuba 3 volpath" if curve is theirs else curve.method
        for n, cpu, error, ratio in zip(curve.passes, curve.cpu, curve.error, curve.ratio, strict=True):
            rows.append([f"{scene} over time", name, n, cpu, f"{ratio:.4f}", 1, error])
    best: Curve = min(curves, key=lambda curve: curve.time_to(goal))
    spent, note = theirs.time_to(goal), f"of Mitsuba 3's time to relMSE {goal:g} on {scene}, by {best.method}"
    note += ", ours against two references" if crossed else ", each against its own converged picture"
    if not math.isfinite(spent):
        spent, note = theirs.cpu[-1], f"{note}; Mitsuba did not reach it within {theirs.cpu[-1]:.3g} CPU s"
    ratio = best.time_to(goal) / spent
    return rows, Target("P22", ratio if np.isfinite(ratio) else math.inf, share, "", False, note)


def run(quick: bool = False) -> BenchResult:
    """Measure all three parts. Raises PmviewerError without Mitsuba."""
    variant = peer.variant()
    rows: list[list[Cell]] = []
    targets: list[Target] = []
    pool = WorkPool()
    try:
        for row, target in (*by_formula(quick, pool), *against_mitsuba(quick, pool)):
            rows.append(row)
            targets += [target] if target is not None else []
    finally:
        pool.close()
    for scene, goal, share, crossed in OVER_TIME:
        more, speed = over_time(scene, goal, share, crossed, quick)
        rows += more
        targets.append(speed)
    notes = [
        "cornell_smoke: the reference is our path tracer's; Mitsuba's pictures are 5 to 7 % darker, how much depends "
        f"on the unit of length (see docs/media.md), and measured against a picture of its own of {OWN_SPP} "
        f"samples ({QUICK_OWN_SPP} if quick), less that one's noise",
        f"Mitsuba 3, {variant}, volpath",
    ]
    return BenchResult("Participating media (T9, E7)", COLUMNS, rows, targets, notes)
