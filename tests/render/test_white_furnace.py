"""Specular balls under a sky of radiance 1: neither adds nor takes light, so that the image is 1 everywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.scene.description import Shape, Sphere
from tests.support.scenes import GLASS, MIRROR, ball_in_environment, ball_mesh, rendered, settings_of


@pytest.mark.parametrize("method", ["path", "progressive", "gather"])
@pytest.mark.parametrize("ball", ["mirror", "glass", "glass mesh"])
def test_white_ball_vanishes(ball, method):
    """Without roulette (chains are longer than its threshold only inside glass), and choosing one way at glass, each
    sample is exactly 1; radiance is compressed on entering glass and expanded on leaving it. Of paths that facets keep
    within the mesh for hundreds of reflections roulette leaves next to none, the brighter."""
    scene = ball_in_environment(MIRROR if ball == "mirror" else GLASS)
    if ball == "glass mesh":
        scene = replace(scene, shapes=(Shape("ball", ball_mesh(1.0, 3), 0),))
    renderer = rendered(scene, settings_of(render={"method": method, "max_depth": 1000, "splits": 0}), passes=4)
    image = renderer.frame(1).image()
    print(f"{ball}, {method}: mean {image.mean():.6f}, extremes {image.min():.6f} {image.max():.6f}")
    caught = 4e-3 if ball == "glass mesh" else 0.0
    assert image.mean() == pytest.approx(1.0, abs=1e-3 + caught if method == "path" else 1e-5)
    if method != "path":
        assert np.abs(image - 1).max() < 1e-4
    assert sum(renderer.tally.dropped.values()) == 0


def test_tinted_mirror_dims_once():
    scene = ball_in_environment(replace(MIRROR, reflectance=(0.25, 0.5, 0.75)))
    frame = rendered(scene, settings_of(render={"method": "progressive"}), passes=2).frame(1)
    centre = frame.image()[12, 12]
    assert centre == pytest.approx((0.25, 0.5, 0.75), rel=1e-5)
    assert frame.image("specular")[12, 12] == pytest.approx((0.25, 0.5, 0.75), rel=1e-5)
    assert frame.image("emission")[0, 0] == pytest.approx((1, 1, 1))
    assert np.all(frame.image("specular")[0, 0] == 0)


def test_roulette_of_paths_takes_no_light_for_lost_inside_glass():
    """Clear glass loses nothing, whatever the radiance within it: a path through a row of balls goes on with the most
    that roulette allows, 0.95, so that the relative variance of a sample is at most 0.95⁻ⁿ − 1 after n surfaces with
    roulette. Taken for loss, n⁻² = 0.44 ends more than half of the paths inside each ball."""
    balls = tuple(Shape(f"ball {k}", Sphere((0.0, 0.0, -2.5 * k), 1.0), 0) for k in range(8))
    scene = replace(ball_in_environment(GLASS), shapes=balls)
    samples = []
    for seed in range(1, 65):
        settings = settings_of(render={"method": "path", "seed": seed, "max_depth": 1000})
        samples.append(rendered(scene, settings, passes=1).frame(1).image()[8:16, 8:16, 0])
    axis = np.array(samples)
    within = 2 * len(balls) - 8
    print(f"mean {axis.mean():.3f}, variance of a sample {axis.var():.3f}, at most {0.95**-within - 1:.3f}")
    assert axis.mean() == pytest.approx(1.0, abs=0.06)
    assert axis.var() < 1.2 * (0.95**-within - 1)
