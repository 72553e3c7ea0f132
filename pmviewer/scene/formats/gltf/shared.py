"""glTF meshes that several nodes show: instances of one group where that saves memory."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping

from pmviewer.scene.arrays.instances import LARGEST_CONDITION
from pmviewer.scene.description import Group, Instance, Shape
from pmviewer.scene.formats.mitsuba.transform import Matrix

FEWEST_SAVED = 20_000
"""Triangles that instances must save: below that, written out, they take few megabytes."""


class SharedMeshes:
    """Which meshes of the file are worth sharing, and the groups made of them so far.

    Parameters
    ----------
    uses: how often each mesh is shown as it is.
    triangles: of each mesh.
    shapes: a mesh's name and shapes in its own coordinates.
    """

    def __init__(
        self,
        uses: Counter[int],
        triangles: Mapping[int, int],
        shapes: Callable[[int], tuple[str, list[Shape]]],
    ) -> None:
        self._shapes = shapes
        self.saving = {index for index, count in uses.items() if (count - 1) * triangles[index] >= FEWEST_SAVED}
        self._groups: dict[int, Group | None] = {}

    def instance(self, index: int, name: str, matrix: Matrix) -> Instance | None:
        """A copy of the mesh as an instance; None when it is to be written out: if that saves too little, if the mesh
        shines or has no triangles, or if the matrix squeezes it flat."""
        if index not in self.saving:
            return None
        if index not in self._groups:
            called, shapes = self._shapes(index)
            lit = any(shape.radiance is not None and max(shape.radiance) > 0 for shape in shapes)
            self._groups[index] = Group(called, tuple(shapes)) if shapes and not lit else None
        group = self._groups[index]
        if group is None:
            return None
        return Instance(name, group, matrix) if _condition(matrix) < LARGEST_CONDITION else None


def _condition(matrix: Matrix) -> float:
    """The product of the Frobenius norms of a transformation's linear part and of its inverse; infinite for flat ones.
    In plain numbers: there may be a million of them, and arrays of nine take long."""
    (a, b, c), (d, e, f), (g, h, i) = matrix[:3, :3].tolist()
    adjugate = (e * i - f * h, c * h - b * i, b * f - c * e)
    rest = (f * g - d * i, a * i - c * g, c * d - a * f, d * h - e * g, b * g - a * h, a * e - b * d)
    determinant = abs(a * adjugate[0] + d * adjugate[1] + g * adjugate[2])
    product = math.hypot(a, b, c, d, e, f, g, h, i) * math.hypot(*adjugate, *rest)
    return product / determinant if determinant > 0 else math.inf
