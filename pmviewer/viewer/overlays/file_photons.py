"""Photons of a file as points."""

from __future__ import annotations

from imgui_bundle import imgui

from pmviewer.viewer import theme
from pmviewer.viewer.overlays.overlay import Needs, Source, Switch
from pmviewer.viewer.overlays.points import Points


class FilePhotons(Points):
    """What `pmviewer photons` has written, of this scene or of another one, by these settings or by others."""

    name = "file"
    switch = Switch(imgui.Key.p, "Shift+P", "Photons of a PLY file on or off", shift=True)
    things = "Photons of the file that was opened (File > Photons of a PLY file)"

    def needs(self, source: Source) -> Needs | None:
        loaded = source.loaded
        return None if loaded is None else (loaded.records, loaded.power_unit)

    def count(self, source: Source) -> int | None:
        return None if source.loaded is None else len(source.loaded.records)

    def more_legend(self, source: Source) -> None:
        name = source.loaded.path.name if source.loaded is not None else "no file yet: File > Photons of a PLY file"
        imgui.text_colored(imgui.ImVec4(*theme.DIM), theme.drawable(name))
