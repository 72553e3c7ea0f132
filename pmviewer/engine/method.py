"""What each method needs: which stages run for these settings and this scene, and which are skipped, and why."""

from __future__ import annotations

from dataclasses import dataclass, replace

from pmviewer.maps.record import CAUSTIC, DIRECT, INDIRECT, INDIRECT_CAUSTIC
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings import Settings

MANY_LIGHTS = 4
"""From so many lights on, the automatic choice of lights asks the photons."""
ALL = 1 << DIRECT | 1 << CAUSTIC | 1 << INDIRECT | 1 << INDIRECT_CAUSTIC


@dataclass(frozen=True)
class Plan:
    """Masks are bit sets of path classes (`1 << class`). `caustic_mask` and `global_mask` are shown directly,
    `global_classes` are what the global map has to hold; 0 means that the map is not built. `choice` is how
    direct light chooses lights, `radiance` whether gather rays use radiance photons."""

    path: bool = False
    direct: bool = False
    gather: bool = False
    radiance: bool = False
    caustic_mask: int = 0
    global_mask: int = 0
    global_classes: int = 0
    choice: str = "power"
    skipped: tuple[tuple[str, str], ...] = ()

    @property
    def photons(self) -> bool:
        return bool(self.caustic_mask or self.global_classes)


def plan_of(settings: Settings, traits: SceneTraits) -> Plan:
    """The stages that the method needs in this scene."""
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
    if not traits.has_specular:
        caustics = 0
        skipped.append(("caustic map", "no mirror or glass in the scene"))
    if method == "global map":
        return Plan(global_mask=ALL, global_classes=ALL, skipped=(*skipped, ("direct light", "a map is shown alone")))
    if method == "caustic map":
        skipped += [("direct light", "a map is shown alone"), ("global map", "not shown")]
        return Plan(caustic_mask=caustics, skipped=tuple(skipped))
    choice, why = _light_choice(settings, traits)
    if choice == "power":
        skipped.append(("light choice by photons", why))
    if method == "gather":
        radiance = settings.gather.radiance_photons != "off"
        if not radiance:
            skipped.append(("radiance photons", "off"))
        gathered = Plan(
            direct=True, gather=True, radiance=radiance, caustic_mask=caustics, global_classes=ALL, choice=choice
        )
        return replace(gathered, skipped=tuple(skipped))
    skipped.append(("final gather", "the method shows the maps directly"))
    shown = Plan(direct=True, caustic_mask=caustics, global_mask=diffuse, global_classes=diffuse, choice=choice)
    return replace(shown, skipped=tuple(skipped))


def _light_choice(settings: Settings, traits: SceneTraits) -> tuple[str, str]:
    """How lights are chosen, and why photons don't choose where that is by power."""
    wanted = settings.direct.choice
    if traits.n_lights <= 1:
        return "power", "there is one light"
    if wanted == "auto":
        few = f"only {traits.n_lights} lights (direct.choice = photons asks for it)"
        return ("photons", "") if traits.n_lights >= MANY_LIGHTS else ("power", few)
    return wanted, "direct.choice = power"
