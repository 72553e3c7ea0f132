"""A plain path tracer, the yardstick (R12): next-event estimation with MIS, Russian roulette, no photons.

Its samples are sorted into the same terms as the photon methods': a path is a caustic when it leaves the first diffuse
surface and reaches the light over mirrors or glass alone, indirect when it meets another diffuse surface.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf import scatter_specular
from pmviewer.kernels.jit import kernel
from pmviewer.kernels.light import emitted, light_pdf
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.random import draw4
from pmviewer.kernels.raycast import closest_hit
from pmviewer.kernels.scene import (
    DIFFUSE,
    L_RADIANCE,
    light_of,
    light_vector,
    material_kind,
    material_of,
    material_two_sided,
    reflectance,
)
from pmviewer.kernels.surface import face, leave, surface_at
from pmviewer.kernels.vector import dot, from_basis, largest, mul, scale
from pmviewer.kernels.warp import square_to_cosine_hemisphere
from pmviewer.render.choice import LIST_WORDS, choose_by_power
from pmviewer.render.direct import INV_PI, light_samples, power_heuristic
from pmviewer.render.eye import (
    CAUSTIC,
    DIRECT,
    EMISSION,
    INDIRECT,
    PIXEL_SET,
    SPECULAR,
    camera_ray,
    deposit,
    pixel_seed,
    properties,
)
from pmviewer.render.record import C_RAYS, C_SHADOW_RAYS

_f4 = np.float32
_INF = _f4(np.inf)
ROULETTE_DEPTH = 8
FIRST_SET = np.int64(2)


@kernel
def path_pass(scenes, eyes, film, counts, first, last):
    """Add one path to each of the pixels first … last−1; arguments as in `pmviewer.render.eye.eye_pass`."""
    scene, eye = scenes[0], eyes[0]
    index = eye.index
    choice = choose_by_power(stack_i4(LIST_WORDS), eye.light_samples)
    for pixel in range(first, last):
        seed = pixel_seed(eye, pixel)
        ux, uy, _, _ = draw4(eye.sequence, seed, index, PIXEL_SET)
        d, near, far = camera_ray(eye, pixel, ux, uy)
        o = (eye.x_eye, eye.y_eye, eye.z_eye)
        beta = (_f4(1.0), _f4(1.0), _f4(1.0))
        diffuse = 0  # diffuse surfaces met so far
        mirrored = False  # whether a specular surface was met before the first diffuse one
        since_diffuse = 0  # specular surfaces since the last diffuse one
        pdf = _f4(0.0)  # of the last direction, when it left a diffuse surface
        origin = o
        for depth in range(eye.max_depth + 1):
            t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], near, far)
            counts[C_RAYS] += 1
            term = INDIRECT
            if mirrored:
                term = SPECULAR
            elif diffuse == 0:
                term = EMISSION
            elif diffuse == 1:
                term = DIRECT if since_diffuse == 0 else CAUSTIC
            light = scene.environment if prim < 0 else light_of(scene, prim)
            p, ng, ns, gap = o, d, d, near
            if prim >= 0:
                p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
            if light >= 0:
                L = light_vector(scene, light, L_RADIANCE) if prim < 0 else emitted(scene, light, ng, d)
                weight = _f4(1.0)
                if diffuse > 0 and since_diffuse == 0:
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
            albedo = reflectance(scene, material)
            if depth == 0:
                properties(scene, film, eye, pixel, albedo, face(ns, wo), p)
            if depth == eye.max_depth:
                break
            u0, u1, _, u3 = draw4(eye.sequence, seed, index, FIRST_SET + 2 * depth)
            if material_kind(scene, material) != DIFFUSE:
                d, factor, compression = scatter_specular(scene, material, ns, d, u0)
                beta = scale(mul(beta, factor), compression)
                mirrored = mirrored or diffuse == 0
                since_diffuse += 1
            else:
                if dot(ng, d) > _f4(0.0):
                    if not material_two_sided(scene, material):
                        break
                    ng, ns = scale(ng, _f4(-1.0)), scale(ns, _f4(-1.0))
                beta = mul(beta, albedo)
                if not largest(beta) > _f4(0.0):
                    break
                diffuse += 1
                since_diffuse = 0
                u_pick, lu, lv, _ = draw4(eye.sequence, seed, index, FIRST_SET + 1 + 2 * depth)
                E, rays = light_samples(
                    scene, p, ng, ns, gap, choice, eye.mis, eye.sequence, seed, index, u_pick, lu, lv
                )
                counts[C_RAYS] += rays
                counts[C_SHADOW_RAYS] += rays
                term = INDIRECT
                if mirrored:
                    term = SPECULAR
                elif diffuse == 1:
                    term = DIRECT
                deposit(film, counts, pixel, term, scale(mul(beta, E), INV_PI))
                local = square_to_cosine_hemisphere(u0, u1)
                d = from_basis(ns, local[0], local[1], local[2])
                pdf = local[2] * INV_PI
                origin = p
                if dot(d, ng) <= _f4(0.0):
                    break
            if not largest(beta) > _f4(0.0):
                break
            if depth >= ROULETTE_DEPTH:
                survival = min(largest(beta), _f4(0.95))
                if not u3 < survival:
                    break
                beta = scale(beta, _f4(1.0) / survival)
            o = leave(p, ng, gap, d[0], d[1], d[2])
            near, far = _f4(0.0), _INF
