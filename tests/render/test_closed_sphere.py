"""Every method on the closed diffuse sphere, whose radiance is 1 everywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.render.planes import TERMS
from pmviewer.scene.description import Mesh
from tests.support.scenes import ball_mesh, closed_sphere, rendered, settings_of

# About 30 000 stored photons reach the part of the sphere that is seen, and they carry half of the radiance: the
# standard error of the mean is 0.3 % at most, that of a path-traced image lower still.
CASES = {
    "progressive": {},
    "gather": {},
    "path": {},
    "global map": {},
    **{f"progressive {f}": {"filter": f} for f in ("cone", "gaussian", "simpson", "epanechnikov")},
    "progressive nearest": {"lookup": "nearest", "max_radius": 0.5},
    "gather nearest": {"lookup": "nearest"},
    "global map nearest": {"lookup": "nearest"},
}


@pytest.mark.parametrize("case", CASES)
def test_radiance_of_the_closed_sphere_is_one(case):
    method = "global map" if "map" in case else case.split()[0]
    settings = settings_of(render={"method": method}, photons={"N": 60_000, "q": 1.0}, estimate=CASES[case])
    renderer = rendered(closed_sphere(), settings, passes=6)
    image = renderer.frame(1).image()
    print(f"{case}: mean {image.mean():.5f}, standard deviation {image.std():.4f}")
    assert image.mean() == pytest.approx(1.0, abs=0.005)
    assert renderer.tally.dropped == {"photons": 0, "samples": 0}


@pytest.mark.extensive
@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("method", ["progressive", "gather", "path"])
def test_radiance_of_a_closed_ball_of_triangles_is_one(method, smooth):
    """With flat and with interpolated normals; scattering around the latter must not lose light below the surface."""
    ball = ball_mesh(1.0, 3)
    normals = -ball.vertices / np.linalg.norm(ball.vertices, axis=1, keepdims=True)
    inwards = Mesh(ball.vertices, np.ascontiguousarray(ball.faces[:, ::-1]), normals if smooth else None)
    scene = closed_sphere()
    scene = replace(scene, shapes=(replace(scene.shapes[0], geometry=inwards),))
    renderer = rendered(scene, settings_of(render={"method": method}, photons={"N": 60_000, "q": 1.0}), passes=6)
    image = renderer.frame(1).image()
    print(f"{method}, {'smooth' if smooth else 'flat'} normals: mean {image.mean():.5f}")
    assert image.mean() == pytest.approx(1.0, abs=0.005)
    assert renderer.tally.dropped == {"photons": 0, "samples": 0}


def test_terms_of_the_closed_sphere():
    """Emission is ½, direct light ¼, all further reflections together ¼; nothing else."""
    for method in ("progressive", "gather", "path"):
        settings = settings_of(render={"method": method}, photons={"N": 60_000, "q": 1.0})
        frame = rendered(closed_sphere(), settings, passes=6).frame(1)
        means = {term: float(frame.image(term).mean()) for term in TERMS}
        print(method, means)
        assert means["emission"] == pytest.approx(0.5, abs=1e-6)
        assert means["direct"] == pytest.approx(0.25, rel=0.01)
        assert means["indirect"] == pytest.approx(0.25, rel=0.01)
        assert means["specular"] == means["caustic"] == 0.0


def test_global_map_shows_reflected_light_alone():
    """A map shown alone holds all incident light: the emission is seen directly, and the rest is reflected."""
    frame = rendered(
        closed_sphere(), settings_of(render={"method": "global map"}, photons={"N": 60_000, "q": 1.0}), 4
    ).frame(1)
    assert np.all(frame.image("direct") == 0)
    assert frame.image("emission").mean() == pytest.approx(0.5, abs=1e-6)
