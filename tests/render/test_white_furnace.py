"""Specular balls under a sky of radiance 1: neither adds nor takes light, so that the image is 1 everywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.scene.description import Shape
from tests.support.scenes import GLASS, MIRROR, ball_in_environment, ball_mesh, rendered, settings_of


@pytest.mark.parametrize("method", ["path", "progressive", "gather"])
@pytest.mark.parametrize("ball", ["mirror", "glass", "glass mesh"])
def test_white_ball_vanishes(ball, method):
    """Without roulette (chains are longer than its threshold only inside glass), and choosing one way at glass, each
    sample is exactly 1; radiance is compressed on entering glass and expanded on leaving it."""
    scene = ball_in_environment(MIRROR if ball == "mirror" else GLASS)
    if ball == "glass mesh":
        scene = replace(scene, shapes=(Shape("ball", ball_mesh(1.0, 3), 0),))
    renderer = rendered(scene, settings_of(render={"method": method, "max_depth": 1000, "splits": 0}), passes=4)
    image = renderer.frame(1).image()
    print(f"{ball}, {method}: mean {image.mean():.6f}, extremes {image.min():.6f} {image.max():.6f}")
    assert image.mean() == pytest.approx(1.0, abs=1e-3 if method == "path" else 1e-5)
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
