"""What each method needs: which stages run for these settings and this scene, and which are skipped, and why."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from pmviewer.engine.look_up_plan import estimator_of, first_neighbours, reaches_to_nearest
from pmviewer.engine.media_plan import BLURRED, BLURRED_FROM, THIN, in_media
from pmviewer.engine.plan import Plan
from pmviewer.maps.record import CAUSTIC, DIRECT, INDIRECT, INDIRECT_CAUSTIC
from pmviewer.render.camera import are_hidden
from pmviewer.render.direct.choice import ASKING, LISTED
from pmviewer.render.direct.samples import samples_at_surface
from pmviewer.render.filter import BOX, filter_of
from pmviewer.scene.analysis import SceneTraits
from pmviewer.scene.description import PixelFilter
from pmviewer.settings.access import Settings, needs_of, with_values
from pmviewer.settings.needs import Facts, unmet
from pmviewer.settings.schema.importance import WITHOUT_IMPORTANCE

MANY_LIGHTS = 8
"""From so many lights on, the automatic choice of lights asks the photons."""
REFLECTING = "tinted and reflecting"
EXACT_GLASS = ("path", "virtual lights")
"""Methods that let no light pass thin glass by other rules than it would."""
EXPONENTS = {"off": 0, "square": 2, "cube": 3}
UNFOUND_BY_PATHS = (
    "The path tracer finds no light that comes from a point, spot or directional light over a mirror or through glass: "
    "no ray can meet such a light. The photon methods show it."
)
SHOWN = "Lights and the sky are shown, which the file or render.lights hides: not in scenes with media."
ALL = 1 << DIRECT | 1 << CAUSTIC | 1 << INDIRECT | 1 << INDIRECT_CAUSTIC


MIRROR_RAYS, EDGE_RAYS = 2, 2
"""Samples a pass where mirrors and glass are seen, automatic."""


def plan_of(settings: Settings, traits: SceneTraits) -> Plan:
    """The stages that the method needs in this scene."""
    plan = _stages_of(settings, traits)
    several = traits.many_lights or traits.has_environment
    return replace(plan, light_samples=samples_at_surface(settings.direct, plan.path, traits.lit_media, several))


def _stages_of(settings: Settings, traits: SceneTraits) -> Plan:
    """All of the plan but the number of light samples."""
    if not traits.has_media:
        return _plan_of(settings, traits)
    asked = settings
    settings, said = in_media(settings, traits)
    plan = _plan_of(settings, traits)
    if any(rule not in ("exact", "by setting") for rule in traits.thin_glass) or (
        "by setting" in traits.thin_glass and asked.render.thin_glass != "exact"
    ):
        said = (*said, THIN)
    if hides_lights(asked, traits):
        said = (*said, SHOWN)
    looked_for = traits.media_emit and not plan.path
    return replace(plan, media=True, looked_for=looked_for, warnings=(*plan.warnings, *said))


def _plan_of(settings: Settings, traits: SceneTraits) -> Plan:
    plan = _photon_plan(settings, traits)
    if traits.has_scattering and settings.render.method in ("progressive", "gather", "virtual lights"):
        plan = replace(
            plan,
            volume=True,
            phase_rays=traits.has_findable_lights or traits.media_emit,
            skipped=tuple(s for s in plan.skipped if s[0] != "light pass"),
            warnings=(*plan.warnings, *((BLURRED,) if traits.straightest > BLURRED_FROM else ())),
        )
    plan = replace(
        plan,
        nearest=reaches_to_nearest(settings, traits),
        neighbours=first_neighbours(settings),
        lens=_has_lens(settings, traits),
        filtered=_filtered(settings, traits),
        split=_splits(settings, traits, plan),
        one_sample=_one_sample(settings, traits, plan),
        hides=hides_lights(settings, traits) and not traits.has_media,
        moments=not _divided(settings, plan),
        thin_glass=thin_rules(settings, traits),
        dispersion=traits.has_dispersion,
        warnings=(*plan.warnings, *_of_thin(settings, traits), *_of_dispersion(plan, traits)),
    )
    adaptive = settings.render.adaptive == "on" and plan.moments and not plan.one_sample
    mirror_rays, edge_rays = _pixel_samples(settings, traits, plan)
    plan = replace(plan, mirror_rays=mirror_rays, edge_rays=edge_rays, adaptive=adaptive)
    if not plan.photons:
        return plan
    how = settings.importance
    if how.deposition == "all":
        plan = replace(plan, skipped=(*plan.skipped, ("deposition rules", "all photons are stored")))
    elif how.map == "off" and how.deposition not in WITHOUT_IMPORTANCE:
        why = f"{how.deposition} needs importance, and importance.map is off"
        skipped, warning = (*plan.skipped, ("deposition rules", why)), f"All photons are stored: {why}."
        plan = replace(plan, skipped=skipped, warnings=(*plan.warnings, warning))
    else:
        plan = replace(plan, deposition=how.deposition)
        if "density" in how.deposition and plan.caustic_classes:
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
        plan = replace(plan, skipped=(*plan.skipped, ("importance", "importance.map is off")))
    return replace(plan, importance=how.map != "off", maps=_maps(settings, plan))


def _maps(settings: Settings, plan: Plan) -> int:
    """Parts of the light pass whose maps are looked up each, where that is not the same as one map of all."""
    of_k = plan.nearest and estimator_of(settings) == "disc"
    return settings.photons.maps if of_k and not plan.chooses_photons else 1


SPLIT_TWICE = (
    "Light that glass splits into colours and that is then seen through such glass mixes red, green and blue there, "
    "not wavelengths: the method 'path' keeps them."
)


def _of_dispersion(plan: Plan, traits: SceneTraits) -> tuple[str, ...]:
    return (SPLIT_TWICE,) if traits.has_dispersion and not plan.path else ()


def _has_lens(settings: Settings, traits: SceneTraits) -> bool:
    camera = settings.camera
    return camera.name in traits.lenses if camera.aperture == "auto" else camera.aperture > 0


def _splits(settings: Settings, traits: SceneTraits, plan: Plan) -> bool:
    """Whether camera paths go both ways at glass."""
    glass = traits.has_smooth_glass and not traits.has_dispersion
    return settings.render.splits > 0 and glass and not (plan.path or plan.virtual)


def _one_sample(settings: Settings, traits: SceneTraits, plan: Plan) -> bool:
    """Whether something counts on one sample a pixel and pass: what is estimated belongs to it, virtual lights add up
    weights, and the photons that pixels find set their radii."""
    counted = plan.path or plan.virtual or plan.estimation
    return counted or radii_of_pixels(Facts(settings, plan, traits))


def radii_of_pixels(facts: Facts) -> bool:
    """Whether each pixel has radii of its own (`pmviewer.render.pixel_radius`)."""
    asked = facts.settings.estimate.radius_rule == "pixel"
    return asked and unmet(needs_of("estimate.radius_rule"), facts) is None


def _pixel_samples(settings: Settings, traits: SceneTraits, plan: Plan) -> tuple[int, int]:
    """`mirror_rays` and `edge_rays`."""
    if plan.one_sample:
        return 1, 1
    render, follows = settings.render, traits.follows(settings.photons.glossy)
    mirrors = MIRROR_RAYS if render.mirror_rays == "auto" else int(render.mirror_rays)
    return mirrors if follows else 1, EDGE_RAYS if render.edge_rays == "auto" else int(render.edge_rays)


def hides_lights(settings: Settings, traits: SceneTraits) -> bool:
    """Whether the picture is asked to show no lights."""
    return are_hidden(settings.camera.name in traits.hiding, settings.render)


def _filtered(settings: Settings, traits: SceneTraits) -> bool:
    return _filter(settings, traits) != BOX


def _filter(settings: Settings, traits: SceneTraits) -> PixelFilter:
    return filter_of(dict(traits.filters).get(settings.camera.name), settings.render)


def _divided(settings: Settings, plan: Plan) -> bool:
    """Whether the film divides sums, which no pass alone does."""
    return plan.virtual and settings.virtual.estimator not in ("unweighted", "clamped")


def thin_rules(settings: Settings, traits: SceneTraits) -> tuple[str, ...]:
    """The rules that the scene's panes go by, () where all of them are exact; the path tracer and virtual lights take
    all glass as it is."""
    if settings.render.method in EXACT_GLASS or traits.has_media:
        return ()
    by_setting = settings.render.thin_glass
    rules = {by_setting if rule == "by setting" else rule for rule in traits.thin_glass}
    return () if rules <= {"exact"} else tuple(sorted(rules))


def _of_thin(settings: Settings, traits: SceneTraits) -> tuple[str, ...]:
    """A sentence for what was asked of thin glass and is not done."""
    if settings.render.method == "virtual lights" and thin_rules(
        with_values(settings, {"render.method": "progressive"}), traits
    ):
        return ("Virtual lights take thin glass as it is: the light behind it comes from the caustic map.",)
    if thin_rules(settings, traits) and settings.direct.shadow_photons:
        return ("Shadow rays are all cast: shadow photons don't know what thin glass lets through.",)
    return ()


def _photon_plan(settings: Settings, traits: SceneTraits) -> Plan:
    """The plan without importance."""
    method, glossy = settings.render.method, settings.photons.glossy
    caustics = 1 << CAUSTIC
    diffuse = 1 << INDIRECT
    if settings.photons.indirect_caustics:
        caustics |= 1 << INDIRECT_CAUSTIC
    else:
        diffuse |= 1 << INDIRECT_CAUSTIC
    skipped: list[tuple[str, str]] = []
    if method == "path":
        warnings = (UNFOUND_BY_PATHS,) if traits.has_delta_lights and traits.has_delta else ()
        skipped.append(("light pass", "the path tracer uses no photons"))
        choice = _light_choice(settings, traits, photons=False)[0]
        return Plan(path=True, choice=choice, skipped=tuple(skipped), warnings=warnings)
    thin = thin_rules(settings, traits)
    if thin and "exact" not in thin and REFLECTING not in thin and not traits.follows_beside_thin(glossy):
        caustics = 0
        skipped.append(("caustic map", "thin glass makes none, and there is no other, no mirror or smooth gloss"))
    elif not traits.follows(glossy):
        caustics = 0
        skipped.append(("caustic map", "no mirror or glass, nor smooth gloss, in the scene"))
    if method in ("global map", "caustic map"):
        if not traits.stores(glossy):
            why = "no surface can store photons"
            return Plan(skipped=(*skipped, ("light pass", why)), warnings=(f"Nothing to show: {why}.",))
        skipped.append(("direct light", "a map is shown alone"))
        if method == "global map":
            return Plan(global_mask=ALL, global_classes=ALL, skipped=tuple(skipped))
        return Plan(caustic_mask=caustics, skipped=(*skipped, ("global map", "not shown")))
    unfound = traits.unfound(glossy)
    if not traits.stores(glossy):
        if not unfound:
            skipped.append(("light pass", "no surface can store photons"))
        skipped.append(("global map", "no surface can store photons"))
        rough = traits.follows_rough(glossy)
        if not rough:
            skipped.append(("direct light", "all surfaces are smooth mirrors or glass"))
        choice = _light_choice(settings, traits, photons=False)[0]
        return Plan(followed_direct=rough, unfound=unfound, choice=choice, skipped=tuple(skipped))
    choice, why = _light_choice(settings, traits)
    if why:
        skipped.append(("light choice by photons", why))
    how = _terms(settings)
    shadows = settings.direct.shadow_photons and traits.n_lights > 0 and not thin
    if not shadows:
        why = "they don't know what thin glass lets through" if thin else "direct.shadow_photons is off"
        skipped.append(("shadow photons", why))
    shown = Plan(
        direct=how.direct == "accurate",
        followed_direct=True,
        unfound=unfound,
        direct_mask=1 << DIRECT if how.direct == "approximate" else 0,
        caustic_mask=caustics if how.caustic == "accurate" else 0,
        global_caustics=caustics if how.caustic == "approximate" else 0,
        choice=choice,
        shadows=shadows,
    )
    if how.direct == "approximate":
        skipped.append(("light samples at surfaces that store photons", "render.direct is approximate"))
    if how.caustic == "approximate" and caustics:
        skipped.append(("caustic map", "render.caustic is approximate"))
    if how.indirect == "virtual lights":
        return _virtual_plan(shown, diffuse, caustics, skipped)
    if how.indirect == "accurate":
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
        estimation, why = _estimation(settings, traits)
        if not estimation:
            skipped.append(("gather estimation", why))
        reprojection = estimation and settings.gather.reprojection == "on"
        if estimation and not reprojection:
            skipped.append(("gather reprojection", "off"))
        return replace(
            shown,
            gather=True,
            radiance=radiance,
            directions=settings.gather.directions if guided else "BSDF",
            guided_rays=guided,
            guide_mask=diffuse if guided else 0,
            corners=settings.gather.secondary > 0,
            cache=cache,
            estimation=estimation,
            reprojection=reprojection,
            global_classes=ALL,
            skipped=tuple(skipped),
        )
    skipped.append(("final gather", "the global map is shown directly"))
    classes = diffuse | shown.direct_mask | shown.global_caustics
    return replace(shown, global_mask=diffuse, global_classes=classes, skipped=tuple(skipped))


def _virtual_plan(shown: Plan, diffuse: int, caustics: int, skipped: list[tuple[str, str]]) -> Plan:
    """With virtual lights, which can't shine over mirrors: where the caustic map leaves out caustics after a diffuse
    bounce, the global map shows them. `diffuse` are the path classes that are no caustics."""
    mirrored = diffuse & 1 << INDIRECT_CAUSTIC if caustics else 0
    chooses = 1 << DIRECT if shown.asks_photons else 0
    classes = mirrored | shown.direct_mask | shown.global_caustics | chooses
    skipped.append(("final gather", "virtual lights bring the indirect light"))
    if not classes:
        skipped.append(("global map", "virtual lights bring the indirect light"))
    if not (classes or shown.caustic_classes):
        skipped.append(("light pass", "virtual lights are traced on their own, and nothing else asks for photons"))
    return replace(shown, virtual=True, global_mask=mirrored, global_classes=classes, skipped=tuple(skipped))


class Terms(NamedTuple):
    """How each term is evaluated: "accurate" or "approximate" (Jensen 1996, §4), indirect light by "virtual lights",
    too."""

    direct: str
    caustic: str
    indirect: str


def _terms(settings: Settings) -> Terms:
    """What the method says, and what the user says otherwise."""
    render = settings.render
    indirect = {"gather": "accurate", "virtual lights": "virtual lights"}.get(render.method, "approximate")
    of_method = Terms("accurate", "accurate", indirect)
    asked = Terms(render.direct, render.caustic, render.indirect)
    return Terms(*(own if one == "by method" else one for one, own in zip(asked, of_method, strict=True)))


def _guided_rays(settings: Settings) -> int:
    """How many gather rays photons guide: at least one and not all of them."""
    gather = settings.gather
    if gather.directions == "BSDF" or gather.rays < 2:
        return 0
    return min(max(round(gather.guided * gather.rays), 1), gather.rays - 1)


def _estimation(settings: Settings, traits: SceneTraits) -> tuple[bool, str]:
    """Whether gathers are estimated, and why not."""
    if settings.gather.estimation == "off":
        return False, "off"
    if settings.gather.cache == "on":
        return False, "the irradiance cache interpolates instead"
    return traits.has_diffuse, "no diffuse surface in the scene"


def _light_choice(settings: Settings, traits: SceneTraits, photons: bool = True) -> tuple[str, str]:
    """How lights are chosen, and why photons don't choose, "" where they do. `photons`: whether there are some."""
    wanted, n = settings.direct.choice, traits.n_lights
    if n <= 1:
        return "power", "there is one light"
    without = "distance" if n <= LISTED else "power"
    if wanted == "auto":
        few = f"only {n} lights (direct.choice = photons asks for it)"
        return ("photons", "") if photons and n >= MANY_LIGHTS else (without, few)
    if wanted in ASKING:
        return (wanted, "") if photons else (without, "there are none")
    return ("power" if wanted == "power" else without), f"direct.choice = {wanted}"
