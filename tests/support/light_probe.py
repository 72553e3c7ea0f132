"""Kernels that emit photons, sample lights and look at them at many places, for tests; and lights of all kinds."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.dimensions import EMITTER
from pmviewer.kernels.lights.light import (
    emit_photon,
    emitted,
    light_probability,
    one_light_pdf,
    pick_light,
    sample_one_light,
)
from pmviewer.kernels.random import INDEPENDENT, SOBOL, draw1, draw4
from pmviewer.kernels.scene import light_of
from pmviewer.kernels.surface import surface_at
from pmviewer.scene.description import DirectionalLight, ImageEnvironment, Mesh, SpotLight
from pmviewer.scene.formats.mitsuba.transform import rotation

TURN = rotation((0.48, 0.64, -0.6), 70.0)[:3, :3]
CORNERS = np.array([[-0.5, 1.0, -0.4], [0.6, 1.1, -0.3], [0.0, 1.3, 0.7]])
NORMALS = np.array([[-0.8, -0.6, 0.0], [0.9, -0.1, 0.4], [0.0, -0.3, 0.95]])
NORMALS /= np.linalg.norm(NORMALS, axis=1, keepdims=True)
ACROSS = np.cross(CORNERS[1] - CORNERS[0], CORNERS[2] - CORNERS[0])
AREA = np.linalg.norm(ACROSS) / 2
NG = ACROSS / np.linalg.norm(ACROSS)
LEANING = Mesh(CORNERS, np.array([[0, 1, 2]], np.int32), NORMALS)
"""A triangle whose vertex normals lean over."""


def unit(*v):
    """The direction of a vector."""
    return tuple(float(c) for c in np.array(v) / np.linalg.norm(v))


def sky_pixels(width=16, height=9, seed=5):
    """Uneven, coloured, with a bright spot, a black patch and a black row."""
    pixels = np.random.default_rng(seed).uniform(0, 1, (height, width, 3)) ** 3
    pixels[2, 3] = 30.0, 25.0, 20.0
    pixels[5:7, 8:12] = 0.0
    pixels[-1] = 0.0
    return pixels.astype(np.float32)


MORE = {
    "spot": SpotLight("spot", (0.3, 1.2, -0.4), unit(-0.2, -1.0, 0.3), (2.0, 3.0, 1.0), 35.0, 20.0),
    "sharp spot": SpotLight("sharp spot", (0.3, 1.2, -0.4), unit(-0.2, -1.0, 0.3), (2.0, 3.0, 1.0), 25.0, 25.0),
    "soft spot": SpotLight("soft spot", (0.3, 1.2, -0.4), unit(-0.2, -1.0, 0.3), (2.0, 3.0, 1.0), 150.0, 0.0),
    "thin spot": SpotLight("thin spot", (0.3, 1.2, -0.4), unit(-0.2, -1.0, 0.3), (2e6, 3e6, 1e6), 0.05, 0.02),
    "directional": DirectionalLight("directional", unit(0.4, -1.0, 0.2), (2.0, 1.5, 1.0)),
    "image": ImageEnvironment("image", sky_pixels(), TURN),
}


@device
def sample_light(scene, x, u_pick, u, v):
    """A direction from the point x towards a light picked by power: as `sample_one_light`, with the density of the
    light among all."""
    light, probability, _ = pick_light(scene, u_pick)
    wi, end, L, pdf, findable = sample_one_light(scene, light, x, u, v)
    return wi, end, L, probability * pdf, findable


@device
def light_pdf(scene, light, x, p, ng, wi):
    """Density per solid angle with which `sample_light` at x would have chosen direction wi to the light's point p."""
    return light_probability(scene, light) * one_light_pdf(scene, light, x, p, ng, wi)


@kernel
def _emit_many(scenes, sequence, seed, position, direction, beta, light):
    for i in range(len(position)):
        index = np.uint32(i)
        u0, u1, u2, u3 = draw4(sequence, seed, index, 0)
        u_pick = draw1(sequence, seed, index, EMITTER)
        position[i], direction[i], beta[i], light[i] = emit_photon(scenes[0], u_pick, (u2, u3), (u0, u1))


@kernel
def _sample_many(scenes, x, seed, wi, end, radiance, pdf, other_pdf, found):
    """Light samples at x; for each, what a ray in that direction finds: `found`, and `light_pdf` there."""
    scene = scenes[0]
    p = (x[0], x[1], x[2])
    zero = np.float32(0.0)
    for i in range(len(wi)):
        u_pick, u, v, _ = draw4(INDEPENDENT, seed, np.uint32(i), 0)
        d, end[i], radiance[i], pdf[i], findable = sample_light(scene, p, u_pick, u, v)
        wi[i] = d
        found[i] = 0
        t, prim, b1, b2 = closest_hit(scene, p[0], p[1], p[2], d[0], d[1], d[2], zero, np.float32(np.inf))
        light = scene.environment
        q, ng = p, d
        if prim >= 0:
            light = light_of(scene, prim)
            q, ng, _, _ = surface_at(scene, prim, b1, b2, p[0], p[1], p[2], d[0], d[1], d[2], t)
        if light >= 0 and findable:
            found[i] = 1
            other_pdf[i] = light_pdf(scene, light, p, q, ng, d)


@kernel
def _look(scenes, x, directions, radiance, pdf):
    """Emission found by rays from x, and the density with which light sampling would have chosen them."""
    scene = scenes[0]
    zero = np.float32(0.0)
    for i in range(len(directions)):
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        t, prim, b1, b2 = closest_hit(scene, x[0], x[1], x[2], d[0], d[1], d[2], zero, np.float32(np.inf))
        radiance[i], pdf[i] = (zero, zero, zero), zero
        if prim >= 0 and light_of(scene, prim) >= 0:
            q, ng, _, _ = surface_at(scene, prim, b1, b2, x[0], x[1], x[2], d[0], d[1], d[2], t)
            light = light_of(scene, prim)
            radiance[i] = emitted(scene, light, prim, q, ng, d)
            if radiance[i, 0] > zero:
                pdf[i] = light_pdf(scene, light, (x[0], x[1], x[2]), q, ng, d)


def emit(flat, n, sequence=SOBOL, seed=1):
    """Positions, directions, powers (n, 3) and lights (n,) of n photons of a flat scene."""
    out = [np.empty((n, 3), np.float32) for _ in range(3)]
    light = np.empty(n, np.int64)
    _emit_many(flat.record, sequence, np.uint32(seed), *out, light)
    return *(a.astype(float) for a in out), light


def sample(flat, x, n, seed=1):
    """Light samples at x: wi, end, radiance, pdf; what `light_pdf` says of them, and whether a ray finds the light."""
    wi, end, radiance = (np.empty((n, 3), np.float32) for _ in range(3))
    pdf, other = np.empty(n, np.float32), np.zeros(n, np.float32)
    found = np.empty(n, np.int64)
    _sample_many(flat.record, np.array(x, np.float32), np.uint32(seed), wi, end, radiance, pdf, other, found)
    return wi.astype(float), end.astype(float), radiance.astype(float), pdf.astype(float), other, found


def look(flat, x, directions):
    """Radiance that rays from x meet at lights, and the density with which light samples go there."""
    directions = np.ascontiguousarray(directions, np.float32)
    radiance, pdf = np.empty_like(directions), np.empty(len(directions), np.float32)
    _look(flat.record, np.array(x, np.float32), directions, radiance, pdf)
    return radiance.astype(float), pdf.astype(float)


def uniform_sphere(n, seed=3):
    """Directions (n, 3), spread evenly."""
    d = np.random.default_rng(seed).normal(size=(n, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def p_uniform(values, bins=32):
    """p-value of numbers in [0, 1) being uniform."""
    return stats.chisquare(np.bincount(np.clip((values * bins).astype(int), 0, bins - 1), minlength=bins)).pvalue


def turn(x, y):
    """Azimuth as a share of the full turn."""
    return np.arctan2(y, x) / (2 * math.pi) % 1.0


def axes_of(normal):
    """Two unit vectors across `normal` (n, 3)."""
    helper = np.where(np.abs(normal[:, :1]) < 0.5, [[1.0, 0, 0]], [[0, 1.0, 0]])
    s = np.cross(normal, helper)
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    return s, np.cross(normal, s)
