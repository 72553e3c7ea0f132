"""Refusing what would not fit into memory before it is tried, as an overcommitting system would end the whole program;
giving back what is not needed any more."""

from __future__ import annotations

import ctypes
import sys

from pmviewer.errors import SceneError, SettingError
from pmviewer.render.moments import BYTES_PER_PIXEL as OF_MOMENTS
from pmviewer.render.planes import CHANNELS
from pmviewer.resources import available_memory
from pmviewer.scene.description import Scene

BYTES_PER_PIXEL = CHANNELS * (8 + 3 * 4) + OF_MOMENTS
"""The film's float64 sums, what it keeps of its noise, and three float32 frames: the one shown, the one being made, the
one being exported."""

BYTES_PER_TRAJECTORY = 250
"""Some three photons stored, twice while batches are joined, and their map."""

BYTES_PER_TRIANGLE = 300
"""Vertices and normals in float64 and float32, and the tree with what building it takes (`pmviewer bench load`)."""

BYTES_PER_INSTANCE = 1200

_M_ARENA_MAX = -8
"""Of malloc.h."""


def give_back() -> None:
    """Return to the system what has been freed. The C library of Linux keeps it otherwise: arrays of a batch are below
    the size from which it would not. Elsewhere nothing is done."""
    if not sys.platform.startswith("linux"):
        return
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # musl has none
    if trim is not None:
        trim(0)


def few_arenas() -> None:
    """Have all threads share two of the C library's heaps, where Linux's would make eight a processor: each keeps what
    is scattered over it, and a program that lives long has threads come and go. Kernels allocate next to nothing."""
    if not sys.platform.startswith("linux"):
        return
    options = getattr(ctypes.CDLL(None), "mallopt", None)  # musl has none
    if options is not None:
        options(_M_ARENA_MAX, 2)


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


def check_memory(width: int, height: int, N: int) -> None:
    """Raises SettingError when an image of that size with N trajectories a pass can't fit."""
    available = available_memory()
    if available is None:
        return
    image, photons = width * height * BYTES_PER_PIXEL, N * BYTES_PER_TRAJECTORY
    if image + photons <= available:
        return
    if image >= photons:
        what, hint = f"An image of {width} × {height} pixels", "Lower camera.width and camera.height."
    else:
        what, hint = f"A pass of {N:,} trajectories", "Lower photons.N."
    needed, free = (image + photons) / 1e9, available / 1e9
    raise SettingError(f"{what} needs about {needed:.1f} GB of memory and {free:.1f} GB are free. {hint}")
