"""Record what Mitsuba 3's `principled` says: `python tests/kernels/principled/record.py`.

Writes expected.json: materials of random parameters (every fourth with refraction, the first ones with one parameter
each), and of each the values f and densities of Mitsuba's own `eval` and of pairs of directions, in the frame of the
surface with the tangent along x. A value is that for radiance over the cosine; densities are not recorded, for they are
a matter of the sampler.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

FILE = Path(__file__).with_name("expected.json")
SINGLE: list[dict[str, Any]] = [
    {"roughness": 0.5},
    {"roughness": 0.9, "specular": 0.0},
    {"roughness": 0.3, "metallic": 1.0},
    {"roughness": 0.4, "metallic": 0.6, "anisotropic": 0.8},
    {"roughness": 0.5, "specular": 0.9, "spec_tint": 1.0},
    {"roughness": 0.7, "sheen": 1.0, "sheen_tint": 0.6},
    {"roughness": 0.8, "flatness": 0.7},
    {"roughness": 0.6, "clearcoat": 1.0, "clearcoat_gloss": 0.2},
    {"roughness": 0.4, "spec_trans": 1.0},
    {"roughness": 0.4, "eta": 0.8, "spec_tint": 0.5, "metallic": 0.2, "clearcoat": 0.5},
]
RANDOM, PAIRS = 14, 12


def main() -> None:
    """Make materials and directions by a fixed seed, and ask Mitsuba."""
    mi.set_variant("scalar_rgb")
    random = np.random.default_rng(1)
    materials = []
    for index, single in enumerate([*SINGLE, *[None] * RANDOM]):
        base = [round(float(x), 3) for x in random.random(3)]
        values = single if single is not None else drawn(random, index)
        materials.append({"base_color": base, **values, "pairs": pairs(base, values, random)})
    made = f"Mitsuba {mi.__version__}, scalar_rgb"
    lines = ",\n".join(f"  {json.dumps(material)}" for material in materials)
    FILE.write_text(f'{{\n "made": "{made}",\n "materials": [\n{lines}\n ]\n}}\n', "utf-8")


def drawn(random: np.random.Generator, index: int) -> dict[str, float]:
    """Random parameters."""
    names = ["roughness", "metallic", "specular", "spec_tint", "anisotropic", "sheen", "sheen_tint", "flatness"]
    values = {name: round(float(random.random()), 3) for name in [*names, "clearcoat", "clearcoat_gloss"]}
    values["roughness"] = round(0.2 + 0.8 * values["roughness"], 3)
    if index % 4 == 0:
        values["spec_trans"] = round(float(random.random()), 3)
    return values


def pairs(base: list[float], values: dict[str, float], random: np.random.Generator) -> list[list[float]]:
    """Rows of wo, wi and f: directions towards the viewer and the light, half of the latter near the mirror's."""
    bsdf = mi.load_dict({"type": "principled", "base_color": {"type": "rgb", "value": base}, **values})
    transmits = values.get("spec_trans", 0) > 0
    rows = []
    for k in range(PAIRS):
        wo, wi = (v / np.linalg.norm(v) for v in random.normal(size=(2, 3)))
        wo[2] = abs(wo[2]) if not transmits or k % 3 else -abs(wo[2])
        wi[2] = abs(wi[2]) if not transmits else wi[2]
        if k % 2:
            near = wo * [-1, -1, 1] + 0.2 * random.normal(size=3)
            near[2] = abs(near[2]) * np.sign(wo[2])
            wi = near / np.linalg.norm(near)
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(*wo)
        f = np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(*wi))) / abs(wi[2])
        rows.append([float(f"{x:.7g}") for x in (*wo, *wi, *f)])
    return rows


if __name__ == "__main__":
    main()
