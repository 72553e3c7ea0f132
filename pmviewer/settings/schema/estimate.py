"""Settings of the density estimate."""

from __future__ import annotations

from typing import ClassVar, Literal

from pmviewer.settings.needs import CAUSTIC_MAP, PHOTONS, VOLUME, Need, Needs
from pmviewer.settings.schema.base import Auto, Group, setting

NEAREST = Need(lambda f: f.plan.nearest, "Only with look-up 'nearest'.")
FIXED_RADIUS = Need(
    lambda f: f.settings.estimate.lookup != "nearest",
    "Not with look-up 'nearest': the k nearest photons set the radius.",
)
RADIUS_OR_MEDIA = Need(
    lambda f: f.settings.estimate.lookup != "nearest" or f.plan.volume,
    "Not with look-up 'nearest': the k nearest photons set the radius.",
)
AUTOMATIC_MAX_RADIUS = Need(
    lambda f: (
        (f.plan.nearest and f.settings.estimate.max_radius == "auto")
        or (f.plan.volume and f.settings.estimate.in_media == "nearest")
    ),
    "Only with an automatic maximum radius of the k nearest photons.",
)
MARCHING = Need(lambda f: f.settings.estimate.in_media != "beam", "Only with ray marching (estimate.in_media).")
NEAREST_IN_MEDIA = Need(
    lambda f: f.settings.estimate.in_media == "nearest", "Only with the k nearest photons in media (estimate.in_media)."
)
NEW_MAPS = Need(
    lambda f: f.settings.photons.renew == "each pass",
    "One photon map serves all passes: the radius does not shrink.",
)
SHRINKING = Need(
    lambda f: f.settings.photons.renew == "each pass" and f.settings.estimate.alpha != 1.0,
    "The radius does not shrink (photons.renew, estimate.alpha).",
)
SHOWN_DIRECTLY = Need(
    lambda f: f.plan.caustic_classes or f.plan.shown_directly,
    "Gather rays alone look photons up, with the radius of the pass.",
)
AUTOMATIC_RADIUS = Need(
    lambda f: not f.plan.nearest or f.settings.estimate.max_radius == "auto",
    "With look-up 'nearest' it bounds the automatic maximum radius.",
)
SHRINKING_RADIUS = Need(
    lambda f: f.plan.nearest or f.settings.estimate.alpha != 1.0,
    "The radius does not shrink with alpha = 1.",
)
PASS_RADIUS = Need(
    lambda f: f.settings.estimate.radius_rule == "pass" or f.plan.nearest or bool(f.plan.gather),
    "Each pixel's radius shrinks by the photons that it finds (estimate.radius_rule).",
)
SEVERAL_MAPS = Need(lambda f: f.plan.maps > 1, "One map is looked up (photons.maps).")
DISC = Need(
    lambda f: f.settings.estimate.area != "convex hull",
    "The convex hull weighs all photons alike and has no dark edges to check for.",
)
CONE = Need(lambda f: f.settings.estimate.filter == "cone", "Only with the cone filter.")
BOUNDARY = Need(
    lambda f: f.settings.estimate.area == "convex hull" or f.settings.estimate.differential,
    "Only with the area 'convex hull' or differential checking.",
)


class Estimate(Group):
    """Density estimate"""

    needs: ClassVar[Needs] = (PHOTONS,)

    radius: float | Auto = setting(
        "auto",
        "Look-up radius of the first pass, relative to the scene's bounding-sphere radius. Automatic: four pixel "
        "footprints at the typical distance of what the camera sees, three below gather rays: the least error after a "
        "few passes; wider in the global map where it is shown directly and few photons reach what is seen. So small "
        "pictures lack light near edges and on small things, until the radius has shrunk.",
        stage="maps",
        scale="log",
        unit="× scene",
        ge=1e-7,
        le=10.0,
        needs=(RADIUS_OR_MEDIA,),
    )
    caustic_radius: float | Auto = setting(
        "auto",
        "Radius of caustic look-ups relative to that of global ones; to an automatic one before that is made wider for "
        "few photons. Automatic: a half, for caustics are sharper and their map is denser; with an automatic radius, "
        "wider where few photons of caustics reach what is seen.",
        stage="maps",
        scale="log",
        unit="× radius",
        ge=0.005,
        le=100.0,
        needs=(
            FIXED_RADIUS,
            CAUSTIC_MAP,
        ),
    )
    volume_radius: float = setting(
        1.0,
        "Radius of look-ups in media relative to that of the global map, but for what an automatic one is wider as "
        "photons lie far apart: photons so near a ray light it.",
        stage="maps",
        scale="log",
        unit="×",
        ge=0.01,
        le=100.0,
        needs=(VOLUME,),
    )
    free_paths: float | Auto = setting(
        "auto",
        "Largest radius of look-ups in a medium, in mean free paths of it, in the first pass: a wider one misses light "
        "within it where it is curved or thin. On lattices it is each photon's own. Automatic: a half, and by beams in "
        "media that are the same everywhere up to two, where few photons are in them.",
        stage="maps",
        scale="log",
        unit="free paths",
        ge=0.01,
        le=1e6,
        needs=(VOLUME,),
    )
    in_media: Literal["beam", "point", "nearest"] = setting(
        "beam",
        "How photons in media are looked up. beam: all around the ray at once (Jarosz, Zwicker and Jensen 2008). "
        "point: ray marching, with the photons in a ball of the radius at every step (Jensen & Christensen 1998). "
        "nearest: the same with the k nearest photons. Steps add noise, and each counts its photons anew.",
        stage="maps",
        scale="choice",
        title="look-up in media",
        needs=(VOLUME,),
    )
    march_step: float = setting(
        2.0,
        "Distance of the places along a ray at which photons in media are looked up, relative to the volume's radius.",
        stage="maps",
        scale="log",
        unit="× radius",
        ge=0.05,
        le=100.0,
        needs=(VOLUME, MARCHING),
    )
    volume_k: int = setting(
        50,
        "Photons in a k-nearest estimate in media of the first pass; later ones take fewer, see alpha. The k-th sets "
        "the radius and does not count.",
        stage="maps",
        scale="log",
        unit="photons",
        ge=2,
        le=1000,
        needs=(VOLUME, NEAREST_IN_MEDIA),
    )
    radius_rule: Literal["pass", "pixel"] = setting(
        "pass",
        "One radius for all look-ups of a pass, or each pixel's own at the surfaces that it sees, shrunk by the "
        "photons found there (Hachisuka and others 2008): not at all in the dark. Gather rays keep that of the pass.",
        stage="image",
        scale="choice",
        title="radius by",
        needs=(
            FIXED_RADIUS,
            SHRINKING,
            SHOWN_DIRECTLY,
        ),
    )
    alpha: float = setting(
        2.0 / 3.0,
        "How fast look-ups shrink from pass to pass, r²ᵢ₊₁ = r²ᵢ·(i+α)/(i+1); with look-up 'nearest' it is k that "
        "shrinks like r². 1 keeps them (and their bias).",
        stage="maps",
        scale="linear",
        ge=0.0,
        le=1.0,
        needs=(NEW_MAPS,),
    )
    delay: int = setting(
        0,
        "Passes for which look-ups stay about as wide as in the first one: they shrink as slowly as after so many, "
        "r²ᵢ₊₁ = r²ᵢ·(i+delay+α)/(i+delay+1), and to nothing in the end. Less noise and more bias after few passes.",
        stage="maps",
        scale="linear",
        unit="passes",
        ge=0,
        le=10_000,
        needs=(SHRINKING, PASS_RADIUS),
    )
    floor: float = setting(
        1e-5,
        "No pass uses a smaller radius than this, relative to the scene's bounding-sphere radius.",
        stage="maps",
        scale="log",
        unit="× scene",
        ge=1e-7,
        le=0.1,
        needs=(
            NEW_MAPS,
            AUTOMATIC_RADIUS,
            SHRINKING_RADIUS,
        ),
    )
    lookup: Literal["auto", "radius", "nearest"] = setting(
        "auto",
        "Photons within the radius of the pass, or the k nearest ones (up to the maximum radius). Automatic: the "
        "nearest where photons aim at what is small on a wide stage, so that they are a hundred times as dense there "
        "as elsewhere, and the radius isn't set by hand; else the radius.",
        section="Look-up",
        stage="maps",
        scale="choice",
        title="look-up",
    )
    k: int | Auto = setting(
        "auto",
        "Photons in a k-nearest estimate of the first pass; later ones take fewer, see alpha. Automatic: 20, 50 where "
        "one photon map serves all passes (photons.renew).",
        stage="maps",
        scale="log",
        unit="photons",
        ge=1,
        le=1000,
        needs=(NEAREST,),
    )
    rim: Literal["left out", "half", "whole"] = setting(
        "left out",
        "How the k-th photon, which sets the radius, counts: leaving it out is exact for independently scattered "
        "photons, half suits stratified ones, whole is too bright.",
        stage="image",
        scale="choice",
        title="k-th photon",
        needs=(
            NEAREST,
            DISC,
        ),
    )
    combine: Literal["powers and areas", "irradiances"] = setting(
        "powers and areas",
        "What several maps tell of a place (photons.maps). powers and areas: the sum of their powers over the mean "
        "area of their discs, as good as one map of all photons. irradiances: the sum of what each map says, whose "
        "noise, and bias where the k-th photon counts, are those of k/M photons.",
        stage="image",
        scale="choice",
        needs=(SEVERAL_MAPS,),
    )
    max_radius: float | Auto = setting(
        "auto",
        "Largest radius of a k-nearest search, relative to the scene; it shrinks with k from pass to pass. Automatic: "
        "where k of the brightest photons would still be darker than the black level (course guide §5.2).",
        stage="maps",
        scale="log",
        unit="× scene",
        ge=1e-7,
        le=10.0,
        needs=(NEAREST,),
    )
    black_level: float = setting(
        0.05,
        "Radiance below which the automatic maximum radius may lose detail.",
        stage="maps",
        scale="log",
        unit="W/(m² sr)",
        ge=1e-6,
        le=10.0,
        needs=(AUTOMATIC_MAX_RADIUS,),
    )
    filter: Literal["constant", "cone", "gaussian", "simpson", "epanechnikov"] = setting(
        "constant",
        "Kernel that weighs photons by their distance (the papers' filter).",
        section="Kernel and area",
        stage="image",
        scale="choice",
        title="kernel",
        needs=(DISC,),
    )
    cone_k: float = setting(
        1.1,
        "Slope of the cone filter: its weight is 1 − d/(k·r).",
        stage="image",
        scale="linear",
        ge=1.0,
        le=10.0,
        needs=(
            DISC,
            CONE,
        ),
    )
    flatness: float = setting(
        0.2,
        "Half-thickness of the search disc relative to the radius: photons further off the tangent plane are another "
        "surface's. 1 searches a sphere.",
        stage="image",
        scale="linear",
        unit="× radius",
        ge=0.01,
        le=1.0,
    )
    area: Literal["covered", "disc", "convex hull"] = setting(
        "covered",
        "Area that the photons' power is divided by. covered: as much of the look-up disc as surfaces cover, right at "
        "edges and in corners. disc: all of it, too large over the edge of a surface, which comes out dark. convex "
        "hull: what the photons span.",
        stage="image",
        scale="choice",
    )
    boundary: float = setting(
        0.0,
        "Share of the power of photons on the convex hull's boundary that counts: 0 is exact for independently "
        "scattered photons, 0.2 suits stratified ones (course guide §5.5.4).",
        stage="image",
        scale="linear",
        ge=0.0,
        le=1.0,
        title="boundary share",
        needs=(BOUNDARY,),
    )
    differential: bool = setting(
        False,
        "Differential checking: a disc that would get darker and darker (or brighter) as it grows stops growing, and "
        "one over an edge has the area that its photons span. Edges of surfaces aren't dark; those of caustics stay "
        "sharp and get noisier.",
        stage="image",
        scale="switch",
        title="differential checking",
        needs=(DISC,),
    )
