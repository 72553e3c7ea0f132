"""Textured area lights: where they emit, that samples and densities agree, and that nothing is lost on the way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.dimensions import EMITTER
from pmviewer.kernels.lights.light import emit_photon, emitted, light_point
from pmviewer.kernels.lights.textured_light import area_density, radiance_from, spread
from pmviewer.kernels.random import INDEPENDENT, draw1, draw4
from pmviewer.kernels.scene import light_of
from pmviewer.kernels.surface import surface_at
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.arrays.texture_coordinates import rectangle_of, square_uv
from pmviewer.scene.description import LUMINANCE, Cylinder, Disk, Mesh, Parallelogram, Shape, Sphere
from pmviewer.scene.texture import Bitmap, evaluate
from tests.support.light_probe import light_pdf, sample_light
from tests.support.scenes import diffuse_box

RNG = np.random.default_rng(8)
_SPOTS = RNG.random((12, 20, 3), dtype=np.float32) ** 6 * 8
_SPOTS[3:6, 4:9] = 0
PICTURE = Bitmap(_SPOTS, filter="nearest")
SMOOTH = Bitmap(_SPOTS, "mirror", to_uv=(1.5, 0.2, 0.1, -0.3, 0.9, 0.4))
FRAME = ((0.6, 0.8, 0.0), (0.0, 0.0, 1.0), (0.8, -0.6, 0.0))
CORNERS = np.array([[-0.5, 2, -0.4], [0.7, 2, -0.1], [0.8, 2, 0.8], [-0.4, 2, 0.5]])
UV = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
LIGHTS = {
    "rectangle": Parallelogram((-0.5, 2.0, -0.4), (1.2, 0.0, 0.3), (0.1, 0.0, 0.9)),
    "swapped": Parallelogram((-0.5, 2.0, -0.4), (1.2, 0.0, 0.3), (0.1, 0.0, 0.9), True),
    "disk": Disk((0.2, 2.0, 0.1), (0.0, -1.0, 0.0), 0.6, ((1, 0, 0), (0, 0, 1), (0, 1, 0))),
    "sphere": Sphere((0.3, 1.5, -0.2), 0.5, False, FRAME),
    "cylinder": Cylinder((-0.4, 1.5, 0), tuple(np.array([-0.4, 1.5, 0]) + 0.8 * np.array(FRAME[2])), 0.2, False, FRAME),
    "mesh rectangle": Mesh(CORNERS, np.array([[0, 1, 2], [0, 2, 3]], np.int32), uv=UV),
    "mesh": Mesh(CORNERS + [[0, 0.1, 0], [0] * 3, [0] * 3, [0] * 3], np.array([[0, 1, 2], [0, 2, 3]], np.int32), uv=UV),
}


@kernel
def _spread_many(scenes, u, v, out, density, again, radiance):
    scene = scenes[0]
    light = np.int64(0)
    for i in range(len(u)):
        s, t, density[i] = spread(scene, light, u[i], v[i])
        out[i] = (s, t)
        p, _, _, _ = light_point(scene, light, s, t)
        again[i] = area_density(scene, light, p)
        radiance[i] = radiance_from(scene, light, p, s, t)


@kernel
def _emit_many(scenes, seed, position, direction, beta):
    for i in range(len(position)):
        u0, u1, u2, u3 = draw4(INDEPENDENT, seed, np.uint32(i), 0)
        pick = draw1(INDEPENDENT, seed, np.uint32(i), EMITTER)
        position[i], direction[i], beta[i], _ = emit_photon(scenes[0], pick, (u2, u3), (u0, u1))


@kernel
def _sample_many(scenes, x, seed, wi, radiance, pdf, found, other):
    """Light samples at x, and for each what a ray in that direction finds."""
    scene = scenes[0]
    p = (x[0], x[1], x[2])
    for i in range(len(wi)):
        pick, u, v, _ = draw4(INDEPENDENT, seed, np.uint32(i), 0)
        d, _, radiance[i], pdf[i], _ = sample_light(scene, p, pick, u, v)
        wi[i] = d
        t, prim, b1, b2 = closest_hit(scene, p[0], p[1], p[2], d[0], d[1], d[2], np.float32(0), np.float32(np.inf))
        if prim >= 0 and light_of(scene, prim) >= 0:
            q, ng, _, _ = surface_at(scene, prim, b1, b2, p[0], p[1], p[2], d[0], d[1], d[2], t)
            found[i] = emitted(scene, light_of(scene, prim), prim, q, ng, d)
            other[i] = light_pdf(scene, light_of(scene, prim), p, q, ng, d)


@kernel
def _look(scenes, x, directions, radiance):
    scene = scenes[0]
    for i in range(len(directions)):
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        zero = np.float32(0)
        t, prim, b1, b2 = closest_hit(scene, x[0], x[1], x[2], d[0], d[1], d[2], zero, np.float32(np.inf))
        if prim >= 0 and light_of(scene, prim) >= 0:
            q, ng, _, _ = surface_at(scene, prim, b1, b2, x[0], x[1], x[2], d[0], d[1], d[2], t)
            radiance[i] = emitted(scene, light_of(scene, prim), prim, q, ng, d)


def lit(name, texture=PICTURE):
    shape = Shape("light", LIGHTS[name], 0, texture.mean, texture)
    return flatten(replace(diffuse_box(), shapes=(shape,)))


def spread_many(flat, n, u=None, v=None):
    u = np.float32(RNG.random(n) if u is None else u)
    v = np.float32(RNG.random(n) if v is None else v)
    out, density, again, radiance = (
        np.empty((n, 2), np.float32),
        *np.empty((2, n), np.float32),
        np.empty((n, 3), np.float32),
    )
    _spread_many(flat.record, u, v, out, density, again, radiance)
    return out.astype(float), density.astype(float), again.astype(float), radiance.astype(float)


@pytest.mark.parametrize("name", ["rectangle", "swapped", "disk", "sphere", "cylinder", "mesh rectangle"])
def test_points_have_the_density_that_they_claim(name):
    """Chi-square of 300,000 points over cells of the light's square, expected counts from the density itself."""
    flat = lit(name)
    n, bins = 300_000, 24
    points, density, again, radiance = spread_many(flat, n)
    grid = (np.arange(bins * 8) + 0.5) / (bins * 8)
    at = np.stack(np.meshgrid(grid, grid), -1).reshape(-1, 2)
    expected = density_at(flat, at).reshape(bins, 8, bins, 8).mean(axis=(1, 3))
    counted, _, _ = np.histogram2d(points[:, 1], points[:, 0], bins, [[0, 1], [0, 1]])
    assert expected.mean() == pytest.approx(1, abs=0.02)
    # The table's cells and the test's are not the same: compare where the table says it exactly.
    exact = table_mass(flat, bins)
    result = stats.chisquare(counted.ravel(), exact.ravel() * n)
    print(f"{name}: chi-square p = {result.pvalue:.3f} over {bins * bins} cells")
    assert result.pvalue > 1e-3
    same = np.abs(again / density - 1) < 1e-3
    assert same.mean() > 0.998  # points within rounding of a cell's edge may count as its neighbour
    value = radiance / density[:, None]
    error = value.std(axis=0) / math.sqrt(n)
    assert np.all(
        np.abs(value.mean(axis=0) - flat.light_power[0] / math.pi / area(flat)) < 4 * error + 2e-2 * value.mean()
    )


def arrays(flat):
    """The light's table as (rows, columns) of probabilities."""
    record = flat.record[0]
    by_address = {a.ctypes.data: a for a in flat.arrays.values()}
    settings, table = by_address[int(record["light_textures"])], by_address[int(record["light_tables"])].astype(float)
    _, first, rows, columns = settings.reshape(-1, 4)[0]
    marginal = np.diff(table[first : first + rows], prepend=0)
    within = np.diff(table[first + rows : first + rows + rows * columns].reshape(rows, columns), axis=1, prepend=0)
    return marginal[:, None] * within


def area(flat):
    by_address = {a.ctypes.data: a for a in flat.arrays.values()}
    return float(by_address[int(flat.record[0]["lights"])].reshape(-1, 20)[0, 13])


def density_at(flat, at):
    mass = arrays(flat)
    rows, columns = mass.shape
    return mass[(at[:, 1] * rows).astype(int), (at[:, 0] * columns).astype(int)] * rows * columns


def table_mass(flat, bins):
    """Probability of each of bins × bins cells of the square, by overlaps."""

    def overlap(cells):
        edges, fine = np.arange(bins + 1) / bins, np.arange(cells + 1) / cells
        low = np.maximum(edges[:-1, None], fine[None, :-1])
        return np.maximum(np.minimum(edges[1:, None], fine[None, 1:]) - low, 0) * cells

    mass = arrays(flat)
    return overlap(mass.shape[0]) @ mass @ overlap(mass.shape[1]).T


@pytest.mark.parametrize("name", LIGHTS)
def test_radiance_is_the_textures(name):
    """What the light emits at its own points is what NumPy looks up there."""
    flat = lit(name, SMOOTH)
    points, _, _, radiance = spread_many(flat, 3000)
    geometry, affine = rectangle_of(LIGHTS[name]) if name == "mesh rectangle" else (LIGHTS[name], None)
    expected = evaluate(SMOOTH, square_uv(geometry, affine, points[:, 0], points[:, 1]))
    assert np.quantile(np.abs(radiance - expected).max(axis=1), 0.995) < 2e-2 * expected.max()
    assert np.median(np.abs(radiance - expected)) < 1e-4


@pytest.mark.parametrize("name", LIGHTS)
def test_photons_carry_the_textures_power(name):
    """Photons' mean power per channel is the light's share; powers are nearly equal where points are picked by
    brightness."""
    flat = lit(name)
    n = 100_000
    position, direction, beta = (np.empty((n, 3), np.float32) for _ in range(3))
    _emit_many(flat.record, np.uint32(3), position, direction, beta)
    mean = flat.light_power[0] / (flat.light_power[0] @ LUMINANCE)
    error = beta.std(axis=0) / math.sqrt(n)
    assert np.all(np.abs(beta.mean(axis=0) - mean) < 4 * error + 3e-3)
    spread_of = (beta @ LUMINANCE).std()
    print(f"{name}: photons' luminance 1 ± {spread_of:.3f}")
    if name in ("rectangle", "swapped", "mesh rectangle"):
        assert spread_of < 0.25
    uniform = (_SPOTS @ LUMINANCE).std() / (_SPOTS @ LUMINANCE).mean()
    assert spread_of < 1.2 * uniform


@pytest.mark.extensive
@pytest.mark.parametrize("name", LIGHTS)
def test_samples_agree_with_looking_around(name):
    flat = lit(name)
    x, n = np.array([0.3, 0.4, -0.2], np.float32), 60_000
    wi, radiance, found = (np.zeros((n, 3), np.float32) for _ in range(3))
    pdf, other = np.zeros(n, np.float32), np.zeros(n, np.float32)
    _sample_many(flat.record, x, np.uint32(5), wi, radiance, pdf, found, other)
    useful = (pdf > 0) & (other > 0)
    # The same point is looked up from both sides; at texels' edges rounding may choose the neighbour.
    same = np.abs(other / np.where(useful, pdf, 1) - 1) < 5e-3
    tangled = name in ("sphere", "cylinder", "mesh")
    assert same[useful].mean() > (0.5 if tangled else 0.985)
    assert (np.abs(found - radiance).max(axis=1) < 1e-2)[useful & same].mean() > 0.97
    value = np.where(useful & same, radiance[:, 0] / np.where(useful, pdf, 1), 0)
    d = RNG.normal(size=(300_000, 3))
    directions = np.float32(d / np.linalg.norm(d, axis=1, keepdims=True))
    seen = np.zeros_like(directions)
    _look(flat.record, x, directions, seen)
    brute = seen[:, 0].astype(float) * 4 * math.pi
    ours, reference = value.mean(), brute.mean()
    error = math.hypot(value.std() / math.sqrt(n), brute.std() / math.sqrt(len(brute)))
    print(f"{name}: {ours:.4f} by samples, {reference:.4f} by looking around, error {error:.4f}")
    assert abs(ours - reference) < 4 * error + 0.015 * reference


def test_black_texture_is_no_light():
    black = Bitmap(np.zeros((2, 2, 3), np.float32))
    scene = diffuse_box()
    shape = Shape("dark", LIGHTS["rectangle"], 0, (1.0, 1.0, 1.0), black)
    flat = flatten(replace(scene, shapes=(*scene.shapes, shape)))
    assert len(flat.light_names) == 1
