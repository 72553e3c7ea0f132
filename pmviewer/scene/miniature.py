"""A scene's stand-in with a handful of shapes, for which the same kernels are compiled as for the scene.

What a kernel is compiled for follows from which kinds of shapes, materials, lights and textures a scene has, not from
how many. The stand-in has two of everything that differs: it is quick to hand to another process and to build.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import (
    Group,
    ImageEnvironment,
    Instance,
    Light,
    Material,
    Medium,
    Mesh,
    ProjectorLight,
    Scene,
    Shape,
)
from pmviewer.scene.grid import Grid
from pmviewer.scene.texture import Bitmap, Texture

FACES = 8
"""Of each mesh."""
TEXELS = 8
"""Of each picture, across and down."""
ALIKE = 2

T = TypeVar("T")


def miniature(scene: Scene) -> Scene:
    """The stand-in: not a picture of the scene."""
    groups = {id(group): Group(group.name, _shapes(group.shapes)) for group in scene.groups}
    shown = _two_each(scene.instances, lambda instance: id(instance.group))
    return replace(
        scene,
        shapes=_shapes(scene.shapes),
        materials=tuple(map(_material, scene.materials)),
        lights=tuple(map(_light, _two_each(scene.lights, type))),
        media=tuple(map(_medium, scene.media)),
        instances=tuple(Instance(each.name, groups[id(each.group)], each.to_world) for each in shown),
        warnings=(),
        dropped={},
    )


def _medium(medium: Medium) -> Medium:
    return replace(
        medium,
        density=_fewer_numbers(medium.density),
        albedo_grid=_fewer_numbers(medium.albedo_grid),
        emission_grid=_fewer_numbers(medium.emission_grid),
    )


def _fewer_numbers(grid: Grid | None) -> Grid | None:
    return grid and replace(grid, values=np.full((2, 2, 2, 1), grid.most, np.float32))


def _two_each(things: Iterable[T], kind: Any) -> list[T]:
    seen: Counter[Any] = Counter()
    kept = []
    for thing in things:
        key = kind(thing)
        seen[key] += 1
        if seen[key] <= ALIKE:
            kept.append(thing)
    return kept


def _shapes(shapes: tuple[Shape, ...]) -> tuple[Shape, ...]:
    return tuple(
        replace(shape, geometry=_fewer(shape.geometry), emission=shape.emission and _coarser(shape.emission))
        for shape in _two_each(shapes, _kind)
    )


def _kind(shape: Shape) -> Any:
    """Shapes alike in this are alike for kernels."""
    g = shape.geometry
    given = (g.normals is None, g.uv is None, g.colours is None) if isinstance(g, Mesh) else ()
    return type(g), given, shape.material, shape.shines, type(shape.emission)


def _fewer(geometry: Any) -> Any:
    if not isinstance(geometry, Mesh) or len(geometry.faces) <= FACES:
        return geometry
    used, faces = np.unique(geometry.faces[:FACES], return_inverse=True)
    at = partial(_rows, used)
    return Mesh(
        geometry.vertices[used],
        faces.reshape(-1, 3).astype(np.int32),
        at(geometry.normals),
        at(geometry.uv),
        at(geometry.colours),
    )


def _rows(used: NDArray[np.signedinteger], values: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    return None if values is None else values[used]


def _coarser(texture: Texture) -> Texture:
    return replace(texture, pixels=_coarse(texture.pixels)) if isinstance(texture, Bitmap) else texture


def _material(material: Material) -> Material:
    textures = {slot: _coarser(texture) for slot, texture in material.textures.items()}
    return replace(material, textures=textures, parts=tuple(map(_material, material.parts)))


def _light(light: Light) -> Light:
    if isinstance(light, ProjectorLight):
        corners = np.full((2, 2, 3), light.pixels.max(), np.float32)
        return replace(light, pixels=corners, columns=np.array([0.0, 1.0]), rows=np.array([0.0, 1.0]))
    return replace(light, pixels=_coarse(light.pixels)) if isinstance(light, ImageEnvironment) else light


def _coarse(pixels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Every so many pixels; at least three rows and two columns of what has them."""
    down, across = (max(1, size // TEXELS) for size in pixels.shape[:2])
    return np.ascontiguousarray(pixels[::down, ::across])
