"""Record what Mitsuba 3 shows of principled materials and blends: `python tests/render/mitsuba_materials/record.py`.

Writes expected.json: a ball on a square of the same material under different lights, the mean of each channel of the
picture and its standard error. The principled materials have random parameters. Smooth mirrors and glass are rendered
with a roughness of 0.002: in a blend Mitsuba (3.9.1) adds densities of smooth lobes to those of others, as if one were
the other, and shows the share of either wrong by some percent.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

FILE = Path(__file__).with_name("expected.json")
RUNS, SAMPLES, SIZE = 8, 512, 24
LIGHTS: dict[str, dict[str, Any]] = {
    "constant": {"type": "constant", "radiance": {"type": "rgb", "value": [0.8, 0.9, 1.1]}},
    "point": {"type": "point", "position": [2.0, 3.0, 2.0], "intensity": {"type": "rgb", "value": [30.0, 25.0, 20.0]}},
    "area": {"type": "rectangle", "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [1.5, 1.25, 1.0]}}},
}
DIFFUSE = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.2, 0.5, 0.8]}}
RED = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.8, 0.2, 0.1]}}
MIRROR = {"type": "conductor", "material": "none", "specular_reflectance": {"type": "rgb", "value": [0.9, 0.8, 0.7]}}
METAL = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": 0.3,
         "specular_reflectance": {"type": "rgb", "value": [0.9, 0.8, 0.7]}}  # fmt: skip
GLASS = {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0}


def blend(weight: float, first: dict[str, Any], second: dict[str, Any]) -> dict[str, Any]:
    """`weight` is the second's share."""
    return {"type": "blendbsdf", "weight": weight, "first": first, "second": second}


BLENDS: dict[str, dict[str, Any]] = {
    "diffuse and mirror": blend(0.3, DIFFUSE, MIRROR),
    "diffuse and glass": blend(0.7, DIFFUSE, GLASS),
    "rough metal and diffuse": blend(0.7, METAL, DIFFUSE),
    "nested": blend(0.4, blend(0.25, DIFFUSE, RED), blend(0.5, METAL, GLASS)),
}
PLAIN, CLEAR = 6, 2


def main() -> None:
    """Render every material under every light."""
    mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    random = np.random.default_rng(5)
    materials = {f"principled {i}": drawn(random, clear=i >= PLAIN) for i in range(PLAIN + CLEAR)} | BLENDS
    rows = []
    for index, (name, material) in enumerate(materials.items()):
        # No path finds a point behind something smooth.
        for light in ("constant", "point" if index % 2 and name not in BLENDS else "area"):
            mean, error = record(rough(material), light)
            rows.append(
                {"name": f"{name}, {light}", "light": light, "material": material, "mean": mean, "error": error}
            )
    lines = ",\n".join(f"  {json.dumps(row)}" for row in rows)
    made = f"Mitsuba {mi.__version__}, scalar_rgb, {RUNS} runs of {SAMPLES} samples a pixel, seeds from 1"
    FILE.write_text(f'{{\n "made": "{made}",\n "scenes": [\n{lines}\n ]\n}}\n', "utf-8")


def rough(material: dict[str, Any]) -> dict[str, Any]:
    """The material with everything smooth a little rough."""
    kinds = {"conductor": "roughconductor", "dielectric": "roughdielectric"}
    changed = {key: rough(value) if isinstance(value, dict) else value for key, value in material.items()}
    if changed["type"] in kinds:
        changed |= {"type": kinds[changed["type"]], "distribution": "ggx", "alpha": 0.002}
    return changed


def drawn(random: np.random.Generator, clear: bool) -> dict[str, Any]:
    """A principled material of random parameters, the last ones clear."""
    names = ["roughness", "metallic", "specular", "spec_tint", "anisotropic", "sheen", "sheen_tint", "flatness"]
    values: dict[str, Any] = {name: round(float(random.random()), 3) for name in [*names, "clearcoat"]}
    values["roughness"] = round(0.15 + 0.85 * values["roughness"], 3)
    values["clearcoat_gloss"] = 0.2
    if clear:
        values["spec_trans"], values["metallic"] = round(float(random.random()), 3), 0.1
    base = [round(float(x), 3) for x in random.random(3)]
    return {"type": "principled", "base_color": {"type": "rgb", "value": base}, **values}


def record(material: dict[str, Any], light: str) -> tuple[list[float], list[float]]:
    """Mean and standard error of the channels."""
    T = mi.ScalarTransform4f
    lamp = dict(LIGHTS[light])
    if light == "area":
        lamp["to_world"] = T().translate([0, 3, 0]).rotate([1, 0, 0], 90).scale([3, 3, 1])
        lamp["bsdf"] = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0, 0, 0]}}
    camera = T().look_at(origin=[0, 1.5, 5], target=[0, 0.6, 0], up=[0, 1, 0])
    scene = mi.load_dict(
        {
            "type": "scene",
            "sensor": {
                "type": "perspective",
                "fov": 40.0,
                "near_clip": 1e-3,
                "to_world": camera,
                "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}},
            },
            "ball": {"type": "sphere", "center": [0, 1, 0], "radius": 1.0, "bsdf": material},
            "square": {"type": "rectangle", "to_world": T().rotate([1, 0, 0], -90).scale([3, 3, 1]), "bsdf": material},
            "light": lamp,
        }
    )
    integrator = mi.load_dict({"type": "path", "max_depth": 33, "rr_depth": 33})
    runs = [
        np.array(mi.render(scene, integrator=integrator, spp=SAMPLES, seed=seed), np.float64)[..., :3].mean((0, 1))
        for seed in range(1, RUNS + 1)
    ]
    error = np.std(runs, axis=0, ddof=1) / RUNS**0.5
    return [float(f"{x:.6g}") for x in np.mean(runs, axis=0)], [float(f"{x:.2g}") for x in error]


if __name__ == "__main__":
    main()
