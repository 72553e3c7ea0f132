"""Light that media emit on what is around them: against sums by NumPy, and all methods against each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.maps.record import unpack
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Camera, Medium, Parallelogram, PointLight, Shape, Sphere
from pmviewer.scene.grid import Grid
from pmviewer.scene.medium import Phase
from pmviewer.settings.access import Photons
from tests.render.test_grids import TO_CUBE, cloud
from tests.render.test_media import BARELY, METHODS, cube_of, picture
from tests.support.scenes import GLASS, diffuse, rendered, settings_of

pytestmark = pytest.mark.usefixtures("any_light_in_media")

ABOVE = Camera((0, 6, 0.01), (0, -1.3, 0), (0, 0, -1), 70.0)
FLOOR = Shape("floor", Parallelogram((-8, -1.3, 8), (16, 0, 0), (0, 0, -16)), 1)
"""Partly near the cube (`pmviewer.kernels.media.glow.MARGIN`), partly not."""


def over_floor(medium, more=(), materials=(), size=12):
    return cube_of(medium, (), (FLOOR, *more), (diffuse(), *materials), camera=ABOVE, size=size)


def flame(channels=1):
    """Emission unlike in every place, of no density where light could be stopped."""
    values = np.random.default_rng(8).random((5, 9, 4, channels)).astype(np.float32) ** 4
    return Grid(values, TO_CUBE)


def interpolated(grid, p):
    """Values (n, channels) of the grid at places (n, 3) in [−1, 1]³, as the documentation says they are."""
    n = np.array(grid.values.shape[2::-1])
    x = np.clip((p + 1) / 2 * n - 0.5, 0, n - 1)
    i = np.minimum(x.astype(int), n - 2)
    f = x - i
    total = 0.0
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod([f[:, k] if corner[k] else 1 - f[:, k] for k in range(3)], axis=0)
        j = i + corner
        total = total + weight[:, None] * grid.values[j[:, 2], j[:, 1], j[:, 0]]
    return total


def irradiance(emission, x, n=200_000, sigma=0.0):
    """On a floor at x, of what emission(places) in [−1, 1]³ sends through extinction sigma: a plain Monte Carlo sum."""
    y = np.random.default_rng(2).uniform(-1, 1, (n, 3))
    way = y - np.asarray(x)
    r = np.linalg.norm(way, axis=1)
    d = way / r[:, None]
    leaves = np.where(d < 0, (1 - y) / -np.minimum(d, -1e-9), (y + 1) / np.maximum(d, 1e-9)).min(axis=1)
    return 8 * (emission(y) * (np.exp(-sigma * np.minimum(leaves, r)) * d[:, 1] / r**2)[:, None]).mean(axis=0)


def seen_on_floor(expected_at, size=12):
    """Pixels in the middle and at the sides of the picture, four each, and the mean that is expected over them."""
    half = np.tan(np.radians(35)) * 7.3
    middle, side = [(5, 5), (5, 6), (6, 5), (6, 6)], [(0, 5), (5, 0), (11, 6), (6, 11)]
    for pixels in (middle, side):
        sums = []
        for row, column in pixels:
            places = [
                (((column + a) / size * 2 - 1) * half, -1.3, ((row + b) / size * 2 - 1) * half)
                for a in (0.17, 0.5, 0.83)
                for b in (0.17, 0.5, 0.83)
            ]
            sums.append(np.mean([expected_at(p) for p in places], axis=0))
        yield pixels, np.mean(sums, axis=0)


EMISSION, SIGMA = (2.0, 1.0, 0.5), 0.4


@pytest.fixture(scope="module")
def lit_by_the_flame():
    """What `seen_on_floor` tells of a floor of albedo 0.5, by a sum with NumPy."""
    lattice = flame()

    def at(x):
        # The floor is seen from above through the cube: dimmed where the camera's ray meets it.
        eye = np.array(ABOVE.origin)
        way = np.array(x) - eye
        near = ((np.where(way < 0, 1, -1) - eye) / way).max()
        far = ((np.where(way < 0, -1, 1) - eye) / way).min()
        T = np.exp(-SIGMA * max(far - near, 0) * np.linalg.norm(way))
        E = irradiance(lambda y: interpolated(lattice, y) * np.array(EMISSION), x, 20_000, SIGMA)
        return 0.5 / np.pi * T * E

    return list(seen_on_floor(at))


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_a_flame_lights_the_floor_under_it(method, lit_by_the_flame):
    """Radiance 0.5/π · E of a floor of albedo 0.5, near the flame and off it, against a sum by NumPy; what is seen of
    the flame itself, by the method's own view, apart. Within 4 %, the noise of path and gather near the flame."""
    albedo = (0, 0, 0) if method == "path" else BARELY
    medium = Medium("flame", (SIGMA,) * 3, albedo, EMISSION, density=Grid(np.ones((1,) * 4, np.float32), TO_CUBE))
    medium = replace(medium, emission_grid=flame())
    passes = {"path": 600, "progressive": 600, "gather": 150}[method]
    scene = over_floor(medium)
    image = picture(scene, method, passes, "direct", gather={"rays": 8}, photons={"N": 500})
    for pixels, expected in lit_by_the_flame:
        found = np.mean([image[row, column] for row, column in pixels], axis=0)
        np.testing.assert_allclose(found, expected, rtol=0.04)


def everything(channels=3):
    """A coloured flame in smoke that scatters, over a floor, beside a glass ball and a small lamp."""
    smoke = Medium(
        "smoke", (1.2, 1.0, 0.8), (0.7, 0.6, 0.5), (3.0, 2.0, 1.0), Phase(0.3), cloud(), None, flame(channels)
    )
    ball = Shape("ball", Sphere((2.2, -0.6, 0.5), 0.6), 2)
    scene = over_floor(smoke, (ball,), (GLASS,), 24)
    return replace(scene, lights=(PointLight("lamp", (-2.5, 2.0, 1.0), (2.0, 2.0, 3.0)),))


@pytest.mark.extensive
@pytest.mark.slow
def test_all_methods_agree_on_flame_smoke_and_glass():
    """Means of the picture and of its terms: nothing is counted twice, nothing is left out."""
    path = rendered(everything(), settings_of(render={"method": "path", "max_depth": 60}), 500).frame(0)
    for method in ("progressive", "gather"):
        settings = settings_of(
            render={"method": method}, estimate={"radius": 0.008}, photons={"N": 60_000}, gather={"rays": 4}
        )
        frame = rendered(everything(), settings, 24).frame(0)
        assert frame.beauty.mean() == pytest.approx(path.beauty.mean(), rel=0.012), method
        for term, within in (
            ("emission", 0.005),
            ("direct", 0.01),
            ("volume", 0.03),
            ("caustic", 0.08),
            ("indirect", 0.03),
            ("volume indirect", 0.05),
        ):
            mean = path.image(term).mean()
            assert mean > 0, term
            assert frame.image(term).mean() == pytest.approx(mean, rel=within), (method, term)


def test_a_flame_on_a_lattice_has_the_power_that_it_emits():
    """4π ∫ε dV per channel, against a sum over the interpolation by NumPy; lattices of one place and of others."""
    grid = flame(3)
    turned = np.array([[0.0, 1.4, 0, -0.7], [-1.4, 0, 0, 0.7], [0, 0, 1.6, -0.8], [0, 0, 0, 1]])
    y = np.random.default_rng(4).uniform(-1, 1, (400_000, 3))
    for place in (TO_CUBE, turned):
        own = Grid(grid.values, place)
        medium = Medium("flame", (1e-3,) * 3, (0, 0, 0), (3.0, 2.0, 1.0), density=cloud(), emission_grid=own)
        flat = flatten(over_floor(medium))
        assert flat.light_names == ("flame",)
        at = (np.c_[y, np.ones(len(y))] @ np.linalg.inv(place).T)[:, :3]
        emitted = interpolated(grid, np.clip(2 * at - 1, -1, 1)) * np.array(medium.emission)
        np.testing.assert_allclose(flat.light_power[0], 4 * np.pi * 8 * emitted.mean(axis=0), rtol=0.02)


def test_a_flame_that_fills_part_of_its_box_sends_out_its_own_power():
    """A ball that emits in a room of its own medium's box: 4π ε V of a sphere; the ledger balances, and what arrives on
    a shell around it is that power."""
    glow = Medium("glow", (1e-6,) * 3, (0, 0, 0), (1.0, 1.0, 1.0))
    ball = Shape("ball", Sphere((0, 0, 0), 1.0), 0, media=(0, -1))
    shell = Shape("shell", Sphere((0, 0, 0), 3.0, True), 1)
    scene = replace(over_floor(glow), shapes=(ball, shell))
    flat = flatten(scene)
    power = 4 * np.pi * 4 / 3 * np.pi
    assert flat.total_luminance == pytest.approx(power, rel=0.01)
    maps = trace_pass(flat, Photons(q=1.0), 1, 0, 200_000, False, lambda tasks: [t() for t in tasks])
    assert maps.energy[1:].sum() == pytest.approx(maps.energy[0], rel=1e-5)
    photons = unpack(maps.global_, maps.global_unit)
    assert photons["Phi"][photons["bounces"] == 0].sum(axis=0) == pytest.approx([power] * 3, rel=0.01)
    assert maps.energy[2] < 1e-3 * maps.energy[0]  # what does not start is no light that escapes
