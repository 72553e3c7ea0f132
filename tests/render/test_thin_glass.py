"""Thin glass that light passes by rules: what is known of the light behind a pane without another renderer (R9)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.scene.description import (
    Camera,
    ConstantEnvironment,
    Material,
    Parallelogram,
    PointLight,
    Scene,
    Shape,
    Sphere,
)
from tests.support import kinds
from tests.support.scenes import box_camera, box_walls, diffuse, panel, rendered, settings_of

pytestmark = pytest.mark.usefixtures("any_bsdf")

TINT = (0.9, 0.5, 0.2)
NEAR = PointLight("near", (0.3, 2.0, 0.2), (3.0, 3.0, 3.0))
SKY = ConstantEnvironment("sky", (1.0, 1.0, 1.0))
DEGREES = 40.0
FAR = PointLight(
    "far", (0.0, 1e3 * math.cos(math.radians(DEGREES)), 1e3 * math.sin(math.radians(DEGREES))), (3e6, 3e6, 3e6)
)
"""All its light arrives under that angle."""


def pane(rule, eta=1.5, kind="thin dielectric"):
    return Material("glass", kind, transmittance=TINT, eta=eta, thin_glass=rule)


def sheet(y, upwards=True):
    edges = ((0, 0, 2e3), (2e3, 0, 0))
    return Parallelogram((-1e3, y, -1e3), *(edges if upwards else edges[::-1]))


def floor_below(glass, *panes, light=NEAR, albedo=0.5):
    """A floor seen from beneath the panes; nothing else reflects."""
    floor = Shape("floor", Parallelogram((-2, 0, -2), (0, 0, 4), (4, 0, 0)), 0)
    camera = Camera((0, 0.5, 0), (0, 0, 0), (0, 0, -1), 60.0)
    shapes = (floor, *(Shape("pane", p, 1) for p in panes))
    return Scene("pane", None, shapes, (diffuse(albedo=(albedo,) * 3), glass), (light,), camera, 16, 16)


def image_of(scene, passes=1, **groups):
    return rendered(scene, settings_of(**groups), passes).frame(0).image().astype(np.float64)


def image_by_other_kernels(scene, passes=1, **groups):
    """Of paths and of exact glass, which have nothing to do with rules for panes: other tests have the kernels."""
    with pytest.MonkeyPatch.context() as patch:
        kinds.every_surface(patch)
        return image_of(scene, passes, **groups)


def without_panes(glass, **more):
    """The floor as it is lit without them; one that nobody meets keeps the kernels for panes."""
    scene = floor_below(glass, **more)
    far = Shape("far pane", Parallelogram((50, -5, 50), (0, 0, 1), (1, 0, 0)), 1)
    return replace(scene, shapes=(*scene.shapes, far))


def fresnel(degrees, eta):
    """Reflectance of a face for unpolarised light, by its two polarisations."""
    i = math.radians(degrees)
    t = math.asin(math.sin(i) / eta)
    s = math.sin(i - t) / math.sin(i + t)
    p = math.tan(i - t) / math.tan(i + t)
    return (s * s + p * p) / 2


@pytest.mark.parametrize("method", ["progressive", "gather"])
def test_an_ignored_pane_is_not_there(method):
    """Solution A: pixel by pixel the picture without it."""
    groups = {"render": {"method": method}, "photons": {"N": 2000}}
    without = image_of(without_panes(pane("ignored")), **groups)
    assert without.mean() > 0.1
    np.testing.assert_allclose(image_of(floor_below(pane("ignored"), sheet(1.0)), **groups), without, rtol=1e-5)


@pytest.mark.parametrize("rule", ["tinted", "tinted and reflecting"])
def test_light_behind_a_tinted_pane_is_tint_times_light(rule):
    """Solution B, with glass that bends and reflects nothing: exactly its colour times the light without it, and its
    colour squared behind two."""
    without = image_of(without_panes(pane(rule)), photons={"N": 2000})
    for panes in (1, 2):
        sheets = [sheet(1.0 + 0.1 * i) for i in range(panes)]
        image = image_of(floor_below(pane(rule, eta=1.0), *sheets), photons={"N": 2000})
        np.testing.assert_allclose(image, without * np.array(TINT) ** panes, rtol=1e-4)


def test_a_pane_reflects_as_much_as_its_two_faces():
    """A thin pane lets (1 − R)/(1 + R) of its colour through, R of one face; a slab of two faces that is passed
    straight (1 − R)², its colour once a face."""
    R = fresnel(DEGREES, 1.5)
    without = image_of(without_panes(pane("tinted"), light=FAR), photons={"N": 200})
    thin = image_of(floor_below(pane("tinted"), sheet(1.0), light=FAR), photons={"N": 200})
    np.testing.assert_allclose(thin, without * np.array(TINT) * (1 - R) / (1 + R), rtol=2e-3)
    glass = pane("tinted", kind="dielectric")
    both = floor_below(glass, sheet(1.0), sheet(0.9, upwards=False), light=FAR)
    assert both.materials[1].thin_rule == "tinted"
    slab = image_of(both, photons={"N": 200})
    np.testing.assert_allclose(slab, without * np.array(TINT) ** 2 * (1 - R) ** 2, rtol=2e-3)


def test_an_absorbing_slab_weakens_by_the_way_straight_through():
    """Beer and Lambert's law, over the length of the straight ray in the glass."""
    sigma = np.array([3.0, 1.0, 0.2])
    glass = replace(pane("tinted", eta=1.0, kind="dielectric"), transmittance=(1.0,) * 3, absorption=tuple(sigma))
    without = image_of(without_panes(pane("tinted"), light=FAR), photons={"N": 200})
    slab = image_of(floor_below(glass, sheet(1.0), sheet(0.9, upwards=False), light=FAR), photons={"N": 200})
    length = 0.1 / math.cos(math.radians(DEGREES))
    np.testing.assert_allclose(slab, without * np.exp(-sigma * length), rtol=3e-3)


def test_exact_caustics_bring_the_same_light():
    """What the caustic map shows behind a thin pane is, in the mean, what rays straight through it find."""
    straight = image_of(floor_below(pane("tinted"), sheet(1.0)), photons={"N": 200})
    exact = image_by_other_kernels(floor_below(pane("exact"), sheet(1.0)), passes=4, photons={"N": 150_000})
    np.testing.assert_allclose(exact.mean(axis=(0, 1)), straight.mean(axis=(0, 1)), rtol=0.03)


@pytest.mark.parametrize("method", ["progressive", "gather"])
def test_a_sky_over_a_dome_of_tinted_glass(method):
    """Light samples and gather rays that find the sky pass the dome alike: albedo × tint × radiance, whatever the
    direction."""
    dome = Sphere((0, 0, 0), 50.0)
    image = image_of(
        floor_below(pane("tinted", eta=1.0), dome, light=SKY), 16, render={"method": method}, photons={"N": 200}
    )
    assert image.mean(axis=(0, 1)) == pytest.approx(0.5 * np.array(TINT), rel=0.01)


def test_replayed_gather_rays_bring_what_the_picture_has():
    """The rays of a pixel, shown in the window, pass panes as those of the picture do: their light adds up to it."""
    wall = Shape("wall", Parallelogram((-50, 3, -50), (100, 0, 0), (0, 0, 100)), 0)
    scene = floor_below(pane("tinted"), sheet(1.0))
    lamp = PointLight("lamp", (0.0, 2.5, 0.0), (9.0, 9.0, 9.0))
    scene = replace(scene, shapes=(*scene.shapes, wall), lights=(lamp,), width=1, height=1)
    settings = settings_of(render={"method": "gather"}, photons={"N": 20_000}, gather={"rays": 64})
    pool = WorkPool(1)
    try:
        renderer = Renderer(open_scene(scene), settings, pool, StageStore(0))
        renderer.step()
        rays = renderer.gather_points(0, 0)
    finally:
        pool.close()
    indirect = renderer.frame(0).image("indirect")[0, 0]
    assert indirect.min() > 0
    assert rays[:, 6:9].sum(axis=0) == pytest.approx(indirect, rel=1e-4)
    assert (rays[:, 4] > 2.9).any(), "they end on the wall above the pane"


def test_a_pane_that_shines_is_seen_by_light_samples_and_rays():
    """A lamp of tinted glass is no pane: its light is the same as if its glass were exact."""
    images = []
    for rule, shown in (("exact", image_by_other_kernels), ("tinted", image_of)):
        lamp = Shape("lamp", Parallelogram((-0.5, 1.0, -0.5), (1, 0, 0), (0, 0, 1)), 1, (1.0,) * 3)
        scene = floor_below(pane(rule))
        unseen = Shape("pane", Parallelogram((50, -5, 50), (0, 0, 1), (1, 0, 0)), 1)
        images.append(shown(replace(scene, shapes=(*scene.shapes, lamp, unseen), lights=()), 16, photons={"N": 2000}))
    assert images[0].mean() > 0.05
    assert images[1].mean() == pytest.approx(images[0].mean(), rel=0.01)


def test_rough_mirrors_see_panes_as_they_are():
    """Below a pane that reflects nearly as much as it lets through, a rough mirror shows what the path tracer does: its
    reflections in the pane's underside, too."""
    scene = floor_below(pane("tinted and reflecting", eta=4.0), sheet(1.0), light=SKY)
    rough = Material("rough", "rough conductor", (0.9,) * 3, two_sided=True, alpha=(0.2, 0.2))
    scene = replace(scene, materials=(rough, scene.materials[1]))
    photons = {"N": 200, "glossy": 0.3}
    path = image_by_other_kernels(scene, 150, render={"method": "path"}, photons=photons)
    ours = image_of(scene, 150, photons=photons)
    assert path.mean() > 0.2
    assert ours.mean(axis=(0, 1)) == pytest.approx(path.mean(axis=(0, 1)), rel=0.02)


def divided_box(rule, size=44):
    """A closed box, lit above a pane and seen below it."""
    materials = (diffuse(albedo=(0.7,) * 3), replace(pane(rule), transmittance=(0.9, 0.8, 0.6)))
    glass = Shape("pane", Parallelogram((-1, 0.3, -1), (0, 0, 2), (2, 0, 0)), 1)
    camera = replace(box_camera(), origin=(0, -0.3, 0.95), target=(0, -0.4, 0))
    return Scene("divided", None, (*box_walls(), panel(), glass), materials, (), camera, size, size)


@pytest.fixture(scope="module")
def divided_path():
    """Mean of the picture by path tracing."""
    return image_by_other_kernels(divided_box("tinted"), 60, render={"method": "path"}).mean(axis=(0, 1))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["progressive", "gather"])
def test_panes_that_reflect_keep_all_light(method, divided_path):
    """Between light and pane, and back from the floor to the pane's underside: the path tracer's light in the mean;
    without reflections less."""
    groups = {"render": {"method": method}, "photons": {"N": 25_000}, "estimate": {"radius": 0.02}}
    reflecting = image_of(divided_box("tinted and reflecting"), 12, **groups).mean(axis=(0, 1))
    tinted = image_of(divided_box("tinted"), 12, **groups).mean(axis=(0, 1))
    assert reflecting == pytest.approx(divided_path, rel=0.015)
    assert np.all(tinted < reflecting)
    assert tinted == pytest.approx(divided_path, rel=0.15)
