"""The beam estimate against integrals: photons of a half-space, whose discs lie along its boundary."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.estimate.beam import Beam, beam_radiance
from pmviewer.maps.search.grid import build_grid
from pmviewer.maps.search.simd import beside8
from pmviewer.render.media.beams import ALONG
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.medium import Medium
from tests.render.test_media import SKY, cube_of
from tests.support import naive_maps as naive

f4 = np.float32
SIGMA, LENGTH, N = 5.0, 1.2, 400_000
INF = f4(np.inf)


@kernel
def along_beams(scenes, maps, origins, d, n, sure, ends, radius, out):
    """Red radiance of beams of length LENGTH from origins (m, 3) in direction d whose discs have the normal n up to 4
    radii; ends (m,): where they are cut, as exp(−(end − sure)) of them are behind it."""
    zero = f4(0.0)
    sigma, lobes = (f4(SIGMA), f4(SIGMA), f4(SIGMA)), (zero, zero, zero)
    for i in range(len(origins)):
        o = (origins[i, 0], origins[i, 1], origins[i, 2])
        length = min(f4(LENGTH), ends[i])
        beam = Beam(o, d, length, n, d, min(ALONG * radius, length), length, sure, f4(1.0))
        L, _ = beam_radiance(scenes[0], maps[0], beam, radius, INF, sigma, lobes)
        out[i] = L[0]


def below_the_plane(seed):
    """N photons of power 1 in the cube (−1, 1)³ below z = 1, whose density falls as exp(−2 depth)."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-1, 1, (N, 3))
    places[:, 2] = 1 + np.log(1 - rng.random(N) * (1 - math.exp(-4))) / 2
    wi = rng.normal(size=(N, 3))
    wi /= np.linalg.norm(wi, axis=1)[:, None]
    return naive.pack(places.astype(f4), wi.astype(f4), np.ones((N, 3), f4), np.zeros(N, int))


def looked_up(radius, slant, seeds, sure=INF, ends=None):
    """Mean radiance of 400 beams that enter at the angle whose cosine is `slant`, over the integral, with discs along
    the boundary and with upright ones."""
    scene = flatten(cube_of(Medium("milk", (SIGMA,) * 3, (1, 1, 1)), SKY)).record
    d = (f4(math.sqrt(1 - slant * slant)), f4(0.0), f4(-slant))
    fall = 2 * slant + SIGMA
    density = N / 4 * 2 / (1 - math.exp(-4))
    exact = density / (4 * math.pi) * (1 - math.exp(-fall * LENGTH)) / fall
    found = np.zeros((2, len(seeds)))
    for s, seed in enumerate(seeds):
        grid = build_grid(below_the_plane(seed), radius)
        rng = np.random.default_rng(100 + seed)
        origins = np.column_stack([rng.uniform(-0.7, -0.3, 400), rng.uniform(-0.7, 0.7, 400), np.full(400, 0.99999)])
        cut = np.full(400, np.inf) if ends is None else ends(rng)
        for k, n in enumerate(((f4(0.0), f4(0.0), f4(1.0)), d)):
            out = np.zeros(400, f4)
            along_beams(scene, grid.record, origins.astype(f4), d, n, f4(sure), cut.astype(f4), f4(radius), out)
            found[k, s] = out.mean() / exact
    return found.mean(axis=1)


@pytest.mark.parametrize("slant", [1.0, 0.7, 0.4])
@pytest.mark.parametrize("radius", [0.05, 0.2])
def test_no_photon_is_missed_at_a_boundary_that_the_ray_crosses_at_an_angle(slant, radius):
    """∫ ρ(t) exp(−σ t)/(4π) dt within 1.5 % (noise 0.5 %), by discs of a quarter of a free path and of one."""
    along, upright = looked_up(radius, slant, range(4))
    assert along == pytest.approx(1, abs=0.015)
    if slant < 0.5:
        assert upright < 1 - radius / 2, "discs across the ray lack what they have outside"


def test_what_lies_deep_is_looked_at_by_chance_and_counts_for_more():
    def ends(rng):
        return 0.05 - np.log(1 - rng.random(400))

    along, _ = looked_up(0.05, 0.7, range(6), sure=0.05, ends=ends)
    assert along == pytest.approx(1, abs=0.02)


@kernel
def masks(blocks, o, d, r2, out):
    """Masks of the photons beside a line, of `blocks` of eight."""
    for i in range(len(out)):
        out[i] = beside8(blocks + i * 192, o, d, r2)


def test_eight_photons_beside_a_line():
    photons = below_the_plane(1)[:800]
    grid = build_grid(photons, 0.3)
    d = np.array([0.6, 0.0, -0.8], f4)
    out = np.zeros(100, np.int32)
    masks(int(grid.record["blocks"][0]), (f4(0.1), f4(0.2), f4(0.9)), tuple(d), f4(0.25), out)
    places = grid.blocks.view(f4)[:, :3].transpose(0, 2, 1).reshape(-1, 3).astype(float) - [0.1, 0.2, 0.9]
    apart2 = (np.cross(places, d.astype(float)) ** 2).sum(axis=1)
    expected = np.packbits(apart2.reshape(-1, 8) < 0.25, axis=1, bitorder="little")[:, 0]
    assert 0 < np.unpackbits(expected).mean() < 1
    np.testing.assert_array_equal(out, expected)
