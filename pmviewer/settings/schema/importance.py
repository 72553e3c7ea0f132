"""Settings of visual importance."""

from __future__ import annotations

from typing import ClassVar, Literal

from pmviewer.settings.needs import CAUSTIC_MAP, CLEAR, GLOBAL_MAP, IMPORTANCE, PHOTONS, Need, Needs
from pmviewer.settings.schema.base import Auto, Group, setting

Deposit = Literal["all", "Keller-Wald", "density control", "constant density"]
WITHOUT_IMPORTANCE = ("all", "constant density")
"""Rules that ask no importance map."""
OF_A_PIXEL = Need(lambda f: f.settings.importance.of == "pixel", "Only for the importance of a pixel (importance.of).")
DEPOSITION = Need(
    lambda f: f.plan.deposition == f.settings.importance.deposition,
    lambda f: f"{f.settings.importance.deposition} needs importance (importance.map).",
)
KELLER_WALD = Need(lambda f: f.plan.deposition == "Keller-Wald", "Only with the deposition rule 'Keller-Wald'.")
DENSITY_CONTROL = Need(
    lambda f: f.plan.deposition in ("density control", "constant density"), "Only with density control."
)
CONSTANT_DENSITY = Need(
    lambda f: f.plan.deposition == "constant density", "Only with the deposition rule 'constant density'."
)
GUARDED = Need(lambda f: f.settings.importance.around == "guarded", "Only with guarded neighbours (importance.around).")
EMISSION = Need(
    lambda f: f.plan.emission == f.settings.importance.emission,
    lambda f: f"{f.settings.importance.emission} needs importance (importance.map).",
)
GUIDED_EMISSION = Need(lambda f: f.plan.emission != "off", "Only with guided emission.")
CHRISTENSEN_DISCARD = Need(
    lambda f: f.plan.emission == "Christensen discard", "Only with guided emission by Christensen discard."
)


class Importance(Group):
    """Importance"""

    needs: ClassVar[Needs] = (PHOTONS,)

    map: Literal["off", "screen", "footprint", "average"] = setting(
        "off",
        "Importance of places for this picture, from importons that start at the camera. screen: how many pixels look "
        "at a place. footprint: how little of the surroundings one pixel sees there (path differentials). average: of "
        "both. Shown by the overlay 'importons' and the view 'required density'.",
        stage="photons",
        scale="choice",
        title="importance map",
    )
    N: int = setting(
        20_000,
        "Importons traced from the camera for the first pass; so many more for each of the next three.",
        stage="photons",
        scale="log",
        title="importons",
        unit="importons",
        ge=100,
        le=5_000_000,
        needs=(IMPORTANCE,),
    )
    neighbours: int = setting(
        200,
        "Importons that an estimate of the importance averages over: fewer are sharper, more are smoother.",
        stage="photons",
        scale="log",
        title="nearest importons",
        unit="importons",
        ge=10,
        le=1024,
        needs=(IMPORTANCE,),
    )
    of: Literal["image", "pixel"] = setting(
        "image",
        "What the importance is for: the whole image, or one pixel of it, to see what that one needs.",
        stage="photons",
        scale="choice",
        title="importance of",
        needs=(IMPORTANCE,),
    )
    x: float = setting(
        0.5,
        "Place of that pixel from left (0) to right (1).",
        stage="photons",
        scale="linear",
        unit="× width",
        ge=0.0,
        le=1.0,
        title="pixel, across",
        needs=(
            IMPORTANCE,
            OF_A_PIXEL,
        ),
    )
    y: float = setting(
        0.5,
        "Place of that pixel from top (0) to bottom (1).",
        stage="photons",
        scale="linear",
        unit="× height",
        ge=0.0,
        le=1.0,
        title="pixel, down",
        needs=(
            IMPORTANCE,
            OF_A_PIXEL,
        ),
    )
    M_r: float = setting(
        2.0,
        "Photons of the global map wanted for each pixel: the required density is importance × M_r per pixel. Where "
        "look-up radii shrink from pass to pass it grows with 1/r², so that a look-up finds as many photons as before.",
        stage="photons",
        scale="log",
        unit="photons/px",
        title="M_r, global map",
        ge=1e-3,
        le=1e4,
        needs=(
            IMPORTANCE,
            GLOBAL_MAP,
        ),
    )
    caustic_M_r: float = setting(
        25.0,
        "The same for the caustic map, which is shown directly and needs more.",
        stage="photons",
        scale="log",
        unit="photons/px",
        title="M_r, caustic map",
        ge=1e-3,
        le=1e5,
        needs=(
            IMPORTANCE,
            CAUSTIC_MAP,
        ),
    )
    deposition: Deposit = setting(
        "all",
        "Which photons the maps store. all: every one. Keller-Wald: with a probability by importance, the power of the "
        "stored ones raised (Keller and Wald §2.2). density control: up to the required density by importance, the "
        "power of the others added to their neighbours' (course guide §3.5). constant density: the same with one "
        "density everywhere, without importance.",
        stage="photons",
        scale="choice",
        needs=(DEPOSITION,),
    )
    f: float | Auto = setting(
        "auto",
        "Probability of storing a photon per pixel of importance around it. Automatic: by test rays, so that every "
        "photon is stored wherever the camera looks directly.",
        stage="photons",
        scale="log",
        unit="1/px",
        title="f",
        ge=1e-9,
        le=1e6,
        needs=(KELLER_WALD,),
    )
    epsilon: float = setting(
        0.02,
        "Probability of storing a photon below which the cut-off acts.",
        stage="photons",
        scale="log",
        title="cut-off ε",
        ge=1e-3,
        le=1.0,
        needs=(KELLER_WALD,),
    )
    cut_off: Literal["clamp", "discard"] = setting(
        "clamp",
        "What happens below ε. clamp: the probability is ε, which is unbiased. discard: the photon is dropped, and the "
        "picture is too dark by the power that the statistics show.",
        stage="photons",
        scale="choice",
        title="below the cut-off",
        needs=(KELLER_WALD,),
    )
    acceptance: Literal["step", "cosine"] = setting(
        "step",
        "How density control decides by ρ, the density so far over the required one. step: store below 1 and never "
        "above. cosine: with the probability ½(1 + cos(π·ρ/2)), 0 from 2 on (Suykens and Willems 2000). Chance leaves "
        "gaps that are filled, so that the density comes to rest at about 1.3 and 2.2 times the required one.",
        stage="photons",
        scale="choice",
        needs=(DENSITY_CONTROL,),
    )
    around: Literal["nearest", "guarded"] = setting(
        "guarded",
        "Which stored photons tell the density and share a photon's power. nearest: the 20 nearest in space, of which "
        "those that arrived on its side share (Suykens and Willems 2000). guarded: the 20 nearest that a look-up "
        "there would count, on its side and in a disc along the surface, with the two limits below: no power seeps "
        "through thin walls and across borders of importance. 'nearest' brightens what is seen of the hundred rooms "
        "many times over, since most of their light ends where nothing is required.",
        stage="photons",
        scale="choice",
        title="photons around",
        needs=(DENSITY_CONTROL,),
    )
    contrast: float = setting(
        4.0,
        "Guarded neighbours never need more than so many times the density required at the photon: where important "
        "and unimportant surfaces meet, the power of many photons would end in few important ones.",
        stage="photons",
        scale="log",
        title="guard: contrast",
        ge=1.0,
        le=1e6,
        needs=(
            DENSITY_CONTROL,
            GUARDED,
        ),
    )
    reach: float = setting(
        1.0,
        "Guarded: how far power moves at most where nothing is required, relative to the distance of the nearest "
        "important place; at 1 it does not get there. Without that bound it would go any distance, and arrive in the "
        "picture.",
        stage="photons",
        scale="log",
        unit="× distance",
        title="guard: reach",
        ge=0.01,
        le=1.0,
        needs=(
            DENSITY_CONTROL,
            GUARDED,
        ),
    )
    convergence: Literal["off", "square", "cube"] = setting(
        "off",
        "Where the caustic map has converged under density control: by (D/D_r)·(L/L_c)^m ≥ 1 with m = 2 or 3, since a "
        "caustic that other light outshines may be coarser (Suykens and Willems 2000). Trajectories that fill the "
        "caustic map alone (q below 1) end when all of it has, unless projection maps aim them and there are "
        "indirect caustics; the view 'caustic "
        "convergence' shows where.",
        stage="photons",
        scale="choice",
        title="caustic convergence",
        needs=(
            DENSITY_CONTROL,
            CAUSTIC_MAP,
        ),
    )
    density: float | Auto = setting(
        "auto",
        "Density of photons to store everywhere. Automatic: so many that a look-up finds 20 of them.",
        stage="photons",
        scale="log",
        unit="photons/m²",
        title="constant density",
        ge=1e-6,
        le=1e12,
        needs=(CONSTANT_DENSITY,),
    )
    emission: Literal["off", "Peter-Pietrek", "Christensen discard", "Christensen keep"] = setting(
        "off",
        "Where photons leave the lights, by what test photons meet. Peter-Pietrek: as often as they met importance. "
        "Christensen discard: strata whose test photons met nothing important keep them, others get many weaker ones "
        "instead; light that test photons miss is lost. Christensen keep: test photons stay and are topped up, which "
        "is unbiased. Both store photons in unimportant places by roulette. Photons that come to a more important "
        "place than they were sent for go on in pieces.",
        stage="photons",
        scale="choice",
        title="guided emission",
        needs=(CLEAR, EMISSION),
    )
    tests: int = setting(
        2,
        "Test photons from each stratum of a light's directions, at least: fewer allow finer strata. A sixteenth "
        "(Peter-Pietrek) or an eighth (Christensen) of a pass's photons are test photons.",
        stage="photons",
        scale="log",
        unit="photons",
        title="test photons",
        ge=2,
        le=1024,
        needs=(GUIDED_EMISSION,),
    )
    important: float = setting(
        0.05,
        "Importance, relative to what most seen places have, from which a place is important: Christensen discard "
        "drops test photons that reach such a place, and those around them, and sends more of less power.",
        stage="photons",
        scale="log",
        title="important from",
        ge=1e-4,
        le=1.0,
        needs=(CHRISTENSEN_DISCARD,),
    )
