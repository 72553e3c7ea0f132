"""Settings of the final gather."""

from __future__ import annotations

from typing import ClassVar, Literal

from pmviewer.settings.needs import CLEAR, UNLIT_MEDIA, Need, Needs
from pmviewer.settings.schema.base import Auto, Group, setting

GATHER = Need(
    lambda f: f.plan.gather,
    lambda f: f"Only a final gather casts gather rays, not the method '{f.settings.render.method}' (render.indirect).",
)
SEVERAL_RAYS = Need(lambda f: f.settings.gather.rays >= 2, "A single gather ray follows the BSDF.")
GUIDES = Need(lambda f: f.plan.guided_rays, "No photons guide the rays: see gather.directions.")
RADIANCE_PHOTONS = Need(lambda f: f.plan.radiance, "Only with radiance photons.")
IRRADIANCE_CACHE = Need(lambda f: f.plan.cache, "Only with the irradiance cache.")

NO_CACHE = Need(
    lambda f: not f.plan.cache, "The irradiance cache interpolates between gathers of its own instead (gather.cache)."
)
DIFFUSE = Need(
    lambda f: f.traits.has_diffuse, "No diffuse surface in this scene: glossy and smooth ones gather as usual."
)
ESTIMATION = Need(lambda f: f.plan.estimation, "Only with estimated gathers (gather.estimation).")
REPROJECTION = Need(lambda f: f.plan.reprojection, "Only with reprojected gathers (gather.reprojection).")


class Gather(Group):
    """Final gather"""

    needs: ClassVar[Needs] = (GATHER,)

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
        needs=(SEVERAL_RAYS,),
    )
    guided: float = setting(
        0.5,
        "Share of the gather rays that photons guide; the rest follows the BSDF.",
        stage="image",
        scale="linear",
        title="guided share",
        ge=0.05,
        le=0.95,
        needs=(
            SEVERAL_RAYS,
            GUIDES,
        ),
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
        needs=(
            SEVERAL_RAYS,
            GUIDES,
        ),
    )
    roulette: float = setting(
        0.0,
        "Gather rays that may add less than this share of what they meet end by Russian roulette before they are cast "
        "(Pharr, exercise 0.3): on dark surfaces, behind dark mirrors, or where guided rays do the work. 0 casts all.",
        title="roulette of rays",
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
        needs=(UNLIT_MEDIA,),
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
        needs=(RADIANCE_PHOTONS,),
    )
    similarity: float = setting(
        0.9,
        "Least cosine between the normals of a radiance photon and of the surface that a gather ray hit.",
        stage="image",
        scale="linear",
        title="normal similarity",
        ge=0.01,
        le=1.0,
        needs=(RADIANCE_PHOTONS,),
    )
    cache: Literal["off", "on"] = setting(
        "off",
        "Irradiance cache: diffuse surfaces gather at few points, each pass at others, and interpolate in between with "
        "gradients (Ward and Heckbert). Where they are too few, pixels gather as without.",
        section="Irradiance cache",
        stage="image",
        scale="choice",
        needs=(UNLIT_MEDIA,),
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
        needs=(IRRADIANCE_CACHE,),
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
        needs=(IRRADIANCE_CACHE,),
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
        needs=(IRRADIANCE_CACHE,),
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
        needs=(IRRADIANCE_CACHE,),
    )
    cache_rays: int | Auto = setting(
        "auto",
        "Gather rays a pixel and pass where no record serves: at edges, where records would have to be as narrow as "
        "what they see is near. Automatic: twice the usual number, up to 16.",
        stage="image",
        scale="integer",
        unit="rays",
        title="rays without record",
        ge=1,
        le=1024,
        needs=(IRRADIANCE_CACHE,),
    )
    estimation: Literal["off", "on"] = setting(
        "off",
        "Final gather estimation: where the picture shows flat, open, diffuse surfaces, few pixels gather, each pass "
        "others, and those between them are interpolated (course guide §6.3.2). All other pixels gather as without.",
        section="Final gather estimation",
        stage="image",
        scale="choice",
        needs=(CLEAR, NO_CACHE, DIFFUSE),
    )
    estimation_error: float = setting(
        0.3,
        "Error that interpolation within a tile may make in the first pass: half a diagonal over the least harmonic "
        "mean distance of what its corners see, and half the turn of the normal. It shrinks with the sixth root of "
        "the pass.",
        stage="image",
        scale="log",
        title="estimation error",
        ge=0.005,
        le=2.0,
        needs=(ESTIMATION,),
    )
    estimation_contrast: float = setting(
        1.5,
        "Tiles whose corners differ in irradiance by more than this share of its mean are divided, whatever their "
        "distances say. Three standard errors of a gather are taken off first, so that noise divides few.",
        stage="image",
        scale="log",
        title="estimation contrast",
        ge=0.05,
        le=4.0,
        needs=(ESTIMATION,),
    )
    estimation_samples: int = setting(
        64,
        "Rays of a full gather, stratified over the hemisphere.",
        stage="image",
        scale="log",
        unit="rays",
        title="estimation samples",
        ge=8,
        le=4096,
        needs=(ESTIMATION,),
    )
    estimation_spacing: int = setting(
        16,
        "Distance of full gathers on the undivided grid in the first pass; it shrinks with the sixth root of the pass.",
        stage="image",
        scale="integer",
        unit="px",
        title="estimation spacing",
        ge=2,
        le=128,
        needs=(ESTIMATION,),
    )
    estimation_smallest: int = setting(
        2,
        "Width of the smallest tile. Where even that is too wide, a share of these tiles that falls from pass to pass "
        "is interpolated all the same, and the rest gathers as usual.",
        stage="image",
        scale="integer",
        unit="px",
        title="smallest tile",
        ge=2,
        le=64,
        needs=(ESTIMATION,),
    )
    estimation_normals: float = setting(
        10.0,
        "Pixels whose normal differs by more than this from that of one beside them are critical and gather as usual.",
        stage="image",
        scale="linear",
        unit="°",
        title="critical turn",
        ge=0.1,
        le=90.0,
        needs=(ESTIMATION,),
    )
    estimation_step: float = setting(
        0.5,
        "Pixels are critical, too, where one beside them lies farther than this off the plane of the surface.",
        stage="image",
        scale="log",
        unit="px",
        title="critical step",
        ge=0.01,
        le=100.0,
        needs=(ESTIMATION,),
    )
    reprojection: Literal["off", "on"] = setting(
        "off",
        "Final gather reprojection: gathers of divided tiles take the hit points of full gathers around them as they "
        "are seen from there, and cast rays only where these tell too little (course guide §6.3.3); full gathers take "
        "what those around them have found besides their own. Pays with many estimation samples.",
        section="Final gather reprojection",
        stage="image",
        scale="choice",
        needs=(ESTIMATION,),
    )
    reprojection_cover: float = setting(
        0.25,
        "Share of a direction's cell that known hit points must cover in the first pass, else a ray is cast there. In "
        "later passes it grows towards all of it.",
        stage="image",
        scale="linear",
        title="reprojection cover",
        ge=0.0,
        le=1.0,
        needs=(REPROJECTION,),
    )
    reprojection_parts: int = setting(
        4,
        "Into how many parts along each side the z-buffer divides the cells of a gather's hemisphere.",
        stage="image",
        scale="integer",
        title="z-buffer parts",
        ge=1,
        le=8,
        needs=(REPROJECTION,),
    )
