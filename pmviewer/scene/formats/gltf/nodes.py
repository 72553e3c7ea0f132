"""The nodes that a scene shows, with their matrices: counted before they are walked, each once."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.formats.gltf.accessors import Accessors, Float
from pmviewer.scene.formats.gltf.document import Document, Json, extension, is_index, name_of
from pmviewer.scene.formats.gltf.pose import Pose
from pmviewer.scene.formats.mitsuba.transform import Matrix

MOST_NODES = 1_000_000
_MOST_REPEATED = 100_000
"""Nodes that may be shown beyond those in the file, which glTF does not foresee: each has one parent at most."""
_LARGEST = 1e30
_INSTANCING = "EXT_mesh_gpu_instancing"


@dataclass(frozen=True)
class Placed:
    """A node as the scene shows it. `copies` are the places of its mesh's copies in the node, if it has several."""

    index: int
    node: Json
    matrix: Matrix
    copies: tuple[Matrix, ...] | None = None

    @property
    def name(self) -> str:
        """For people."""
        return name_of(self.node, f"node {self.index}")

    @property
    def matrices(self) -> tuple[Matrix, ...]:
        """World matrices of the mesh's copies."""
        return (self.matrix,) if self.copies is None else tuple(self.matrix @ copy for copy in self.copies)


class Nodes:
    """The nodes of one file. `world` holds the matrices of all that were walked.

    Parameters
    ----------
    pose: what replaces the nodes' own translations, rotations and scales.
    """

    def __init__(self, document: Document, accessors: Accessors, pose: Pose) -> None:
        self._document, self._accessors, self._pose = document, accessors, pose
        self._rows = document.rows("nodes")
        if len(self._rows) > MOST_NODES:
            what = f"The file has {len(self._rows)} nodes; {MOST_NODES} is the most that can be opened."
            raise document.error(what, hint="Join objects, or use EXT_mesh_gpu_instancing for copies.")
        self.world: dict[int, Matrix] = {}
        self._locals: tuple[Float, NDArray[np.bool_]] | None = None

    def walk(self, scene: int | None) -> list[Placed]:
        """The nodes of a scene (of the whole file where it has no scenes), parents before children; hidden ones and
        what is below them are left out. Raises SceneError for nodes that contain themselves."""
        scenes = self._document.rows("scenes")
        if scenes:
            index = self._document.header.get("scene", 0) if scene is None else scene
            roots = self._listed(self._document.row("scenes", index, "the file"), "nodes")
        else:
            inside = {child for row in self._rows for child in self._listed(row, "children")}
            roots = [i for i in range(len(self._rows)) if i not in inside] or list(range(len(self._rows)))
        self._check_count(roots)
        return list(self._placed(roots))

    def all_world(self) -> dict[int, Matrix]:
        """World matrices of all nodes of the file: joints may stand outside of the scene."""
        if len(self.world) < len(self._rows):
            inside = {child for row in self._rows for child in self._listed(row, "children")}
            missing = [i for i in range(len(self._rows)) if i not in inside and i not in self.world]
            self._check_count(missing)
            known = dict(self.world)
            for _ in self._placed(missing, hidden_too=True):
                pass
            self.world.update(known)
        return self.world

    def _placed(self, roots: list[int], hidden_too: bool = False) -> Iterator[Placed]:
        stack = [(index, _IDENTITY) for index in reversed(roots)]
        while stack:
            index, parent = stack.pop()
            node = self._rows[index]
            matrix = self._under(parent, index)
            self.world[index] = matrix
            if not hidden_too and _is_hidden(node):
                self._document.warn("Nodes that the file hides are left out.")
                self._settle(index, matrix)
                continue
            yield Placed(index, node, matrix, self._copies(node, index))
            stack += [(child, matrix) for child in reversed(self._listed(node, "children"))]

    def _settle(self, index: int, matrix: Matrix) -> None:
        """World matrices below a hidden node, whose joints may move what is seen."""
        below = [(child, matrix) for child in self._listed(self._rows[index], "children")]
        while below:
            child, parent = below.pop()
            self.world[child] = self._under(parent, child)
            below += [(c, self.world[child]) for c in self._listed(self._rows[child], "children")]

    def _listed(self, row: Json, key: str) -> list[int]:
        """Nodes that a scene or node lists."""
        found = row.get(key, [])
        if not isinstance(found, list):
            return []
        for index in found:
            if not is_index(index) or index >= len(self._rows):
                what = f"A list of nodes names node {str(index)[:20]}, but the file has {len(self._rows)}."
                raise self._document.error(what)
        return found

    def _check_count(self, roots: list[int]) -> None:
        """Raises SceneError for a circle, and for more nodes than the file can mean (a node may have several parents
        here, so their number can double at each level). Takes time in proportion to the file."""
        shown: dict[int, int] = {}
        inside: set[int] = set()
        for root in roots:
            stack = [root]
            while stack:
                index = stack[-1]
                children = self._listed(self._rows[index], "children")
                if not children:
                    shown[index] = 1
                    stack.pop()
                elif index in shown:
                    stack.pop()
                elif index in inside:
                    shown[index] = 1 + sum(shown[child] for child in children)
                    inside.discard(index)
                    stack.pop()
                else:
                    inside.add(index)
                    for child in children:
                        if child in inside:
                            raise self._document.error(
                                f"The file's nodes contain each other in a circle (node {child})."
                            )
                    stack += [child for child in children if child not in shown]
        total = sum(shown[root] for root in roots)
        if total > len(self._rows) + _MOST_REPEATED:
            times = total if total < 10**15 else "countless"
            what = f"The file's {len(self._rows)} nodes contain each other {times} times."
            raise self._document.error(what, hint="In glTF a node has one parent at most: export the file again.")

    def _under(self, parent: Matrix, index: int) -> Matrix:
        """The node's world matrix below one of that matrix. Raises SceneError for one of unusable numbers."""
        if self._locals is None:
            self._locals = self._all_local()
        matrices, usable = self._locals
        if not usable[index]:
            what = f"The place of {name_of(self._rows[index], f'node {index}')!r} is not given by usable numbers."
            raise self._document.error(what)
        local: Matrix = matrices[index]
        return local if parent is _IDENTITY else parent @ local

    def _all_local(self) -> tuple[Float, NDArray[np.bool_]]:
        """(n, 4, 4) matrices of all nodes in their parents, and which of them can be used: at once, since arrays of few
        numbers take long."""
        columns: list[Float] = []
        for key, default in _TRS:
            values = [row.get(key, default) for row in self._rows]
            for i, moved in self._pose.items():
                if key in moved and i < len(values):
                    values[i] = moved[key]
            columns.append(_rows_of_numbers(values, len(default)))
        matrices = trs(*columns)
        given = [
            i
            for i, row in enumerate(self._rows)
            if "matrix" in row and not (i in self._pose and any(key in self._pose[i] for key, _ in _TRS))
        ]
        if given:
            found = _rows_of_numbers([self._rows[i]["matrix"] for i in given], 16)
            matrices[given] = found.reshape(-1, 4, 4).transpose(0, 2, 1)
        return matrices, np.all(np.abs(matrices) <= _LARGEST, axis=(1, 2))

    def _copies(self, node: Json, index: int) -> tuple[Matrix, ...] | None:
        """Places of EXT_mesh_gpu_instancing in the node."""
        if "mesh" not in node or "extensions" not in node:
            return None
        attributes = extension(node, _INSTANCING).get("attributes")
        if not isinstance(attributes, dict):
            return None
        who = f"the copies of node {index}"
        found: list[Any] = []
        for key, default in (("TRANSLATION", (0, 0, 0)), ("ROTATION", (0, 0, 0, 1)), ("SCALE", (1, 1, 1))):
            if key in attributes:
                found.append(self._accessors.floats(attributes[key], who, (len(default),)))
            else:
                found.append(np.array([default], np.float64))
        counts = {len(a) for a, key in zip(found, ("TRANSLATION", "ROTATION", "SCALE")) if key in attributes}
        if len(counts) != 1:
            return None
        (count,) = counts
        if count > MOST_NODES:
            raise self._document.error(
                f"Node {index} asks for {count} copies of its mesh; {MOST_NODES} is the most.", ""
            )
        matrices = trs(*(np.broadcast_to(a, (count, a.shape[1])) for a in found))
        good = np.isfinite(matrices).all(axis=(1, 2))
        return tuple(matrices[good])


_TRS = (("translation", (0, 0, 0)), ("rotation", (0, 0, 0, 1)), ("scale", (1, 1, 1)))
_IDENTITY = np.eye(4)


def _is_hidden(node: Json) -> bool:
    return "extensions" in node and extension(node, "KHR_node_visibility").get("visible", True) is False


def _rows_of_numbers(values: list[Any], count: int) -> Float:
    """(n, count); NaN where a row is something else."""
    try:
        return np.array(values, np.float64).reshape(len(values), count)
    except (TypeError, ValueError, OverflowError):
        return np.array([_numbers(value, count) for value in values])


def _numbers(value: Any, count: int) -> list[float]:
    """As many numbers, or NaN where it is something else."""
    try:
        numbers = [float(v) for v in value]
    except (TypeError, ValueError, OverflowError):
        numbers = []
    return numbers if len(numbers) == count else [math.nan] * count


def trs(translation: Float, rotation: Float, scale: Float) -> Float:
    """(n, 4, 4) matrices from translations (n, 3), unit quaternions x, y, z, w (n, 4) and scales (n, 3). A quaternion
    of other length is scaled to one; one of zeros turns nothing. ValueError for other shapes."""
    if translation.shape[1:] != (3,) or rotation.shape[1:] != (4,) or scale.shape[1:] != (3,):
        raise ValueError("a translation and a scale have three numbers, a rotation has four")
    length = np.sqrt((rotation * rotation).sum(axis=1, keepdims=True))
    with np.errstate(divide="ignore"):
        x, y, z, w = np.where(length > 0, rotation / length, (0.0, 0.0, 0.0, 1.0)).T
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrices = np.zeros((len(translation), 4, 4))
    matrices[:, :3, :3] = turn.transpose(2, 0, 1) * scale[:, None, :]
    matrices[:, :3, 3], matrices[:, 3, 3] = translation, 1.0
    return matrices


def chosen(document: Document, kind: str, wanted: str | None) -> int | None:
    """Which of the file's scenes, … a user names, by number or name; None if none is named. Raises SceneError."""
    if wanted is None:
        return None
    names = [name_of(row, f"{i}") for i, row in enumerate(document.rows(kind))]
    if wanted in names:
        return names.index(wanted)
    if wanted.isdecimal() and int(wanted) < len(names):
        return int(wanted)
    listed = ", ".join(f"{i} ({name})" if name != str(i) else name for i, name in enumerate(names[:20]))
    hint = f"It has {listed}." if names else "It has none."
    raise SceneError(f"The file has no {kind.removesuffix('s')} {wanted[:80]!r}.", document.path, hint=hint)
