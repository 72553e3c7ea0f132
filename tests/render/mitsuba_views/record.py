"""Render the scenes of this folder with Mitsuba 3 and record block means with their standard errors.

python -m tests.render.mitsuba_views.record [NAME …]: those, or all; the others stay as they are.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from tests.render.mitsuba_views.scenes import VIEWS, for_mitsuba

RUNS, SAMPLES, BLOCK = 8, 1024, 8


def main() -> None:
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    path = Path(__file__).with_name("expected.json")
    recorded = json.loads(path.read_text("utf-8"))["scenes"] if sys.argv[1:] else {}
    for name in sys.argv[1:] or VIEWS:
        scene = mi.load_dict(for_mitsuba(name, mi))
        rows = []
        for seed in range(RUNS):
            image = np.array(mi.render(scene, spp=SAMPLES, seed=seed))[..., :3]
            h, w, _ = image.shape
            rows.append(image.reshape(h // BLOCK, BLOCK, w // BLOCK, BLOCK, 3).mean(axis=(1, 3)).reshape(-1))
        mean, error = np.mean(rows, axis=0), np.std(rows, axis=0, ddof=1) / np.sqrt(RUNS)
        recorded[name] = {
            "mean": [float(f"{x:.6g}") for x in mean],
            "error": [float(f"{x:.3g}") for x in error],
        }
        print(name, mean.mean(), (error / mean).max())
    about = f"Mitsuba {mi.__version__}, volpath, {SAMPLES} samples a pixel, {RUNS} runs"
    out = {"made": about, "runs": RUNS, "block": BLOCK, "scenes": recorded}
    path.write_text(json.dumps(out) + "\n", "utf-8")


if __name__ == "__main__":
    main()
