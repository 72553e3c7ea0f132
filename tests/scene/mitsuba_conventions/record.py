"""Record what Mitsuba 3 shows of the scenes in this folder: `python tests/scene/mitsuba_conventions/record.py`.

Writes expected.json: of each scene the means over 8 × 8 pixels and channels, and their standard errors, of RUNS
independent images. Lights whose own samples Mitsuba contradicts (docs/scenes.md) are rendered by BSDF samples alone,
which is all that such a scene of one reflection needs.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

FOLDER = Path(__file__).parent
RUNS, SAMPLES, BLOCK = 16, 256, 8
BY_BSDF = ("mirrored_cylinder_light", "smooth_mesh_light", "smooth_mesh_light_inside_out")


def main() -> None:
    """Render every scene; mean and error are listed row by row."""
    mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    scenes = {path.stem: record(path) for path in sorted(FOLDER.glob("*.xml"))}
    made = f"Mitsuba {mi.__version__}, scalar_rgb, {RUNS} runs of {SAMPLES} samples a pixel, seeds from 1"
    lines = [f'  "{name}": {json.dumps(scene)}' for name, scene in scenes.items()]
    head = f'{{\n "made": "{made}",\n "runs": {RUNS},\n "block": {BLOCK},\n "scenes": {{\n'
    (FOLDER / "expected.json").write_text(head + ",\n".join(lines) + "\n }\n}\n")


def record(path: Path) -> dict[str, Any]:
    """Integrator, block means and their standard errors of one scene."""
    by_bsdf = path.stem in BY_BSDF
    description = {"type": "direct", "emitter_samples": 0, "bsdf_samples": 1} if by_bsdf else {"type": "path"}
    integrator = mi.load_dict(description | ({} if by_bsdf else {"max_depth": -1, "rr_depth": 12}))
    mi.file_resolver().prepend(str(FOLDER))
    scene = mi.load_string(with_true_normals(path.read_text("utf-8")))
    runs = []
    for seed in range(1, RUNS + 1):
        image = np.array(mi.render(scene, integrator=integrator, spp=SAMPLES, seed=seed), np.float64)[..., :3]
        h, w, _ = image.shape
        runs.append(image.reshape(h // BLOCK, BLOCK, w // BLOCK, BLOCK, 3).mean(axis=(1, 3, 4)).reshape(-1))
    error = np.std(runs, axis=0, ddof=1) / RUNS**0.5
    mean = np.mean(runs, axis=0)
    return {
        "integrator": description["type"],
        "mean": [float(f"{x:.6g}") for x in mean],
        "error": [float(f"{x:.3g}") for x in error],
    }


def with_true_normals(text: str) -> str:
    """The scene with each <rotate> as the matrix that Mitsuba makes of it: for an axis that is not of unit length
    Mitsuba would turn normals by that matrix too, instead of its inverse's transpose."""

    def matrix(match: re.Match[str]) -> str:
        attributes = dict(re.findall(r'(\w+)="([^"]*)"', match[1]))
        axis = [float(attributes.get(c, "0")) for c in "xyz"]
        m = np.array(mi.ScalarTransform4f().rotate(axis, float(attributes["angle"])).matrix)
        return '<matrix value="' + " ".join(f"{x:.9g}" for x in m.reshape(-1)) + '"/>'

    return re.sub(r"<rotate ([^>]*)/>", matrix, text)


if __name__ == "__main__":
    main()
