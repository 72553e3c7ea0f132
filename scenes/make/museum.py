"""The museum: sphere flake, glossy cylinder, anisotropic metal vase, glass sphere (Jensen 1996, figure 3)."""

from __future__ import annotations

import numpy as np

from make.document import BLACK, MadeScene, bsdf, cylinder, dielectric, diffuse, disk, mesh, number, rgb, sphere
from make.glasses import spline
from make.mesh import F8, joined, lathe, prism, quad


def _flake(center: F8, radius: float, axis: F8, depth: int) -> list[tuple[F8, float]]:
    """Spheres of Haines' flake: nine children a third as large, six around the waist and three above."""
    spheres = [(center, radius)]
    if depth == 0:
        return spheres
    helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.6 else np.array([0.0, 0.0, 1.0])
    u = np.cross(axis, helper)
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    rings = [(6, 0.0, np.pi / 2), (3, np.pi / 6, np.deg2rad(35.0))]
    for count, start, from_axis in rings:
        for i in range(count):
            angle = start + 2 * np.pi * i / count
            around = np.cos(angle) * u + np.sin(angle) * v
            direction = np.cos(from_axis) * axis + np.sin(from_axis) * around
            spheres += _flake(center + direction * radius * 4 / 3, radius / 3, direction, depth - 1)
    return spheres


def _vase() -> F8:
    return spline(
        [(0.0, 0.0), (0.10, 0.0), (0.115, 0.012), (0.09, 0.03), (0.135, 0.12), (0.165, 0.22), (0.14, 0.33),
         (0.07, 0.43), (0.058, 0.50), (0.085, 0.56)],
        8,
    )  # fmt: skip


def museum() -> MadeScene:
    """A hall of 4 × 2.5 × 4 m with two spherical lights."""
    w, h, d = 4.0, 2.5, 4.0
    flake = _flake(np.array([1.12, 0.87, 1.1]), 0.27, np.array([0.0, 1.0, 0.0]), 2)

    def pedestal(x: float, z: float, half: float, high: float) -> list[tuple[float, float]]:
        return [(x - half, z - half), (x + half, z - half), (x + half, z + half), (x - half, z + half)]

    stands = [((1.12, 1.1), 0.26, 0.6), ((2.95, 1.0), 0.24, 0.62), ((2.35, 1.9), 0.2, 0.42)]
    meshes = {
        "white": joined(
            quad((0, 0, 0), (w, 0, 0), (w, h, 0), (0, h, 0)),
            quad((0, 0, d), (0, h, d), (w, h, d), (w, 0, d)),
            quad((0, h, 0), (w, h, 0), (w, h, d), (0, h, d)),
        ),
        "floor": quad((0, 0, 0), (0, 0, d), (w, 0, d), (w, 0, 0)),
        "red": quad((0, 0, 0), (0, h, 0), (0, h, d), (0, 0, d)),
        "blue": quad((w, 0, d), (w, h, d), (w, h, 0), (w, 0, 0)),
        "stone": joined(*(prism(pedestal(*place, half, high), 0, high) for place, half, high in stands)),
        "vase": lathe([_vase()], 72, with_uv=True),
    }
    brushed = (
        rgb("eta", 0.2, 0.92, 1.1), rgb("k", 3.9, 2.45, 2.14), '<string name="distribution" value="ggx"/>',
        number("alpha_u", 0.08), number("alpha_v", 0.32),
    )  # fmt: skip
    polished = (
        '<string name="material" value="none"/>', '<string name="distribution" value="ggx"/>', number("alpha", 0.05),
        rgb("specular_reflectance", 0.85, 0.82, 0.75),
    )  # fmt: skip
    light = (11.0, 10.0, 8.4)
    return MadeScene(
        "The museum",
        "A sphere flake of 91 spheres with Schlick's model, a glossy cylinder, a vase of brushed copper and a glass "
        "sphere on stands.",
        "All combinations of reflections: caustics of glass and polished metal, colour bleeding, anisotropic gloss.",
        (2.05, 1.45, 3.85),
        (1.95, 0.8, 1.0),
        54,
        [
            diffuse("white", 0.72, 0.7, 0.66),
            diffuse("floor", 0.42, 0.38, 0.33),
            diffuse("red", 0.55, 0.18, 0.12),
            diffuse("blue", 0.16, 0.26, 0.5),
            diffuse("stone", 0.55, 0.53, 0.48),
            bsdf("roughconductor", "copper", *brushed, two_sided=True),
            bsdf("roughconductor", "polished", *polished, two_sided=True),
            bsdf("schlick", "flake", rgb("reflectance", 0.75, 0.6, 0.3), number("alpha", 0.1), two_sided=True),
            dielectric("glass", 1.5),
            BLACK,
        ],
        [
            *(mesh(stem, stem, flat=True) for stem in ("white", "floor", "red", "blue", "stone")),
            mesh("vase", "copper", transform='<translate x="2.95" y="0.62" z="1"/>'),
            cylinder((2.0, 0.0, 0.85), (2.0, 1.25, 0.85), 0.22, "polished"),
            sphere((2.35, 0.6, 1.9), 0.18, "glass"),
            *(sphere(tuple(center.tolist()), radius, "flake") for center, radius in flake),
            sphere((1.1, 2.1, 2.6), 0.1, "black", tuple(6.5 * c for c in light)),
            sphere((3.2, 2.1, 2.2), 0.1, "black", tuple(6.5 * c for c in light)),
            disk((2.0, 1.25, 0.85), 0.22, "polished"),
        ],
        meshes,
        aspect=(384, 288),
        max_depth=32,
    )
