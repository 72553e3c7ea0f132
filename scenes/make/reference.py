"""`python scenes/make/reference.py NAME [--spp N]`: render a scene's reference.exr.

By default it is path-traced by Mitsuba 3 (package `mitsuba`), a program of others. Caustics of small lights can't be
path-traced in reasonable time, and Mitsuba lacks some materials: `--passes N` renders such scenes by pmviewer's own
gather, whose look-up radius shrinks from pass to pass, so that it converges to the same picture.

The file is half float: its rounding, 5e-4 of a pixel at most, is far below the noise. Its attribute `pmviewer.made`
says how it was made and how noisy it is.
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

from pmviewer.output.exr import read_exr, write_exr

CHUNK = 64
"""Samples per pixel at once."""
PHOTONS = 300_000
"""Trajectories of a pass of pmviewer."""
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


def path_traced(path: Path, spp: int, variant: str) -> list[np.ndarray]:
    """Two independent images (h, w, 3) by Mitsuba 3, of half the samples each."""
    import mitsuba as mi

    mi.set_variant(variant)
    scene = mi.load_file(str(path))
    _weigh_lights(mi, scene)
    rounds = max(1, spp // (2 * CHUNK))
    halves = []
    for half in range(2):
        seeds = range(half * rounds, (half + 1) * rounds)
        halves.append(sum(np.array(mi.render(scene, spp=CHUNK, seed=seed), np.float64) for seed in seeds) / rounds)
    return halves


def gathered(path: Path, passes: int) -> list[np.ndarray]:
    """Two independent images (h, w, 3) by pmviewer's gather, of that many passes each."""
    halves = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in (1, 2):
            out = Path(folder) / f"{seed}.exr"
            command = [sys.executable, "-m", "pmviewer", "render", str(path), "-o", str(out), "--passes", str(passes)]
            for setting in ("render.method=gather", f"render.seed={seed}", f"photons.N={PHOTONS}"):
                command += ["--set", setting]
            subprocess.run(command, check=True)
            halves.append(read_exr(out)[0][""][..., :3].astype(np.float64))
    return halves


def main() -> None:
    """Render and write, and say how noisy the result is: the relMSE that the halves' difference amounts to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="+", help="scenes")
    parser.add_argument("--spp", type=int, default=4096, help="samples per pixel, rounded to a multiple of 128")
    parser.add_argument("--variant", default="llvm_ad_rgb", help="Mitsuba's; scalar_rgb needs no LLVM but is slower")
    parser.add_argument("--passes", type=int, help="render by pmviewer's gather instead, twice this many passes")
    arguments = parser.parse_args()
    for name in arguments.names:
        folder = Path(__file__).resolve().parents[1] / name
        if arguments.passes:
            a, b = gathered(folder / "scene.xml", arguments.passes)
            made = f"pmviewer, gather, 2 x {arguments.passes} passes of {PHOTONS} photon trajectories"
        else:
            a, b = path_traced(folder / "scene.xml", arguments.spp, arguments.variant)
            made = f"Mitsuba 3, path, {max(1, arguments.spp // (2 * CHUNK)) * 2 * CHUNK} samples per pixel"
        mean = (a + b) / 2
        noise = float((((a - b) / 2) ** 2 / (mean**2 + 0.01)).mean())
        made += f"; noise relMSE {noise:.1e}"
        write_exr(folder / "reference.exr", {"": mean.astype(np.float32)}, {"made": made}, half=True)
        print(f"{name}: {made}, {(folder / 'reference.exr').stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
