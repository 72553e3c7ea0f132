"""Where the outlines of lights cross the picture.

A pixel that a light covers in part holds most of the error of a picture with few passes: its light is a hundred times
brighter than the wall beside it, and one sample either meets it or not. These pixels are known beforehand, and the eye
pass spends some more camera rays on what they emit. It stays unbiased, because the choice of pixels depends on scene
and camera alone.

A reconstruction filter widens what a pixel sees, and a lens spreads an outline over its circle of confusion: pixels as
far from it are marked too, after the outline that the lens's middle sees.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.render.camera import CameraPose
from pmviewer.scene.description import Cylinder, Disk, Mesh, Parallelogram, Scene, Sphere

Float = NDArray[np.float64]
SEGMENTS = 256
"""Straight pieces of a circle."""
STEP, REACH = 0.25, 0.15
"""Points along an outline lie this far apart, and mark all pixels this near; in pixels."""
FAR = 1e6
"""Distance in picture widths from which an orthographic camera is taken to see outlines."""
RADII = 1.25
"""Blurred outlines are marked with radii that are powers of this."""
NEAREST = 1e-6
"""Outlines are cut off in front of the eye at this depth, relative to the scene's size seen from it."""


def outline_pixels(scene: Scene, camera: CameraPose, reach: float = 0.0) -> NDArray[np.uint8]:
    """(width · height,) uint8, 1 for pixels that the outline of an emitting shape crosses; (0,) when there is none.
    reach: pixels that a pixel sees beyond its own edges."""
    eye = np.array(camera.origin, float)
    if camera.orthographic:  # from so far that all rays are parallel
        eye = eye - camera.axes()[2] * (FAR * max(camera.view_width, 1e-300))
    pieces = [
        _outline(shape.geometry, eye)
        for shape in scene.shapes
        if shape.radiance is not None and max(shape.radiance) > 0
    ]
    segments = np.concatenate([np.zeros((0, 2, 3)), *pieces])
    marked = np.zeros(camera.width * camera.height, np.uint8)
    points, depth = _points(segments, camera)
    if reach > 0 or camera.aperture > 0:
        marked = _around(points, camera.confusion(depth) + (reach + REACH), camera)
        return marked if marked.any() else np.zeros(0, np.uint8)
    for dx in (-REACH, REACH):
        for dy in (-REACH, REACH):
            x, y = np.floor(points[:, 0] + dx), np.floor(points[:, 1] + dy)
            inside = (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)
            marked[(y[inside] * camera.width + x[inside]).astype(np.int64)] = 1
    return marked if marked.any() else np.zeros(0, np.uint8)


def _around(points: Float, radii: Float, camera: CameraPose) -> NDArray[np.uint8]:
    """Pixels at most so far (m,) from points (m, 2) of the picture, and hardly any others."""
    width, height = camera.width, camera.height
    edges = np.zeros((height, width + 1), np.int64)  # of rows of marked pixels: +1 where one begins, −1 behind its end
    step = np.ceil(np.log(np.maximum(radii, 1.0)) / np.log(RADII))
    for level in np.unique(step):
        R = min(RADII**level, float(width + height))
        places = np.unique(np.floor(points[step == level]).astype(np.int64), axis=0)
        for dy in range(-int(R) - 1, int(R) + 2):
            half = int(np.sqrt(max(R * R - max(abs(dy) - 1, 0) ** 2, 0.0))) + 1
            y = places[:, 1] + dy
            x = places[(y >= 0) & (y < height), 0]
            y = y[(y >= 0) & (y < height)]
            np.add.at(edges, (y, np.clip(x - half, 0, width)), 1)
            np.add.at(edges, (y, np.clip(x + half + 1, 0, width)), -1)
    return (np.cumsum(edges[:, :-1], axis=1) > 0).astype(np.uint8).ravel()


def _outline(g: object, eye: Float) -> Float:
    """Segments (m, 2, 3) of a shape's outline as seen from the eye."""
    if isinstance(g, Mesh):
        return _mesh_outline(g, eye)
    if isinstance(g, Parallelogram):
        a, u, v = (np.array(x, float) for x in (g.corner, g.edge_u, g.edge_v))
        return _closed(np.array([a, a + u, a + u + v, a + v]))
    if isinstance(g, Disk):
        return _circle(np.array(g.center, float), np.array(g.normal, float), g.radius)
    if isinstance(g, Sphere):
        offset = eye - np.array(g.center, float)
        distance = float(np.linalg.norm(offset))
        if distance <= g.radius:
            return np.zeros((0, 2, 3))
        share = g.radius / distance
        center = np.array(g.center, float) + offset * share**2
        return _circle(center, offset / distance, g.radius * np.sqrt(1 - share**2))
    assert isinstance(g, Cylinder)
    p0, p1 = np.array(g.p0, float), np.array(g.p1, float)
    axis = (p1 - p0) / np.linalg.norm(p1 - p0)
    across = eye - p0 - axis * ((eye - p0) @ axis)
    distance = float(np.linalg.norm(across))
    pieces = [_circle(p0, axis, g.radius), _circle(p1, axis, g.radius)]
    if distance > g.radius:
        s, share = across / distance, g.radius / distance
        t = np.cross(axis, s)
        for side in (-1, 1):
            rim = g.radius * (share * s + side * np.sqrt(1 - share**2) * t)
            pieces.append(np.array([[p0 + rim, p1 + rim]]))
    return np.concatenate(pieces)


def _mesh_outline(mesh: Mesh, eye: Float) -> Float:
    """Edges between a triangle that faces the eye and none or one that does not."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces = mesh.faces[((eye - corners[:, 0]) * normals).sum(1) > 0]
    if not len(faces):
        return np.zeros((0, 2, 3))
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return mesh.vertices[unique[count == 1]]


def _closed(points: Float) -> Float:
    return np.stack([points, np.roll(points, -1, axis=0)], axis=1)


def _circle(center: Float, normal: Float, radius: float) -> Float:
    s = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    s /= np.linalg.norm(s)
    t = np.cross(normal, s)
    phi = np.linspace(0, 2 * np.pi, SEGMENTS, endpoint=False)[:, None]
    return _closed(center + radius * (np.cos(phi) * s + np.sin(phi) * t))


def _points(segments: Float, camera: CameraPose) -> tuple[Float, Float]:
    """Points (m, 2) in pixels along the parts of the segments that are seen, if only blurred, and their distances (m,)
    along the view."""
    eye, corner, right, down = camera.ray_frame()
    if camera.orthographic:
        inverse = np.linalg.inv(np.stack([right, down, camera.axes()[2]], axis=1))
        ends = (segments - eye - corner) @ inverse.T  # (m, 2, 3): x, y, depth
    else:
        inverse = np.linalg.inv(np.stack([right, down, corner], axis=1))
        ends = (segments - eye) @ inverse.T  # (m, 2, 3): x·depth, y·depth, depth
    nearest = NEAREST * max(float(np.abs(ends[..., 2]).max(initial=0.0)), 1e-300)
    ends = ends[(ends[..., 2] > nearest).any(axis=1)]
    behind = ends[..., 2] < nearest
    t = (nearest - ends[:, 0, 2]) / np.where(behind.any(axis=1), ends[:, 1, 2] - ends[:, 0, 2], 1.0)
    cut = ends[:, 0] + t[:, None] * (ends[:, 1] - ends[:, 0])
    ends = np.where(behind[..., None], cut[:, None], ends)
    screen = ends[..., :2] if camera.orthographic else ends[..., :2] / ends[..., 2:]
    # What is linear along a straight line of the picture.
    away = ends[..., 2] if camera.orthographic else 1 / ends[..., 2]
    blur = camera.confusion(ends[..., 2]).max(initial=0.0)
    first, last = _clipped(screen, camera, 1.0 + min(float(blur), float(camera.width + camera.height)))
    seen = last > first
    start, step = screen[seen, 0], screen[seen, 1] - screen[seen, 0]
    a, b = start + first[seen, None] * step, start + last[seen, None] * step
    far_a, far_b = (away[seen, 0] + t[seen] * (away[seen, 1] - away[seen, 0]) for t in (first, last))
    count = np.ceil(np.linalg.norm(b - a, axis=1) / STEP).astype(np.int64) + 1
    piece = np.repeat(np.arange(len(a)), count)
    place = np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)
    share = (place / np.maximum(count[piece] - 1, 1))[:, None]
    depth = far_a[piece] * (1 - share[:, 0]) + far_b[piece] * share[:, 0]
    return a[piece] * (1 - share) + b[piece] * share, depth if camera.orthographic else 1 / depth


def _clipped(screen: Float, camera: CameraPose, margin: float) -> tuple[Float, Float]:
    """Where each segment (m, 2, 2) enters and leaves the picture with a margin in pixels, as shares of its length
    (Liang and Barsky 1984)."""
    first, last = np.zeros(len(screen)), np.ones(len(screen))
    for axis, size in enumerate((camera.width, camera.height)):
        start, step = screen[:, 0, axis], screen[:, 1, axis] - screen[:, 0, axis]
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = (-margin - start) / step, (size + margin - start) / step
        outside = (start < -margin) | (start > size + margin)
        low, high = (
            np.where(step == 0, np.where(outside, np.inf, -np.inf), np.minimum(low, high)),
            np.where(step == 0, np.where(outside, -np.inf, np.inf), np.maximum(low, high)),
        )
        first, last = np.maximum(first, low), np.minimum(last, high)
    return first, last
