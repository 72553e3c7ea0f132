"""A frame as EXR (every layer, every setting) or PNG (one view as it is shown)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import OutputError
from pmviewer.output.diagnostic_views import DENOISED, DIAGNOSTICS, HELD_WHILE_SHOWN, coloured
from pmviewer.output.exr import BEAUTY, PREFIX, Value, write_exr
from pmviewer.output.false_look import look_of
from pmviewer.output.png import write_png
from pmviewer.output.shading import shaded, shades
from pmviewer.output.side_by_side import side_by_side
from pmviewer.output.tone import display_image, to_uint8
from pmviewer.settings.access import Display, Settings, flat
from pmviewer.settings.edits import as_text
from pmviewer.version import __version__

LAYERS = ("beauty", "emission", "direct", "specular", "caustic", "indirect", "albedo", "normal", "depth")
"""The beauty image, its terms in the order in which their sum gives it bit for bit, and the first hit's properties."""
BEAUTY_VIEW = LAYERS[0]
VOLUME_LAYERS = ("volume", "volume indirect")
"""Terms of scenes with media, added to the sum behind the others; files of other scenes don't have them."""
EXR_NAMES = {"beauty": BEAUTY, "normal": "N", "volume indirect": "volume_indirect"}
RADIANCE_UNIT = "W/(m^2 sr)"


class Counts(Protocol):
    """What an exporter reads of `pmviewer.engine.frame.Statistics`."""

    @property
    def passes(self) -> int:
        """In the film."""

    @property
    def emitted(self) -> int:
        """Trajectories of all passes."""

    @property
    def stored(self) -> Mapping[str, int]:
        """Photons of all passes by map."""

    @property
    def radius(self) -> Mapping[str, float]:
        """Of look-ups in the latest pass by map, in scene units."""

    @property
    def rays(self) -> int:
        """All that were cast, shadow rays included."""

    @property
    def seconds(self) -> float:
        """Rendering time without pauses, by wall clock."""

    @property
    def cpu_seconds(self) -> float:
        """Of all passes, summed over threads."""

    @property
    def remaining(self) -> Remaining | None:
        """Estimate of the picture's error, None without."""

    @property
    def dropped(self) -> Mapping[str, int]:
        """Samples that were not finite or negative, by where they arose."""


class Remaining(Protocol):
    """What an exporter reads of `pmviewer.engine.remaining.Remaining`."""

    @property
    def relmse(self) -> float:
        """Estimate."""

    @property
    def low(self) -> float:
        """Lower end of the interval that covers nine pictures of ten."""

    @property
    def high(self) -> float:
        """Upper end."""


class Pose(Protocol):
    """What an exporter reads of `pmviewer.render.camera.CameraPose`."""

    @property
    def origin(self) -> tuple[float, float, float]:
        """World coordinates of the eye."""

    @property
    def target(self) -> tuple[float, float, float]:
        """World coordinates of the point that is looked at, in the middle of an unshifted picture."""

    @property
    def up(self) -> tuple[float, float, float]:
        """Direction that points up in the picture; need not be perpendicular to the view."""

    @property
    def fov(self) -> float:
        """Horizontal angle of view in degrees, of perspective alone."""

    @property
    def near(self) -> float:
        """Distance of the near plane from the eye."""

    @property
    def near_normal(self) -> tuple[float, float, float] | None:
        """Unit normal of a near plane that clips the picture, away from the eye; None where there is none."""

    @property
    def projection(self) -> str:
        """ "perspective" or "orthographic"."""

    @property
    def view_width(self) -> float:
        """Width of the picture in scene units, of orthographic alone."""

    @property
    def shift(self) -> tuple[float, float]:
        """Of the picture on the film, in widths and heights."""

    @property
    def aperture(self) -> float:
        """Radius of the lens, 0 for a pinhole."""

    @property
    def focus(self) -> float | None:
        """Distance that the lens shows sharp."""


class Exportable(Protocol):
    """What an exporter reads of `pmviewer.engine.frame.Frame`."""

    @property
    def settings(self) -> Settings:
        """Those that the frame was made with."""

    @property
    def statistics(self) -> Counts:
        """Up to this frame's pass."""

    @property
    def camera(self) -> Pose:
        """Through which the picture is seen, the free camera where it is on."""

    @property
    def scene_name(self) -> str:
        """For titles."""

    @property
    def exposure(self) -> float:
        """In stops, as the display resolved it."""

    @property
    def has_media(self) -> bool:
        """Whether it has VOLUME_LAYERS."""

    @property
    def diagnostics(self) -> Mapping[str, NDArray[np.float32]]:
        """Planes of `HELD_WHILE_SHOWN` that the frame holds, (h, w, c) by view."""

    def image(self, view: str = ...) -> NDArray[np.float32]:
        """A layer of `LAYERS` or a plane of `diagnostics`, (h, w, c) float32; the image without a name."""


def layers_of(frame: Exportable) -> tuple[str, ...]:
    """The names of its layers: LAYERS, and where there are media VOLUME_LAYERS."""
    return (*LAYERS, *VOLUME_LAYERS) if frame.has_media else LAYERS


def frame_layers(frame: Exportable) -> dict[str, NDArray[np.float32]]:
    """Every one of `LAYERS` by its name in an EXR file, (h, w, 3) float32, depth (h, w, 1); behind them those of
    VOLUME_LAYERS where there are media, and the planes of diagnostic views that the frame holds, negative where there
    is nothing to tell."""
    layers = {EXR_NAMES.get(name, name): frame.image(name) for name in layers_of(frame)}
    return layers | {layer_name(view): plane for view, plane in frame.diagnostics.items()}


def layer_name(view: str) -> str:
    """Of a diagnostic view's plane in an EXR file."""
    return view.replace(" ", "_").replace("-", "_")


def frame_metadata(frame: Exportable) -> dict[str, Value]:
    """What made the picture: every setting by its full name, the camera as it was resolved, and the counts.

    Vectors are texts of three numbers, switches "true" or "false", lengths in scene units, times in seconds.
    """
    counts, camera = frame.statistics, frame.camera
    about: dict[str, Value] = {
        "program": f"pmviewer {__version__}",
        "scene": frame.scene_name,
        "units": RADIANCE_UNIT,
        "seed": frame.settings.render.seed,
        "passes": counts.passes,
        "photons_emitted": counts.emitted,
        "rays": counts.rays,
        "seconds": float(counts.seconds),
        "cpu_seconds": float(counts.cpu_seconds),
        "view.exposure": exposure_of(frame, frame.settings.display),
        **camera_metadata(camera),
    }
    about |= {f"photons_stored.{name}": count for name, count in counts.stored.items()}
    about |= {f"radius.{name}": float(radius) for name, radius in counts.radius.items()}
    about |= {f"dropped.{place}": count for place, count in counts.dropped.items()}
    about |= {f"units.{layer_name(view)}": DIAGNOSTICS[view].unit for view in frame.diagnostics if view in DIAGNOSTICS}
    if (found := counts.remaining) is not None:
        about |= {"relmse.estimate": found.relmse, "relmse.low": found.low, "relmse.high": found.high}
    if DENOISED in frame.diagnostics:
        about["denoiser"] = "Open Image Denoise; a guess, no estimate"
    return about | {path: _plain(value) for path, value in flat(frame.settings).items()}


def camera_metadata(camera: Pose) -> dict[str, Value]:
    """The camera as it was resolved, by the names of the attributes."""
    about: dict[str, Value] = {
        "view.origin": _text(camera.origin),
        "view.target": _text(camera.target),
        "view.up": _text(camera.up),
        "view.projection": camera.projection,
    }
    if camera.projection == "orthographic":
        about["view.width"] = float(camera.view_width)
    else:
        about["view.fov"] = float(camera.fov)
    if any(camera.shift):
        about["view.shift"] = f"{camera.shift[0]:.9g} {camera.shift[1]:.9g}"
    if camera.near_normal is not None:
        about["view.clip"] = f"{_text(camera.near_normal)} {camera.near:.9g}"
    if camera.aperture > 0 and camera.focus is not None:
        about |= {"view.aperture": float(camera.aperture), "view.focus": float(camera.focus)}
    return about


def exposure_of(frame: Exportable, display: Display) -> float:
    """EV that the frame is shown with by these display settings. EXR files hold radiance, whatever it is."""
    return frame.exposure if display.exposure == "auto" else float(display.exposure)


def write_frame_exr(path: str | Path, frame: Exportable, half: bool = False) -> None:
    """Write all layers and the metadata. Raises OutputError."""
    write_exr(path, frame_layers(frame), frame_metadata(frame), half)


def write_frame_png(
    path: str | Path, frame: Exportable, view: str | None = None, display: Display | None = None
) -> None:
    """Write one view as it is shown.

    Parameters
    ----------
    view: what to show; the display settings' view if None.
    display: view, exposure and tone curve; the frame's own if None. They change without a new frame.

    Raises OutputError, also for the view `geometry`, which only the window draws.
    """
    display = display or frame.settings.display
    view = view or display.view
    if view in HELD_WHILE_SHOWN and view not in frame.diagnostics:
        raise OutputError(f"{path}: this frame holds nothing for the view '{view}': see when it is available.")
    if view not in LAYERS and view not in HELD_WHILE_SHOWN:
        raise OutputError(f"{path}: the view '{view}' is drawn by the window alone. Choose one of {', '.join(LAYERS)}.")
    pixels = shown_pixels(frame, view, display)
    write_png(path, pixels, frame_texts(frame))


def frame_texts(frame: Exportable) -> dict[str, str]:
    """The metadata as PNG files have it."""
    texts = {PREFIX + name: _text(value) for name, value in frame_metadata(frame).items()}
    return {"Software": f"pmviewer {__version__}", "Title": frame.scene_name, **texts}


def shown_pixels(frame: Exportable, view: str, display: Display) -> NDArray[np.float32]:
    """A view that the frame holds as it is shown: display-encoded, 0 … 1, (h, w, 3)."""
    if view in DIAGNOSTICS:
        pixels = coloured(view, frame.image(view), look_of(display))
        return shaded(pixels, shades(frame.image("normal"), frame.camera), display.shading)
    return display_image(view, frame.image(view), exposure_of(frame, display), display.tone).pixels


class Pair(Protocol):
    """What an exporter reads of `pmviewer.engine.comparison.importance_gain.Gain`."""

    def frames(self) -> tuple[Exportable, Exportable]:
        """With importance and without."""

    def table(self) -> list[tuple[str, str, str, str]]:
        """Rows of text: what, with importance, without, the latter over the former; their heading first."""

    def sentences(self) -> list[str]:
        """What the errors are against, and what to know besides."""


def gain_sheet(pair: Pair, display: Display | None = None) -> NDArray[np.uint8]:
    """Both pictures of a comparison beside each other, with its table. `display`: view, exposure and tone curve; the
    frames' own if None. What is no layer gives the image."""
    frames = pair.frames()
    display = display or frames[0].settings.display
    view = display.view if display.view in LAYERS else BEAUTY_VIEW
    left, right = (
        to_uint8(display_image(view, frame.image(view), exposure_of(frames[0], display), display.tone).pixels)
        for frame in frames
    )
    return side_by_side(left, right, ("with importance", "without importance"), pair.table(), pair.sentences())


def setting_texts(settings: Settings) -> dict[str, str]:
    """Every setting by its full name, as the command line and files' attributes have it."""
    return {path: _text(value) for path, value in flat(settings).items()}


def _plain(value: Any) -> Value:
    return value if isinstance(value, str | int | float) and not isinstance(value, bool) else _text(value)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return as_text(value)
    if isinstance(value, tuple):
        return " ".join(repr(float(part)) for part in value)
    return str(value)
