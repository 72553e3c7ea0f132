"""Media against formulas, and all methods against each other."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.method import plan_of
from pmviewer.scene.analysis import analyse
from pmviewer.scene.description import (
    Camera,
    ConstantEnvironment,
    DirectionalLight,
    Material,
    Medium,
    Parallelogram,
    Scene,
    Shape,
    Sphere,
)
from pmviewer.scene.medium import Phase
from tests.support.scenes import GLASS, closed_sphere, cube_mesh, diffuse, rendered, settings_of

pytestmark = pytest.mark.usefixtures("any_light_in_media")

NULL = Material("boundary", "null", (0.0, 0.0, 0.0))
CAMERA = Camera((0, 0, 4), (0, 0, 0), (0, 1, 0), 20.0)
METHODS = ("path", "progressive", "gather")
BLACK = (0.0,) * 3
BARELY = (1e-6,) * 3
"""Albedo of media that absorb, so that kernels are those of media that scatter; paths would be scattered by chance."""
ABSORBING = (
    pytest.param("path", BLACK, id="path"),
    pytest.param("progressive", BARELY, id="progressive"),
    pytest.param("gather", BARELY, id="gather"),
    pytest.param("progressive", BLACK, id="progressive, black", marks=pytest.mark.extensive),
    pytest.param("gather", BLACK, id="gather, black", marks=pytest.mark.extensive),
)
"""Methods, and albedos of what is to be black."""


def cube_of(medium, lights=(), more=(), materials=(), half=1.0, camera=CAMERA, size=16):
    """A medium in a cube around the origin, which nothing bounds."""
    cube = Shape("cube", cube_mesh(half=half), 0, media=(0, -1))
    shapes, media = (cube, *more), (medium,)
    return Scene("cube", None, shapes, (NULL, *materials), tuple(lights), camera, size, size, media=media)


SKY = (ConstantEnvironment("sky", (1.0, 1.0, 1.0)),)


def picture(scene, method, passes, view="beauty", **settings):
    values = settings_of(render={"method": method, "max_depth": 1000, **settings.pop("render", {})}, **settings)
    renderer = rendered(scene, values, passes)
    assert sum(renderer.tally.dropped.values()) == 0
    return renderer.frame(0).image(view).astype(np.float64)


@pytest.mark.parametrize(("method", "albedo"), ABSORBING)
def test_absorption_is_beer_and_lambert(method, albedo):
    """exp(−σ s) per channel of a sky behind a cube 2 thick, seen head on, within 0.1 %."""
    sigma = (0.2, 0.8, 2.0)
    image = picture(cube_of(Medium("ink", sigma, albedo), SKY), method, 2, photons={"N": 500})
    center = image[8, 8]  # at most 0.7° off the axis, whose way is 1.00008 times as long
    np.testing.assert_allclose(center, np.exp(-2 * np.array(sigma)), rtol=1e-3)


def slab(mu0, tau, albedo):
    """A slab of depth 1 over z < 0 under parallel light from the cosine mu0, and what it scatters back once."""
    way = (math.sqrt(1 - mu0 * mu0), 0.0, -mu0)
    light = DirectionalLight("sun", way, (math.pi,) * 3)
    size = 200.0
    bottom = Parallelogram((-size, -size, -1), (0, 2 * size, 0), (2 * size, 0, 0))
    top = Parallelogram((-size, -size, 0), (2 * size, 0, 0), (0, 2 * size, 0))
    shapes = tuple(Shape(name, g, 0, media=(0, -1)) for name, g in (("bottom", bottom), ("top", top)))
    camera = Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), 2.0)
    medium = Medium("slab", (tau,) * 3, (albedo,) * 3)
    scene = Scene("slab", None, shapes, (NULL,), (light,), camera, 16, 16, media=(medium,))
    return scene, albedo * math.pi / (4 * math.pi) * mu0 / (1 + mu0) * (1 - math.exp(-tau * (1 + 1 / mu0)))


@pytest.mark.parametrize("method", ["path", "progressive"])
@pytest.mark.parametrize(("mu0", "tau"), [(1.0, 0.5), (0.6, 3.0)])
def test_single_scattering_of_a_slab(method, mu0, tau):
    """α F/(4π) μ₀/(μ+μ₀) (1 − exp(−τ(1/μ+1/μ₀))), here with F = π and μ = 1, within 1 %."""
    scene, expected = slab(mu0, tau, 0.8)
    image = picture(scene, method, 64, "volume", photons={"N": 500})
    assert image.mean() == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    "gather",
    [{"cache": "on", "secondary": 5.0}, pytest.param({}, marks=pytest.mark.extensive)],
    ids=["cache and second gathers", "plain"],
)
def test_light_in_a_closed_sphere_of_ink(gather):
    """Le = ρ = ½ and a way of 2cosθ to wherever a wall point looks: L = Le/(1 − ρT) with T = ∫ exp(−2σμ) 2μ dμ, seen
    from the center through exp(−σ), per channel within 1 %."""
    sigma = np.array([0.2, 0.8, 2.0])
    T = 2 * (1 - np.exp(-2 * sigma) * (1 + 2 * sigma)) / (2 * sigma) ** 2
    sphere = closed_sphere(size=24)
    filled = replace(
        sphere,
        shapes=(replace(sphere.shapes[0], media=(-1, 0)),),
        camera=replace(sphere.camera, medium=0),
        media=(Medium("ink", tuple(sigma), BLACK),),
    )
    image = picture(filled, "gather", 6, photons={"N": 20_000}, gather=gather)
    np.testing.assert_allclose(image.mean(axis=(0, 1)), 0.5 / (1 - 0.5 * T) * np.exp(-sigma), rtol=0.01)
    if gather:
        values = settings_of(render={"method": "gather"}, gather=gather)
        assert plan_of(values, analyse(filled)).cache


@pytest.mark.extensive
@pytest.mark.parametrize("method", ["path", "progressive"])
@pytest.mark.parametrize("g", [0.0, 0.7])
def test_white_medium_under_a_white_sky_vanishes(method, g):
    """Nothing is lost, nothing is added: radiance 1 in each channel, within 0.5 %."""
    medium = Medium("milk", (1.0, 2.0, 1.5), (1, 1, 1), phase=Phase(g))
    settings = {} if method == "path" else {"estimate": {"radius": 0.05}, "photons": {"N": 250_000}}
    image = picture(cube_of(medium, SKY), method, 96 if method == "path" else 20, **settings)
    inside = image[2:14, 2:14].mean(axis=(0, 1))
    np.testing.assert_allclose(inside, 1, rtol=5e-3)


@pytest.mark.parametrize("sigma", [2.0, 10.0])
def test_white_media_vanish_when_they_are_seen_at_an_angle(sigma):
    """Radiance 1 within 1.5 % (noise 0.5 %), faces 45° and more from upright; discs across the rays, which lack what
    they have outside, showed 0.976 and 0.937."""
    camera = Camera((3.2, 2.4, 2.8), (0, 0, 0), (0, 1, 0), 26.0)
    scene = cube_of(Medium("milk", (sigma,) * 3, (1, 1, 1)), SKY, camera=camera, size=24)
    image = picture(scene, "progressive", 20, photons={"N": 20_000}, estimate={"radius": 0.05})
    assert image.mean() == pytest.approx(1, abs=0.015)


def test_light_comes_out_of_a_dense_medium_after_hundreds_of_collisions():
    """A cube 20 to 40 mean free paths wide: radiance 1 again, within 5 % (noise 2 %). Photons that are dropped after 64
    scatterings leave a fifth of it in there."""
    medium = Medium("milk", (10.0, 20.0, 15.0), (1, 1, 1))
    image = picture(cube_of(medium, SKY), "progressive", 8, photons={"N": 20_000})
    np.testing.assert_allclose(image[2:14, 2:14].mean(axis=(0, 1)), 1, rtol=0.05)


@pytest.mark.parametrize("method", METHODS)
def test_white_medium_in_a_white_box_brightens_nothing(method):
    """A sphere that emits 0.5 and reflects half, filled with a white medium: radiance 1 everywhere, within 0.5 %."""
    sphere = Shape("sphere", Sphere((0, 0, 0), 1.0, True), 1, (0.5,) * 3, media=(-1, 0))
    camera = replace(CAMERA, origin=(0, 0, 0.2), target=(0, 0, 1), medium=0)
    scene = Scene(
        "box", None, (sphere,), (NULL, diffuse()), (), camera, 16, 16, media=(Medium("milk", (0.7,) * 3, (1,) * 3),)
    )
    settings = {} if method == "path" else {"estimate": {"radius": 0.05}, "photons": {"N": 60_000}}
    image = picture(scene, method, 64 if method == "path" else 24, **settings)
    assert image.mean() == pytest.approx(1, rel=5e-3)


def mixed_scene(size=24):
    """Coloured forward-scattering fog with a diffuse and a glass sphere in it, over a floor, under a panel."""
    medium = Medium("fog", (0.5, 0.8, 1.2), (0.9, 0.8, 0.7), phase=Phase(0.5, -0.3, 0.2))
    floor = Shape("floor", Parallelogram((-3, -1.5, 3), (6, 0, 0), (0, 0, -6)), 1)
    ball = Shape("ball", Sphere((-0.4, -0.2, 0.1), 0.4), 1, media=(-1, 0))
    glass = Shape("glass", Sphere((0.5, 0.1, 0.2), 0.35), 2, media=(-1, 0))
    light = Shape("light", Parallelogram((-0.6, 2.5, -0.6), (1.2, 0, 0), (0, 0, 1.2)), 1, (12.0,) * 3)
    camera = replace(CAMERA, fov=45.0)
    return cube_of(medium, (), (floor, ball, glass, light), (diffuse(), GLASS), camera=camera, size=size)


@pytest.mark.extensive
def test_photons_and_paths_agree_on_a_scene_with_everything():
    """Means of the picture, within 1.5 %; emission, direct and volume, which both sample, within 1 %."""
    path = rendered(mixed_scene(), settings_of(render={"method": "path", "max_depth": 100}), 600).frame(0)
    for method in ("progressive", "gather"):
        settings = settings_of(
            render={"method": method}, estimate={"radius": 0.008}, photons={"N": 60_000}, gather={"rays": 2}
        )
        frame = rendered(mixed_scene(), settings, 24).frame(0)
        assert frame.beauty.mean() == pytest.approx(path.beauty.mean(), rel=0.015), method
        for term in ("emission", "direct", "volume"):
            assert frame.image(term).mean() == pytest.approx(path.image(term).mean(), rel=0.02), (method, term)
        indirect = frame.image("volume indirect").mean()
        assert indirect == pytest.approx(path.image("volume indirect").mean(), rel=0.04), method


@pytest.mark.parametrize(("method", "albedo"), ABSORBING)
def test_a_flame_emits_along_the_whole_way(method, albedo):
    """∫ ε exp(−σ s) ds = ε (1 − exp(−2σ))/σ through a cube 2 thick that emits and absorbs, exactly."""
    flame = Medium("flame", (0.5, 1e-7, 3.0), albedo, (2.0, 1.0, 0.5))
    light = ConstantEnvironment("sky", (1e-6,) * 3)
    center = picture(cube_of(flame, (light,)), method, 2, photons={"N": 500})[8, 8]
    expected = [2 * (1 - math.exp(-1.0)) / 0.5, 2.0, 0.5 * (1 - math.exp(-6.0)) / 3]
    np.testing.assert_allclose(center, expected, rtol=1e-3)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("sigma", "g", "z"),
    [(1e-6, 0.0, 4.0), (1e6, 0.0, 4.0), (1.0, 0.999, 4.0), (1.0, -0.999, 4.0), (1.0, 0.0, 1.0), (1.0, 0.0, 0.999999)],
)
def test_extremes_make_finite_pictures(method, sigma, g, z):
    """Thin and thick media, straight scattering, a camera on the boundary: radiance between 0 and that of the sky."""
    camera = replace(CAMERA, origin=(0.0, 0.0, z))
    scene = cube_of(Medium("m", (sigma,) * 3, (0.9,) * 3, phase=Phase(g)), SKY, camera=camera, size=8)
    image = picture(scene, method, 2, render={"max_depth": 50}, photons={"N": 2000})
    assert np.isfinite(image).all()
    assert image.min() >= 0
    if method == "path":
        assert image.mean() <= 1.01


@pytest.mark.parametrize("method", ["path", "progressive"])
def test_a_lamp_close_above_a_boundary_shines_in_whatever_the_unit_of_length(method):
    """Single scattering under a lamp 0.03 above a medium 1 high: the same picture in a hundredth and a hundredfold of
    the size. (Mitsuba's volpath brings 0.69 and 1.14 of what it does at 1.)"""
    means = []
    for scale in (0.01, 1.0, 100.0):
        lamp = Parallelogram((-0.16 * scale, 0.53 * scale, -0.14 * scale), (0.32 * scale, 0, 0), (0, 0, 0.28 * scale))
        shape = Shape("lamp", lamp, 1, (10.0,) * 3)
        camera = replace(CAMERA, origin=(0.0, 0.0, 2.4 * scale), fov=39.3)
        medium = Medium("fog", (3.0 / scale,) * 3, (0.96,) * 3)
        scene = cube_of(medium, (), (shape,), (diffuse(albedo=(0.0,) * 3),), 0.5 * scale, camera)
        means.append(picture(scene, method, 64, "volume", photons={"N": 500}).mean())
    assert means[1] > 0.005
    assert means == pytest.approx([means[1]] * 3, rel=2e-3)


def test_clear_scenes_know_nothing_of_media():
    """Neither scene nor film nor camera have a field of them."""
    clear = replace(
        cube_of(Medium("none"), SKY), shapes=(Shape("ball", Sphere((0, 0, 0), 1.0), 1),), materials=(NULL, diffuse())
    )
    renderer = rendered(clear, settings_of(render={"method": "path"}), 1)
    assert not renderer.scene.flat.has_media
    assert renderer.film.channels == 22
    assert renderer.camera.medium is None
