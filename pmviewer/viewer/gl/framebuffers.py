"""Framebuffers by name, as large as they are needed."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray


class Framebuffers:
    """Each has a colour texture and a depth buffer. Every method needs the window's OpenGL context."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._named: dict[str, moderngl.Framebuffer] = {}

    def get(self, name: str, size: tuple[int, int]) -> moderngl.Framebuffer:
        """The one of that name; another size (width, height) replaces it."""
        size = (max(size[0], 1), max(size[1], 1))
        old = self._named.get(name)
        if old is not None and old.size == size:
            return old
        self.drop(name)
        colour = self._context.texture(size, 4)
        colour.filter = (moderngl.NEAREST, moderngl.NEAREST)  # shown pixel for pixel
        new = self._named[name] = self._context.framebuffer([colour], self._context.depth_renderbuffer(size))
        return new

    def drop(self, name: str) -> None:
        """Free the one of that name, if there is one."""
        old = self._named.pop(name, None)
        if old is not None:
            old.color_attachments[0].release()
            old.depth_attachment.release()
            old.release()

    def release(self) -> None:
        """Free all of them."""
        for name in list(self._named):
            self.drop(name)

    def read(self, name: str) -> NDArray[np.uint8]:
        """(height, width, 3) of what was drawn into that framebuffer, top row first."""
        framebuffer = self._named[name]
        width, height = framebuffer.size
        pixels = np.frombuffer(framebuffer.read(components=3, alignment=1), np.uint8).reshape(height, width, 3)
        return np.ascontiguousarray(pixels[::-1])
