"""Reconstruction filters: their formulas against Mitsuba's, where samples fall, and the edge that a film shows."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.render.filter import BOX, DEFAULTS, evaluate, filter_of, filtered, noise_share, reach_of
from pmviewer.render.planes import PLANES
from pmviewer.render.record import EYE_DTYPE, eye_record
from pmviewer.render.share import weigh_samples
from pmviewer.scene.analysis import analyse
from pmviewer.scene.description import Camera, Parallelogram, PixelFilter, Scene, Shape
from pmviewer.settings.access import Settings
from tests.render.test_lens import PINHOLE
from tests.support.scenes import closed_sphere, diffuse, rendered, settings_of

X = np.array([0, 0.25, 0.5, 0.75, 1, 1.25, 1.5, 1.9, 2.5])
MITSUBA = {  # mitsuba 3.9.1: load_dict({"type": …}).eval(x) for x in X
    PixelFilter("tent", 1.0): [1, 0.75, 0.5, 0.25, 0, 0, 0, 0, 0],
    PixelFilter("tent", 2.0): [1, 0.875, 0.75, 0.625, 0.5, 0.375, 0.25, 0.05, 0],
    PixelFilter("Gaussian", 2.0, (0.5,)): [
        0.999247, 0.882167, 0.606423, 0.324243, 0.13496, 0.043603, 0.010758, 0.000388, 0],
    PixelFilter("Gaussian", 4.0, (1.0,)): [
        0.999247, 0.968614, 0.882167, 0.754728, 0.606423, 0.45757, 0.324243, 0.164071, 0.043603],
    PixelFilter("Mitchell-Netravali", 2.0, (1 / 3, 1 / 3)): [
        0.888889, 0.782118, 0.534722, 0.256076, 0.055556, -0.023437, -0.034722, -0.002944, 0],
    PixelFilter("Mitchell-Netravali", 2.0, (0.2, 0.4)): [
        0.933333, 0.816146, 0.545833, 0.244271, 0.033333, -0.042188, -0.045834, -0.003567, 0],
    PixelFilter("Catmull-Rom", 2.0): [1, 0.867188, 0.5625, 0.226562, 0, -0.070312, -0.0625, -0.0045, 0],
    PixelFilter("Lanczos", 3.0): [
        1, 0.890067, 0.607927, 0.27019, 0, -0.132871, -0.135095, -0.02377, 0.024317],
    PixelFilter("Lanczos", 2.0): [1, 0.877354, 0.573159, 0.235347, 0, -0.084725, -0.063684, -0.002714, 0],
}  # fmt: skip
NAMED = {"tent": 0, "Gaussian": 2, "Mitchell-Netravali": 4, "Catmull-Rom": 6, "Lanczos": 7}


@pytest.mark.parametrize("chosen", MITSUBA)
def test_formulas_are_mitsubas(chosen):
    near = 1e-3 if chosen.kind == "Gaussian" else 1e-5  # Mitsuba's is a fitted polynomial
    assert evaluate(chosen, X) == pytest.approx(MITSUBA[chosen], abs=near)
    assert evaluate(chosen, -X) == pytest.approx(MITSUBA[chosen], abs=near)


@pytest.mark.parametrize("name", NAMED)
def test_defaults_are_mitsubas(name):
    assert list(MITSUBA)[NAMED[name]] == DEFAULTS[name]


def test_what_the_settings_choose():
    def of(own, **render):
        return filter_of(own, Settings(render=render).render)

    lanczos = PixelFilter("Lanczos", 2.0)
    assert of(None) == BOX
    assert of(lanczos) == lanczos
    assert of(lanczos, filter="box") == BOX
    assert of(None, filter="Gaussian", filter_radius=1.0) == PixelFilter("Gaussian", 1.0, (0.25,))
    assert of(lanczos, filter_radius=4.0) == PixelFilter("Lanczos", 4.0)
    wide = of(None, filter="Catmull-Rom", filter_radius=4.0)
    assert evaluate(wide, 2 * X) == pytest.approx(MITSUBA[PixelFilter("Catmull-Rom", 2.0)], abs=1e-5)


def record_of(**render):
    return eye_record(PINHOLE, Settings(render=render), 0)


def test_the_box_has_no_part_in_the_record():
    assert record_of().dtype == EYE_DTYPE
    assert record_of(filter="box").dtype == EYE_DTYPE
    assert record_of(filter="tent").dtype != EYE_DTYPE


def weights_of(chosen, passes, side=1.0, **render):
    """(passes, 2, taps) what the samples of passes count, of columns and of rows."""
    out = np.empty((passes, 2, 2 * reach_of(chosen, side) + 1), np.float32)
    pose = replace(PINHOLE, pixel_side=side)
    for index in range(passes):
        weigh_samples(eye_record(pose, Settings(render=render), index), out[index])
    return out


@pytest.mark.parametrize("name", ["box", *NAMED])
def test_samples_count_as_the_filter_says_over_the_passes(name):
    """A pixel's mean weight of the samples of a neighbour is the filter's integral over that neighbour; those of a pass
    add up to 1."""
    chosen = PixelFilter(name, {"box": 0.8}.get(name, DEFAULTS[name].radius), DEFAULTS[name].shape)
    weights = weights_of(chosen, 4096, filter=name, filter_radius=chosen.radius)
    assert weights.sum(axis=2) == pytest.approx(1, abs=1e-5)
    fine = (np.arange(400_000) + 0.5) / 200_000 * chosen.radius - chosen.radius
    f = evaluate(chosen, fine) / evaluate(chosen, fine).sum()
    reach = reach_of(chosen, 1.0)
    expected = np.histogram(fine, np.arange(-reach, reach + 2) - 0.5, weights=f)[0]
    print(f"{name}: deviation {np.abs(weights.mean(axis=0) - expected).max():.4f}")
    assert weights.mean(axis=0) == pytest.approx(np.tile(expected, (2, 1)), abs=4e-3)


def test_parts_of_pixels_share_nothing():
    weights = weights_of(BOX, 16, 0.2, filter="Lanczos")
    assert weights.shape == (16, 2, 1)
    assert (weights == 1).all()


RADII = [0.1, 0.3, 0.5, 0.7, 1.0, 1.3, 1.7, 2.0, 2.6, 3.0, 5.0, 8.0]


@pytest.mark.parametrize(("name", "radius"), [(n, r) for n in DEFAULTS for r in RADII if (n, r) != ("box", 0.5)])
def test_no_radius_lets_weights_explode(name, radius):
    chosen = filter_of(None, Settings(render={"filter": name, "filter_radius": radius}).render)
    weights = weights_of(chosen, 256, filter=name, filter_radius=radius)
    assert np.abs(weights.sum(axis=2)) == pytest.approx(1, abs=1e-5)
    assert np.abs(weights).max() < 4, np.abs(weights).max()


EDGE = 15.3
"""Where the light begins, in pixels from the left."""


def edge_scene(own=None, aperture=1e-6):
    """A light on the right of a sharp edge across the picture's columns; the camera looks along −z. Its lens makes no
    difference but that kernels are compiled for all tests at once."""
    width = 2 * math.tan(math.radians(20)) * 5.0
    left = (EDGE / 32 - 0.5) * width
    light = Shape("light", Parallelogram((left, -9, -5.0), (9, 0, 0), (0, 18, 0)), 0, (1.0,) * 3)
    pose = Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), 40.0, aperture=aperture, focus=5.0, filter=own)
    return Scene("edge", None, (light,), (diffuse(),), (), pose, 32, 32)


def small_box(name):
    """A box that is not the plain one."""
    return {"filter_radius": 0.75} if name == "box" else {}


def edge_of(name, x):
    """Light of a pixel whose middle lies x pixels from the edge, by a sum over the filter that Mitsuba's numbers
    above were compared with."""
    chosen = PixelFilter("box", 0.75) if name == "box" else DEFAULTS[name]
    fine = np.linspace(-chosen.radius, chosen.radius, 20_001)
    f = evaluate(chosen, fine)
    return np.array([f[fine > -d].sum() for d in x]) / f.sum()


@pytest.mark.usefixtures("room_for_split_paths")
@pytest.mark.parametrize("method", ["path", "progressive"])
@pytest.mark.parametrize("name", DEFAULTS)
def test_an_edge_has_the_filters_shape(name, method):
    """Overshoots of the signed ones included; the progressive method with its extra rays at outlines, which make up for
    passes."""
    settings = settings_of(render={"method": method, "filter": name, **small_box(name)}, photons={"N": 100})
    path = method == "path"
    passes = 256 if path else 64
    row = rendered(edge_scene(), settings, passes).film.planes()[..., PLANES["emission"]].mean(axis=(0, 2), dtype=float)
    expected = edge_of(name, np.arange(32) + 0.5 - EDGE)
    print(f"{name}, {method}: deviation {np.abs(row - expected).max():.4f}, lowest {row.min():.4f}")
    assert row == pytest.approx(expected, abs=0.008)
    if name == "Lanczos":
        assert row.min() < -0.02
        assert row.max() > 1.02


def test_a_plain_wall_is_plain_after_one_pass():
    settings = settings_of(render={"method": "path", "filter": "Lanczos"})
    for passes in (1, 3):
        image = rendered(edge_scene(), settings, passes).film.planes()[..., PLANES["emission"]]
        assert image[:, 20:].min() > 0.999
        assert image[:, 20:].max() < 1.001


@functools.cache
def variance_in_a_sphere(chosen):
    """Of indirect light between seeds, the middle pixels' mean; each seed has a place of its own, of which weights
    depend."""
    scene, pictures = open_scene(closed_sphere(size=16)), []
    for seed in range(400):
        settings = settings_of(render={"method": "path", "filter": chosen, "seed": seed})
        planes = rendered(scene, settings, 1).film.planes()
        pictures.append(planes[4:-4, 4:-4, PLANES["indirect"]].astype(float))
    return np.var(pictures, axis=0, ddof=1).mean()


@pytest.mark.parametrize(("name", "share"), [("tent", 4 / 9), ("Gaussian", 1 / math.pi), ("Lanczos", None)])
def test_pixels_share_their_noise(name, share):
    """Of what differs from pixel to pixel ∫f² is left: of tents (∫(1 − |x|)² dx)² = (2/3)², of a Gaussian 1/(4πσ²)."""
    if share is None:
        fine = np.linspace(-3, 3, 60_001)
        f = evaluate(DEFAULTS[name], fine)
        share = ((f / f.sum()) ** 2).sum() ** 2 / (fine[1] - fine[0]) ** 2
    assert noise_share(DEFAULTS[name]) == pytest.approx(share, rel=0.02)

    found = variance_in_a_sphere(name) / variance_in_a_sphere("box")
    print(f"{name}: {found:.3f} of the variance is left, ∫f² = {share:.3f}")
    assert found == pytest.approx(share, rel=0.08)


@pytest.mark.parametrize("name", ["tent", "Gaussian", "Lanczos"])
def test_each_pixels_own_samples_are_kept(name):
    """Those of the plain box in the mean, with noise that differs from pixel to pixel."""
    scene, chosen = open_scene(closed_sphere(size=16)), DEFAULTS[name]
    own, shared = [], []
    for seed in range(100):
        settings = settings_of(render={"method": "path", "filter": name, "seed": seed})
        film = rendered(scene, settings, 1).film
        own.append(film.unshared()[4:-4, 4:-4, PLANES["indirect"]].astype(float).sum(axis=-1))
        shared.append(film.planes()[4:-4, 4:-4, PLANES["indirect"]].astype(float).sum(axis=-1))

    def likeness(pictures):
        """Correlation of pixels with their right neighbours."""
        noise = np.array(pictures) - np.mean(pictures, axis=0)
        return (noise[:, :, 1:] * noise[:, :, :-1]).mean() / (noise**2).mean()

    assert abs(likeness(own)) < 0.03
    assert likeness(shared) > 0.05
    assert np.mean(own) == pytest.approx(np.mean(shared), rel=0.02)
    plain = rendered(scene, settings_of(render={"method": "path"}), 1).film
    assert plain.unshared() is None
    smooth = filtered(np.full((9, 9, 3), 2.0, np.float32), chosen)
    assert smooth == pytest.approx(2.0, rel=1e-5)


@pytest.mark.parametrize("name", ["tent", "Gaussian", "Mitchell-Netravali", "Catmull-Rom", "Lanczos"])
def test_squares_through_the_filter_have_its_edges(name):
    """A picture of squares knows of an edge how much of a pixel it covers: with the filter after it, it is off by no
    more than a tenth of the edge, where the squares alone are off by more."""
    reach = np.arange(32) + 0.5
    for edge in (15.0, 15.3, 15.5, 15.8):
        squares = np.clip(reach + 0.5 - edge, 0, 1)
        image = np.tile(squares[None, :, None], (8, 1, 3)).astype(np.float32)
        found = filtered(image, DEFAULTS[name])[4, :, 0]
        off, plain = (np.abs(row - edge_of(name, reach - edge)).max() for row in (found, squares))
        print(f"{name}, edge at {edge}: off by {off:.3f}, squares by {plain:.3f}")
        assert off < 0.1


@pytest.mark.parametrize("method", ["path", "progressive"])
def test_at_the_border_what_is_there_counts_whole(method):
    settings = settings_of(render={"method": method, "filter": "Gaussian"}, photons={"N": 200})
    image = rendered(closed_sphere(size=12), settings, 2).film.planes()
    assert image[..., PLANES["emission"]] == pytest.approx(0.5, rel=1e-5)


@pytest.mark.usefixtures("room_for_split_paths")
def test_threads_change_nothing():
    """A lens and a signed filter together, with the extra rays of outlines."""
    scene = edge_scene(PixelFilter("Mitchell-Netravali", 2.0, (1 / 3, 1 / 3)), 0.2)
    assert analyse(scene).filters == (("auto", scene.camera.filter),)
    settings = settings_of(camera={"focus": 3.0}, photons={"N": 500})
    one, two = (rendered(scene, settings, 3, threads) for threads in (1, 2))
    assert np.array_equal(one.film.sums, two.film.sums)
    assert one.film.planes().tobytes() == two.film.planes().tobytes()
