"""The choice of few lights by what gloss reflects of them (`pmviewer.render.direct.by_lobes`): the small lamp that a
plate mirrors beside a strong one overhead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.kernels.bsdf.scattering import FOLLOWED, STORED
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.memory import stack_i4
from pmviewer.output.metric import z_test
from pmviewer.render.cast import Ray, cast
from pmviewer.render.chain import WHITE, arrive
from pmviewer.render.direct.by_lobes import DEFENSIVE, choose_by_lobes
from pmviewer.render.direct.choice import BY_DISTANCE, LIST_WORDS, expected_samples
from pmviewer.render.direct.choose import choose_without_photons
from pmviewer.render.planes import beauty_of
from pmviewer.render.record import EYE_DTYPE
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Camera, Material, Parallelogram, Scene, Shape, Sphere
from tests.support.scenes import diffuse, rendered, settings_of

BLACK = Material("black", "diffuse", (0.0, 0.0, 0.0))
PLATE = Parallelogram((-2, 0, -2), (0, 0, 4), (4, 0, 0))
SEEDS = 24
SMALL, STRONG, ASIDE = (0.0, 1.0, -1.0), (0.0, 6.0, 4.0), (1.5, 1.0, 0.5)


def plate(material):
    """A plate that mirrors the small one of three lamps; the strong one has two hundred times its power."""
    lamps = (
        Shape("small", Sphere(SMALL, 0.05), 1, (400.0,) * 3),
        Shape("strong", Sphere(STRONG, 0.5), 1, (800.0,) * 3),
        Shape("aside", Sphere(ASIDE, 0.05), 1, (400.0,) * 3),
    )
    camera = Camera((0, 1.0, 1.0), (0, 0, 0), (0, 1, 0), 30.0)
    shapes = (Shape("plate", PLATE, 0), *lamps)
    return Scene("plate", None, shapes, (material, BLACK), (), camera, 16, 16)


def rough(alpha):
    """A rough metal, whose lobes are followed below a roughness of 0.2 and stored above."""
    metal = ((1.5, 1.2, 1.0), (7.0, 6.0, 5.0))
    return Material("metal", "rough conductor", (1.0, 1.0, 1.0), alpha=(alpha, alpha), metal=metal, two_sided=True)


@kernel
def _shares(scenes, eyes, group, before, after):
    """m of each light at the plate's middle, by distance and by what its lobes reflect, too."""
    scene, eye = scenes[0], eyes[0]
    zero, half = np.float32(0.0), np.float32(np.sqrt(0.5))
    ray = Ray((zero, np.float32(1.0), np.float32(1.0)), (zero, -half, -half), zero, np.float32(np.inf), None, None)
    si, _ = arrive(scene, eye.glossy, ray.d, cast(scene, ray), WHITE)
    choice = choose_without_photons(scene, eye, si.p, stack_i4(LIST_WORDS))
    for light in range(len(before)):
        before[light] = expected_samples(scene, choice, light)
    choice = choose_by_lobes(scene, si, group, choice)
    for light in range(len(after)):
        after[light] = expected_samples(scene, choice, light)


def shares(scene, group):
    """m of each lamp, by distance and by lobes, of four samples."""
    eyes = np.zeros(1, EYE_DTYPE)
    eyes["choice"], eyes["light_samples"], eyes["glossy"] = BY_DISTANCE, 4, 0.2
    before, after = np.zeros(3, np.float32), np.zeros(3, np.float32)
    flat = flatten(scene)
    _shares(flat.record, eyes, group, before, after)
    return before, after


@pytest.mark.parametrize(("alpha", "group"), [(0.05, FOLLOWED), (0.25, STORED)])
def test_the_lamp_that_is_mirrored_gets_the_samples(alpha, group):
    before, after = shares(plate(rough(alpha)), group)
    print(f"roughness {alpha}: {before} by distance, {after} by lobes")
    assert after.sum() == pytest.approx(4.0, rel=1e-5)
    assert before[0] < 0.25 * before.sum()
    assert after[0] > 0.6 * after.sum()
    assert (after >= 0.999 * DEFENSIVE * before).all()


@pytest.mark.parametrize("method", ["progressive", "path"])
@pytest.mark.parametrize("alpha", [0.08, 0.25])
def test_the_picture_is_that_of_sampling_by_power_with_less_noise(method, alpha):
    """Another estimator of the same integral."""
    means, noise = {}, {}
    for choice, samples in (("power", 4), ("distance", 4), ("power", 64)):
        images = []
        for seed in range(SEEDS):
            settings = settings_of(
                render={"method": method, "seed": seed},
                direct={"choice": choice, "samples": samples},
                photons={"N": 1000},
            )
            images.append(beauty_of(rendered(plate(rough(alpha)), settings, 4).film.planes()).astype(np.float64))
        mean, variance = np.mean(images, axis=0), np.var(images, axis=0, ddof=1)
        means[choice] = mean, variance / SEEDS
        noise[choice, samples] = float((variance / (mean**2 + 1e-2)).mean())
    outcome = z_test(*means["distance"], *means["power"], block=4)  # by power with 64: fewer are far from Gaussian
    print(f"{method}, roughness {alpha}: {outcome}, noise {noise}")
    assert outcome.passes()
    assert noise["distance", 4] < 0.5 * noise["power", 4]


def test_so_does_the_lamp_behind_rough_glass():
    """The small lamp straight behind, the strong one beside the ray."""
    glass = Material("glass", "rough dielectric", (1.0,) * 3, (1.0,) * 3, eta=1.5, alpha=(0.1, 0.1))
    scene = plate(glass)
    behind = replace(scene.shapes[1], geometry=Sphere((0.0, -2.5, -1.2), 0.2))
    shapes = (scene.shapes[0], behind, *scene.shapes[2:])
    before, after = shares(replace(scene, shapes=shapes), FOLLOWED)
    print(f"{before} by distance, {after} by lobes")
    assert before[0] < 0.3 * before.sum()
    assert after[0] > 0.6 * after.sum()


def test_what_scatters_evenly_is_left_as_it_is():
    before, after = shares(plate(diffuse()), STORED)
    assert after.sum() == pytest.approx(4.0, rel=1e-5)
    assert (after == before).all()
