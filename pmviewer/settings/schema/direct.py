"""Settings of direct light."""

from __future__ import annotations

from typing import ClassVar, Literal

from pmviewer.settings.needs import CLEAR, Need, Needs
from pmviewer.settings.schema.base import Auto, Group, setting

LIGHT_SAMPLES = Need(
    lambda f: f.plan.direct or f.plan.followed_direct or f.plan.path,
    "No light is sampled: a map is shown alone, direct light comes from photons, or all is smooth.",
)
ONE_LIGHT_SET = Need(
    lambda f: f.plan.choice != "Keller-Wald", "Keller-Wald sets contributing and other samples instead."
)
TWO_LIGHT_SETS = Need(lambda f: f.plan.choice == "Keller-Wald", "Only with the light choice Keller-Wald.")
HAS_PHOTONS = Need(lambda f: not f.plan.path, "The path tracer has no photons to ask.")
MANY_LIGHTS = Need(lambda f: f.traits.n_lights > 1, "There is one light.")
MOST_BY_DISTANCE = 64
"""Lights that the choice by distance goes through: `pmviewer.render.direct.choice.LISTED`."""
FEW_LIGHTS = Need(lambda f: f.traits.n_lights <= MOST_BY_DISTANCE, f"Only with at most {MOST_BY_DISTANCE} lights.")
CHOICE_BY_PHOTONS = Need(lambda f: f.plan.asks_photons, "No photons choose lights: see direct.choice.")
UNBIASED = Need(lambda f: not f.settings.direct.biased, "Lights without photons near are left out.")
NOTHING_EMITS = Need(
    lambda f: not f.plan.looked_for, "Media emit light in this scene: what is near to them is lit by what rays find."
)
SPARES_SHADOW_RAYS = Need(lambda f: not f.plan.path, "The path tracer casts every shadow ray.")
SHADOW_PHOTONS_ON = Need(lambda f: f.settings.direct.shadow_photons, "Only with shadow photons.")


class Direct(Group):
    """Direct light"""

    needs: ClassVar[Needs] = (LIGHT_SAMPLES,)

    samples: int | Auto = setting(
        "auto",
        "Light samples per surface and pass. Automatic: 2, with several lights or light from all around 4; by the path "
        "tracer and in scenes with media that scatter or emit light 1.",
        stage="image",
        scale="integer",
        unit="samples",
        ge=1,
        le=64,
        needs=(ONE_LIGHT_SET,),
    )
    mis: bool = setting(
        True,
        "Combine light sampling with BSDF sampling by multiple importance sampling (power heuristic). Off: light "
        "sampling alone.",
        stage="image",
        scale="switch",
        title="MIS",
        needs=(NOTHING_EMITS,),
    )
    choice: Literal["auto", "power", "distance", "photons", "Keller-Wald"] = setting(
        "auto",
        "How light samples are spread over the lights. power: by the lights' power. distance: by power and distance "
        "from the point, and up to 16 by what gloss reflects of each. photons: mostly by the photons that arrived "
        "from each light near the point. Keller-Wald: some samples for the lights with photons near, some for all "
        "others (§3). auto: photons with 8 lights or more, distance with fewer and, up to 64, by the path tracer.",
        section="Many lights",
        stage="image",
        scale="choice",
        needs=(MANY_LIGHTS,),
        choice_needs={"distance": (FEW_LIGHTS,), "photons": (HAS_PHOTONS,), "Keller-Wald": (HAS_PHOTONS,)},
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
        needs=(CHOICE_BY_PHOTONS,),
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
        needs=(TWO_LIGHT_SETS,),
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
        needs=(
            TWO_LIGHT_SETS,
            UNBIASED,
        ),
    )
    biased: bool = setting(
        False,
        "Leave lights without photons near the point out: less noise, a little too dark.",
        stage="image",
        scale="switch",
        title="only contributing lights",
        needs=(CHOICE_BY_PHOTONS,),
    )
    shadow_photons: bool = setting(
        False,
        "Where all shadow photons of a light near a point are lit, or all in shadow, no shadow ray is cast (Jensen "
        "1996, §4.1). Fewer rays, but biased: faint penumbrae and shadows smaller than the photons' distance are lost.",
        section="Shadow photons",
        stage="maps",
        scale="switch",
        title="shadow photons",
        needs=(
            CLEAR,
            SPARES_SHADOW_RAYS,
        ),
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
        needs=(
            SPARES_SHADOW_RAYS,
            SHADOW_PHOTONS_ON,
        ),
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
        needs=(
            SPARES_SHADOW_RAYS,
            SHADOW_PHOTONS_ON,
        ),
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
        needs=(
            SPARES_SHADOW_RAYS,
            SHADOW_PHOTONS_ON,
        ),
    )
