"""Two pictures as textures, for a viewport that compares them."""

from __future__ import annotations

from collections.abc import Callable, Hashable

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.viewer.gl.textures import HeldTexture

Keyed = tuple[Hashable, Callable[[], NDArray[np.float32]]]


class PairPlanes:
    """Every method needs the window's OpenGL context."""

    def __init__(self, context: moderngl.Context) -> None:
        self._held = HeldTexture(context), HeldTexture(context)

    @property
    def planes(self) -> tuple[moderngl.Texture, ...]:
        """Both textures, or none."""
        held = tuple(one.texture for one in self._held if one.texture is not None)
        return held if len(held) == 2 else ()

    def upload(self, pair: tuple[Keyed, Keyed] | None) -> bool:
        """Take two images, each with what tells it from others, or none. True when anything changed."""
        if pair is None:
            changed = [held.take(None, lambda: np.empty(0)) for held in self._held]
        else:
            changed = [held.take(key, image) for held, (key, image) in zip(self._held, pair, strict=True)]
        return any(changed)
