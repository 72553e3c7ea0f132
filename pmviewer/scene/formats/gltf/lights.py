"""Lights of KHR_lights_punctual, and the surroundings of EXT_lights_image_based."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.clean import LARGEST_COORDINATE
from pmviewer.scene.description import DirectionalLight, ImageEnvironment, Light, PointLight, SpotLight
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.gltf.buffers import Buffers, content
from pmviewer.scene.formats.gltf.document import Document, Json, name_of
from pmviewer.scene.formats.gltf.fields import Fields
from pmviewer.scene.formats.gltf.nodes import trs
from pmviewer.scene.formats.mitsuba.transform import Matrix
from pmviewer.scene.formats.texture_file import read_alpha, read_picture

LUMENS_PER_WATT = 683.0
"""Luminous efficacy by which exporters turn watts into lumens."""
IMAGE_BASED = "EXT_lights_image_based"
_MOST_SIDE = 1024
_FACES = 6


def punctual(row: Json, matrix: Matrix, diagnostics: Diagnostics) -> Light | None:
    """A light in a node with this world matrix: candela become W/sr, and lux W/m². Spots and directional lights shine
    along −z. None for what can't be used, with a warning."""
    kind = row.get("type")
    if kind not in ("point", "spot", "directional"):
        diagnostics.warn(f"A light of type '{str(kind)[:40]}' is not supported and was ignored.")
        return None
    name = name_of(row, f"{kind} light")
    fields = Fields(row, f"the light '{name}'", diagnostics)
    if "range" in row:
        diagnostics.warn("The ranges of lights are ignored: their light reaches everything.")
    intensity = fields.number("intensity", 1.0, 0.0) / LUMENS_PER_WATT
    r, g, b = (c * intensity for c in fields.vector("color", (1.0, 1.0, 1.0), 0.0))
    x, y, z = (float(c) for c in matrix[:3, 3])
    if not np.all(np.abs(matrix) <= LARGEST_COORDINATE):
        diagnostics.warn(f"The {kind} light '{name}' stands at no usable place and was ignored.")
        return None
    if kind == "point":
        return PointLight(name, (x, y, z), (r, g, b))
    forward = -matrix[:3, 2]
    length = float(np.linalg.norm(forward))
    if not 0 < length < math.inf:
        diagnostics.warn(f"The {kind} light '{name}' has no direction and was ignored.")
        return None
    dx, dy, dz = (float(c) for c in forward / length)
    if kind == "directional":
        return DirectionalLight(name, (dx, dy, dz), (r, g, b))
    cone = fields.table("spot")
    outer = cone.number("outerConeAngle", math.pi / 4, 1e-3, math.pi / 2)
    inner = min(outer, cone.number("innerConeAngle", 0.0, 0.0, math.pi / 2))
    diagnostics.warn("The intensity of spot lights falls linearly between their inner and outer angle.")
    return SpotLight(name, (x, y, z), (dx, dy, dz), (r, g, b), math.degrees(outer), math.degrees(inner))


def image_based(document: Document, buffers: Buffers, scene: Json) -> ImageEnvironment | None:
    """The surroundings that a scene refers to, from the sharpest level of their cube map (PNG files with alpha hold
    colours that are divided by it); None if it has none or they can't be read, with a warning."""
    found = Fields(scene, "the scene", document.diagnostics).extension(IMAGE_BASED).row.get("light")
    lights = document.extension(IMAGE_BASED).get("lights")
    if found is None or not isinstance(lights, list):
        return None
    try:
        row = lights[found]
        faces = np.stack([_face(document, buffers, image) for image in row["specularImages"][0][:_FACES]])
        if len(faces) < _FACES:
            raise ValueError("a cube has six faces")
    except (SceneError, KeyError, IndexError, TypeError, ValueError) as error:
        reason = f" {error.what}" if isinstance(error, SceneError) else ""
        document.warn(f"The light of the file's surroundings ({IMAGE_BASED}) can't be read and is left out.{reason}")
        return None
    fields = Fields(row, "the surroundings", document.diagnostics)
    turn = np.array([fields.vector("rotation", (0.0, 0.0, 0.0, 1.0))])
    matrix = trs(np.zeros((1, 3)), turn, np.ones((1, 3)))[0, :3, :3]
    pixels = latlong(faces) * np.float32(fields.number("intensity", 1.0, 0.0))
    return ImageEnvironment(name_of(row, "surroundings"), pixels.astype(np.float32), matrix)


def _face(document: Document, buffers: Buffers, index: Any) -> NDArray[np.float32]:
    """One face (n, n, 3) as linear radiance."""
    image = document.row("images", index, IMAGE_BASED)
    if image.get("uri") is None:
        data = buffers.view(image.get("bufferView"), f"image {index}")[0].tobytes()
    else:
        data = content(document, image["uri"], "The picture of the surroundings")
    pixels, _ = read_picture(data, f"image {index}", False)
    alpha = read_alpha(data, f"image {index}") if data[:4] == b"\x89PNG" else None
    pixels = np.broadcast_to(pixels, (*pixels.shape[:2], 3)).astype(np.float32)
    if max(pixels.shape) > _MOST_SIDE:
        raise ValueError("too large")
    return pixels if alpha is None else (pixels / np.maximum(alpha, np.float32(1 / 255))).astype(np.float32)


def latlong(faces: NDArray[np.float32]) -> NDArray[np.float32]:
    """A cube map (6, n, n, 3) as radiance by direction (2n, 4n, 3), in the layout of `ImageEnvironment`.

    Faces are those in the directions +x, −x, +y, −y, +z, −z, as OpenGL lays them out, with the rows from below: so
    Khronos' EnvironmentTest has them, whose edges meet and whose brighter sides are those of its coefficients.
    """
    n = faces.shape[1]
    theta = np.pi * (np.arange(2 * n) + 0.5) / (2 * n)
    phi = 2 * np.pi * (0.5 - (np.arange(4 * n) + 0.5) / (4 * n))
    d = np.stack(np.broadcast_arrays(
        np.sin(theta)[:, None] * np.sin(phi), np.cos(theta)[:, None], np.sin(theta)[:, None] * np.cos(phi)
    ), axis=-1)  # fmt: skip
    axis = np.abs(d).argmax(axis=-1)
    major = np.take_along_axis(d, axis[..., None], axis=-1)[..., 0]
    x, y, z = (d[..., i] / np.abs(major) for i in range(3))
    face = 2 * axis + (major < 0)
    across = np.choose(face, [-z, z, x, x, x, -x])
    down = np.choose(face, [-y, -y, z, -z, -y, -y])
    column = np.clip(((1 + across) / 2 * n).astype(int), 0, n - 1)
    row = np.clip(((1 - down) / 2 * n).astype(int), 0, n - 1)
    return np.ascontiguousarray(faces[face, row, column])
