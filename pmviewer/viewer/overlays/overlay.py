"""What an overlay is: one object that knows its settings, its data, how it is drawn and what the panel says of it.

`docs` and CONTRIBUTING.md ("Add an overlay") show how to add one; `pmviewer.viewer.overlays.registry` lists them.
"""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from imgui_bundle import imgui

from pmviewer.engine.frame import Frame
from pmviewer.render.camera import CameraPose
from pmviewer.settings.access import SETTINGS, SettingInfo, Settings
from pmviewer.viewer.gl.program import Drawing, Shaders

if TYPE_CHECKING:
    from pmviewer.viewer.inspector import Inspector
    from pmviewer.viewer.loaded_photons import FilePhotons
    from pmviewer.viewer.viewport.viewport import Viewport

Needs = tuple[Any, ...]
_BY_VALUE = (int, float, str, CameraPose)


@dataclass(frozen=True)
class Source:
    """What overlays take their data from. `scene_radius` is that of the bounding sphere, in scene units; `pixel` the
    one that was asked for with I, `inspector` what is pinned."""

    settings: Settings
    frame: Frame | None = None
    scene_radius: float = 1.0
    render_camera: Callable[[], CameraPose | None] = lambda: None
    pixel: tuple[int, int] | None = None
    inspector: Inspector | None = None
    loaded: FilePhotons | None = None
    """Of a file that was opened."""


@dataclass(frozen=True)
class Switch:
    """The key that switches an overlay, perhaps with Shift, and what the overview of keys says of it."""

    key: imgui.Key
    keys: str
    text: str
    shift: bool = False


class Overlay(ABC):
    """Every method but those of the class needs the window's OpenGL context."""

    name: ClassVar[str]
    """Of its settings, `overlays.NAME`, and its action, `toggle_NAME`."""
    switch: ClassVar[Switch | None] = None
    """None: it has no row in the panel and no settings in `overlays`."""
    things: ClassVar[str] = ""
    """What the number beside its name counts."""
    by_settings: ClassVar[bool] = True
    """Whether settings switch it; what is pinned is shown whenever something is."""
    rank: ClassVar[int] = 0
    """Of what is drawn translucently: smaller ones lie under larger ones."""

    def __init__(self, shaders: Shaders) -> None:
        self.shaders = shaders
        self._taken: Needs | None = None

    # what it shows ----------------------------------------------------------------------------------------------

    @classmethod
    def style(cls, settings: Settings) -> Any:
        """Its group of settings."""
        return getattr(settings.overlays, _attributes(type(settings.overlays))[cls.name])

    @classmethod
    def is_shown(cls, settings: Settings) -> bool:
        """Whether the settings ask for it; there may be nothing to draw all the same."""
        return bool(cls.style(settings).show)

    @classmethod
    def tests_depth(cls, settings: Settings) -> bool:
        """Whether surfaces hide any of it."""
        return bool(cls.style(settings).depth)

    @abstractmethod
    def needs(self, source: Source) -> Needs | None:
        """What `take` brings to the GPU while the overlay is shown, None when there is nothing. It is asked for in
        every frame: objects count as others than before when they are others, numbers and cameras by value."""

    @abstractmethod
    def take(self, *needs: Any) -> None:
        """Bring it to the GPU, in place of what is there."""

    @abstractmethod
    def release(self) -> None:
        """Free what lies on the GPU."""

    @property
    def active(self) -> bool:
        """Whether it takes part in drawing while it is shown."""
        return True

    def upload(self, source: Source) -> bool:
        """Take what the source has, if it is something else than before. True when anything changed."""
        needs = self.needs(source) if self.is_shown(source.settings) else None
        if _same(self._taken, needs):
            return False
        self._taken = needs
        if needs is None:
            self.release()
        else:
            self.take(*needs)
        return True

    def forget(self) -> None:
        """Free what lies on the GPU, and know that it is gone."""
        self._taken = None
        self.release()

    # drawing ----------------------------------------------------------------------------------------------------

    def draw(self, drawing: Drawing, settings: Settings) -> None:  # noqa: B027
        """Draw what is opaque."""

    def draw_over(self, drawing: Drawing, settings: Settings) -> None:  # noqa: B027
        """Draw what is translucent, after everything that is opaque. The depth buffer is not written."""

    def annotate(self, viewport: Viewport, source: Source) -> None:  # noqa: B027
        """Write text over the picture."""

    # panel ------------------------------------------------------------------------------------------------------

    @classmethod
    def rows(cls) -> list[SettingInfo]:
        """The settings that the panel lists while the overlay is shown."""
        start = f"overlays.{cls.name}."
        return [info for path, info in SETTINGS.items() if path.startswith(start) and path != f"{start}show"]

    def count(self, source: Source) -> int | None:
        """The number beside its name in the panel, None for none."""
        return None

    def legend(self, source: Source) -> None:  # noqa: B027
        """What the colours mean, with imgui, in the panel."""


@functools.cache
def _attributes(overlays: type[Any]) -> dict[str, str]:
    """The attributes of that group of settings by the names in their paths: asked for some fifty times a frame."""
    return {field.alias or name: name for name, field in overlays.model_fields.items()}


def _same(before: Needs | None, now: Needs | None) -> bool:
    if before is None or now is None:
        return before is now
    return all(a is b or (isinstance(a, _BY_VALUE) and a == b) for a, b in zip(before, now, strict=True))
