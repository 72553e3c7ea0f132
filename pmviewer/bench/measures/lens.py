"""Thin lens and reconstruction filters: the circle of confusion against its formula, pictures against Mitsuba 3.

A small disc of light out of focus, alone in the picture, is spread over a disc of the circle of confusion's radius: the
second moment of its picture is r²/2 for the circle, ρ²/2 for the disc itself and 1/6 for the pixels' box.

The same files go through Mitsuba 3 (`pmviewer.bench.peer`), block by block as in `pmviewer.bench.measures.mitsuba`: a
lens focused in front and behind, and each filter. Its film has samples beyond the picture's border, as ours does.
Filters are compared in blocks of two pixels, which tell each from the others; larger ones average them away.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench import peer
from pmviewer.bench.measures.mitsuba import SIGNIFICANCE, Case, compare
from pmviewer.bench.report import BenchResult, Cell, Target
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.render.planes import PLANES
from pmviewer.scene.description import Camera, Disk, Material, Scene, Shape
from pmviewer.settings.access import Settings, with_values

FOV, SIZE = 30.0, 160
SPOT = 2.0
"""Radius of the disc of light in pixels."""
MOST_ERROR = 1.0
"""Percent of the circle's radius."""
PASSES, QUICK_PASSES = 512, 128
COLUMNS = ("what", "case", "radius or runs", "measured or ratio", "expected", "error % or p")


@dataclass(frozen=True)
class Blur:
    """A disc of light at the distance `depth`, a lens of that `aperture` with `focus`; all in scene units."""

    name: str
    depth: float
    aperture: float
    focus: float
    orthographic: bool = False

    @property
    def pixel(self) -> float:
        """Width of a pixel at the disc."""
        return 2 * math.tan(math.radians(FOV) / 2) * (1 if self.orthographic else self.depth) / SIZE

    @property
    def radius(self) -> float:
        """Of the circle of confusion in pixels: what the lens, seen from the disc through the plane in focus, covers
        there."""
        return self.aperture * abs(1 - self.depth / self.focus) / self.pixel


BLURS = (
    Blur("behind the focus", 6.0, 0.12, 3.0),
    Blur("before the focus", 2.0, 0.1, 8.0),
    Blur("focus at infinity", 4.0, 0.2, 1e12),
    Blur("little blur", 5.0, 0.06, 3.5),
    Blur("telecentric", 3.0, 0.05, 1.5, True),
)
LENSES = {"lens, focus in front": (0.1, 2.6), "lens, focus behind": (0.15, 7.0)}
"""Aperture and distance in focus."""
FILTERS = {
    "box": '<rfilter type="box"/>',
    "tent": '<rfilter type="tent"/>',
    "Gaussian": '<rfilter type="gaussian"/>',
    "Gaussian of 0.8": '<rfilter type="gaussian"><float name="stddev" value="0.8"/></rfilter>',
    "Mitchell-Netravali": '<rfilter type="mitchell"/>',
    "Catmull-Rom": '<rfilter type="catmullrom"/>',
    "Lanczos": '<rfilter type="lanczos"/>',
}


def confused(blur: Blur, passes: int, pool: WorkPool) -> float:
    """The radius of the circle of confusion, in pixels, that a film shows."""
    spot = Disk((0.0, 0.0, -blur.depth), (0.0, 0.0, 1.0), SPOT * blur.pixel)
    camera = Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), FOV, aperture=blur.aperture, focus=blur.focus,
                    projection="orthographic" if blur.orthographic else "perspective",
                    width=2 * math.tan(math.radians(FOV) / 2))  # fmt: skip
    black = Material("black", "diffuse", (0.0, 0.0, 0.0))
    scene = Scene(blur.name, None, (Shape("spot", spot, 0, (1.0,) * 3),), (black,), (), camera, SIZE, SIZE)
    settings = with_values(Settings(), {"photons.N": 100, "render.method": "progressive"})
    renderer = Renderer(open_scene(scene), settings, pool, StageStore(0))
    for _ in range(passes):
        renderer.step()
    return radius_of(renderer.film.planes()[..., PLANES["emission"]].mean(axis=2))


def radius_of(image: NDArray[np.floating]) -> float:
    """The radius of the circle of confusion by the second moment of the picture (h, w) of the disc of light."""
    light = np.asarray(image, float)
    y, x = (axis + 0.5 for axis in np.indices(light.shape))
    total = light.sum()
    mean_x, mean_y = (light * x).sum() / total, (light * y).sum() / total
    moment = (light * ((x - mean_x) ** 2 + (y - mean_y) ** 2)).sum() / total
    return math.sqrt(max(2 * (moment - SPOT**2 / 2 - 1 / 6), 0.0))


def scene_file(sensor: str, rfilter: str) -> str:
    """Balls at several distances on a floor before a wall, with a chequered texture for filters to show."""
    balls = "".join(
        f'<shape type="sphere"><point name="center" value="{x} 0.4 {z}"/><float name="radius" value="0.4"/>'
        f'<bsdf type="diffuse"><rgb name="reflectance" value="{colour}"/></bsdf></shape>'
        for x, z, colour in ((-0.8, 1.4, "0.7 0.3 0.1"), (0.0, 0.0, "0.2 0.6 0.3"), (0.9, -1.6, "0.2 0.3 0.7"))
    )
    checks = (
        '<bsdf type="twosided"><bsdf type="diffuse"><texture name="reflectance" type="checkerboard">'
        '<rgb name="color0" value="0.7"/><rgb name="color1" value="0.1"/>'
        '<transform name="to_uv"><scale x="6" y="6"/></transform></texture></bsdf></bsdf>'
    )
    return f"""<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="-1"/><integer name="rr_depth" value="8"/></integrator>
  <sensor {sensor}
    <float name="fov" value="36"/>
    <transform name="to_world"><lookat origin="0, 1.1, 4.4" target="0, 0.5, 0" up="0, 1, 0"/></transform>
    <sampler type="independent"/>
    <film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="64"/>{rfilter}</film>
  </sensor>
  <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform>{checks}
  </shape>
  <shape type="rectangle"><transform name="to_world"><scale value="3"/><translate z="-3"/></transform>
    <bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>
  {balls}
  <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><translate y="3" z="1"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
    <emitter type="area"><rgb name="radiance" value="7 6.5 6"/></emitter></shape>
</scene>
"""


STEPPED = 0.03
"""Share of a block by which Mitsuba's scalar variants may be off with other filters than the box: they read them from
tables of 32 steps, always at the step's beginning, which makes a Gaussian some 5 % wider."""


def files(folder: Path, quick: bool, stepped: bool) -> Iterator[tuple[Case, tuple[str, ...]]]:
    """Cases by lens and by filter, their files in the folder, with the methods that are compared: where time is
    short none of photons, which compile kernels of their own. `stepped`: filters are in Mitsuba's tables."""
    cases: list[tuple[str, str, int, tuple[str, ...]]] = []
    for name, (aperture, focus) in LENSES.items():
        lens = f'type="thinlens"><float name="aperture_radius" value="{aperture}"/>'
        sensor = f'{lens}<float name="focus_distance" value="{focus}"/>'
        cases.append((name, scene_file(sensor, FILTERS["box"]), 8, ("path", "progressive", "gather")))
    for name, rfilter in FILTERS.items():
        cases.append((f"filter {name}", scene_file('type="perspective">', rfilter), 2, ("path",)))
    of_photons = scene_file('type="perspective">', FILTERS["Mitchell-Netravali"])
    cases.append(("filter Mitchell-Netravali", of_photons, 8, ("progressive", "gather")))
    for i, (name, text, block, methods) in enumerate(cases):
        file = folder / f"{i}.xml"
        file.write_text(text, "utf-8")
        wanted = tuple(method for method in methods if not quick or method == "path")
        if wanted:
            table = stepped and "<rfilter" in text and FILTERS["box"] not in text
            yield Case(name, {}, 128, 16, block, 0.03, file, STEPPED if table else 0.0), wanted


def run(quick: bool = False) -> BenchResult:
    """Measure every blur and compare every file. Raises PmviewerError without Mitsuba."""
    variant, runs = peer.variant(), 8 if quick else 16
    rows: list[list[Cell]] = []
    targets = []
    pool = WorkPool()
    try:
        for blur in BLURS:
            found = confused(blur, QUICK_PASSES if quick else PASSES, pool)
            error = 100 * abs(found / blur.radius - 1)
            rows.append(["circle of confusion", blur.name, blur.radius, found, blur.radius, error])
            note = f"circle of confusion, {blur.name}: {found:.3f} of {blur.radius:.3f} pixels"
            targets.append(Target("R13", error, MOST_ERROR, "%", False, note))
        with tempfile.TemporaryDirectory() as folder:
            for case, methods in files(Path(folder), quick, variant.startswith("scalar")):
                for method, _, tolerance, same, _ in compare(case, methods, runs, pool):
                    what = f"{case.scene}, {method}"
                    rows.append(["against Mitsuba", what, runs, f"{same.ratio:.4f}", 1, same.p_value])
                    within = f" within {tolerance:.0%} of a block" if tolerance else ""
                    note = f"p of {what} and Mitsuba 3 being equal{within}; mean ratio {same.ratio:.4f}"
                    targets.append(Target("R13", same.p_value, SIGNIFICANCE, "", True, note))
    finally:
        pool.close()
    notes = [f"Mitsuba 3, {variant}, path; {runs} independent runs a side of 64 × 64 pixels"]
    return BenchResult("Lens and reconstruction filters (R13)", COLUMNS, rows, targets, notes)
