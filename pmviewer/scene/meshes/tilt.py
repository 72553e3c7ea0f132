"""Shading normals that lean far from mirroring faces, where photons and paths from the eye can't agree.

A mirror's shading normal is bent so that reflections stay above the surface (`pmviewer.kernels.textures.normal_map`).
Which way depends on who looks, and photons look from the light.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.scene.arrays.blends import leaves
from pmviewer.scene.description import Material, Mesh, Scene

LEANING = 30.0
"""Degrees between a vertex normal and its face from which it counts. A sphere of 100 triangles stays below."""
SHARE = 0.2
"""Of a mesh's area, from which a sentence says so."""
_MOST = 100_000
"""Faces that are looked at, spread over the mesh."""
_MIRRORING = ("conductor", "rough conductor", "plastic", "rough plastic", "principled")


def leaning_share(mesh: Mesh) -> float:
    """Share of the area whose vertex normals lean by more than LEANING degrees, 0 to 1; 0 without vertex normals."""
    if mesh.normals is None or not len(mesh.faces):
        return 0.0
    faces = mesh.faces[:: max(1, len(mesh.faces) // _MOST)]
    a, b, c = (mesh.vertices[faces[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    area = np.linalg.norm(across, axis=1)
    cosines = np.abs(np.einsum("fj,fcj->fc", across, mesh.normals[faces]))
    leaning = cosines.min(axis=1) < math.cos(math.radians(LEANING)) * area
    total = float(area.sum())
    return float(area[leaning].sum()) / total if total > 0 else 0.0


def leaning_mirrors(scene: Scene) -> str:
    """A sentence about the mirroring meshes of a scene whose vertex normals lean; "" if there is none."""
    found = [
        shape.name
        for shape in scene.all_shapes
        if isinstance(shape.geometry, Mesh)
        and _mirrors(scene.materials[shape.material])
        and leaning_share(shape.geometry) > SHARE
    ]
    if not found:
        return ""
    names = ", ".join(f"'{name}'" for name in found[:3]) + (f" and {len(found) - 3} more" if len(found) > 3 else "")
    return (
        f"The vertex normals of {names} lean from their faces by more than {LEANING:g}° in many places. Reflections "
        "there are bent to stay above the surface, by the viewer for the picture and by the light for photons, so that "
        "methods differ in the caustics of it. A finer mesh, or one without vertex normals, is exact."
    )


def _mirrors(material: Material) -> bool:
    return any(part.kind in _MIRRORING for part in leaves(material))
