"""The tree over a large file's triangles, built while its camera and light are still being looked for.

Both take about as long, and neither needs the other: what completes a scene are few shapes at its end, for which
there is room. Where something else becomes of the scene (it is moved or edited), the tree is not used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.accel.bvh import Begun, begun
from pmviewer.kernels.meshes.mesh import at_corners
from pmviewer.progress import beside, parallel
from pmviewer.scene.description import Mesh, Scene, Shape

Float = NDArray[np.float32]
FEWEST = 100_000
"""Triangles from which on it pays."""
ROOM = 4096
"""Primitives that can be added."""
_AT_ONCE = 1 << 17
"""Triangles that one thread looks at at a time."""


@dataclass(frozen=True, eq=False)
class TreeAhead:
    """`triangles` (n_triangles + ROOM, 3, 3): first those of the `shapes`, meshes all. `begun` waits for their tree."""

    shapes: tuple[Shape, ...]
    triangles: Float
    n_triangles: int
    begun: Callable[[], Begun | None]

    @property
    def n_meshes(self) -> int:
        """How many of a scene's meshes are in it."""
        return len(self.shapes)

    def fits(self, scene: Scene) -> bool:
        """Does the scene begin with the very same surfaces?"""
        own = len(self.shapes)
        same = len(scene.shapes) >= own and not scene.instances
        return same and all(a.geometry is b.geometry for a, b in zip(self.shapes, scene.shapes))


@contextmanager
def tree_ahead(scene: Scene, wanted: bool) -> Iterator[TreeAhead | None]:
    """Within this context the tree over the scene's triangles is built beside, if that is wanted and they are many and
    everything; else there is None. At the end it is given up."""
    meshes = [shape.geometry for shape in scene.shapes if isinstance(shape.geometry, Mesh)]
    count = sum(len(mesh.faces) for mesh in meshes)
    if not wanted or scene.instances or len(meshes) < len(scene.shapes) or count < FEWEST:
        yield None
        return
    triangles = np.empty((count + ROOM, 3, 3), np.float32)
    fill_corners(meshes, triangles)
    with beside(partial(begun, triangles, count, ROOM)) as found:
        yield TreeAhead(scene.shapes, triangles, count, found)


def fill_corners(meshes: list[Mesh], out: Float) -> None:
    """The vertices at the corners of all triangles, one mesh after the other, become out (≥ F, 3, 3)."""
    start = 0
    for mesh in meshes:
        take_corners(mesh.vertices, mesh.faces, out[start : start + len(mesh.faces)])
        start += len(mesh.faces)


def take_corners(values: NDArray[np.float64], faces: NDArray[np.int32], out: Float) -> None:
    """out (F, 3, 3) = values (V, 3) at the corners of the faces, whose indices were checked before."""
    values, faces = np.ascontiguousarray(values, np.float64), np.ascontiguousarray(faces, np.int32)
    starts = range(0, len(faces), _AT_ONCE)
    parallel([partial(at_corners, values, faces, i, min(i + _AT_ONCE, len(faces)), out) for i in starts])
