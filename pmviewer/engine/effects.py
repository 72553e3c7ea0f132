"""Why a setting has no effect just now: the interface greys it and says so."""

from __future__ import annotations

from pmviewer.engine.method import Plan, plan_of
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings import Settings

_KDTREE_ONLY = ("estimate.k", "estimate.rim", "estimate.max_radius", "estimate.black_level")
_GRID_ONLY = ("estimate.radius", "estimate.caustic_radius", "estimate.alpha")
_RADIANCE_ONLY = ("gather.cutoff", "gather.similarity")


def inactive_reason(path: str, settings: Settings, traits: SceneTraits | None) -> str | None:
    """A sentence for a setting that changes nothing with these settings in this scene, None for one that does."""
    if traits is None:
        return None
    plan = plan_of(settings, traits)
    method = settings.render.method
    group = path.split(".")[0]
    if group in ("photons", "estimate") and not plan.photons:
        return "The path tracer uses no photons." if plan.path else "No surface of this scene stores photons."
    if group == "photons":
        return _photons(path, settings, traits)
    if group == "estimate":
        return _estimate(path, settings, plan.caustic_mask)
    if group == "gather" and not plan.gather:
        return f"Only the method 'gather' casts gather rays, not '{method}'."
    if path in _RADIANCE_ONLY and not plan.radiance:
        return "Only with radiance photons."
    if group == "direct" and not (plan.direct or plan.path):
        return "Direct light is not computed: a map is shown alone, or nothing is diffuse."
    if group == "direct":
        return _direct(path, settings, plan, traits)
    if path == "overlays.caustic.show" and plan.photons and not plan.caustic_mask:
        return "No caustic photons: the scene has no mirror or glass, or the method does not use them."
    if path.startswith("overlays.radiance.") and not plan.radiance:
        return "Only the method 'gather' has radiance photons, where they are on."
    if path == "overlays.radiance.colour":
        return "Radiance photons are coloured by irradiance: light of many photons, lights and bounces."
    if path.startswith("overlays.") and not plan.photons:
        return "This method traces no photons."
    if path == "render.max_depth" and not (plan.path or traits.has_specular):
        return "No mirror or glass in this scene."
    return None


def _direct(path: str, settings: Settings, plan: Plan, traits: SceneTraits) -> str | None:
    direct = settings.direct
    if path == "direct.choice":
        if plan.path:
            return "The path tracer chooses lights by power."
        if traits.n_lights <= 1:
            return "There is one light."
    if path == "direct.samples" and plan.choice == "Keller-Wald":
        return "Keller-Wald sets contributing and other samples instead."
    if path in ("direct.choice_radius", "direct.biased") and plan.choice == "power":
        return "No photons choose lights: see direct.choice."
    if path in ("direct.con_samples", "direct.noncon_samples") and plan.choice != "Keller-Wald":
        return "Only with the light choice Keller-Wald."
    if path == "direct.noncon_samples" and direct.biased:
        return "Lights without photons near are left out."
    return None


def _photons(path: str, settings: Settings, traits: SceneTraits) -> str | None:
    if path == "photons.indirect_caustics" and not traits.has_specular:
        return "No mirror or glass in this scene."
    if settings.render.method == "caustic map" and path == "photons.q_rule":
        return "The method shows the caustic map alone."
    return None


def _estimate(path: str, settings: Settings, caustic_mask: int) -> str | None:
    estimate = settings.estimate
    if path in _KDTREE_ONLY and estimate.lookup != "nearest":
        return "Only with look-up 'nearest'."
    if path in _GRID_ONLY and estimate.lookup == "nearest":
        return "Not with look-up 'nearest': the k nearest photons set the radius."
    if path == "estimate.black_level" and estimate.max_radius != "auto":
        return "Only with an automatic maximum radius."
    if path == "estimate.caustic_radius" and not caustic_mask:
        return "No caustic map in this scene or with this method."
    if path == "estimate.cone_k" and estimate.filter != "cone":
        return "Only with the cone filter."
    if path == "estimate.floor" and estimate.lookup != "nearest" and estimate.alpha == 1.0:
        return "The radius does not shrink with alpha = 1."
    return None
