"""Integrals that some materials look up: a rough coat's transmittance, the limit of Schlick's model."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.bsdf.microfacet import g1_over_cos, reflect_at, sample_visible_normal
from pmviewer.kernels.bsdf.schlick import schlick_shadowing, schlick_shadowing_over_cos
from pmviewer.kernels.bsdf.specular import fresnel_dielectric
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.scene import BSDF_TABLE_SIZE, GGX
from pmviewer.kernels.vector import dot

_f4 = np.float32
_LAST = BSDF_TABLE_SIZE - 1
_ACROSS, _DOWN = 32, 64
_OUTSIDE, _INSIDE = np.polynomial.legendre.leggauss(32), np.polynomial.legendre.leggauss(64)
"""Nodes and weights for a coat from outside, and from inside, where total reflection has an edge: with so many its
diffuse reflectance is right to 2e-4."""
_FINE = 8
"""Angles a cell at which the albedo of Schlick's model is computed."""


@device
def _at_cos(cos):
    return _f4(math.sqrt(max(_f4(0.0), (_f4(1.0) - cos) * (_f4(1.0) + cos)))), _f4(0.0), cos


@device
def _coat(cos, ax, ay, distribution, eta, nodes, weights):
    """Shares (reflected, transmitted) at a rough interface, both without multiple scattering, by Gauss-Legendre
    quadrature over both numbers that a visible normal is made of; nodes in −1 … 1."""
    o = _at_cos(max(cos, _f4(1e-6)))
    reflected, transmitted = 0.0, 0.0
    for a in range(len(nodes)):
        for b in range(len(nodes)):
            weight = 0.25 * weights[a] * weights[b]
            u, v = _f4(0.5 * (nodes[a] + 1.0)), _f4(0.5 * (nodes[b] + 1.0))
            m = sample_visible_normal(o, ax, ay, distribution, u, v)
            c = min(max(dot(o, m), _f4(0.0)), _f4(1.0))
            fresnel, cos_t = fresnel_dielectric(c, eta)
            i = reflect_at(o, m)
            if i[2] > _f4(0.0):
                reflected += weight * fresnel * g1_over_cos(i, ax, ay, distribution) * i[2]
            s = c / eta - cos_t
            z = s * m[2] - o[2] / eta
            if fresnel < _f4(1.0) and z < _f4(0.0):
                t = (s * m[0] - o[0] / eta, s * m[1] - o[1] / eta, z)
                transmitted -= weight * (_f4(1.0) - fresnel) * g1_over_cos(t, ax, ay, distribution) * z
    return reflected, transmitted


@kernel
def fill_coat(table, ax, ay, distribution, eta):
    """A coat's transmittance from outside at cosines j/63 into `table`, float32 (64,).

    Returns its diffuse reflectance from inside.
    It is the mean over those cosines, ends included, as Mitsuba 3 takes it: up to 3.5 % below the integral, but
    pictures agree.
    """
    outside, outside_weights = _OUTSIDE
    inside, inside_weights = _INSIDE
    inner = 0.0
    for j in range(BSDF_TABLE_SIZE):
        cos = _f4(j) / _f4(_LAST)
        table[j] = _f4(_coat(cos, ax, ay, distribution, eta, outside, outside_weights)[1])
        back = _coat(cos, ax, ay, distribution, _f4(1.0) / eta, inside, inside_weights)[0]
        inner += 2.0 * cos * back / BSDF_TABLE_SIZE
    return inner


@device
def _schlick_albedo(cos, alpha, mean):
    """Albedo of Jensen's equation 5; `mean` is the cosine-weighted mean of G."""
    o, a = _at_cos(cos), _f4(math.sqrt(alpha))
    shadowing = schlick_shadowing(cos, alpha)
    glossy = 0.0
    for i in range(_ACROSS):
        for j in range(_DOWN):
            u, v = (_f4(i) + _f4(0.5)) / _f4(_ACROSS), (_f4(j) + _f4(0.5)) / _f4(_DOWN)
            w = reflect_at(o, sample_visible_normal(o, a, a, GGX, u, v))
            if w[2] > _f4(0.0):
                glossy += schlick_shadowing(w[2], alpha)
    glossy *= schlick_shadowing_over_cos(cos, alpha) / g1_over_cos(o, a, a, GGX) / (_ACROSS * _DOWN)
    return 1.0 - shadowing * mean + glossy


@kernel
def fill_schlick(table, alpha):
    """c(v) at v = (j/63)⁴ into `table`, float32 (64,): at most 1, and the least 1/albedo of the cells around."""
    mean, steps = 0.0, 4096
    for j in range(steps):
        x = (j + 0.5) / steps
        v = x * x * x * x
        mean += 2.0 * v * schlick_shadowing(_f4(v), alpha) * 4.0 * x * x * x / steps
    for j in range(BSDF_TABLE_SIZE):
        table[j] = _f4(1.0)
    for j in range(_LAST * _FINE + 1):
        x = _f4(j) / _f4(_LAST * _FINE)
        c = _f4(1.0 / max(1.0, _schlick_albedo(max(x * x * x * x, _f4(1e-12)), alpha, mean)))
        for node in range(max(0, j // _FINE), min(_LAST, (j + _FINE - 1) // _FINE) + 1):
            table[node] = min(table[node], c)
