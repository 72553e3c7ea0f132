"""Where nodes stand at the start: the first animation at time 0, and skins by the joints' places there."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.arrays.primitives import unit
from pmviewer.scene.description import Mesh
from pmviewer.scene.formats.gltf.accessors import Accessors, Float
from pmviewer.scene.formats.gltf.document import Document, is_index

Pose = dict[int, dict[str, list[float]]]
"""By node, what an animation sets: "translation", "rotation", "scale", "weights"."""
_PATHS = {"translation": (3,), "rotation": (4,), "scale": (3,), "weights": (1,)}


def pose_at_start(document: Document, accessors: Accessors) -> Pose:
    """What the file's first animation sets at time 0: the values of its first keyframes, since times run from 0 on
    (glTF 2.0, section 3.11). Channels that can't be read are left out with a warning."""
    animations = document.rows("animations")
    if not animations:
        return {}
    document.warn("The file is animated: its first animation is shown at its beginning.")
    pose: Pose = {}
    samplers: Any = animations[0].get("samplers")
    channels = animations[0].get("channels")
    for channel in channels if isinstance(channels, list) else []:
        try:
            target = channel["target"]
            node, path = target.get("node"), target["path"]
            if path not in _PATHS or not is_index(node):
                continue  # extensions animate other things
            sampler = samplers[channel["sampler"]]
            values = accessors.floats(sampler["output"], "an animation", _PATHS[path]).reshape(-1)
            cubic = sampler.get("interpolation") == "CUBICSPLINE"
            n_keys = accessors.count(sampler["input"], "an animation")
            size = len(values) // (n_keys * (3 if cubic else 1)) if path == "weights" else _PATHS[path][0]
            first = values[size : 2 * size] if cubic else values[:size]  # a spline's keys are in-tangent, value, out
            if size and len(first) == size and np.isfinite(first).all():
                pose.setdefault(node, {})[path] = first.tolist()
        except (SceneError, KeyError, IndexError, TypeError, AttributeError, ZeroDivisionError):
            document.warn("Parts of the file's animation can't be read: what they move stands as its nodes say.")
    return pose


def joint_matrices(document: Document, accessors: Accessors, skin: Any, who: str, world: dict[int, Float]) -> Float:
    """(J, 4, 4): from a mesh at rest to the world, for each joint of a skin. Raises SceneError.

    Parameters
    ----------
    world: world matrices by node.
    """
    row = document.row("skins", skin, who)
    joints = row.get("joints")
    if not isinstance(joints, list) or not joints:
        raise document.error(f"Skin {skin} has no joints.")
    at_rest = np.broadcast_to(np.eye(4), (len(joints), 4, 4))
    if "inverseBindMatrices" in row:
        flat = accessors.floats(row["inverseBindMatrices"], f"skin {skin}", (16,))
        if len(flat) < len(joints):
            raise document.error(f"Skin {skin} has {len(joints)} joints and {len(flat)} matrices.")
        at_rest = flat[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)
    for joint in joints:
        if not is_index(joint) or joint not in world:
            raise document.error(f"Skin {skin} refers to node {str(joint)[:20]}, which does not exist.")
    return np.stack([world[joint] for joint in joints]) @ at_rest


def skinned(mesh: Mesh, joints: NDArray[np.int64], weights: Float, matrices: Float) -> Mesh:
    """The mesh where its joints put it, in the world (linear blend skinning, glTF 2.0 section 3.7.3)."""
    weights = np.maximum(np.nan_to_num(weights), 0.0)
    total = weights.sum(axis=1, keepdims=True)
    weights = np.where(total > 0, weights / np.where(total > 0, total, 1), np.eye(1, weights.shape[1]))
    joints = np.minimum(joints, len(matrices) - 1)
    blend = np.zeros((len(joints), 3, 4))
    for k in range(joints.shape[1]):
        blend += weights[:, k, None, None] * matrices[joints[:, k], :3]
    vertices = np.einsum("nij,nj->ni", blend[:, :, :3], mesh.vertices) + blend[:, :, 3]
    a, b, c = blend[:, :, 0], blend[:, :, 1], blend[:, :, 2]
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=2)
    mirrored = bool(np.median((a * cofactors[:, :, 0]).sum(axis=1)) < 0) if len(joints) else False
    normals = mesh.normals
    if normals is not None:
        normals = unit(np.einsum("nij,nj->ni", cofactors, normals)) * (-1.0 if mirrored else 1.0)
    faces = np.ascontiguousarray(mesh.faces[:, ::-1]) if mirrored else mesh.faces
    return Mesh(vertices, faces, normals, mesh.uv, mesh.colours)
