"""`python scenes/make/reference.py NAME… [--by mitsuba|path|gather]`: render a scene's reference.exr.

By default it is path-traced by Mitsuba 3 (package `mitsuba`), a program of others. What Mitsuba lacks is path-traced by
pmviewer (`--by path`), where paths find the light. Caustics of small lights can't be path-traced in reasonable time:
`--by gather` renders such scenes by pmviewer's final gather with look-ups a tenth as wide as the automatic ones, a
third of a pixel: what they blur is less than the noise.

The file is half float: its rounding, 5e-4 of a pixel at most, is far below the noise. Its attributes say how it was
made: `pmviewer.made` in words, `pmviewer.command`, `pmviewer.seeds`, `pmviewer.samples` (per pixel, or passes), and
`pmviewer.noise`, the relMSE that the difference of two independent halves amounts to.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.exr import read_exr, write_exr
from pmviewer.settings.access import Settings, with_values

CHUNK = 64
"""Samples per pixel at once."""
NARROW = 0.1
"""Look-up radius in units of the automatic one."""
MANY = 8
"""With more lights than this, they are no longer chosen evenly."""


def _weigh_lights(mi: ModuleType, scene: Any) -> None:
    """Choose lights by power over squared distance from what the middle of the picture shows, and a tenth evenly.

    The image's expectation doesn't change; its noise falls much where most of the lights are out of sight.
    """
    ray, _ = scene.sensors()[0].sample_ray(0.0, 0.5, (0.5, 0.5), (0.5, 0.5))
    seen = np.array(scene.ray_intersect(mi.Ray3f(ray)).p, np.float64).reshape(3)
    lights = [shape for shape in scene.shapes() if shape.is_emitter()]
    if len(lights) <= MANY or len(lights) != len(scene.emitters()):
        return
    values = []
    for shape in lights:
        radiance = np.array(mi.traverse(shape.emitter())["radiance.value"], np.float64).mean()
        away = np.array(shape.bbox().center(), np.float64).reshape(3) - seen
        values.append(radiance * float(np.array(shape.surface_area()).item()) / (away @ away + 1))
    for shape, value in zip(lights, values, strict=True):
        parameters = mi.traverse(shape.emitter())
        parameters["sampling_weight"] = float(0.9 * value / sum(values) + 0.1 / len(values))
        parameters.update()
    # The scene draws up its table of lights only when it is told of a change.
    scene.parameters_changed()


def by_mitsuba(path: Path, spp: int, variant: str) -> tuple[list[np.ndarray], dict[str, str]]:
    """Two independent images (h, w, 3) by Mitsuba 3, of half the samples each, and what to say of them."""
    import mitsuba as mi

    mi.set_variant(variant)
    scene = mi.load_file(str(path))
    _weigh_lights(mi, scene)
    rounds = max(1, spp // (2 * CHUNK))
    halves = []
    for half in range(2):
        seeds = range(half * rounds, (half + 1) * rounds)
        halves.append(sum(np.array(mi.render(scene, spp=CHUNK, seed=seed), np.float64) for seed in seeds) / rounds)
    integrator = "volpath" if "Volumetric" in str(scene.integrator()) else "path"
    made = f"Mitsuba 3 ({mi.__version__}, {variant}), {integrator}, {2 * rounds * CHUNK} samples per pixel"
    return halves, {"made": made, "seeds": f"0 to {2 * rounds - 1}", "samples": str(2 * rounds * CHUNK)}


def by_pmviewer(path: Path, how: argparse.Namespace) -> tuple[list[np.ndarray], dict[str, str]]:
    """The same by pmviewer's path tracer or final gather, of `how.samples` passes in all."""
    method, passes = how.by, how.samples
    settings = [f"render.method={method}"]
    made = f"pmviewer, path, {2 * (passes // 2)} samples per pixel"
    if method == "gather":
        radius = _automatic_radius(path) * NARROW
        settings += [f"photons.N={how.photons}", f"photons.q={how.q}", f"estimate.radius={radius:.4g}"]
        settings += ["estimate.alpha=1", f"estimate.caustic_radius={how.caustic_radius}"]
        made = f"pmviewer, gather, {2 * (passes // 2)} passes of {how.photons} trajectories, radius {NARROW} x auto"
    halves = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in (1, 2):
            out = Path(folder) / f"{seed}.exr"
            command = [sys.executable, "-m", "pmviewer", "render", str(path), "-o", str(out)]
            command += ["--passes", str(passes // 2)]
            for setting in (*settings, f"render.seed={seed}"):
                command += ["--set", setting]
            subprocess.run(command, check=True)
            halves.append(read_exr(out)[0][""][..., :3].astype(np.float64))
    return halves, {"made": made, "seeds": "1, 2", "samples": str(2 * (passes // 2))}


def _automatic_radius(path: Path) -> float:
    """Of look-ups in the first pass of a gather, relative to the scene."""
    opened = open_scene(str(path), {})
    pool = WorkPool(1)
    settings = with_values(Settings(), {"render.method": "gather"})
    radius = Renderer(opened, settings, pool, StageStore(0)).first_radius / opened.flat.radius
    pool.close()
    return radius


def main() -> None:
    """Render and write, and say how noisy the result is."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="+", help="scenes")
    parser.add_argument("--by", choices=("mitsuba", "path", "gather"), default="mitsuba")
    parser.add_argument("--samples", type=int, default=4096, help="per pixel (Mitsuba: a multiple of 128), or passes")
    parser.add_argument("--photons", type=int, default=250_000, help="trajectories of a pass of the gather")
    parser.add_argument("--q", type=float, default=0.2, help="share of them that fills the global map")
    parser.add_argument("--caustic-radius", type=float, default=1.0, help="in units of the gather's radius")
    parser.add_argument("--variant", default="llvm_ad_rgb", help="Mitsuba's; scalar_rgb needs no LLVM but is slower")
    arguments = parser.parse_args()
    for name in arguments.names:
        folder = Path(__file__).resolve().parents[1] / name
        if arguments.by == "mitsuba":
            (a, b), said = by_mitsuba(folder / "scene.xml", arguments.samples, arguments.variant)
        else:
            (a, b), said = by_pmviewer(folder / "scene.xml", arguments)
        mean = (a + b) / 2
        noise = float((((a - b) / 2) ** 2 / (mean**2 + 0.01)).mean())
        command = f"python scenes/make/reference.py {name} --by {arguments.by} --samples {arguments.samples}"
        if arguments.by == "gather":
            how = f"--photons {arguments.photons} --q {arguments.q} --caustic-radius {arguments.caustic_radius}"
            command += f" {how}"
        said |= {"command": command, "noise": f"{noise:.2e}"}
        write_exr(folder / "reference.exr", {"": mean.astype(np.float32)}, said, half=True)
        print(f"{name}: {said['made']}; noise {noise:.1e}, {(folder / 'reference.exr').stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
