"""The choice of lights at a point (`pmviewer.render.direct.choice`), by the rule that the eye record says."""

from __future__ import annotations

from pmviewer.kernels.bsdf.scattering import FOLLOWED, STORED, is_lambertian, shading_normal, transmits
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.lights.reach import samples_by_power_suffice
from pmviewer.kernels.lights.sky_facing import facing_sky
from pmviewer.kernels.media.medium import has_media
from pmviewer.render.direct.by_distance import choose_by_distance, samples_by_distance_suffice
from pmviewer.render.direct.by_lobes import choose_by_lobes
from pmviewer.render.direct.by_photons import choose_by_photons
from pmviewer.render.direct.choice import BY_DISTANCE, BY_POWER, LISTED, choose_by_power


@device
def choose_without_photons(scene, eye, p, lights):
    """The choice at p where no photons are asked: by distance, or by power where that is the rule or lights are too
    many. `lights`: LIST_WORDS words for the list."""
    choice = choose_by_power(lights, eye.light_samples)
    if eye.choice != BY_POWER and scene.n_lights <= LISTED:
        choice = choose_by_distance(scene, p, eye.light_samples, lights)
    return choice


@device
def choose_by_rule(scene, eye, grid, p, n, lights):
    """The choice at the point p with normal n, whatever reflects there. `grid`: of the photons that are asked; `lights`
    as above."""
    if eye.choice == BY_POWER or eye.choice == BY_DISTANCE:
        return choose_without_photons(scene, eye, p, lights)
    return choose_by_photons(scene, eye, grid, p, n, lights)


@device
def _for_lobes(scene, si, group, choice):
    """The choice that a rule has made, by what the lobes reflect of lights and of the sky."""
    if group == FOLLOWED or not is_lambertian(si.bsdf):
        choice = choose_by_lobes(scene, si, group, choice)
    if group == STORED or not transmits(si.bsdf):
        choice = facing_sky(scene, choice, si.p, si.ng, shading_normal(si.bsdf))
    return choice


@device
def choose(scene, eye, grid, si, lights):
    """The choice for the STORED lobes of a SurfaceInteraction."""
    return _for_lobes(scene, si, STORED, choose_by_rule(scene, eye, grid, si.p, si.ng, lights))


@device
def choose_for_group(scene, eye, si, group, lights):
    """The choice for a group of its lobes where no photons are asked."""
    return _for_lobes(scene, si, group, choose_without_photons(scene, eye, si.p, lights))


@specialised
def samples_suffice(scene, eye, choice, p):
    """Whether the light samples of the choice find direct light at the point p of a Lambertian surface as well without
    rays by the BSDF (`pmviewer.kernels.lights.reach`). Photons promise nothing; in scenes with media, never."""
    if has_media(scene):
        return lambda scene, eye, choice, p: False

    def by_rule(scene, eye, choice, p):
        if eye.choice == BY_POWER:
            return samples_by_power_suffice(scene, eye.light_samples, p)
        return eye.choice == BY_DISTANCE and samples_by_distance_suffice(scene, choice, p)

    return by_rule
