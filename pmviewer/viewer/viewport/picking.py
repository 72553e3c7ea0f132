"""The photon under the mouse, of the clouds that are drawn."""

from __future__ import annotations

import numpy as np

from pmviewer.engine.inspector.report import PhotonAt
from pmviewer.render.camera import CameraPose
from pmviewer.settings.access import get
from pmviewer.viewer.overlays.overlay import Source
from pmviewer.viewer.viewport.target import clip_planes

REACH = 0.012
"""How far from the mouse a photon may be, as a share of the picture's height."""
MAPS = ("caustic", "global")


def picked(source: Source, camera: CameraPose | None, mouse: tuple[float, float]) -> PhotonAt | None:
    """The drawn photon that is nearest to the camera of those within REACH of the mouse, a place (u, v) of the picture
    from its left and top; None where none is drawn. Surfaces hide nothing."""
    frame = source.frame
    if frame is None or frame.coarse or camera is None:  # a coarse frame has other photons
        return None
    best: tuple[float, np.ndarray] | None = None
    for name in MAPS:
        cloud = frame.clouds.get(name)
        if cloud is None or not get(source.settings, f"overlays.{name}.show") or not len(cloud.photons):
            continue
        depth, distance = on_picture(camera, cloud.photons[:, :3], source.scene_radius, mouse)
        near = np.flatnonzero((distance < REACH) & (depth > 0))
        if len(near):
            at = near[np.argmin(depth[near])]
            if best is None or depth[at] < best[0]:
                best = float(depth[at]), cloud.photons[at, :3]
    if best is None:
        return None
    x, y, z = (float(v) for v in best[1])
    settings, passes = frame.settings, frame.statistics.passes
    index = 0 if settings.photons.renew == "once" else max(passes - 1, 0)
    return PhotonAt(index, settings.photons.N, (x, y, z))


def on_picture(
    camera: CameraPose, points: np.ndarray, scene_radius: float, mouse: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Depth (n,), above 0 ahead of the camera, and distance (n,) from the mouse in picture heights of points (n, 3)."""
    near, far = clip_planes(camera, np.asarray(camera.target, float), scene_radius)
    clip = camera.cut_projection(near, far) @ camera.view_matrix()
    placed = np.column_stack([points.astype(np.float64), np.ones(len(points))]) @ np.asarray(clip, np.float64).T
    w = np.where(placed[:, 3] > 0, placed[:, 3], np.inf)
    u, v = 0.5 + 0.5 * placed[:, 0] / w, 0.5 - 0.5 * placed[:, 1] / w
    aspect = camera.width / camera.height
    distance = np.hypot((u - mouse[0]) * aspect, v - mouse[1])
    ahead = placed[:, 3] if not camera.orthographic else 1.0 + placed[:, 2]
    return ahead, np.where(np.isfinite(w), distance, np.inf)
