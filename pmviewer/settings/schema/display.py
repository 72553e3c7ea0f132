"""Settings of what the window draws: the view, and overlays on it."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any, Literal

from pmviewer.settings.needs import BOTH_MAPS, IMPORTANCE, MEDIA, SHADOW_PHOTONS, VOLUME, Need, Needs
from pmviewer.settings.schema.base import Auto, Group, setting
from pmviewer.settings.schema.gather import ESTIMATION, REPROJECTION
from pmviewer.settings.schema.virtual import VIRTUAL_LIGHTS, WEIGHTED

LOOKED_UP = Need(
    lambda f: f.plan.photons, "Nothing is looked up: this method uses no photons, or no surface stores them."
)
STORED = Need(lambda f: f.plan.photons, "No photons are stored: this method uses none, or no surface stores them.")
REQUIRED_DENSITY = Need(
    lambda f: f.plan.importance or f.plan.deposition == "constant density",
    "Only with importance (importance.map) or constant density (importance.deposition).",
)
STORED_BY_CHANCE = Need(
    lambda f: f.plan.deposition == "Keller-Wald",
    "Only with the deposition rule 'Keller-Wald' (importance.deposition).",
)
CONVERGENCE = Need(
    lambda f: f.plan.convergence,
    "Only with density control of a caustic map, and its criterion (importance.convergence).",
)
RADIANCE_PHOTONS = Need(
    lambda f: f.plan.radiance, "Only with the method 'gather' and radiance photons (gather.radiance_photons)."
)
DENOISER = Need(lambda f: find_spec("pyoidn") is not None, "Needs Open Image Denoise: pip install 'pmviewer[denoise]'.")
MOMENTS = Need(
    lambda f: f.plan.moments,
    "Not with weighted virtual lights: their pictures divide sums.",
)
SEVERAL_SAMPLES = Need(
    lambda f: f.plan.adaptive or f.plan.mirror_rays > 1 or f.plan.edge_rays > 1,
    "All pixels have one sample a pass: of mirrors and edges, too, and no adaptive samples (render.adaptive).",
)
VIEW_NEEDS: dict[str, Needs] = {
    "denoised": (DENOISER,),
    "look-up radius": (LOOKED_UP,),
    "photon count": (LOOKED_UP,),
    "shadow rays skipped": (SHADOW_PHOTONS,),
    "radiance photons": (RADIANCE_PHOTONS,),
    "radiance cells": (RADIANCE_PHOTONS,),
    "importance": (STORED, IMPORTANCE),
    "required density": (STORED, REQUIRED_DENSITY),
    "achieved density": (STORED,),
    "density ratio": (STORED, REQUIRED_DENSITY),
    "storing probability": (STORED, STORED_BY_CHANCE),
    "caustic convergence": (STORED, CONVERGENCE),
    "virtual light error": (VIRTUAL_LIGHTS,),
    "sum of weights": (VIRTUAL_LIGHTS, WEIGHTED),
    "normalisation": (VIRTUAL_LIGHTS, WEIGHTED),
    "estimation mask": (ESTIMATION,),
    "gathered points": (ESTIMATION,),
    "subdivision level": (ESTIMATION,),
    "reprojected share": (ESTIMATION, REPROJECTION),
    "noise": (MOMENTS,),
    "samples a pass": (SEVERAL_SAMPLES,),
    "optical depth": (MEDIA,),
    "mean free path": (MEDIA,),
    "volume radius": (MEDIA, VOLUME),
    "volume photon count": (MEDIA, VOLUME),
    "extinction slice": (MEDIA,),
    "photon slice": (MEDIA, VOLUME),
}
"""Of the views that a frame holds only while they are shown."""
MEDIA_VIEWS = ("volume", "volume indirect")
SLICE_VIEWS = ("extinction slice", "photon slice")
MAP_VIEWS = (
    "look-up radius",
    "photon count",
    "importance",
    "required density",
    "achieved density",
    "density ratio",
    "storing probability",
)
"""Views that show one of the maps."""
VIEW_OF_A_SLICE = Need(
    lambda f: f.settings.display.view in SLICE_VIEWS,
    f"Only with the views {' and '.join(repr(view) for view in SLICE_VIEWS)}.",
)
VIEW_OF_A_MAP = Need(
    lambda f: f.settings.display.view in MAP_VIEWS,
    f"Only with the views {', '.join(repr(view) for view in MAP_VIEWS)}.",
)

FALSE_COLOURS = Need(
    lambda f: f.settings.display.view == "error" or f.settings.display.view in VIEW_NEEDS.keys() - {"denoised"},
    "Only with views in false colours.",
)
TWO_SIDED_VIEWS, CLASS_VIEWS, CELL_VIEWS = ("density ratio",), ("caustic convergence",), ("radiance cells",)
_TWO_SIDED_DIFFERENCES = ("signed", "relative")


def _difference(settings: Any) -> str:
    """The kind of difference between two pictures that is shown, "" for none."""
    return settings.compare.difference if settings.compare.mode == "difference" else ""


def _scaled(settings: Any) -> bool:
    view = settings.display.view
    quantity = view == "error" or view in VIEW_NEEDS.keys() - {"denoised", *CLASS_VIEWS, *CELL_VIEWS}
    return bool(_difference(settings)) or quantity


def _two_sided(settings: Any) -> bool:
    kind = _difference(settings)
    return kind in _TWO_SIDED_DIFFERENCES if kind else settings.display.view in TWO_SIDED_VIEWS


SCALED_COLOURS = Need(lambda f: _scaled(f.settings), "Only with views and differences of a quantity, in false colours.")
SEQUENTIAL_COLOURS = Need(
    lambda f: (_scaled(f.settings) and not _two_sided(f.settings)) or f.settings.overlays.importons.show,
    "Only with views and differences in false colours that have no middle.",
)
TWO_SIDED_COLOURS = Need(
    lambda f: _two_sided(f.settings), "Only with the view 'density ratio' and differences with a sign."
)
CLASS_COLOURS = Need(
    lambda f: f.settings.display.view in CLASS_VIEWS or f.settings.overlays.fates.show,
    "Only with the view 'caustic convergence' and the overlay of photons by fate.",
)
BY_PERCENTILES = Need(lambda f: f.settings.display.range == "percentiles", "Only by percentiles (display.range).")
BY_HAND = Need(lambda f: f.settings.display.range == "by hand", "Only by hand (display.range).")


class Display(Group):
    """Display"""

    view: Literal[
        "beauty",
        "emission",
        "direct",
        "specular",
        "caustic",
        "indirect",
        "albedo",
        "normal",
        "depth",
        "geometry",
        "volume",
        "volume indirect",
        "reference",
        "error",
        "denoised",
        "look-up radius",
        "photon count",
        "shadow rays skipped",
        "radiance photons",
        "radiance cells",
        "importance",
        "required density",
        "achieved density",
        "density ratio",
        "storing probability",
        "caustic convergence",
        "virtual light error",
        "sum of weights",
        "normalisation",
        "estimation mask",
        "gathered points",
        "subdivision level",
        "reprojected share",
        "noise",
        "samples a pass",
        "optical depth",
        "mean free path",
        "volume radius",
        "volume photon count",
        "extinction slice",
        "photon slice",
    ] = setting(
        "beauty",
        "What the viewport shows: the image, one of its terms, a property of the first hit, the shaded geometry, the "
        "loaded reference, the error against it, the image without its noise as a denoiser guesses it, or, in false "
        "colours with a legend, how the latest pass made the picture.",
        stage="display",
        scale="choice",
        choice_needs={**VIEW_NEEDS, **dict.fromkeys(MEDIA_VIEWS, (MEDIA,))},
    )
    map: Literal["global", "caustic"] = setting(
        "global",
        "The map whose look-ups the views 'look-up radius' and 'photon count' show, and whose photons or importance "
        "the views of importance, densities and the probability of storing. With the method 'gather', the "
        "global map is looked up where gather rays end, not at the first surface; shown is the look-up there.",
        stage="display",
        scale="choice",
        title="map of the view",
        needs=(
            VIEW_OF_A_MAP,
            BOTH_MAPS,
        ),
    )
    slice: float = setting(
        0.5,
        "Where the plane of the views 'extinction slice' and 'photon slice' cuts the box around media: 0 at its low "
        "end, 1 at its high one.",
        stage="display",
        scale="linear",
        title="place of the slice",
        ge=0,
        le=1,
        needs=(VIEW_OF_A_SLICE,),
    )
    slice_axis: Literal["x", "y", "z"] = setting(
        "z",
        "The axis across the plane of these views.",
        stage="display",
        scale="choice",
        title="axis of the slice",
        needs=(VIEW_OF_A_SLICE,),
    )
    exposure: float | Auto = setting(
        "auto",
        "Exposure before the tone curve. Automatic: the scene's own, 0 for the bundled ones; for files that have none "
        "chosen by the first picture, so that surfaces look as bright as they are.",
        stage="display",
        scale="linear",
        unit="EV",
        ge=-20,
        le=20,
    )
    tone: Literal["sRGB", "Reinhard", "filmic", "linear"] = setting(
        "sRGB", "Tone curve from radiance to the screen.", stage="display", scale="choice", title="tone curve"
    )
    shading: float = setting(
        0.5,
        "How much of the surfaces' shading lies under false colours; 0 shows the colours of the legend alone.",
        stage="display",
        scale="linear",
        ge=0,
        le=1,
        needs=(FALSE_COLOURS,),
    )
    through_surfaces: bool = setting(
        False,
        "The mouse and the keys of flight move the camera through walls and objects. Without it they stop before "
        "them; the free camera passes everything.",
        stage="display",
        scale="switch",
        title="through surfaces",
    )
    preview: Literal["off", "coarse", "denoised"] = setting(
        "coarse",
        "What the window shows of a young picture, with a caption that says so. off: the estimate as it is. coarse: "
        "the first coarse picture drawn out along edges, and where only the camera moved, light of the last picture "
        "until there are some passes. denoised: also smoothed by a trained network, until noise is low. Films, files "
        "and measurements are never made of it.",
        stage="display",
        scale="choice",
        choice_needs={"denoised": (DENOISER,)},
    )
    automatic: bool = setting(
        True,
        "A scene that is opened in the window gets the way of rendering that suits it: a short trial after the first "
        "passes chooses it, unless somebody has. It is one change to undo; without it the trial begins when asked.",
        stage="display",
        scale="switch",
        title="choose by itself",
    )
    compile_ahead: bool = setting(
        True,
        "While nothing is asked for, compile in the background what the next click may need: other methods, look-ups, "
        "views. Without it the first use of each takes some seconds.",
        stage="display",
        scale="switch",
        title="compile ahead",
    )
    autosave: float = setting(
        60.0,
        "The window keeps session and film on disk this often, and offers them after a crash; 0 is never. Films of "
        "less than ten seconds of rendering are not kept.",
        stage="display",
        scale="linear",
        unit="s",
        ge=0.0,
        le=3600.0,
    )
    colours: Literal["violet-yellow", "fire", "blue-yellow", "grey"] = setting(
        "violet-yellow",
        "Colours of quantities from small to large. In all of them lightness alone tells the order, for colour-blind "
        "eyes too.",
        stage="display",
        scale="choice",
        section="false colours and marks",
        needs=(SEQUENTIAL_COLOURS,),
    )
    two_sided: Literal["blue-orange", "purple-green"] = setting(
        "blue-orange",
        "Colours of what lies below and above a middle: ratios around 1, differences around 0.",
        stage="display",
        scale="choice",
        title="two-sided colours",
        needs=(TWO_SIDED_COLOURS,),
    )
    classes: Literal["usual", "colour-blind safe"] = setting(
        "usual",
        "Colours of caustic convergence and of photons by fate: red, green and blue as in the sources, or such as "
        "colour-blind eyes tell apart.",
        stage="display",
        scale="choice",
        title="colours of classes",
        needs=(CLASS_COLOURS,),
    )
    range: Literal["auto", "percentiles", "by hand"] = setting(
        "auto",
        "From where to where the colours go. auto: the view's own ends, or those between which 98 % of the values lie.",
        stage="display",
        scale="choice",
        title="range of colours",
        needs=(SCALED_COLOURS,),
    )
    percentile: float = setting(
        1.0,
        "Share of the pixels that lies beyond each end of the colours.",
        stage="display",
        scale="linear",
        unit="%",
        ge=0,
        le=25,
        needs=(SCALED_COLOURS, BY_PERCENTILES),
    )
    low: float = setting(
        0.0,
        "Value of the first colour, in the view's unit. By logarithm, 0 and less is a millionth of the last one's.",
        stage="display",
        scale="linear",
        title="first colour at",
        ge=-1e15,
        le=1e15,
        needs=(SCALED_COLOURS, BY_HAND),
    )
    high: float = setting(
        1.0,
        "Value of the last colour, in the view's unit.",
        stage="display",
        scale="linear",
        title="last colour at",
        ge=-1e15,
        le=1e15,
        needs=(SCALED_COLOURS, BY_HAND),
    )
    spacing: Literal["auto", "linear", "log"] = setting(
        "auto",
        "Colours follow the values evenly or by their logarithm; auto is as the view's values are spread. What may be "
        "negative is always shown evenly.",
        stage="display",
        scale="choice",
        title="spacing of colours",
        needs=(SCALED_COLOURS,),
    )
    marks: bool = setting(
        False,
        "Mark and count pixels that hide something: not finite (magenta), negative (cyan), and clipped ones (stripes), "
        "brighter than the screen or beyond the colours' ends. In the window alone.",
        stage="display",
        scale="switch",
        title="mark odd pixels",
    )
