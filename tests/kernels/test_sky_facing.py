"""How surfaces sample an image environment: densities integrate to one and are those of what is drawn, irradiance is
that of a quadrature, and samples scatter less than those by luminance."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.lights.light import environment_radiance, sample_one_light
from pmviewer.kernels.lights.sky_facing import FACINGS, FLOOR, facing_sky, place_on_light, seen_light_pdf
from pmviewer.kernels.lights.sky_square import SIDE, TABLE
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.random import SOBOL, draw4
from pmviewer.render.direct.choice import LIST_WORDS, choose_by_power
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import ImageEnvironment
from tests.support.kinds import EVERY_SURFACE
from tests.support.light_probe import TURN
from tests.support.scenes import light_scene

MANY = 1 << 15
NORMALS = {
    "x": (1, 0, 0),
    "down y": (0, -1, 0),
    "z": (0, 0, 1),
    "down z": (0, 0, -1),
    "oblique": (0.48, -0.6, 0.64),
    "below": (-0.3, 0.2, -0.933),
}


def clouds():
    """Coloured noise with a lamp of few texels and a black quarter."""
    rng = np.random.default_rng(5)
    pixels = rng.uniform(0.1, 1.0, (24, 48, 3))
    pixels[5:7, 30:33] = (200.0, 150.0, 80.0)
    pixels[:, 12:24] = 0.0
    return pixels


SKIES = {
    "clouds": clouds(),
    "even": np.full((5, 4, 3), 0.7),
    "one texel": np.eye(1, 18 * 36, 8 * 36 + 20).reshape(18, 36, 1) * np.ones(3) + 1e-6,
    "wide": np.linspace(0.0, 1.0, 9 * 300 * 3).reshape(9, 300, 3) ** 4,
}


class Met(NamedTuple):
    """What of a hit the density of light samples asks for."""

    p: Any
    ng: Any


def flat_of(pixels):
    sky = ImageEnvironment("sky", np.asarray(pixels, np.float32), TURN)
    return flatten(replace(light_scene(floor=True), lights=(sky,)), features_at_least=EVERY_SURFACE)


@kernel
def _drawn(scenes, n, wi, f, pdf, seen):
    """Directions for a surface that faces n, the light from there, the density of the draw and of what is seen."""
    scene = scenes[0]
    zero = (np.float32(0.0), np.float32(0.0), np.float32(0.0))
    n = (n[0], n[1], n[2])
    choice = facing_sky(scene, choose_by_power(stack_i4(LIST_WORDS), 1), zero, n, n)
    sky = scene.environment
    for i in range(len(wi)):
        u, v, _, _ = draw4(SOBOL, np.uint32(7), np.uint32(i), np.int64(3))
        u, v, density = place_on_light(scene, sky, choice[5], u, v)
        d, _, L, p, _ = sample_one_light(scene, sky, zero, u, v)
        wi[i], f[i], pdf[i] = d, L, p * density
        seen[i] = seen_light_pdf(scene, sky, choice[5], zero, Met(zero, d), d, L)


@kernel
def _seen(scenes, n, wi, f, pdf):
    """Light from directions and the density with which a surface that faces n would have drawn them."""
    scene = scenes[0]
    zero = (np.float32(0.0), np.float32(0.0), np.float32(0.0))
    n = (n[0], n[1], n[2])
    choice = facing_sky(scene, choose_by_power(stack_i4(LIST_WORDS), 1), zero, n, n)
    for i in range(len(wi)):
        d = (wi[i, 0], wi[i, 1], wi[i, 2])
        L = environment_radiance(scene, d)
        f[i], pdf[i] = L, seen_light_pdf(scene, scene.environment, choice[5], zero, Met(zero, d), d, L)


def unit(n):
    return (np.asarray(n, float) / np.linalg.norm(n)).astype(np.float32)


def drawn(flat, n):
    wi, f = np.empty((MANY, 3), np.float32), np.empty((MANY, 3), np.float32)
    pdf, seen = np.empty(MANY, np.float32), np.empty(MANY, np.float32)
    _drawn(flat.record, unit(n), wi, f, pdf, seen)
    return wi.astype(float), f.astype(float), pdf.astype(float), seen.astype(float)


def everywhere(rows=720, columns=1440):
    """Directions over the sphere, and the solid angle that each stands for."""
    z = (np.arange(rows) + 0.5) / rows * 2 - 1
    phi = (np.arange(columns) + 0.5) / columns * 2 * math.pi
    r = np.sqrt(1 - z * z)[:, None]
    d = np.stack([r * np.cos(phi), r * np.sin(phi), np.broadcast_to(z[:, None], (rows, columns))], axis=2)
    return d.reshape(-1, 3).astype(np.float32), 4 * math.pi / (rows * columns)


@pytest.mark.parametrize("name", SKIES)
@pytest.mark.parametrize("facing", NORMALS)
def test_samples_give_the_irradiance_of_a_quadrature(name, facing):
    flat, n = flat_of(SKIES[name]), unit(NORMALS[facing]).astype(float)
    d, solid = everywhere()
    f, pdf = np.empty_like(d), np.empty(len(d), np.float32)
    _seen(flat.record, unit(NORMALS[facing]), d, f, pdf)
    expected = (f.astype(float) * np.maximum(d @ n, 0.0)[:, None]).sum(axis=0) * solid
    wi, L, density, _ = drawn(flat, NORMALS[facing])
    assert density.min() > 0
    E = (L * (np.maximum(wi @ n, 0.0) / density)[:, None]).mean(axis=0)
    whole = pdf.astype(float).sum() * solid
    print(f"{name}, {facing}: E {E} of samples, {expected} of a quadrature; density integrates to {whole:.4f}")
    assert pytest.approx(expected, rel=2e-2, abs=2e-3 * float(f.max())) == E
    assert whole == pytest.approx(1, abs=5e-3)


@pytest.mark.parametrize("name", SKIES)
def test_what_rays_see_has_the_density_that_samples_were_drawn_with(name):
    flat = flat_of(SKIES[name])
    for n in NORMALS.values():
        _, _, pdf, seen = drawn(flat, n)
        # But for places on the border of two cells, which rounding puts on either side.
        assert np.mean(abs(seen - pdf) > 1e-3 * pdf) < 1e-3


@pytest.mark.parametrize("facing", NORMALS)
def test_samples_scatter_less_than_by_luminance(facing):
    """Relative variance of irradiance's luminance by one sample; half of those by luminance are below the horizon."""
    flat, n = flat_of(SKIES["even"]), unit(NORMALS[facing]).astype(float)
    wi, L, pdf, _ = drawn(flat, NORMALS[facing])
    found = np.maximum(wi @ n, 0.0) * L[:, 0] / pdf
    scatter = found.var() / found.mean() ** 2
    print(f"{facing}: {scatter:.3f}; by luminance 5/3")
    assert scatter < 0.25  # by luminance: ⟨cos²⟩ / ⟨cos⟩² − 1 = (1/6) / (1/16) − 1


def test_tables_are_cumulative_and_leave_nothing_out():
    tables = flat_of(SKIES["clouds"]).arrays["sky_facings"]
    assert tables.shape == (FACINGS**2, TABLE)
    rows = np.diff(tables[:, :SIDE], axis=1, prepend=0.0)
    cells = np.diff(tables[:, SIDE:].reshape(-1, SIDE, SIDE), axis=2, prepend=0.0)
    share = rows[:, :, None] * cells
    assert share.min() > 0.9 * FLOOR / SIDE**2
    np.testing.assert_allclose(share.sum(axis=(1, 2)), 1, rtol=1e-5)


@kernel
def _table(scenes, ng, ns, found):
    ng, ns = (ng[0], ng[1], ng[2]), (ns[0], ns[1], ns[2])
    found[0] = facing_sky(scenes[0], choose_by_power(stack_i4(LIST_WORDS), 1), ng, ng, ns)[5]


def test_a_shading_normal_behind_the_surface_stands_for_the_side_that_is_seen():
    """Surfaces that transmit keep theirs when seen from behind."""
    flat = flat_of(SKIES["clouds"])
    found = []
    for ng, ns in (((0, 0, 1), (0.1, 0.2, 0.9)), ((0, 0, 1), (-0.1, -0.2, -0.9)), ((0, 0, -1), (-0.1, -0.2, -0.9))):
        place = np.zeros(1, np.int64)
        _table(flat.record, unit(ng), unit(ns), place)
        found.append(int(place[0]))
    assert found[0] == found[1]
    assert found[0] != found[2]
