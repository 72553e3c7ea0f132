"""glTF cameras: they look along their node's −z axis; the field of view is vertical, magnifications are half sizes."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.scene.clean import LARGEST_COORDINATE
from pmviewer.scene.description import Camera
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.gltf.document import Json, name_of
from pmviewer.scene.formats.gltf.fields import Fields
from pmviewer.scene.formats.meshfile import NamedCamera
from pmviewer.scene.formats.mitsuba.transform import Matrix, mirrors

_WIDEST = math.radians(179)
_MOST_ASPECT = 16.0


def camera_at(row: Json, matrix: Matrix, node_name: str, diagnostics: Diagnostics) -> NamedCamera | None:
    """The camera in a node with this world matrix; None for one that can't be used, with a warning."""
    name = name_of(row, node_name)
    kind = row.get("type")
    eye, up, backward = matrix[:3, 3], matrix[:3, 1], matrix[:3, 2]
    length = float(np.linalg.norm(backward))
    usable = bool(np.all(np.abs(matrix) <= LARGEST_COORDINATE)) and bool(np.any(np.cross(up, backward)))
    if kind not in ("perspective", "orthographic") or not usable:
        diagnostics.warn(
            f"The camera '{name}' is left out: its type is unknown, or its node has no place or direction."
        )
        return None
    target = eye - backward / length
    lens = Fields(row, f"the camera '{name}'", diagnostics).table(kind)
    near, far = lens.number("znear", 0.0, 0.0), lens.number("zfar", math.inf, 0.0)
    if kind == "orthographic":
        half_width, half_height = abs(lens.number("xmag", 1.0)), abs(lens.number("ymag", 1.0))
        aspect = half_width / half_height if half_height > 0 else 1.0
    else:
        aspect = lens.number("aspectRatio", 1.0, 0.0)
    camera = Camera(
        origin=(float(eye[0]), float(eye[1]), float(eye[2])),
        target=(float(target[0]), float(target[1]), float(target[2])),
        up=(float(up[0]), float(up[1]), float(up[2])),
        fov=math.degrees(lens.number("yfov", math.radians(40), 1e-3, _WIDEST)),
        fov_axis="y",
        near=near,
        far=far if far > near else math.inf,
        projection="orthographic" if kind == "orthographic" else "perspective",
        width=max(2 * half_width, 1e-9) if kind == "orthographic" else 1.0,
        mirrored=mirrors(matrix),
    )
    return NamedCamera(name, camera, min(_MOST_ASPECT, max(1 / _MOST_ASPECT, aspect)))
