"""The scenes that the program brings along, with their pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import moderngl
import numpy as np
from imgui_bundle import imgui

from pmviewer.errors import PmviewerError
from pmviewer.output.png import read_png
from pmviewer.viewer import theme
from pmviewer.viewer.state import ViewerState

if TYPE_CHECKING:
    from pmviewer.scene.load import BundledScene

PREVIEW = "preview.png"
_SIDE = 14.0
"""Of a picture's longer side, in multiples of the font size."""


class BundledMenu:
    """Pictures are read when the mouse is over a name."""

    def __init__(self, state: ViewerState) -> None:
        self._state = state
        self._scenes: list[BundledScene] = []
        self._pictures: dict[str, moderngl.Texture | None] = {}

    def gui(self) -> None:
        """The menu's entries."""
        if not self._scenes:
            from pmviewer.scene.load import bundled_scenes  # readers of scene files, which the window doesn't wait for

            self._scenes = bundled_scenes()
        for scene in self._scenes:
            if imgui.menu_item(scene.name, "", self._state.session.scene_path == scene.name)[0]:
                self._state.open(scene.name)
            if imgui.is_item_hovered():
                self._tell(scene)

    def _tell(self, scene: BundledScene) -> None:
        """A tooltip: what the scene is for, and its picture."""
        imgui.begin_tooltip()
        imgui.push_text_wrap_pos(imgui.get_font_size() * _SIDE * 1.5)
        imgui.text_unformatted(theme.drawable(scene.description))
        imgui.pop_text_wrap_pos()
        picture = self._picture(scene.name, scene.path / PREVIEW)
        if picture is not None:
            scale = imgui.get_font_size() * _SIDE / max(picture.size)
            imgui.image(imgui.ImTextureRef(picture.glo), (picture.width * scale, picture.height * scale))
        imgui.end_tooltip()

    def _picture(self, name: str, path: Path) -> moderngl.Texture | None:
        if name not in self._pictures:
            try:
                pixels, _ = read_png(path)
            except (PmviewerError, OSError):  # a picture is missed, not needed
                self._pictures[name] = None
            else:
                rgb = np.ascontiguousarray(pixels[..., :3])
                context = moderngl.get_context()
                self._pictures[name] = context.texture(rgb.shape[1::-1], 3, rgb.tobytes(), alignment=1)
        return self._pictures[name]
