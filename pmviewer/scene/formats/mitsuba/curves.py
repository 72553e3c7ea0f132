"""Shapes of many curves: `linearcurve` and `bsplinecurve` of Mitsuba 3, and `hair` of 0.6, as meshes of tubes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pmviewer.errors import SceneError
from pmviewer.scene.description import Mesh
from pmviewer.scene.formats.curve_file import read_curves
from pmviewer.scene.formats.mitsuba.document import Properties
from pmviewer.scene.formats.mitsuba.mesh_file import BrokenMesh
from pmviewer.scene.formats.mitsuba.transform import Matrix
from pmviewer.scene.meshes.tubes import Curves, tubes

CURVES = ("linearcurve", "bsplinecurve", "hair")
_HAIR_RADIUS = 0.025


def curves(p: Properties, to_world: Matrix, flip: bool) -> Mesh:
    """The tubes around the curves of the file. `to_world` moves the points; radii are the world's, but for those of
    `hair`, which grow with its z axis. Raises SceneError."""
    name, document, cubic = p.string("filename", ""), p.document, p.type == "bsplinecurve"
    if not name:
        raise document.error(f"{p.element} needs a 'filename'.", p.element)
    p.known("angle_threshold", "reduction")
    path = document.file(name, p.element)
    scale = float(np.linalg.norm(to_world[:3, 2])) if p.type == "hair" else 1.0
    try:
        found = read_curves(path, p.number("radius", _HAIR_RADIUS) * scale if p.type == "hair" else None)
    except SceneError as error:
        raise BrokenMesh(path.name, error, p.element.file or document.diagnostics.path, p.element.line) from None
    used = found.longer_than(4 if cubic else 2)
    if len(used) < len(found):
        few = len(found) - len(used)
        document.warn(f"{few:,} curves of {path.name} have too few points and are left out.", p.element)
    if not len(used):
        raise document.error(f"{p.element} has no curve that can be shown.", p.element)
    points = used.points.copy()
    with np.errstate(invalid="ignore", over="ignore"):  # broken points are `clean`'s business
        points[:, :3] = points[:, :3] @ to_world[:3, :3].T + to_world[:3, 3]
    points[:, 3] = np.abs(points[:, 3])
    mesh = tubes(Curves(points, used.first), cubic=cubic)
    if not flip:
        return mesh
    assert mesh.normals is not None
    return replace(mesh, faces=np.ascontiguousarray(mesh.faces[:, ::-1]), normals=-mesh.normals)
