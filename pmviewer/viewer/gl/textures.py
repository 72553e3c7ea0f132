"""Images as textures that stay as long as they are the same."""

from __future__ import annotations

from collections.abc import Callable, Hashable

import moderngl
import numpy as np
from numpy.typing import NDArray


class Same:
    """Stands for one object in a key, and keeps it: equal only to that of the very same one."""

    def __init__(self, one: object) -> None:
        self._one = one

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and other._one is self._one

    def __hash__(self) -> int:
        return id(self._one)


class HeldTexture:
    """One texture (h, w, channels) of float32. Every method needs the window's OpenGL context."""

    def __init__(self, context: moderngl.Context) -> None:
        self.texture: moderngl.Texture | None = None
        self._context = context
        self._key: Hashable = None

    def take(self, key: Hashable, image: Callable[[], NDArray[np.floating]]) -> bool:
        """Hold the image that goes by that key, None for none; `image` is called for another key alone. True when it
        is another one than before."""
        if key == self._key:
            return False
        self._key = key
        if key is None:
            self._free()
            return True
        self.write(image())
        return True

    def write(self, image: NDArray[np.floating]) -> None:
        """Hold this image, in another texture where it has another shape."""
        planes = image[..., None] if image.ndim == 2 else image
        height, width, channels = planes.shape
        held = self.texture
        if held is None or held.size != (width, height) or held.components != channels:
            self._free()
            self.texture = self._context.texture((width, height), channels, dtype="f4", alignment=4)
            self.texture.repeat_x = self.texture.repeat_y = False
        assert self.texture is not None
        self.texture.write(np.ascontiguousarray(planes, np.float32))

    def _free(self) -> None:
        if self.texture is not None:
            self.texture.release()
            self.texture = None

    def release(self) -> None:
        """Free it; whatever comes next is another image."""
        self._free()
        self._key = None
