"""What each method needs: which stages run for these settings and this scene, and which are skipped, and why."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from pmviewer.maps.record import CAUSTIC, DIRECT, INDIRECT, INDIRECT_CAUSTIC
from pmviewer.maps.variant import Estimator
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings import Settings

MANY_LIGHTS = 8
"""From so many lights on, the automatic choice of lights asks the photons."""
EXPONENTS = {"off": 0, "square": 2, "cube": 3}
Deposit = Literal["all", "Keller-Wald", "density control", "constant density"]
Emission = Literal["off", "Peter-Pietrek", "Christensen discard", "Christensen keep"]
ALL = 1 << DIRECT | 1 << CAUSTIC | 1 << INDIRECT | 1 << INDIRECT_CAUSTIC


@dataclass(frozen=True)
class Plan:
    """Masks are bit sets of path classes (`1 << class`). `caustic_mask` and `global_mask` are shown directly,
    `global_classes` are what the global map has to hold; 0 means that the map is not built. `choice` is how
    direct light chooses lights, `radiance` whether gather rays use radiance photons, `directions` how they look about:
    photons of the classes `guide_mask` guide `guided_rays` of them; `corners` is whether short ones gather again,
    `cache` whether diffuse surfaces gather through an irradiance cache, `shadows` whether shadow photons save shadow
    rays, `importance` whether there are importance maps, `deposition` which photons maps store, `emission` how
    importance guides it, `convergence` the exponent of the caustic map's convergence criterion, 0 without; `warnings`
    are sentences for the log about what was asked for and can't be."""

    path: bool = False
    direct: bool = False
    gather: bool = False
    radiance: bool = False
    directions: Literal["BSDF", "photon cones", "hemisphere grid"] = "BSDF"
    guided_rays: int = 0
    guide_mask: int = 0
    corners: bool = False
    cache: bool = False
    shadows: bool = False
    importance: bool = False
    deposition: Deposit = "all"
    emission: Emission = "off"
    convergence: int = 0
    caustic_mask: int = 0
    global_mask: int = 0
    global_classes: int = 0
    choice: str = "power"
    skipped: tuple[tuple[str, str], ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def photons(self) -> bool:
        return bool(self.caustic_mask or self.global_classes)


def plan_of(settings: Settings, traits: SceneTraits) -> Plan:
    """The stages that the method needs in this scene."""
    plan = _photon_plan(settings, traits)
    if not plan.photons:
        return plan
    how = settings.importance
    if how.deposition == "all":
        plan = replace(plan, skipped=(*plan.skipped, ("deposition rules", "all photons are stored")))
    elif how.map == "off" and how.deposition != "constant density":
        why = f"{how.deposition} needs importance, and importance.map is off"
        skipped, warning = (*plan.skipped, ("deposition rules", why)), f"All photons are stored: {why}."
        plan = replace(plan, skipped=skipped, warnings=(*plan.warnings, warning))
    else:
        plan = replace(plan, deposition=how.deposition)
        if "density" in how.deposition and plan.caustic_mask:
            plan = replace(plan, convergence=EXPONENTS[how.convergence])
    if how.emission == "off":
        plan = replace(plan, skipped=(*plan.skipped, ("guided emission", "importance.emission is off")))
    elif how.map == "off":
        why = f"{how.emission} needs importance, and importance.map is off"
        skipped, warning = (*plan.skipped, ("guided emission", why)), f"Photons leave the lights by power: {why}."
        plan = replace(plan, skipped=skipped, warnings=(*plan.warnings, warning))
    else:
        plan = replace(plan, emission=how.emission)
    if how.map == "off":
        return replace(plan, skipped=(*plan.skipped, ("importance", "importance.map is off")))
    return replace(plan, importance=True)


def _photon_plan(settings: Settings, traits: SceneTraits) -> Plan:
    """The plan without importance."""
    method = settings.render.method
    caustics = 1 << CAUSTIC
    diffuse = 1 << INDIRECT
    if settings.photons.indirect_caustics:
        caustics |= 1 << INDIRECT_CAUSTIC
    else:
        diffuse |= 1 << INDIRECT_CAUSTIC
    skipped: list[tuple[str, str]] = []
    if method == "path":
        return Plan(path=True, skipped=(("light pass", "the path tracer uses no photons"),))
    if not traits.has_diffuse:
        skipped += [("light pass", "no surface can store photons"), ("direct light", "no diffuse surface")]
        return Plan(skipped=tuple(skipped))
    if not traits.follows(settings.photons.glossy):
        caustics = 0
        skipped.append(("caustic map", "no mirror or glass, nor smooth gloss, in the scene"))
    if method == "global map":
        return Plan(global_mask=ALL, global_classes=ALL, skipped=(*skipped, ("direct light", "a map is shown alone")))
    if method == "caustic map":
        skipped += [("direct light", "a map is shown alone"), ("global map", "not shown")]
        return Plan(caustic_mask=caustics, skipped=tuple(skipped))
    choice, why = _light_choice(settings, traits)
    if choice == "power":
        skipped.append(("light choice by photons", why))
    shadows = settings.direct.shadow_photons and traits.n_lights > 0
    if not shadows:
        skipped.append(("shadow photons", "direct.shadow_photons is off"))
    if method == "gather":
        radiance = settings.gather.radiance_photons != "off"
        if not radiance:
            skipped.append(("radiance photons", "off"))
        if settings.gather.secondary == 0:
            skipped.append(("secondary gathering", "off"))
        guided = _guided_rays(settings)
        if not guided:
            single = settings.gather.directions != "BSDF"
            skipped.append(("guided directions", "a single gather ray follows the BSDF" if single else "off"))
        cache = settings.gather.cache == "on"
        if not cache:
            skipped.append(("irradiance cache", "off"))
        gathered = Plan(
            direct=True,
            gather=True,
            radiance=radiance,
            directions=settings.gather.directions if guided else "BSDF",
            guided_rays=guided,
            guide_mask=diffuse if guided else 0,
            corners=settings.gather.secondary > 0,
            cache=cache,
            caustic_mask=caustics,
            global_classes=ALL,
            choice=choice,
        )
        return replace(gathered, shadows=shadows, skipped=tuple(skipped))
    skipped.append(("final gather", "the method shows the maps directly"))
    shown = Plan(direct=True, caustic_mask=caustics, global_mask=diffuse, global_classes=diffuse, choice=choice)
    return replace(shown, shadows=shadows, skipped=tuple(skipped))


def _guided_rays(settings: Settings) -> int:
    """How many gather rays photons guide: at least one and not all of them."""
    gather = settings.gather
    if gather.directions == "BSDF" or gather.rays < 2:
        return 0
    return min(max(round(gather.guided * gather.rays), 1), gather.rays - 1)


def estimator_of(settings: Settings) -> Estimator:
    """The density estimate that maps are looked up with."""
    if settings.estimate.area == "convex hull":
        return "hull"
    return "differential" if settings.estimate.differential else "disc"


def _light_choice(settings: Settings, traits: SceneTraits) -> tuple[str, str]:
    """How lights are chosen, and why photons don't choose where that is by power."""
    wanted = settings.direct.choice
    if traits.n_lights <= 1:
        return "power", "there is one light"
    if wanted == "auto":
        few = f"only {traits.n_lights} lights (direct.choice = photons asks for it)"
        return ("photons", "") if traits.n_lights >= MANY_LIGHTS else ("power", few)
    return wanted, "direct.choice = power"
