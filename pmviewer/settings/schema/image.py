"""Settings of the eye pass: direct light, final gather, method, camera."""

from __future__ import annotations

from typing import Literal

from pmviewer.settings.schema.base import Auto, Group, Vec3, setting


class Direct(Group):
    """Direct light"""

    samples: int = setting(
        1, "Light samples per pixel and pass.", stage="image", scale="integer", unit="samples", ge=1, le=64
    )
    mis: bool = setting(
        True,
        "Combine light sampling with BSDF sampling by multiple importance sampling (power heuristic). Off: light "
        "sampling alone.",
        stage="image",
        scale="switch",
        title="MIS",
    )
    choice: Literal["auto", "power", "photons", "Keller-Wald"] = setting(
        "auto",
        "How light samples are spread over the lights. power: by the lights' power. photons: mostly by the photons "
        "that arrived from each light near the point. Keller-Wald: some samples for the lights with photons near, some "
        "for all others (§3). auto: photons with many lights, power otherwise.",
        section="Many lights",
        stage="image",
        scale="choice",
    )
    choice_radius: float | Auto = setting(
        "auto",
        "Radius within which photons tell the lights of a point, relative to the scene. Automatic: some dozens of "
        "photons. Too small a radius misses lights and leaves single bright pixels.",
        stage="maps",
        scale="log",
        unit="× scene",
        ge=1e-4,
        le=1.0,
    )
    con_samples: int = setting(
        2,
        "Samples of the lights with photons near the point.",
        stage="image",
        scale="integer",
        unit="samples",
        ge=1,
        le=64,
        title="contributing samples",
    )
    noncon_samples: int = setting(
        1,
        "Samples of all other lights.",
        stage="image",
        scale="integer",
        unit="samples",
        ge=1,
        le=64,
        title="other samples",
    )
    biased: bool = setting(
        False,
        "Leave lights without photons near the point out: less noise, a little too dark.",
        stage="image",
        scale="switch",
        title="only contributing lights",
    )
    shadow_photons: bool = setting(
        False,
        "Where all shadow photons of a light near a point are lit, or all in shadow, no shadow ray is cast (Jensen "
        "1996, §4.1). Fewer rays, but biased: faint penumbrae and shadows smaller than the photons' distance are lost.",
        section="Shadow photons",
        stage="maps",
        scale="switch",
        title="shadow photons",
    )
    shadow_N: int = setting(
        50_000,
        "Photons sent from the lights straight through the scene in each pass; with one photon map for all passes "
        "(photons.renew), in the first.",
        stage="maps",
        scale="log",
        unit="photons",
        ge=100,
        le=5_000_000,
        title="shadow trajectories",
    )
    shadow_fewest: int = setting(
        8,
        "Shadow photons of a light that it takes near a point to do without a shadow ray: more miss fewer penumbrae.",
        stage="maps",
        scale="integer",
        unit="photons",
        ge=1,
        le=1000,
        title="fewest shadow photons",
    )
    shadow_radius: float | Auto = setting(
        "auto",
        "Radius within which shadow photons tell, relative to the scene. Automatic: photons enough nearly "
        "everywhere; where a smaller disc has enough, that one tells.",
        stage="maps",
        scale="log",
        unit="× scene",
        ge=1e-4,
        le=1.0,
    )


class Gather(Group):
    """Final gather"""

    rays: int = setting(
        4, "Final-gather rays per pixel and pass.", stage="image", scale="integer", unit="rays", ge=1, le=256
    )
    directions: Literal["BSDF", "photon cones", "hemisphere grid"] = setting(
        "BSDF",
        "Where gather rays look. BSDF: as the surface reflects. photon cones: some of them into cones of 10° around "
        "the directions that photons near the point came from (Pharr §0.4). hemisphere grid: some of them by the cells "
        "of a hemisphere that these photons fill (Jensen 1995). Pays where light comes from few directions.",
        section="Directions",
        stage="image",
        scale="choice",
    )
    guided: float = setting(
        0.5,
        "Share of the gather rays that photons guide; the rest follows the BSDF.",
        stage="image",
        scale="linear",
        title="guided share",
        ge=0.05,
        le=0.95,
    )
    guide_radius: float | Auto = setting(
        "auto",
        "Radius within which photons guide the rays of a point, relative to the scene. Automatic: some dozens of "
        "photons.",
        stage="maps",
        scale="log",
        unit="× scene",
        ge=1e-4,
        le=1.0,
    )
    roulette: float = setting(
        0.0,
        "Gather rays that may add less than this share of what they meet end by Russian roulette before they are cast "
        "(Pharr, exercise 0.3): on dark surfaces, behind dark mirrors, or where guided rays do the work. 0 casts all.",
        section="Weak rays, corners",
        stage="image",
        scale="linear",
        ge=0.0,
        le=1.0,
    )
    secondary: float = setting(
        0.0,
        "Gather rays shorter than this gather again where they land instead of looking the map up, which is dark at "
        "corners (secondary final gathering, course guide §6.2). 0: never.",
        stage="image",
        scale="linear",
        unit="× radius",
        ge=0.0,
        le=20.0,
        title="secondary below",
    )
    radiance_photons: Literal["off", "all", "1/4", "1/8"] = setting(
        "off",
        "Share of the global photons that become radiance photons: gather rays take the irradiance of the nearest one, "
        "computed when first needed, instead of a look-up each (Pharr §0.3). Pays with many gather rays or k nearest.",
        section="Radiance photons",
        stage="photons",
        scale="choice",
    )
    cutoff: float | Auto = setting(
        "auto",
        "Farthest radiance photon that a gather ray uses, relative to the look-up radius (with k nearest, to its "
        "median); farther off the ray looks the map up itself. Automatic: 0.5, which is free of bias, or 1 with k "
        "nearest.",
        stage="maps",
        scale="linear",
        unit="× radius",
        ge=0.05,
        le=2.0,
        title="cut-off",
    )
    similarity: float = setting(
        0.9,
        "Least cosine between the normals of a radiance photon and of the surface that a gather ray hit.",
        stage="image",
        scale="linear",
        title="normal similarity",
        ge=0.01,
        le=1.0,
    )
    cache: Literal["off", "on"] = setting(
        "off",
        "Irradiance cache: diffuse surfaces gather at few points, each pass at others, and interpolate in between with "
        "gradients (Ward and Heckbert). Where they are too few, pixels gather as without.",
        section="Irradiance cache",
        stage="image",
        scale="choice",
    )
    cache_error: float = setting(
        0.45,
        "Error a that interpolation may make in the first pass: a record reaches as far as a times the harmonic mean "
        "distance of what it sees. It shrinks with the sixth root of the pass.",
        stage="image",
        scale="log",
        title="cache error",
        ge=0.02,
        le=1.0,
    )
    cache_samples: int = setting(
        64,
        "Gather rays of a record, stratified over the hemisphere.",
        stage="image",
        scale="log",
        unit="rays",
        title="cache samples",
        ge=8,
        le=4096,
    )
    cache_min: float = setting(
        4.0,
        "Least reach of a record in the first pass.",
        stage="image",
        scale="log",
        unit="px",
        title="cache least reach",
        ge=0.1,
        le=100.0,
    )
    cache_max: float = setting(
        16.0,
        "Largest reach of a record in the first pass; the larger of both counts.",
        stage="image",
        scale="log",
        unit="px",
        title="cache largest reach",
        ge=1.0,
        le=1000.0,
    )


class Render(Group):
    """Method"""

    method: Literal["progressive", "gather", "path", "global map", "caustic map"] = setting(
        "progressive",
        "progressive: direct light by sampling, both maps shown directly with a shrinking radius. gather: indirect "
        "light by a final gather into the global map. path: path tracing, the yardstick without photons. "
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
    )
    seed: int = setting(1, "Seed of every random stream.", stage="photons", scale="integer", ge=0, le=2**31 - 1)
    passes: int = setting(
        1024, "Refinement stops after this many passes.", stage="stop", scale="log", unit="passes", ge=1, le=1_000_000
    )
    time_limit: float = setting(
        0.0, "Refinement stops after this time; 0 is no limit.", stage="stop", scale="linear", unit="s", ge=0, le=1e6
    )
    direct: Literal["by method", "accurate", "approximate"] = setting(
        "by method",
        "Direct light. accurate: light samples. approximate: the global map's photons straight from the lights (Jensen "
        "1996, §4).",
        section="Terms",
        stage="image",
        scale="choice",
        title="direct light",
    )
    caustic: Literal["by method", "accurate", "approximate"] = setting(
        "by method",
        "Caustics. accurate: the caustic map. approximate: the same photons as the global map has them, at its radius.",
        stage="image",
        scale="choice",
        title="caustics",
    )
    indirect: Literal["by method", "accurate", "approximate"] = setting(
        "by method",
        "Indirect light. accurate: a final gather. approximate: the global map shown directly.",
        stage="image",
        scale="choice",
        title="indirect light",
    )


class CameraSettings(Group):
    """Camera"""

    name: str = setting(
        "auto",
        "Which of the file's cameras, by its name or its number from 1; auto is the first. The settings below come on "
        "top of it.",
        stage="image",
        scale="name",
        title="camera",
    )
    origin: Vec3 | Auto = setting("auto", "Eye point; auto is the scene file's.", stage="image", scale="vector")
    target: Vec3 | Auto = setting("auto", "Point in the image's centre.", stage="image", scale="vector")
    up: Vec3 | Auto = setting("auto", "Direction that is upright in the image.", stage="image", scale="vector")
    fov: float | Auto = setting(
        "auto", "Horizontal field of view.", stage="image", scale="linear", unit="°", ge=1.0, le=170.0, title="FOV"
    )
    projection: Literal["auto", "perspective", "orthographic"] = setting(
        "auto",
        "perspective: things look smaller the farther away they are. orthographic: rays are parallel, sizes and angles "
        "stay true. auto is the scene file's.",
        stage="image",
        scale="choice",
    )
    view_width: float | Auto = setting(
        "auto",
        "What the width of an orthographic picture spans. Automatic: the scene file's, or what its perspective camera "
        "sees at its target.",
        stage="image",
        scale="log",
        unit="units",
        ge=1e-12,
        le=1e15,
        title="view width",
    )
    shift_x: float | Auto = setting(
        "auto",
        "Moves the picture to the right by that share of its width without turning the camera, as a shift lens does.",
        stage="image",
        scale="linear",
        unit="× width",
        ge=-1000.0,
        le=1000.0,
        title="shift right",
    )
    shift_y: float | Auto = setting(
        "auto",
        "Moves the picture down by that share of its height.",
        stage="image",
        scale="linear",
        unit="× height",
        ge=-1000.0,
        le=1000.0,
        title="shift down",
    )
    width: int | Auto = setting(
        "auto", "Image width; auto is the scene file's.", stage="image", scale="integer", unit="px", ge=1, le=16384
    )
    height: int | Auto = setting("auto", "Image height.", stage="image", scale="integer", unit="px", ge=1, le=16384)
