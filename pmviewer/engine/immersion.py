"""Which medium the camera is in."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pmviewer.render.camera import CameraPose

if TYPE_CHECKING:  # numba, which the window doesn't wait for
    from pmviewer.scene.arrays.flatten import FlatScene


def immersed(scene: FlatScene, camera: CameraPose) -> CameraPose:
    """The camera with the medium around its eye, or around the middle of its near plane: what the boundaries say that
    rays from there meet or, where they meet none, what the file says of its own camera. The camera itself in scenes
    without media."""
    if not scene.has_media:
        return camera
    from pmviewer.scene.arrays.media import medium_at

    return replace(camera, medium=medium_at(scene.record, camera.start(), scene.owner.camera.medium))
