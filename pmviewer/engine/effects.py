"""Why a setting has no effect just now: the interface greys it and says so."""

from __future__ import annotations

from pmviewer.engine.comparison.without_importance import refusal
from pmviewer.engine.method import Plan, plan_of
from pmviewer.engine.wanted import OF_A_MAP, judges, refused_view
from pmviewer.output.diagnostic_views import DIAGNOSTICS
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import Settings

_KDTREE_ONLY = ("estimate.k", "estimate.rim", "estimate.max_radius", "estimate.black_level")
_GRID_ONLY = ("estimate.radius", "estimate.caustic_radius")
_DISC_ONLY = ("estimate.filter", "estimate.cone_k", "estimate.rim", "estimate.differential")
_RADIANCE_ONLY = ("gather.cutoff", "gather.similarity")
_GUIDED_ONLY = ("gather.guided", "gather.guide_radius")
_KELLER_WALD_ONLY = ("importance.f", "importance.epsilon", "importance.cut_off")
_GUARDED_ONLY = ("importance.contrast", "importance.reach")
_DEPOSITION = (
    "importance.deposition",
    "importance.acceptance",
    "importance.around",
    *_GUARDED_ONLY,
    "importance.density",
    "importance.convergence",
    *_KELLER_WALD_ONLY,
)
_EMISSION = ("importance.emission", "importance.tests", "importance.important")
_CACHE_ONLY = ("gather.cache_error", "gather.cache_samples", "gather.cache_min", "gather.cache_max")


def inactive_reason(path: str, settings: Settings, traits: SceneTraits | None) -> str | None:
    """A sentence for a setting that changes nothing with these settings in this scene, None for one that does.

    `path` may also name one choice of a setting, "display.view=photon count".
    """
    if traits is None:
        return None
    plan = plan_of(settings, traits)
    method = settings.render.method
    group = path.split(".")[0]
    if group in ("photons", "estimate", "importance") and not plan.photons:
        return "The path tracer uses no photons." if plan.path else "No surface of this scene stores photons."
    if group == "importance":
        if path in _DEPOSITION:
            return _deposition(path, settings, plan)
        if path in _EMISSION:
            return _emission(path, settings, plan)
        if path != "importance.map" and not plan.importance:
            return "Only with importance (importance.map)."
        if path in ("importance.x", "importance.y") and settings.importance.of != "pixel":
            return "Only for the importance of a pixel (importance.of)."
        if path == "importance.caustic_M_r" and not plan.caustic_classes:
            return "No caustic map in this scene or with this method."
        if path == "importance.M_r" and not plan.global_classes:
            return "The method shows the caustic map alone."
        return None
    if group == "display":
        return _display(path, settings, plan)
    if group == "overlays":
        return _overlays(path, settings, plan)
    if group == "photons":
        return _photons(path, settings, traits, plan)
    if group == "estimate":
        return _estimate(path, settings, plan)
    if group == "gather" and not plan.gather:
        return f"Only a final gather casts gather rays, not the method '{method}' (render.indirect)."
    if path in ("gather.directions", *_GUIDED_ONLY) and settings.gather.rays < 2:
        return "A single gather ray follows the BSDF."
    if path in _GUIDED_ONLY and not plan.guided_rays:
        return "No photons guide the rays: see gather.directions."
    if path in _RADIANCE_ONLY and not plan.radiance:
        return "Only with radiance photons."
    if path in _CACHE_ONLY and not plan.cache:
        return "Only with the irradiance cache."
    if group == "direct" and not (plan.direct or plan.followed_direct or plan.path):
        return "No light is sampled: a map is shown alone, direct light comes from photons, or all is smooth."
    if group == "direct":
        return _direct(path, settings, plan, traits)
    if group == "free_camera" and path != "free_camera.on" and not settings.free_camera.on:
        return "Only with the free camera (free_camera.on)."
    if group == "compare" and (why := refusal(settings, traits)) is not None:
        return why
    if path == "compare.limit" and settings.compare.equal != "error":
        return "Only at equal error (compare.equal)."
    if path == "free_camera.cut_height" and not settings.free_camera.cut:
        return "Nothing is cut open (free_camera.cut)."
    if path == "free_camera.length" and not settings.free_camera.frustum:
        return "The frustum is not drawn."
    if path == "camera.fov" and settings.camera.projection == "orthographic":
        return "An orthographic camera has none: see camera.view_width."
    if path == "camera.view_width" and settings.camera.projection == "perspective":
        return "Only of an orthographic camera (camera.projection)."
    if path == "camera.fov" and settings.camera.projection == "auto" and traits.orthographic:
        return "The scene's camera is orthographic: see camera.view_width."
    if path == "camera.view_width" and settings.camera.projection == "auto" and not traits.orthographic:
        return "The scene's camera is perspective (camera.projection)."
    if path == "render.outline_rays" and plan.path:
        return "The path tracer treats all pixels alike."
    if path in ("render.direct", "render.caustic", "render.indirect"):
        return _term(path, plan, traits, settings)
    if path == "render.max_depth" and not (plan.path or traits.follows(settings.photons.glossy)):
        return "No mirror or glass in this scene."
    return None


def _term(path: str, plan: Plan, traits: SceneTraits, settings: Settings) -> str | None:
    if settings.render.method not in ("progressive", "gather"):
        return "Only with the methods 'progressive' and 'gather'."
    if not plan.global_classes:
        return "No surface of this scene stores photons."
    if path == "render.caustic" and not traits.follows(settings.photons.glossy):
        return "No mirror or glass in this scene."
    return None


def _deposition(path: str, settings: Settings, plan: Plan) -> str | None:
    asked, active = settings.importance.deposition, plan.deposition
    if path == "importance.deposition":
        return None if active == asked else f"{asked} needs importance (importance.map)."
    if path == "importance.convergence":
        if active not in ("density control", "constant density"):
            return "Only with density control."
        return None if plan.caustic_classes else "No caustic map in this scene or with this method."
    if path in _KELLER_WALD_ONLY:
        return None if active == "Keller-Wald" else "Only with the deposition rule 'Keller-Wald'."
    if path == "importance.density":
        return None if active == "constant density" else "Only with the deposition rule 'constant density'."
    if active in ("all", "Keller-Wald"):
        return "Only with density control."
    guards = path not in _GUARDED_ONLY or settings.importance.around == "guarded"
    return None if guards else "Only with guarded neighbours (importance.around)."


def _emission(path: str, settings: Settings, plan: Plan) -> str | None:
    asked, active = settings.importance.emission, plan.emission
    if path == "importance.emission":
        return None if active == asked else f"{asked} needs importance (importance.map)."
    if path == "importance.important":
        return None if active == "Christensen discard" else "Only with guided emission by Christensen discard."
    return "Only with guided emission." if active == "off" else None


def _display(path: str, settings: Settings, plan: Plan) -> str | None:
    view = path.removeprefix("display.view=")
    if view in DIAGNOSTICS:
        return refused_view(view, plan)
    shown = settings.display.view
    if path == "display.map":
        if shown not in DIAGNOSTICS or DIAGNOSTICS[shown].family not in OF_A_MAP:
            views = ", ".join(f"'{view}'" for view, how in DIAGNOSTICS.items() if how.family in OF_A_MAP)
            return f"Only with the views {views}."
        if not (plan.caustic_classes and plan.global_classes):
            return "There is one map."
    return None


def _overlays(path: str, settings: Settings, plan: Plan) -> str | None:
    name = path.split(".")[1]
    if name == "shadow":
        return None if plan.shadows else "Only with shadow photons (direct.shadow_photons)."
    if not plan.photons:
        return "This method traces no photons."
    if name in ("importons", "lights") and not plan.importance:
        return "Only with importance (importance.map)."
    if name == "fates" and not judges(plan):
        return "Every photon is stored (importance.deposition)."
    two_maps = plan.caustic_classes and plan.global_classes
    if path == "overlays.fates.map" and not two_maps:
        return "There is one map."
    if path == "overlays.importons.map" and not (two_maps and plan.gather):
        return "One importance serves both maps: they are shown at the same places."
    if name == "gather":
        return None if plan.gather else "Only the method 'gather' casts gather rays."
    if name == "projection" and plan.emission != "off":
        return "Guided emission takes no projection maps (importance.emission)."
    if name == "projection" and settings.photons.projection == "off":
        return "Photons leave the lights in all directions (photons.projection)."
    if path == "overlays.projection.map" and (settings.photons.q == 1.0 or settings.photons.q_rule == "photons"):
        return "All trajectories fill the global map, and leave for any surface (photons.q)."
    if path == "overlays.caustic.show" and not plan.caustic_classes:
        return "No caustic photons: the scene has no mirror or glass, or the method does not use them."
    if name == "radiance" and not plan.radiance:
        return "Only the method 'gather' has radiance photons, where they are on."
    if name == "cache" and not plan.cache:
        return "Only the method 'gather' has an irradiance cache, where it is on."
    if path == "overlays.cache.colour":
        return "Records are coloured by irradiance: light of many photons, lights and bounces."
    if path == "overlays.radiance.colour":
        return "Radiance photons are coloured by irradiance: light of many photons, lights and bounces."
    return None


def _direct(path: str, settings: Settings, plan: Plan, traits: SceneTraits) -> str | None:
    direct = settings.direct
    if path.startswith("direct.shadow_"):
        if plan.path:
            return "The path tracer casts every shadow ray."
        if path != "direct.shadow_photons" and not direct.shadow_photons:
            return "Only with shadow photons."
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


def _photons(path: str, settings: Settings, traits: SceneTraits, plan: Plan) -> str | None:
    if plan.emission != "off":
        if path == "photons.projection":
            return "Guided emission finds where photons start by test photons (importance.emission)."
        if path == "photons.q_rule":
            return "With guided emission q is the probability of storing a global photon."
    if path == "photons.glossy" and not traits.glossy_roughness:
        return "No glossy surface in this scene."
    if path == "photons.indirect_caustics" and not traits.follows(settings.photons.glossy):
        return "No mirror or glass in this scene."
    if settings.render.method == "caustic map" and path == "photons.q_rule":
        return "The method shows the caustic map alone."
    return None


def _estimate(path: str, settings: Settings, plan: Plan) -> str | None:
    estimate = settings.estimate
    if path in _KDTREE_ONLY and estimate.lookup != "nearest":
        return "Only with look-up 'nearest'."
    if path in _GRID_ONLY and estimate.lookup == "nearest":
        return "Not with look-up 'nearest': the k nearest photons set the radius."
    if path == "estimate.radius_rule":
        if estimate.lookup == "nearest":
            return "Not with look-up 'nearest': the k nearest photons set the radius."
        if settings.photons.renew == "once" or estimate.alpha == 1.0:
            return "The radius does not shrink (photons.renew, estimate.alpha)."
        if not (plan.caustic_classes or plan.shown_directly):
            return "Gather rays alone look photons up, with the radius of the pass."
    if path == "estimate.black_level" and estimate.max_radius != "auto":
        return "Only with an automatic maximum radius."
    if path == "estimate.caustic_radius" and not plan.caustic_classes:
        return "No caustic map in this scene or with this method."
    hull = estimate.area == "convex hull"
    if hull and path in _DISC_ONLY:
        return "The convex hull weighs all photons alike and has no dark edges to check for."
    if path == "estimate.boundary" and not (hull or estimate.differential):
        return "Only with the area 'convex hull' or differential checking."
    if path == "estimate.cone_k" and estimate.filter != "cone":
        return "Only with the cone filter."
    if path in ("estimate.alpha", "estimate.floor") and settings.photons.renew == "once":
        return "One photon map serves all passes: the radius does not shrink."
    if path == "estimate.floor" and estimate.lookup == "nearest" and estimate.max_radius != "auto":
        return "With look-up 'nearest' it bounds the automatic maximum radius."
    if path == "estimate.floor" and estimate.lookup != "nearest" and estimate.alpha == 1.0:
        return "The radius does not shrink with alpha = 1."
    return None
