"""What is in a scene, in words: for `pmviewer info` and the window's scene panel."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from pmviewer.scene.description import (
    RGB,
    ConstantEnvironment,
    Cylinder,
    Disk,
    Geometry,
    Material,
    Mesh,
    Parallelogram,
    PointLight,
    Scene,
)
from pmviewer.scene.framing import bounds

_LISTED = 8


def area(geometry: Geometry) -> float:
    """Surface area in squared scene units."""
    if isinstance(geometry, Mesh):
        corners = geometry.vertices[geometry.faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return float(np.linalg.norm(cross, axis=1).sum()) / 2
    if isinstance(geometry, Parallelogram):
        return float(np.linalg.norm(np.cross(geometry.edge_u, geometry.edge_v)))
    if isinstance(geometry, Disk):
        return math.pi * geometry.radius**2
    if isinstance(geometry, Cylinder):
        return 2 * math.pi * geometry.radius * math.dist(geometry.p0, geometry.p1)
    return 4 * math.pi * geometry.radius**2


def describe(scene: Scene) -> list[tuple[str, str]]:
    """Label and text of every line worth showing; warnings and dropped things come last, one line each."""
    low, high = bounds(scene.shapes)
    size, radius = high - low, float(np.linalg.norm(high - low)) / 2
    rows = [("scene", scene.name)]
    if scene.path is not None:
        rows.append(("file", str(scene.path)))
    rows += [
        ("surfaces", _surfaces(scene)),
        ("bounds", f"{_numbers(low)} to {_numbers(high)}, size {' × '.join(f'{s:.4g}' for s in size)}"),
        ("materials", _materials(scene)),
        *_lights(scene, radius),
        ("camera", _camera(scene)),
        ("image", f"{scene.width} × {scene.height} pixels"),
    ]
    rows += [("left out", f"{count:,} × {reason}") for reason, count in scene.dropped.items()]
    rows += [("warning", warning) for warning in scene.warnings]
    return rows


def description_text(scene: Scene) -> str:
    """The rows of `describe` as aligned lines."""
    rows = describe(scene)
    width = max(len(label) for label, _ in rows)
    return "\n".join(f"{label:<{width}}  {text}" for label, text in rows)


def _numbers(values: np.ndarray | tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{v:.4g}" for v in values) + ")"


def _plural(count: int, noun: str) -> str:
    return f"{count:,} {noun}" + ("" if count == 1 else "s")


def _surfaces(scene: Scene) -> str:
    triangles = sum(len(s.geometry.faces) for s in scene.shapes if isinstance(s.geometry, Mesh))
    meshes = sum(isinstance(s.geometry, Mesh) for s in scene.shapes)
    smooth = sum(isinstance(s.geometry, Mesh) and s.geometry.normals is not None for s in scene.shapes)
    parts = []
    if meshes:
        shading = f", {smooth} smooth" if smooth else ""
        where = "1 mesh" if meshes == 1 else f"{meshes} meshes"
        parts.append(f"{_plural(triangles, 'triangle')} in {where}{shading}")
    kinds = Counter(type(s.geometry).__name__.lower() for s in scene.shapes if not isinstance(s.geometry, Mesh))
    parts += [_plural(count, kind) for kind, count in sorted(kinds.items())]
    return ", ".join(parts)


def _materials(scene: Scene) -> str:
    used = [scene.materials[i] for i in sorted({s.material for s in scene.shapes})]
    groups: dict[str, list[Material]] = {}
    for material in used:
        groups.setdefault(material.kind, []).append(material)
    texts = []
    for kind, members in groups.items():
        names = ", ".join(m.name for m in members[:_LISTED]) + (" …" if len(members) > _LISTED else "")
        texts.append(f"{len(members)} {kind} ({names})")
    return ", ".join(texts)


def _lights(scene: Scene, radius: float) -> list[tuple[str, str]]:
    """One row a light up to a few, then a sum. Powers are watts per RGB channel."""
    lights: list[tuple[str, np.ndarray]] = []
    for shape in scene.shapes:
        if shape.radiance is not None:
            lights.append((f"area light '{shape.name}'", _power(shape.radiance, math.pi * area(shape.geometry))))
    for light in scene.lights:
        if isinstance(light, PointLight):
            lights.append((f"point light '{light.name}'", _power(light.intensity, 4 * math.pi)))
        elif isinstance(light, ConstantEnvironment):
            through_bounds = 4 * math.pi**2 * radius**2
            lights.append((f"constant environment '{light.name}'", _power(light.radiance, through_bounds)))
    rows = [("light", f"{name}, {_numbers(power)} W") for name, power in lights[:_LISTED]]
    if len(lights) > _LISTED:
        total = sum(power for _, power in lights)
        rows.append(("light", f"… {_plural(len(lights), 'light')} in all, {_numbers(np.asarray(total))} W"))
    return rows


def _power(emitted: RGB, factor: float) -> np.ndarray:
    return np.array(emitted) * factor


def _camera(scene: Scene) -> str:
    c = scene.camera
    mirrored = ", mirrored" if c.mirrored else ""
    return f"at {_numbers(c.origin)} looking at {_numbers(c.target)}, fov {c.fov:.4g}° ({c.fov_axis}){mirrored}"
