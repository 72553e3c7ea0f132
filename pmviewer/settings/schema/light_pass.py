"""Settings of the light pass."""

from __future__ import annotations

from typing import Literal

from pmviewer.settings.needs import CLEAR, FOLLOWED, GLOBAL_MAP, PHOTONS, Need
from pmviewer.settings.schema.base import Auto, Group, setting

GLOSSY = Need(lambda f: f.traits.glossy_roughness, "No glossy surface in this scene.")
TERMS_OF_PATHS = Need(lambda f: f.plan.path or f.plan.photons, "No surface of this scene stores photons.")
"""The path tracer sorts its paths into terms as photons would be."""
PLAIN_EMISSION = Need(
    lambda f: f.plan.emission == "off",
    "Guided emission finds where photons start by test photons (importance.emission).",
)
PLAIN_EMISSION_FOR_Q = Need(
    lambda f: f.plan.emission == "off", "With guided emission q is the probability of storing a global photon."
)
LOOKED_UP_BY_K = Need(
    lambda f: f.plan.nearest,
    "Look-ups of a fixed radius find the same photons in several maps as in one (estimate.lookup).",
)
PLAIN_DISC = Need(
    lambda f: f.settings.estimate.area != "convex hull" and not f.settings.estimate.differential,
    "Hulls and differential checking go through the photons of one map.",
)
ALL_STORED = Need(
    lambda f: not f.plan.chooses_photons, "Deposition rules and guided emission ask the whole pass, not its parts."
)


class Photons(Group):
    """Light pass"""

    N: int = setting(
        150_000,
        "Photon trajectories emitted in each pass.",
        stage="photons",
        scale="log",
        unit="photons",
        ge=1,
        le=50_000_000,
        needs=(PHOTONS,),
    )
    q: float = setting(
        1.0,
        "Share of the trajectories that fill the global map; the caustic map gets all of them (Keller and Wald §2.4).",
        stage="photons",
        scale="log",
        ge=0.001,
        le=1.0,
        needs=(PHOTONS,),
    )
    q_rule: Literal["trajectories", "photons"] = setting(
        "trajectories",
        "How q thins the global map: only the first q·N trajectories fill it, or every trajectory's photon is stored "
        "with probability q and power divided by q.",
        stage="photons",
        scale="choice",
        title="q rule",
        needs=(
            PHOTONS,
            PLAIN_EMISSION_FOR_Q,
            GLOBAL_MAP,
        ),
    )
    indirect_caustics: bool = setting(
        True,
        "Photons last scattered by a specular surface go to the caustic map even after a diffuse bounce "
        "(Keller and Wald §2.3). Off: they belong to the global map alone.",
        stage="photons",
        scale="switch",
        needs=(TERMS_OF_PATHS, FOLLOWED),
    )
    maps: int = setting(
        1,
        "Parts of the light pass, each with maps of its own, as so many workers would make them: k nearest look-ups "
        "then find k/M photons in each of M maps (course guide §5.6).",
        stage="photons",
        scale="integer",
        ge=1,
        le=64,
        title="photon maps",
        needs=(PHOTONS, LOOKED_UP_BY_K, PLAIN_DISC, ALL_STORED),
    )
    renew: Literal["each pass", "once"] = setting(
        "each pass",
        "New photons for each pass, with a radius that shrinks: the image converges to the right one. Or one photon "
        "map for all passes, at the first radius: the classical method, whose image converges to what that map says.",
        stage="photons",
        scale="choice",
        title="new photons",
        needs=(PHOTONS,),
    )
    glossy: float = setting(
        0.2,
        "Roughness from which glossy reflection stores photons and is looked up in the maps. Smoother lobes are "
        "followed ray by ray, as mirrors are.",
        stage="photons",
        scale="linear",
        ge=0.0,
        le=1.0,
        title="glossy from",
        needs=(GLOSSY,),
    )
    sequence: Literal["sobol", "independent"] = setting(
        "sobol",
        "Random numbers of the photons: Owen-scrambled Sobol points, or independent ones.",
        stage="photons",
        scale="choice",
        needs=(PHOTONS,),
    )
    projection: Literal["auto", "on", "off"] = setting(
        "auto",
        "Projection maps: photons start only where they can meet a surface, and those for the caustic map alone (q "
        "below 1) only where they can meet mirrors or glass. auto: where that spares at least a third of them. Light "
        "from outside starts more densely near what stands on a wide floor; so does that of lamps high above it.",
        stage="photons",
        scale="choice",
        title="projection maps",
        needs=(CLEAR, PHOTONS, PLAIN_EMISSION),
    )
    roulette: Literal["luminance", "channel maximum", "equal"] = setting(
        "luminance",
        "Chance of surviving a scattering: by the ratio of the power's luminance or of its largest channel after and "
        "before, or by rejection sampling, so that all photons have exactly the same luminance.",
        stage="photons",
        scale="choice",
        needs=(PHOTONS,),
    )
    max_bounces: int | Auto = setting(
        "auto",
        "Scatterings after which a photon is dropped; Russian roulette ends nearly all of them earlier. Automatic: 64, "
        "in scenes with media 1000, since light leaves marble or milk after hundreds of them.",
        stage="photons",
        scale="integer",
        ge=1,
        le=1000,
        needs=(PHOTONS,),
    )
