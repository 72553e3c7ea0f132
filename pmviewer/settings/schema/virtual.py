"""Settings of the method "virtual lights"."""

from __future__ import annotations

from typing import ClassVar, Literal

from pmviewer.settings.needs import Need, Needs
from pmviewer.settings.schema.base import Group, setting

Estimator = Literal[
    "unweighted",
    "clamped",
    "single step",
    "full path",
    "every vertex",
    "modified",
    "printed single step",
    "printed full path",
]

VIRTUAL_LIGHTS = Need(
    lambda f: f.plan.virtual, "Only with the method 'virtual lights' (render.method), where surfaces store photons."
)
WEIGHTED = Need(
    lambda f: f.settings.virtual.estimator not in ("unweighted", "clamped"), "The plain sum is not weighted."
)
CLAMPED = Need(lambda f: f.settings.virtual.estimator == "clamped", "Only with the estimator 'clamped'.")
SINGLE_STEP = Need(lambda f: f.settings.virtual.estimator == "single step", "Only with the estimator 'single step'.")
ANY_SINGLE_STEP = Need(lambda f: "single step" in f.settings.virtual.estimator, "Only with a single step.")
BY_THE_MAP = Need(
    lambda f: f.settings.virtual.density == "photon map", "The virtual lights tell their density (virtual.density)."
)
NORMALISED = Need(
    lambda f: not f.settings.virtual.estimator.startswith("printed"), "The printed forms are not normalised."
)
WINDOWED = Need(
    lambda f: f.settings.virtual.normalisation == "interpolated", "Only with an interpolated normalisation."
)


WALKING = Need(lambda f: f.settings.virtual.normalisation != "none", "Nothing is gathered without a normalisation.")
GLOSS = Need(
    lambda f: f.traits.rich and not f.traits.has_media, "Only with glossy surfaces, and not in scenes with media."
)
SOME = Need(
    lambda f: 0 < f.settings.virtual.per_pixel < f.settings.virtual.number,
    "A pixel asks for all virtual lights (virtual.per_pixel).",
)


class Virtual(Group):
    """Virtual lights"""

    needs: ClassVar[Needs] = (VIRTUAL_LIGHTS,)

    number: int = setting(
        200,
        "Virtual lights in each pass: photons that light what the camera sees as point lights do. Each pass has "
        "others, so that the picture converges whatever their number.",
        stage="image",
        scale="log",
        unit="lights",
        ge=1,
        le=100_000,
    )
    per_pixel: int = setting(
        0,
        "Virtual lights that a pixel asks for in a pass, each pixel for others; 0 asks for all. Fewer spare shadow "
        "rays and turn spots that neighbours share into noise.",
        stage="image",
        scale="integer",
        unit="lights",
        ge=0,
        le=100_000,
        title="lights per pixel",
    )
    choice: Literal["even", "light tree"] = setting(
        "even",
        "How a pixel chooses them. even: each alike, one after the other through all of them. light tree: those that "
        "may bring most, by a tree over all of them, with probabilities that the sums are divided by; choosing takes "
        "longer than a shadow ray in a small scene, and leaves fewer bright pixels.",
        stage="image",
        scale="choice",
        needs=(SOME,),
    )
    estimator: Estimator = setting(
        "single step",
        "unweighted: the plain sum, unbiased, with bright spots in corners. clamped: near lights are dimmed, light is "
        "lost. Others weigh by gathering: single step by the photons' density, full path by whole light paths, every "
        "vertex likewise with a light sample at each vertex, modified where walks stop only where they see the light. "
        "printed forms are those of the paper as printed: biased, and the picture stays wrong.",
        section="Estimator",
        stage="image",
        scale="choice",
    )
    normalisation: Literal["interpolated", "per pixel", "per object", "none"] = setting(
        "interpolated",
        "Probability c that a gathering walk makes what the lights stand for, which weighted sums are multiplied by. "
        "interpolated: from pixels around, ever fewer from pass to pass. per pixel: exact in the limit, noisy at "
        "first. per object: one number for all of an object's pixels, as in the paper; leaves false shadows. "
        "none: c = 1, right in closed scenes alone and with a single step alone.",
        stage="image",
        scale="choice",
        needs=(WEIGHTED, NORMALISED),
    )
    walks: int = setting(
        4,
        "Gathering walks of a pixel in a pass that estimate the normalisation; of a single step, gather rays.",
        stage="image",
        scale="integer",
        unit="walks",
        ge=1,
        le=256,
        needs=(WEIGHTED,),
    )
    window: float = setting(
        6.0,
        "Distance up to which pixels share their normalisation in the first pass; it shrinks with the fourth root of "
        "the passes.",
        stage="image",
        scale="linear",
        unit="px",
        ge=1.0,
        le=64.0,
        needs=(WEIGHTED, NORMALISED, WINDOWED),
    )
    gather_rays: int = setting(
        16,
        "Gather rays of a glossy surface in a pass that bring light themselves, of the photons where they end, besides "
        "normalising: few virtual lights lie in a narrow lobe. 0: virtual lights alone.",
        title="gather rays of gloss",
        stage="image",
        scale="integer",
        unit="rays",
        ge=0,
        le=256,
        needs=(SINGLE_STEP, BY_THE_MAP, WALKING, GLOSS),
    )
    clamp: float = setting(
        15.0,
        "Largest cosθ·cosθ'/distance² that a virtual light counts with (clamped), distances relative to the scene. The "
        "statistics tell how much light that loses.",
        stage="image",
        scale="log",
        unit="/scene²",
        ge=1e-3,
        le=1e6,
        needs=(CLAMPED,),
    )
    density: Literal["photon map", "virtual lights"] = setting(
        "photon map",
        "What tells the density of the virtual lights to the single step: all photons that they are chosen from, or "
        "they themselves.",
        section="Density",
        stage="image",
        scale="choice",
        needs=(SINGLE_STEP,),
    )
    photons: int = setting(
        20_000,
        "Trajectories in the first pass that virtual lights are chosen from where the photon map tells their density; "
        "they grow with the cube root of the passes, up to 500,000.",
        stage="image",
        scale="log",
        unit="photons",
        ge=100,
        le=5_000_000,
        title="trajectories",
        needs=(SINGLE_STEP, BY_THE_MAP),
    )
    k: int = setting(
        8,
        "Photons that each place of a surface belongs to in the first pass, and that share what a virtual light weighs "
        "there: more are less noisy and blur more. By the photon map they shrink with the cube root of the passes. "
        "Printed single step: photons of the disc that tells the density.",
        title="k at a light",
        stage="image",
        scale="integer",
        unit="photons",
        ge=2,
        le=500,
        needs=(ANY_SINGLE_STEP,),
    )
