"""Two pictures as textures, for a viewport that is split between them."""

from __future__ import annotations

import moderngl
import numpy as np

from pmviewer.engine.frame import Frame


class PairPlanes:
    """Every method needs the window's OpenGL context."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._shown: tuple[Frame, Frame, str] | None = None
        self.planes: tuple[moderngl.Texture, ...] = ()

    def upload(self, frames: tuple[Frame, Frame] | None, view: str) -> bool:
        """Take that view of both frames, or none. True when anything changed."""
        wanted = None if frames is None else (*frames, view)
        before = self._shown
        if wanted is None and before is None:
            return False
        if wanted and before and wanted[0] is before[0] and wanted[1] is before[1] and view == before[2]:
            return False
        for plane in self.planes:
            plane.release()
        self._shown, self.planes = wanted, ()
        if frames is not None:
            images = [np.ascontiguousarray(frame.image(view), np.float32) for frame in frames]
            self.planes = tuple(self._texture(image) for image in images)
        return True

    def _texture(self, image: np.ndarray) -> moderngl.Texture:
        height, width, channels = image.shape
        texture = self._context.texture((width, height), channels, image.tobytes(), dtype="f4", alignment=4)
        texture.repeat_x = texture.repeat_y = False
        return texture
