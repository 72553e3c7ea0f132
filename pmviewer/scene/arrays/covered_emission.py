"""Lights on surfaces that rays pass in part: what they emit is their radiance times their opacity.

That is what shows of a light whose surface covers only a share of each place, and what compositing by alpha means
(glTF 2.0 §3.9.4). Kernels give the radiance itself to the rays that a surface stops, and its product with the opacity
to everything else, photons and light samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.arrays.material_row import used_materials
from pmviewer.scene.description import RGB, Material, Mesh, Scene, Shape
from pmviewer.scene.texture import LUMINANCE, Bitmap, Checkerboard, Texture, evaluate, scaled

Float = NDArray[np.float64]
_FINEST = 2048
"""Texels along a side of a product of textures."""
_BETWEEN = 2
"""Texels of a product for one of the finer texture."""


def with_covered_emission(scene: Scene) -> Scene:
    """The scene with each light's emission multiplied by the opacity of its material; a light that is nowhere opaque
    is none."""
    return _with_lights(scene, _covered)


def without_unseen_lights(scene: Scene) -> Scene:
    """The scene without the emission of surfaces that are nowhere opaque."""

    def seen(shape: Shape, material: Material) -> Shape:
        return shape if _covered(shape, material).radiance is not None else replace(shape, radiance=None, emission=None)

    return _with_lights(scene, seen)


def _with_lights(scene: Scene, change: Callable[[Shape, Material], Shape]) -> Scene:
    """The scene with each light on a surface that rays pass changed."""
    shapes = [
        change(s, scene.materials[s.material]) if s.radiance is not None and scene.materials[s.material].passable else s
        for s in scene.shapes
    ]
    return scene if all(a is b for a, b in zip(shapes, scene.shapes)) else replace(scene, shapes=tuple(shapes))


def ignored_opacity(scene: Scene) -> tuple[str, ...]:
    """A sentence for glass that lets rays pass beside refracting them and absorbs light: it never does here."""
    names = [m.name for m in used_materials(scene) if m.veiled and not m.passable]
    if not names:
        return ()
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    return (
        f"The opacity of '{names[0]}'{more} is ignored: glass that absorbs light shows all over. Without its "
        "absorption it lets light pass.",
    )


def _covered(shape: Shape, material: Material) -> Shape:
    assert shape.radiance is not None
    texture = material.textures.get("opacity")
    if texture is None:
        share = material.opacity if material.alpha_cutoff is None else 0.0  # passable, so below the cut-off
        emission = None if shape.emission is None else scaled(shape.emission, (share,) * 3)
        r, g, b = (share * c for c in shape.radiance)
        return replace(shape, radiance=(r, g, b) if share > 0 else None, emission=emission if share > 0 else None)
    if shape.emission is None and material.alpha_cutoff is None:
        emission = scaled(_grey(texture), shape.radiance)
    else:
        emission = _product(shape, texture, material.alpha_cutoff)
    if not max(emission.mean) > 0:
        return replace(shape, radiance=None, emission=None)
    return replace(shape, radiance=emission.mean, emission=emission)


def _grey(texture: Texture) -> Texture:
    """Its luminance, between 0 and 1."""

    def luminance(colour: RGB) -> RGB:
        value = min(max(float(np.dot(colour, LUMINANCE)), 0.0), 1.0)
        return value, value, value

    if isinstance(texture, Checkerboard):
        return replace(texture, color0=luminance(texture.color0), color1=luminance(texture.color1))
    colours = np.broadcast_to(texture.pixels, (*texture.pixels.shape[:2], 3)) * np.array(texture.scale)
    grey = np.clip(colours @ LUMINANCE, 0.0, 1.0).astype(np.float32)[..., None]
    return replace(texture, pixels=grey, scale=(1.0, 1.0, 1.0))


def _product(shape: Shape, opacity: Texture, cutoff: float | None) -> Bitmap:
    """The light's emission times its opacity as a picture over the texture coordinates that the shape has."""
    low, high = np.zeros(2), np.ones(2)
    geometry = shape.geometry
    if isinstance(geometry, Mesh) and geometry.uv is not None and len(geometry.uv):
        low, high = geometry.uv.min(axis=0), geometry.uv.max(axis=0)
    size = np.maximum(high - low, 1e-9)
    parts = [opacity] if shape.emission is None else [opacity, shape.emission]
    columns, rows = (
        int(min(max(_BETWEEN * max(_texels(t, axis) for t in parts) * size[axis], 8), _FINEST)) for axis in (0, 1)
    )
    v, u = np.meshgrid((np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns, indexing="ij")
    uv = low + size * np.stack([u.reshape(-1), v.reshape(-1)], axis=1)
    share = np.clip(evaluate(opacity, uv) @ LUMINANCE, 0.0, 1.0)
    if cutoff is not None:
        share = (share >= cutoff).astype(float)
    light = np.asarray(shape.radiance) if shape.emission is None else evaluate(shape.emission, uv)
    pixels = (share[:, None] * light).reshape(rows, columns, 3).astype(np.float32)
    to_uv = (1 / size[0], 0.0, -low[0] / size[0], 0.0, 1 / size[1], -low[1] / size[1])
    return Bitmap(pixels, "clamp", "nearest", tuple(float(x) for x in to_uv), name="emission")  # type: ignore[arg-type]


def _texels(texture: Texture, axis: int) -> float:
    """Texels of the texture along one unit of the shape's coordinate."""
    columns, rows = (16, 16) if isinstance(texture, Checkerboard) else texture.pixels.shape[1::-1]
    return abs(texture.to_uv[axis]) * columns + abs(texture.to_uv[3 + axis]) * rows
