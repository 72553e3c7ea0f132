"""Refusing what would not fit into memory before it is tried: an overcommitting system would end the whole program."""

from __future__ import annotations

from pmviewer.errors import SceneError, SettingError
from pmviewer.render.moments import BYTES_PER_PIXEL as OF_MOMENTS
from pmviewer.render.planes import CHANNELS
from pmviewer.resources import available_memory
from pmviewer.scene.description import Scene

BYTES_PER_PIXEL = CHANNELS * (8 + 3 * 4) + OF_MOMENTS
"""The film's float64 sums, what it keeps of its noise, and three float32 frames: the one shown, the one being made, the
one being exported."""

OF_FILTERS = CHANNELS * (2 * 8 + 2 * 4)
"""With a filter also: float64 sums of each pixel's own samples, of a pass and of all, and float32 frames of these."""

BYTES_PER_TRAJECTORY = 250
"""Some three photons stored, twice while batches are joined, and their map."""

BYTES_PER_TRIANGLE = 300
"""Vertices and normals in float64 and float32, and the tree with what building it takes (`pmviewer bench load`)."""

BYTES_PER_INSTANCE = 1200


def check_scene_memory(scene: Scene) -> None:
    """Raises SceneError when the arrays and trees of a scene can't fit; instances cost little, however much they
    show."""
    available = available_memory()
    if available is None:
        return
    triangles = sum(len(getattr(s.geometry, "faces", "--")) for s in scene.all_shapes)
    needed = triangles * BYTES_PER_TRIANGLE + len(scene.instances) * BYTES_PER_INSTANCE
    if needed > available:
        what = f"The scene needs about {needed / 1e9:.1f} GB of memory and {available / 1e9:.1f} GB are free."
        raise SceneError(what, scene.path, hint="Show repeated meshes by instances, or subdivide less.")


def check_memory(width: int, height: int, N: int, filtered: bool = False) -> None:
    """Raises SettingError when an image of that size with N trajectories a pass can't fit, `filtered` by another filter
    than the plain box."""
    available = available_memory()
    if available is None:
        return
    of_pixel = BYTES_PER_PIXEL + (OF_FILTERS if filtered else 0)
    image, photons = width * height * of_pixel, N * BYTES_PER_TRAJECTORY
    if image + photons <= available:
        return
    if image >= photons:
        what, hint = f"An image of {width} × {height} pixels", "Lower camera.width and camera.height."
    else:
        what, hint = f"A pass of {N:,} trajectories", "Lower photons.N."
    needed, free = (image + photons) / 1e9, available / 1e9
    raise SettingError(f"{what} needs about {needed:.1f} GB of memory and {free:.1f} GB are free. {hint}")
