"""What is in a scene, in words: for `pmviewer info` and the window's scene panel."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from pmviewer.scene.arrays.blends import blend_text
from pmviewer.scene.arrays.instances import joint_bounds
from pmviewer.scene.description import (
    RGB,
    ConstantEnvironment,
    Cylinder,
    DirectionalLight,
    Disk,
    Geometry,
    ImageEnvironment,
    Material,
    Mesh,
    Parallelogram,
    PointLight,
    ProjectorLight,
    Scene,
    Shape,
    SpotLight,
)
from pmviewer.scene.emission import emitted_power

_LISTED = 8
_LIGHT_KINDS = {
    PointLight: "point light",
    SpotLight: "spot light",
    ProjectorLight: "projector",
    DirectionalLight: "directional light",
    ConstantEnvironment: "constant environment",
    ImageEnvironment: "image environment",
}


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
    low, high = joint_bounds(scene.shapes, scene.instances)
    size, radius = high - low, float(np.linalg.norm(high - low)) / 2
    rows = [("scene", scene.name)]
    if scene.path is not None:
        rows.append(("file", str(scene.path)))
    rows += [
        ("surfaces", _surfaces(scene.shapes) or "none"),
        *_instances(scene),
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


def _elements(shapes: tuple[Shape, ...]) -> int:
    """Triangles and round shapes that are stored for these."""
    counts = {Mesh: lambda g: len(g.faces), Parallelogram: lambda g: 2}
    return sum(counts.get(type(s.geometry), lambda g: 1)(s.geometry) for s in shapes)


def _instances(scene: Scene) -> list[tuple[str, str]]:
    if not scene.instances:
        return []
    in_group = {group: _elements(group.shapes) for group in scene.groups}
    total = _elements(scene.shapes) + sum(in_group[instance.group] for instance in scene.instances)
    stored = _elements(scene.all_shapes)
    groups = "; ".join(f"{group.name}: {_surfaces(group.shapes)}" for group in scene.groups[:_LISTED])
    more = " …" if len(in_group) > _LISTED else ""
    copies = f"{_plural(len(scene.instances), 'copy').replace('copys', 'copies')} of {_plural(len(in_group), 'group')}"
    return [("instances", f"{copies} ({groups}{more})"), ("elements", f"{total:,} to be hit, {stored:,} stored")]


def _surfaces(shapes: tuple[Shape, ...]) -> str:
    triangles = sum(len(s.geometry.faces) for s in shapes if isinstance(s.geometry, Mesh))
    meshes = sum(isinstance(s.geometry, Mesh) for s in shapes)
    smooth = sum(isinstance(s.geometry, Mesh) and s.geometry.normals is not None for s in shapes)
    parts = []
    if meshes:
        shading = f", {smooth} smooth" if smooth else ""
        where = "1 mesh" if meshes == 1 else f"{meshes} meshes"
        parts.append(f"{_plural(triangles, 'triangle')} in {where}{shading}")
    kinds = Counter(type(s.geometry).__name__.lower() for s in shapes if not isinstance(s.geometry, Mesh))
    parts += [_plural(count, kind) for kind, count in sorted(kinds.items())]
    return ", ".join(parts)


def _materials(scene: Scene) -> str:
    used = [scene.materials[i] for i in sorted({s.material for s in scene.all_shapes})]
    groups: dict[str, list[Material]] = {}
    for material in used:
        groups.setdefault(material.kind, []).append(material)
    texts = []
    for kind, members in groups.items():
        names = ", ".join(blend_text(m) if kind == "blend" else m.name for m in members[:_LISTED]) + (
            " …" if len(members) > _LISTED else ""
        )
        texts.append(f"{len(members)} {kind} ({names})")
    passed = [m.name for m in used if m.passable]
    if passed:
        names = ", ".join(passed[:_LISTED]) + (" …" if len(passed) > _LISTED else "")
        texts.append(f"{len(passed)} of them let light pass in part ({names})")
    split = [_glass_text(m) for m in used if m.disperses]
    if split:
        names = ", ".join(split[:_LISTED]) + (" …" if len(split) > _LISTED else "")
        texts.append(f"{len(split)} of them split light into colours ({names})")
    return ", ".join(texts)


def _glass_text(material: Material) -> str:
    """A dispersive glass with its numbers."""
    glass = material.dispersion
    assert glass is not None
    name = f"{material.name}: {glass.name}" if glass.name else material.name
    return f"{name}, n_d {glass.n_d:.4g}, Abbe number {glass.abbe:.3g}"


def _lights(scene: Scene, radius: float) -> list[tuple[str, str]]:
    """One row a light up to a few, then a sum. Powers are watts per RGB channel."""
    lights: list[tuple[str, np.ndarray]] = []
    for shape in scene.shapes:
        if shape.radiance is not None:
            lights.append((f"area light '{shape.name}'", _power(shape.radiance, math.pi * area(shape.geometry))))
    for light in scene.lights:
        lights.append((f"{_LIGHT_KINDS[type(light)]} '{light.name}'", emitted_power(light, radius)))
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
    lens = f"fov {c.fov:.4g}° ({c.fov_axis})"
    if c.projection == "orthographic":
        lens = f"orthographic, {c.width:.4g} wide"
    shift = f", shifted by {_numbers(c.shift)}" if any(c.shift) else ""
    if c.aperture > 0:
        sharp = "" if c.focus is None else f" focused at {c.focus:.4g}"
        lens += f", aperture radius {c.aperture:.4g}{sharp}"
    return f"at {_numbers(c.origin)} looking at {_numbers(c.target)}, {lens}{shift}{mirrored}"
