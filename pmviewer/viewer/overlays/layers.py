"""The overlays of a window, drawn one over the other."""

from __future__ import annotations

import moderngl

from pmviewer.settings.access import Settings
from pmviewer.viewer.gl.program import Drawing, Shaders
from pmviewer.viewer.overlays.overlay import Overlay, Source
from pmviewer.viewer.overlays.registry import OVERLAYS


def any_shown(settings: Settings) -> bool:
    """Whether the settings have anything drawn over the picture."""
    return any(overlay.is_shown(settings) for overlay in OVERLAYS if overlay.by_settings)


class Layers:
    """One overlay of each kind, by name. Every method needs the window's OpenGL context."""

    def __init__(self, shaders: Shaders) -> None:
        self._context = shaders.context
        self.by_name: dict[str, Overlay] = {overlay.name: overlay(shaders) for overlay in OVERLAYS}

    def upload(self, source: Source) -> bool:
        """Bring what is shown to the GPU and free what is not. True when anything changed."""
        changed = [overlay.upload(source) for overlay in self.by_name.values()]
        return any(changed)

    def forget(self) -> None:
        """Free everything that lies on the GPU."""
        for overlay in self.by_name.values():
            overlay.forget()

    def shown(self, settings: Settings) -> list[Overlay]:
        """Those that are switched on, in the panel's order."""
        return [one for one in self.by_name.values() if one.is_shown(settings) and one.active]

    def cover_surfaces(self, settings: Settings) -> bool:
        """Whether shaded surfaces have to be dim, for what lies on them to be seen. A frustum has a rim of its own."""
        return any(overlay.switch is not None for overlay in self.shown(settings))

    def need_depth(self, settings: Settings) -> bool:
        """Whether surfaces hide any of what is drawn."""
        return any(overlay.tests_depth(settings) for overlay in self.shown(settings))

    def draw(self, framebuffer: moderngl.Framebuffer, drawing: Drawing, settings: Settings) -> None:
        """Draw into the bound framebuffer: opaque things first, then translucent ones, which leave its depth buffer as
        it is. moderngl hands a framebuffer's mask to OpenGL when it is bound."""
        shown = self.shown(settings)
        for overlay in shown:
            overlay.draw(drawing, settings)
        framebuffer.depth_mask = False
        framebuffer.use()
        for overlay in sorted(shown, key=lambda one: one.rank):
            overlay.draw_over(drawing, settings)
        framebuffer.depth_mask = True
        framebuffer.use()
