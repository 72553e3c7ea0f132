"""Colours in binary STL files, by the two conventions that programs follow.

Both put five bits a channel into the two bytes behind each triangle, which the format leaves free. Materialise Magics
writes "COLOR=" and the object's red, green, blue and opacity into the header; a triangle whose highest bit is 0 has a
colour of its own, red lowest. VisCAM and SolidView write nothing in the header; a triangle whose highest bit is 1 has a
colour, blue lowest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.meshes.corners import merge
from pmviewer.scene.description import Mesh
from pmviewer.scene.formats.meshfile import DEFAULT_MATERIAL
from pmviewer.scene.formats.texture_file import linear

_WORD, _SET = b"COLOR=", 0x8000
_CHANNEL = 31


def colours_by_attribute(header: bytes, attributes: NDArray[np.uint16]) -> NDArray[np.float64] | None:
    """(65536, 3): the linear RGB that each attribute stands for in a file with this header; None if the attributes
    (n,) of its triangles are no colours."""
    at = header.find(_WORD)
    all_ = np.arange(1 << 16)
    low, middle, high = (_decoded((all_ >> shift & _CHANNEL) / _CHANNEL) for shift in (0, 5, 10))
    is_set = (all_ & _SET)[:, None] > 0
    if 0 <= at <= len(header) - len(_WORD) - 3:
        of_object = _decoded(np.frombuffer(header, np.uint8, 3, at + len(_WORD)) / 255)
        if not attributes.any():
            return np.broadcast_to(of_object, (1 << 16, 3))
        return np.where(is_set, of_object, np.stack([low, middle, high], axis=1))
    if not attributes.any() or (attributes[attributes > 0] < _SET).any():
        return None
    return np.where(is_set, np.stack([high, middle, low], axis=1), DEFAULT_MATERIAL.reflectance)


def _decoded(encoded: NDArray[np.float64]) -> NDArray[np.float64]:
    return linear(encoded.astype(np.float32)).astype(np.float64)


def coloured(mesh: Mesh, attributes: NDArray[np.uint16], colours: NDArray[np.float64]) -> Mesh:
    """The mesh with the colours of its triangles' attributes (n,) at its vertices; where triangles of several colours
    meet there is one for each."""
    corners, codes = mesh.faces.reshape(-1), np.repeat(attributes, 3).astype(np.int32)
    head, follower = np.full(len(mesh.vertices), -1, np.int32), np.empty(len(corners), np.int32)
    keys, faces = np.empty((len(corners), 3), np.int32), np.empty(len(corners), np.int32)
    used = merge(corners, codes, np.empty(0, np.int32), head, follower, keys, faces)
    return Mesh(mesh.vertices[keys[:used, 0]], faces.reshape(-1, 3), colours=colours[keys[:used, 1]])
