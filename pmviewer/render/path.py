"""A plain path tracer, the yardstick (R12): next-event estimation with MIS, Russian roulette, no photons.

Its samples are sorted into the same terms as the photon methods': a path is a caustic when it leaves the first diffuse
surface over followed lobes (mirrors, glass, see `pmviewer.kernels.bsdf.scattering`) and reaches the light over these
alone, or with `photons.indirect_caustics` whatever it meets after them; indirect when it meets another diffuse surface
else.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.bsdf.scattering import (
    FOLLOWED,
    NOTHING,
    STORED,
    attenuation,
    bsdf_at,
    bsdf_sample,
    is_delta,
    pick_group,
    same_side,
    shading_normal,
)
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.dimensions import PATH_LIGHT, PATH_SCATTER, PATH_STRIDE, PIXEL
from pmviewer.kernels.lights.light import emitted, environment_radiance, light_pdf
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.random import draw4
from pmviewer.kernels.scene import light_of, material_of
from pmviewer.kernels.surface import face, leave, surface_at
from pmviewer.kernels.vector import largest, mul, scale
from pmviewer.render.direct.choice import LIST_WORDS, choose_by_power
from pmviewer.render.direct.direct import light_samples, power_heuristic
from pmviewer.render.eye import (
    CAUSTIC,
    DIRECT,
    EMISSION,
    INDIRECT,
    SPECULAR,
    camera_ray,
    deposit,
    pixel_seed,
    properties,
)
from pmviewer.render.given import Sampler, SurfaceInteraction
from pmviewer.render.record import C_CUT, C_RAYS, C_SHADOW_RAYS

_f4 = np.float32
_INF = _f4(np.inf)
ROULETTE_DEPTH = 8


@device
def term_of(eye, mirrored, stored, by_chain):
    """The term of light that arrives after the lobes that a path took: `stored` of those that photons are stored for,
    with followed ones before (`mirrored`) and right after (`by_chain`) the first of them."""
    if mirrored:
        return SPECULAR
    if by_chain and (stored == 1 or eye.indirect_caustics != 0):
        return CAUSTIC
    return DIRECT if stored == 1 else INDIRECT


@kernel
def path_pass(scenes, eyes, film, counts, first, last):
    """Add one path to each of the pixels first … last−1; arguments as in `pmviewer.render.eye.eye_pass`."""
    scene, eye = scenes[0], eyes[0]
    index = eye.index
    choice = choose_by_power(stack_i4(LIST_WORDS), eye.light_samples)
    for pixel in range(first, last):
        seed = pixel_seed(eye, pixel)
        ux, uy, _, _ = draw4(eye.sequence, seed, index, PIXEL)
        o, d, near, far = camera_ray(eye, pixel, ux, uy)
        beta = (_f4(1.0), _f4(1.0), _f4(1.0))
        stored = 0  # how often the path took lobes that photons are stored for
        mirrored = False  # whether it took a followed lobe before the first of these
        by_chain = False  # whether it took one right after the first of these
        pdf = _f4(0.0)  # of the last direction, 0 if the lobe is a delta
        origin = o
        for depth in range(eye.max_depth + 1):
            t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], near, far)
            counts[C_RAYS] += 1
            term = EMISSION
            if depth > 0:
                term = term_of(eye, mirrored, stored, by_chain)
            light = scene.environment if prim < 0 else light_of(scene, prim)
            p, ng, ns, gap = o, d, d, near
            if prim >= 0:
                p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
                beta = attenuation(scene, material_of(scene, prim), ng, d, t, beta)
            if light >= 0:
                L = environment_radiance(scene, d) if prim < 0 else emitted(scene, light, prim, p, ng, d)
                weight = _f4(1.0)
                if pdf > _f4(0.0):
                    weight = _f4(0.0)
                    if eye.mis != 0:
                        other = light_pdf(scene, light, origin, p, ng, d)
                        weight = power_heuristic(_f4(1.0), pdf, _f4(eye.light_samples), other)
                if largest(L) > _f4(0.0) and weight > _f4(0.0):
                    deposit(film, counts, pixel, term, scale(mul(beta, L), weight))
            if prim < 0:
                break
            wo = (-d[0], -d[1], -d[2])
            material = material_of(scene, prim)
            b = bsdf_at(scene, prim, material, u, v, p, ng, ns, wo, eye.glossy)
            if depth == 0:
                properties(scene, film, eye, pixel, b.albedo, face(shading_normal(b), wo), p)
            if b.groups == NOTHING:
                break
            if depth == eye.max_depth:
                counts[C_CUT] += 1
                break
            ng = face(ng, wo)
            u0, u1, u_lobe, u3 = draw4(eye.sequence, seed, index, PATH_SCATTER + PATH_STRIDE * depth)
            group, share, u_lobe = pick_group(b, wo, u_lobe)
            beta = scale(beta, share)
            if group == FOLLOWED:
                mirrored = mirrored or stored == 0
                by_chain = by_chain or stored == 1
            else:
                stored += 1
            if group == STORED or not is_delta(b):
                u_pick, lu, lv, _ = draw4(eye.sequence, seed, index, PATH_LIGHT + PATH_STRIDE * depth)
                si = SurfaceInteraction(p, ng, gap, b, wo)
                sampler = Sampler(eye.sequence, seed, index)
                L, rays, _ = light_samples(scene, None, si, group, choice, eye.mis, sampler, u_pick, lu, lv)
                counts[C_RAYS] += rays
                counts[C_SHADOW_RAYS] += rays
                term = term_of(eye, mirrored, stored, by_chain)
                deposit(film, counts, pixel, term, mul(beta, L))
            d, weight, pdf, compression = bsdf_sample(scene, b, group, wo, u_lobe, u0, u1)
            beta = scale(mul(beta, weight), compression)
            origin = p
            if same_side(b, group, ng, wo, d) == 0 or not largest(beta) > _f4(0.0):
                break
            if depth >= ROULETTE_DEPTH:
                survival = min(largest(beta), _f4(0.95))
                if not u3 < survival:
                    break
                beta = scale(beta, _f4(1.0) / survival)
            o = leave(p, ng, gap, d[0], d[1], d[2])
            near, far = _f4(0.0), _INF
