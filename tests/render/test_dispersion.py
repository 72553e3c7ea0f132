"""Pictures with dispersive glass: white where nothing disperses, the same by paths and by photons (T10)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.scene.description import Camera, ConstantEnvironment, Parallelogram, Scene, Shape, Sphere
from pmviewer.scene.dispersion import GLASSES, Dispersion
from tests.support.dispersive import lit_sphere
from tests.support.scenes import rendered, settings_of

pytestmark = pytest.mark.usefixtures("any_bsdf_and_light")

FLAT = Dispersion("cauchy", (1.5, 0.0))
"""An index that is the same for all light: the same kernels, and nothing to see."""
RUNS = 6


def means(scene, method, passes, seeds=range(RUNS), **groups):
    """(RUNS, 3) mean pictures of runs with other seeds."""
    groups = {"photons": {"N": 8000}, **groups}
    found = []
    for seed in seeds:
        settings = settings_of(render={"method": method, "seed": seed + 1}, **groups)
        found.append(rendered(scene, settings, passes).frame(0).image().astype(np.float64).mean(axis=(0, 1)))
    return np.array(found)


def differ_by(a, b):
    """Difference of two sets of runs (n, 3) in standard errors, per channel, and relative to the mean."""
    error = np.sqrt(a.var(axis=0, ddof=1) / len(a) + b.var(axis=0, ddof=1) / len(b))
    return (a.mean(axis=0) - b.mean(axis=0)) / error, np.abs(a.mean(axis=0) / b.mean(axis=0) - 1)


@pytest.mark.extensive
@pytest.mark.parametrize(("method", "passes"), [("path", 48), ("progressive", 24)])
def test_an_index_that_is_the_same_for_all_light_gives_the_undispersed_picture(method, passes):
    """White in, white out: every channel, not only their sum."""
    split = means(lit_sphere(FLAT), method, passes)
    plain = means(lit_sphere(None, eta=1.5), method, passes)
    z, relative = differ_by(split, plain)
    assert (np.abs(z) < 5).all()
    assert (relative < 0.015).all()


@pytest.mark.parametrize("kind", ["dielectric", "rough dielectric"])
def test_paths_and_photons_agree(kind):
    """The mean of the floor that the lamp lights through the glass, all wavelengths on their own ways."""
    scene = lit_sphere(GLASSES["sf11"], kind=kind)
    path, photons = means(scene, "path", 96), means(scene, "progressive", 32)
    z, relative = differ_by(path, photons)
    assert (relative < 0.02).all(), (z, relative)


def test_a_furnace_of_glass_stays_white():
    """A dispersive sphere under a sky of radiance 1 that fills everything can't be seen (nothing is absorbed)."""
    camera = Camera((0, 0, -3.0), (0, 0, 0), (0, 1, 0), 20.0)
    scene = lit_sphere(GLASSES["sf11"])
    ball = Shape("ball", Sphere((0, 0, 0), 0.45), 1)
    floor = Shape("floor", Parallelogram((-1, 50, -1), (0, 0, 2), (2, 0, 0)), 0)
    sky = ConstantEnvironment("sky", (1.0, 1.0, 1.0))
    scene = Scene("furnace", None, (ball, floor), scene.materials, (sky,), camera, 32, 32)
    image = rendered(scene, settings_of(render={"method": "path"}), 256).frame(0).image().astype(np.float64)
    assert image.mean(axis=(0, 1)) == pytest.approx([1, 1, 1], abs=0.01)


def test_the_same_picture_for_any_number_of_threads():
    scene, settings = open_scene(lit_sphere(GLASSES["sf11"])), settings_of(photons={"N": 20_000})
    pictures = [rendered(scene, settings, 2, threads).frame(0).planes for threads in (1, 3)]
    assert (pictures[0] == pictures[1]).all()


def test_what_no_path_of_the_glass_reaches_has_no_noise_of_colours():
    """A grey floor beside the glass stays grey in every pixel: direct light is sampled before anything disperses, and
    so is what the glass reflects from outside."""
    scene = lit_sphere(GLASSES["sf11"])
    camera = replace(scene.camera, target=(-1.6, 0.0, 0.6))
    scene = replace(scene, camera=camera)
    image = rendered(scene, settings_of(render={"method": "path", "max_depth": 1}), 4).frame(0).planes[..., 3:6]
    assert image.max() > 0.05
    assert np.ptp(image, axis=2).max() < 1e-6 * image.max()
