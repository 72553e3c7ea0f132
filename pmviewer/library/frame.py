"""A picture as a library gives it: arrays, figures, errors, files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.comparison.reference import reference_for
from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.frame import Frame, Statistics
from pmviewer.engine.inspection import Inspection
from pmviewer.engine.opened import OpenScene
from pmviewer.errors import OutputError, SceneError, SettingError
from pmviewer.library.photons import Photons, check_map, photons_of
from pmviewer.output.diagnostic_views import DIAGNOSTICS, HELD_WHILE_SHOWN
from pmviewer.output.files import check_target
from pmviewer.output.frame_export import (
    LAYERS,
    RADIANCE_UNIT,
    VOLUME_LAYERS,
    shown_pixels,
    write_frame_exr,
    write_frame_png,
)
from pmviewer.output.metric import Metrics, metrics
from pmviewer.output.session_file import write_session
from pmviewer.output.tone import to_uint8
from pmviewer.render.camera import CameraPose
from pmviewer.settings.access import Settings

Image = NDArray[np.float32]
Look = Callable[[Frame, str, str | None], Inspection]
"""Makes a diagnostic view, of a map if one is named, for a frame. Raises SettingError."""

SUFFIXES = (".exr", ".png", ".toml")
VIEWS = (*LAYERS, *VOLUME_LAYERS, *HELD_WHILE_SHOWN)
UNITS = {"albedo": "", "normal": "", "depth": "scene units"}
"""Of views that are no radiance."""


@dataclass(frozen=True, eq=False, repr=False)
class RenderedFrame:
    """What `Rendering.render` gives: the film after some passes. It stays as it is when the rendering goes on.

    Images are float32, row 0 at the top, linear radiance in W/(m² sr); they can't be written to, a `.copy()` can.
    """

    opened: OpenScene
    frame: Frame
    parameters: Mapping[str, str]
    look: Look

    def __repr__(self) -> str:
        camera = self.camera
        return f"<frame of {self.opened.scene.name}: {camera.width}×{camera.height} pixels, {self.passes} passes>"

    @property
    def beauty(self) -> Image:
        """The image (h, w, 3): the sum of the terms, bit for bit."""
        return self.view("beauty")

    @property
    def emission(self) -> Image:
        """Term (h, w, 3): light sources that the camera sees."""
        return self.view("emission")

    @property
    def direct(self) -> Image:
        """Term (h, w, 3): direct light on the first diffuse surface."""
        return self.view("direct")

    @property
    def specular(self) -> Image:
        """Term (h, w, 3): everything seen over mirrors and glass."""
        return self.view("specular")

    @property
    def caustic(self) -> Image:
        """Term (h, w, 3): light that came to the first diffuse surface over mirrors and glass alone."""
        return self.view("caustic")

    @property
    def indirect(self) -> Image:
        """Term (h, w, 3): light that came there after a diffuse reflection."""
        return self.view("indirect")

    @property
    def albedo(self) -> Image:
        """First hit (h, w, 3): share of the light that the surface sends back, 0 … 1."""
        return self.view("albedo")

    @property
    def normal(self) -> Image:
        """First hit (h, w, 3): the unit normal of shading in world coordinates; averaged over the passes."""
        return self.view("normal")

    @property
    def depth(self) -> Image:
        """First hit (h, w): distance from the camera in scene units, 0 where nothing is hit; averaged likewise."""
        return self.view("depth")

    @property
    def statistics(self) -> Statistics:
        """What was counted: passes, photons, rays, seconds, the energy ledger, warnings."""
        return self.frame.statistics

    @property
    def passes(self) -> int:
        """In the film."""
        return self.frame.statistics.passes

    @property
    def camera(self) -> CameraPose:
        """Through which the picture is seen."""
        return self.frame.camera

    @property
    def settings(self) -> Settings:
        """With which it was rendered."""
        return self.frame.settings

    def view(self, name: str, map: str | None = None) -> Image:
        """A view by the name that the window has for it.

        "beauty", a term or a first-hit property; or a diagnostic view, made from the maps of the latest pass:
        "look-up radius", "photon count", "importance", "achieved density" …, of `map` "global" or "caustic" where
        there are two, and "denoised". (h, w, 3), or (h, w) for one number a pixel; diagnostic views hold −1 where
        there is nothing to tell. `unit` has their units.

        Raises SettingError for an unknown view, one that these settings have nothing for, and a diagnostic view of a
        frame that the rendering has left behind.
        """
        if name in HELD_WHILE_SHOWN:
            plane = self._held(name, map).image(name)
        elif name in (*LAYERS, *VOLUME_LAYERS):
            if map is not None:
                raise SettingError(f"The view '{name}' is of no map: leave out map={map!r}.")
            plane = self.frame.image(name)
        else:
            raise _no_view(name)
        plane = plane[..., 0] if plane.shape[-1] == 1 else plane
        plane = plane.view()
        plane.flags.writeable = False
        return plane

    def picture(self, view: str | None = None) -> NDArray[np.uint8]:
        """A view as the window shows it, (h, w, 3) for a screen: with the exposure and tone curve of the settings
        `display`, diagnostic views in false colours. That of `display.view` if None. Raises as `view` does."""
        view = view or self.settings.display.view
        if view not in VIEWS:
            raise _no_view(view)
        return to_uint8(shown_pixels(self._held(view, None), view, self.settings.display))

    def unit(self, view: str) -> str:
        """Unit of a view's numbers, "" for a mere number."""
        return DIAGNOSTICS[view].unit if view in DIAGNOSTICS else UNITS.get(view, RADIANCE_UNIT)

    def photons(self, map: str = "global") -> Photons:
        """The photons of the latest pass in the "global" or the "caustic" map. Raises SettingError where there is no
        such map with these settings."""
        check_map(map)
        reason = inactive_reason(f"overlays.{map}.show", self.settings, self.opened.traits)
        if reason is not None:
            raise SettingError(f"photons('{map}'): {reason}")
        scene = self.opened.scene
        cloud = self.frame.clouds[map]
        return photons_of(map, cloud, self.settings, scene.name, self.passes, tuple(scene.warnings))

    def errors(self, reference: str | Path | NDArray[Any] | None = None) -> Metrics:
        """Errors against an image: relMSE (`relmse_all`), the same without the worst pixels (`relmse_drop`), the ratio
        of the means, the error of 8×8 blocks; formulas in `pmviewer.output.metric`.

        reference: an image (h, w, 3) in W/(m² sr), an EXR file, or None for the scene's own reference.
        Raises SceneError or SettingError where the two can't be compared.
        """
        if isinstance(reference, np.ndarray):
            image = np.asarray(reference)
            if image.shape != self.beauty.shape:
                raise SettingError(f"The reference has the shape {image.shape}, the picture {self.beauty.shape}.")
            if not np.isfinite(image).all():
                raise SettingError("The reference is not finite everywhere: it can't serve for a comparison.")
        else:
            image = reference_for(reference, self.opened.scene, self.settings).image
        return metrics(self.beauty, image)

    def relmse(self, reference: str | Path | NDArray[Any] | None = None) -> float:
        """Relative squared error, the mean of (I−R)²/(R²+0.01); see `errors`."""
        return self.errors(reference).relmse_all

    def save(self, path: str | Path, *, view: str | None = None, half: bool = False) -> None:
        """Write a file by its ending: .exr (all layers and every setting, in half precision with `half`), .png (a view
        as it is shown, that of `display.view` if None), .toml (a session that opens to the same picture).

        Raises OutputError, SettingError for a view that there is not.
        """
        check_target(path, SUFFIXES)
        suffix = Path(path).suffix.lower()
        if half and suffix != ".exr":
            raise SettingError(f"{path}: half precision is for .exr files.")
        if view is not None and suffix == ".toml":
            raise SettingError(f"{path}: a session holds no picture: leave out view={view!r}.")
        if view is not None and view not in VIEWS:
            raise _no_view(view)
        if suffix == ".toml":
            self._save_session(path)
        elif suffix == ".exr":
            write_frame_exr(path, self.frame if view is None else self._held(view, None), half=half)
        else:
            view = view or self.settings.display.view
            write_frame_png(path, self._held(view, None), view=view)

    def _held(self, view: str, map: str | None) -> Frame:
        """The frame, with the view in it if it is one that is made on demand."""
        if view not in HELD_WHILE_SHOWN or (map is None and view in self.frame.inspection.planes):
            return self.frame
        return replace(self.frame, inspection=self.look(self.frame, view, map))

    def _save_session(self, path: str | Path) -> None:
        if self.opened.content is None:
            raise OutputError(f"{path}: a session names its scene's file, and this scene was made in Python.")
        try:
            write_session(path, self.settings, self.opened.source, self.passes, self.parameters)
        except SceneError as error:
            raise OutputError(str(error)) from None


def _no_view(name: str) -> SettingError:
    return SettingError(f"There is no view '{name}'. There are {', '.join(VIEWS)}.")
