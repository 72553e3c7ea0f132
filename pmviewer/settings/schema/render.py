"""Settings of the method: how terms are evaluated, and for how long."""

from __future__ import annotations

from typing import Literal

from pmviewer.settings.needs import CLEAR, FOLLOWED, Need
from pmviewer.settings.schema.base import Auto, Group, setting

FOLLOWED_OR_PATHS = Need(lambda f: f.plan.path or FOLLOWED.holds(f), "No mirror or glass in this scene.")
NO_PATHS = Need(lambda f: not f.plan.path, "The path tracer treats all pixels alike.")
TELLS_ERROR = Need(
    lambda f: f.plan.moments and f.settings.photons.renew == "each pass",
    "Passes don't tell their error: they share one photon map, or divide sums.",
)
TELLS_NOISE = Need(lambda f: f.plan.moments, "Passes don't tell their noise: they divide sums.")
TWO_WAYS = Need(
    lambda f: f.settings.render.method in ("progressive", "gather", "virtual lights"),
    "Only with the methods 'progressive', 'gather' and 'virtual lights'.",
)
GLOBAL_MAP_STORED = Need(lambda f: f.plan.global_classes or f.plan.virtual, "No surface of this scene stores photons.")

THIN_GLASS = Need(
    lambda f: "by setting" in f.traits.thin_glass and f.settings.render.method not in ("path", "virtual lights"),
    lambda f: (
        "The path tracer and virtual lights take all glass as it is."
        if "by setting" in f.traits.thin_glass
        else "No thin glass in this scene that goes by this setting (a thindielectric does)."
    ),
)
SMOOTH_GLASS = Need(lambda f: f.traits.has_smooth_glass, "No smooth glass in this scene.")
ONE_INDEX = Need(lambda f: not f.plan.dispersion, "Where glass splits light into colours, paths go one way at it.")
ONE_SAMPLE = Need(
    lambda f: not f.plan.one_sample,
    "One sample a pixel and pass: with virtual lights, estimated gathers, and radii that "
    "pixels set by the photons they find.",
)
SPLIT = Need(
    lambda f: not (f.plan.path or f.plan.virtual), "The path tracer and virtual lights go one way at every surface."
)


class Render(Group):
    """Method"""

    method: Literal["progressive", "gather", "virtual lights", "path", "global map", "caustic map"] = setting(
        "progressive",
        "progressive: direct light by sampling, both maps shown directly with a shrinking radius. gather: indirect "
        "light by a final gather into the global map. virtual lights: indirect light by photons as point lights. path: "
        "path tracing, the yardstick without photons. "
        "global/caustic map: that map alone, as it is.",
        stage="image",
        scale="choice",
    )
    max_depth: int = setting(
        32,
        "Longest chain of mirrors and glass followed from the camera, and longest path of the path tracer.",
        stage="image",
        scale="integer",
        ge=1,
        le=1000,
        needs=(FOLLOWED_OR_PATHS,),
    )
    splits: int = setting(
        2,
        "Surfaces of smooth glass on a path from the camera at which it goes both ways, by reflection and by "
        "refraction, the weaker thinned out where it meets what stores photons; at all others it goes one of them by "
        "chance. What is seen in glass is less noisy for it: lamps that a glass ball reflects most of all.",
        stage="image",
        scale="integer",
        unit="surfaces",
        ge=0,
        le=2,
        needs=(
            SMOOTH_GLASS,
            ONE_INDEX,
            SPLIT,
        ),
    )
    thin_glass: Literal["exact", "ignored", "tinted", "tinted and reflecting"] = setting(
        "exact",
        "How light gets through thin glass, which fills closed cabins and rooms with noisy caustics (course guide, "
        "6.2.3). exact: by the caustic map, as through all glass. ignored: photons, light samples and gather rays meet "
        "no pane: too bright by what panes absorb and reflect, without their colour. tinted: photons refract without "
        "becoming caustics, light samples and gather rays go straight on, weakened and coloured; what panes reflect "
        "onto the surface seen is missing. tinted and reflecting: that is a caustic still, and noisier. Behind glass "
        "of two faces both lack its displacement and focus. What the camera sees of glass itself stays exact.",
        stage="photons",
        scale="choice",
        title="thin glass",
        needs=(
            CLEAR,
            THIN_GLASS,
        ),
    )
    outline_rays: int = setting(
        16,
        "Camera rays per pass that look for emission in pixels which the outline of a light crosses: nearly all of the "
        "error of the first passes sits there. 0 leaves it to the pixel's one ray. Path tracing does without.",
        stage="image",
        scale="integer",
        unit="rays",
        ge=0,
        le=256,
        needs=(NO_PATHS,),
    )
    mirror_rays: int | Auto = setting(
        "auto",
        "Samples a pass of pixels that show a mirror or glass, along the whole way through them: what is seen there is "
        "noisier than all else in the first passes. Automatic: 2.",
        stage="image",
        scale="integer",
        unit="samples",
        title="samples in mirrors",
        ge=1,
        le=16,
        needs=(
            FOLLOWED,
            NO_PATHS,
            ONE_SAMPLE,
        ),
    )
    edge_rays: int | Auto = setting(
        "auto",
        "Samples a pass of pixels that an edge of what the camera sees crosses: where all else is smooth, these hold "
        "most of the error of the first passes. In mirrors as many times as many. Automatic: 2, or 1 where a tenth of "
        "the pixels have edges.",
        stage="image",
        scale="integer",
        unit="samples",
        title="samples at edges",
        ge=1,
        le=16,
        needs=(
            NO_PATHS,
            ONE_SAMPLE,
        ),
    )
    adaptive: Literal["off", "on"] = setting(
        "off",
        "From the ninth pass on, pixels with noise of their own (edges, textures, outlines of shadows, what glass "
        "shows) get 2, 4 or 8 times the samples a pass. The first eight tell which; the mean stays the same.",
        stage="image",
        scale="choice",
        title="adaptive samples",
        needs=(
            NO_PATHS,
            ONE_SAMPLE,
            TELLS_NOISE,
        ),
    )
    filter: Literal["auto", "box", "tent", "Gaussian", "Mitchell-Netravali", "Catmull-Rom", "Lanczos"] = setting(
        "auto",
        "Reconstruction filter: how what lies around a pixel counts in it. box: the pixel alone. tent, Gaussian: "
        "softer. Mitchell-Netravali, Catmull-Rom, Lanczos: ever sharper, with negative parts that ring at edges. "
        "Automatic: the scene file's, or box.",
        stage="image",
        scale="choice",
        title="pixel filter",
    )
    filter_radius: float | Auto = setting(
        "auto",
        "How far from its middle a pixel sees; other radii than the automatic one stretch the filter, and give Lanczos "
        "as many lobes. Automatic: the scene file's, or box 0.5, tent 1, Lanczos 3, all others 2.",
        stage="image",
        scale="linear",
        unit="px",
        ge=0.1,
        le=8.0,
    )
    lights: Literal["auto", "shown", "hidden"] = setting(
        "auto",
        "Whether the picture shows lights and the sky themselves. hidden: the camera's rays pass what shines and find "
        "the sky black; what lights shine on stays lit, and mirrors and glass show them. Automatic: as the scene file "
        "says (hide_emitters of Mitsuba's files), or shown.",
        stage="image",
        scale="choice",
        title="lights in the picture",
        needs=(CLEAR,),
    )
    seed: int = setting(1, "Seed of every random stream.", stage="photons", scale="integer", ge=0, le=2**31 - 1)
    passes: int = setting(
        1024, "Refinement stops after this many passes.", stage="stop", scale="log", unit="passes", ge=1, le=1_000_000
    )
    time_limit: float = setting(
        0.0, "Refinement stops after this time; 0 is no limit.", stage="stop", scale="linear", unit="s", ge=0, le=1e6
    )
    error: float = setting(
        0.0,
        "Refinement stops when the picture's relMSE is estimated to be below this; 0 is no limit. The estimate is the "
        "statistics' one: from how passes differ, and how they change with the radius.",
        stage="stop",
        scale="linear",
        title="error limit",
        ge=0,
        le=10.0,
        needs=(TELLS_ERROR,),
    )
    direct: Literal["by method", "accurate", "approximate"] = setting(
        "by method",
        "Direct light. accurate: light samples. approximate: the global map's photons straight from the lights (Jensen "
        "1996, §4).",
        section="Terms",
        stage="image",
        scale="choice",
        title="direct light",
        needs=(
            TWO_WAYS,
            GLOBAL_MAP_STORED,
        ),
    )
    caustic: Literal["by method", "accurate", "approximate"] = setting(
        "by method",
        "Caustics. accurate: the caustic map. approximate: the same photons as the global map has them, at its radius.",
        stage="image",
        scale="choice",
        title="caustics",
        needs=(
            TWO_WAYS,
            GLOBAL_MAP_STORED,
            FOLLOWED,
        ),
    )
    indirect: Literal["by method", "accurate", "approximate"] = setting(
        "by method",
        "Indirect light. accurate: a final gather. approximate: the global map shown directly.",
        stage="image",
        scale="choice",
        title="indirect light",
        needs=(
            TWO_WAYS,
            GLOBAL_MAP_STORED,
        ),
    )
