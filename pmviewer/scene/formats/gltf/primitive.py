"""Primitives of glTF meshes as triangles, with morph targets and skins at rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.arrays.primitives import unit
from pmviewer.scene.description import Mesh
from pmviewer.scene.formats.gltf.accessors import Accessors, Float
from pmviewer.scene.formats.gltf.buffers import Buffers
from pmviewer.scene.formats.gltf.compression import DracoMesh, decode_draco
from pmviewer.scene.formats.gltf.document import DAMAGED, Document, Json, extension, is_index

Faces = NDArray[np.int64]
TRIANGLES, STRIP, FAN = 4, 5, 6
_DRACO = "KHR_draco_mesh_compression"


@dataclass(frozen=True)
class Decoded:
    """One primitive. `alpha` (V,) is that of its vertices' colours, `joints` (V, k) and `weights` (V, k) its skin's."""

    mesh: Mesh
    alpha: Float | None = None
    joints: NDArray[np.int64] | None = None
    weights: Float | None = None


class Primitives:
    """Decodes the primitives of one file."""

    def __init__(self, document: Document, buffers: Buffers, accessors: Accessors) -> None:
        self._document, self._buffers, self._accessors = document, buffers, accessors

    def triangles(self, primitive: Json, who: str) -> int:
        """How many triangles the primitive claims, from its header alone; 0 for points and lines."""
        mode = primitive.get("mode", TRIANGLES)
        attributes = _attributes(primitive)
        if mode not in (TRIANGLES, STRIP, FAN) or "POSITION" not in attributes:
            return 0
        counted = primitive.get("indices", attributes["POSITION"])
        count = self._accessors.count(counted, who)
        return count // 3 if mode == TRIANGLES else max(0, count - 2)

    def decode(self, primitive: Json, who: str, uv_set: int = 0, weights: Sequence[float] = ()) -> Decoded | None:
        """The primitive's triangles in its own coordinates; None if it has none, with a warning. Raises SceneError.

        Parameters
        ----------
        who: name for errors ("mesh 3").
        uv_set: which of its texture coordinates are wanted.
        weights: of its morph targets.
        """
        attributes = _attributes(primitive)
        mode = primitive.get("mode", TRIANGLES)
        if mode not in (TRIANGLES, STRIP, FAN) or "POSITION" not in attributes:
            self._document.warn("Points, lines and primitives without positions are left out: they have no surface.")
            return None
        source = _Source(self._document, self._buffers, self._accessors, primitive, who)
        vertices = source.floats("POSITION", (3,), weights)
        assert vertices is not None
        faces, used = _compact(self._faces(source, mode, len(vertices), who), len(vertices))
        normals, uv = source.floats("NORMAL", (3,), weights), source.floats(f"TEXCOORD_{uv_set}", (2,), weights)
        colours = source.floats("COLOR_0", (3, 4), weights)
        joints, shares = source.skin()
        arrays = (normals, uv, colours, joints, shares)
        if any(a is not None and len(a) != len(vertices) for a in arrays):
            raise self._document.error(f"The attributes of {who} are not of one length.")
        if used is not None:
            vertices = vertices[used]
            normals, uv, colours, shares = (a if a is None else a[used] for a in (normals, uv, colours, shares))
            joints = None if joints is None else joints[used]
        alpha = None
        if colours is not None:
            colours = np.clip(np.nan_to_num(colours), 0.0, None)
            alpha = np.minimum(colours[:, 3], 1.0) if colours.shape[1] == 4 else None
            colours = np.ascontiguousarray(colours[:, :3])
            colours = None if (colours == 1).all() else colours
        mesh = Mesh(vertices, faces.astype(np.int32), None if normals is None else unit(normals), uv, colours)
        return Decoded(mesh, alpha, joints, shares)

    def _faces(self, source: _Source, mode: int, n_vertices: int, who: str) -> Faces:
        indices = source.indices()
        if indices is None:
            indices = np.arange(n_vertices)
        elif len(indices) and int(indices.max()) >= n_vertices:
            bad = int(indices.max())
            what = f"A triangle of {who} uses vertex {bad}, which does not exist (there are {n_vertices})."
            raise self._document.error(what)
        return as_triangles(indices, mode)


def as_triangles(indices: NDArray[np.int64], mode: int) -> Faces:
    """Triangles (n, 3) of a list, strip or fan of vertex numbers; left-over ones are dropped."""
    if mode == TRIANGLES:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    i = np.arange(max(0, len(indices) - 2))
    if mode == FAN:
        return np.stack([indices[i + 1], indices[i + 2], np.broadcast_to(indices[:1], len(i))], axis=1)
    odd = i % 2
    return np.stack([indices[i], indices[i + 1 + odd], indices[i + 2 - odd]], axis=1)


def _compact(faces: Faces, n_vertices: int) -> tuple[Faces, NDArray[np.int64] | None]:
    """Faces by the vertices they use, and which those are, where they use a small part: primitives often share one
    long list of vertices."""
    if 2 * faces.size >= n_vertices:
        return faces, None
    used, inverse = np.unique(faces, return_inverse=True)
    return inverse.reshape(-1, 3), used


def _attributes(primitive: Json) -> Json:
    found = primitive.get("attributes")
    return {key: value for key, value in found.items() if value is not None} if isinstance(found, dict) else {}


class _Source:
    """Attributes and indices of one primitive, from accessors or from Draco's data."""

    def __init__(self, document: Document, buffers: Buffers, accessors: Accessors, primitive: Json, who: str) -> None:
        self._document, self._accessors, self._who = document, accessors, who
        self._primitive, self._attributes = primitive, _attributes(primitive)
        self._draco: DracoMesh | None = None
        self._numbers: Json = {}
        packed = extension(primitive, _DRACO)
        if packed and not accessors.has_bytes(self._attributes["POSITION"], who):
            data, _ = buffers.view(packed.get("bufferView"), who)
            numbers = packed.get("attributes")
            self._numbers = numbers if isinstance(numbers, dict) else {}
            try:
                self._draco = decode_draco(data)
            except SceneError as error:
                what = error.what if error.hint else f"{who.capitalize()}: {error.what}"
                raise document.error(what, hint=error.hint or DAMAGED) from None

    def floats(self, name: str, components: tuple[int, ...], weights: Sequence[float]) -> Float | None:
        """The attribute's numbers, moved by the morph targets; None if the primitive hasn't got it."""
        index = self._attributes.get(name)
        if index is None:
            return None
        if self._draco is not None and name in self._numbers:
            values = Accessors.as_floats(self._drawn(name, components), self._accessors.accessor(index, self._who))
        else:
            values = self._accessors.floats(index, self._who, components)
        targets = self._primitive.get("targets", [])
        for weight, target in zip(weights, targets if isinstance(targets, list) else []):
            if weight and isinstance(target, dict) and name in target:
                moved = self._accessors.floats(target[name], self._who, components)
                if moved.shape != values.shape:
                    raise self._document.error(f"A morph target of {self._who} is not as long as what it moves.")
                values = values + weight * moved
        return values

    def _drawn(self, name: str, components: tuple[int, ...]) -> NDArray:
        """One attribute of Draco's data. Raises SceneError if it is not there."""
        assert self._draco is not None
        number = self._numbers[name]
        found = self._draco.attributes.get(number) if is_index(number) else None
        if found is None or found.shape[1] not in components:
            raise self._document.error(f"The compressed data of {self._who} lack {name}.")
        return found

    def indices(self) -> NDArray[np.int64] | None:
        """Vertex numbers of the corners; None if the vertices themselves are in order."""
        if self._draco is not None:
            return self._draco.faces.reshape(-1)
        index = self._primitive.get("indices")
        return None if index is None else self._accessors.integers(index, self._who)[:, 0]

    def skin(self) -> tuple[NDArray[np.int64] | None, Float | None]:
        """Joints and weights of all sets, side by side."""
        joints: list[NDArray[np.int64]] = []
        weights: list[Float] = []
        for i in range(4):
            ours, share = self._attributes.get(f"JOINTS_{i}"), self._attributes.get(f"WEIGHTS_{i}")
            if ours is None or share is None:
                break
            if self._draco is not None and f"JOINTS_{i}" in self._numbers:
                joints.append(self._drawn(f"JOINTS_{i}", (4,)).astype(np.int64))
            else:
                joints.append(self._accessors.integers(ours, self._who, (4,)))
            weight = self.floats(f"WEIGHTS_{i}", (4,), ())
            assert weight is not None
            weights.append(weight)
        if not joints or any(len(a) != len(joints[0]) for a in (*joints, *weights)):
            return None, None
        return np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)


def numbers_of(value: Any) -> list[float]:
    """Weights of morph targets as the file lists them; what is no finite number counts as 0."""
    if not isinstance(value, list):
        return []
    return [float(v) if isinstance(v, int | float) and abs(v) < 1e30 else 0.0 for v in value]
