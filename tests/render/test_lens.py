"""The thin lens: where its rays go, how it blurs an edge, and that nothing is left of it when it is closed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.focus import distance_at, focused
from pmviewer.kernels.compile.jit import kernel
from pmviewer.render.camera import CameraPose, resolve_camera
from pmviewer.render.direct.outline import outline_pixels
from pmviewer.render.free_camera import resolve_view
from pmviewer.render.pixel import lens_ray
from pmviewer.render.planes import PLANES
from pmviewer.render.record import EYE_DTYPE, eye_record
from pmviewer.scene.analysis import analyse
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Camera, NamedCamera, Parallelogram, Scene, Shape, Sphere
from pmviewer.settings.access import CameraSettings, Settings
from tests.support.importon_paths import SHOWN, traced
from tests.support.scenes import cornell_box, diffuse, rendered, settings_of

PINHOLE = CameraPose((1, 2, 3), (0.5, 0, -1), (0, 1, 0), 50.0, 64, 40, shift=(0.2, 0.15))
LENS = replace(PINHOLE, aperture=0.3, focus=2.5)
TELECENTRIC = replace(LENS, projection="orthographic", view_width=3.0)


@kernel
def _rays(eyes, pixel, place, lens, out):
    """Rays of a pixel at a place through places (n, 2) of the lens: origins and directions, out (n, 6)."""
    for i in range(len(lens)):
        ray = lens_ray(eyes[0], pixel, place[0], place[1], lens[i, 0], lens[i, 1])
        for k in range(3):
            out[i, k], out[i, 3 + k] = ray.o[k], ray.d[k]


def rays_of(pose, pixel, place, n=64):
    u = (np.arange(n, dtype=np.float32) + np.float32(0.5)) / n
    lens = np.stack([g.reshape(-1) for g in np.meshgrid(u, u)], 1)
    out = np.empty((len(lens), 6), np.float32)
    eye = eye_record(pose, Settings(), 0)
    _rays(eye, np.int64(pixel[1] * pose.width + pixel[0]), np.array(place, np.float32), lens, out)
    return out[:, :3].astype(float), out[:, 3:].astype(float)


@pytest.mark.parametrize("pose", [LENS, TELECENTRIC, replace(LENS, focus=math.inf)])
def test_rays_meet_where_the_pinhole_sees_the_plane_in_focus(pose):
    """They start evenly on the lens's disc; on a plane at another distance z they fill a disc of R·|1 − z/F|."""
    pixel, place = (50, 7), (0.25, 0.75)
    o, d = rays_of(pose, pixel, place)
    eye, along = (np.array(part)[0] for part in pose.rays(*(np.array([p + q]) for p, q in zip(pixel, place))))
    forward = pose.axes()[2]
    assert np.linalg.norm(d, axis=1) == pytest.approx(1, abs=1e-6)
    off = o - eye
    assert off @ forward == pytest.approx(0, abs=1e-6)
    assert (off**2).sum(1).max() == pytest.approx(0.3**2, rel=0.05)
    assert (off**2).sum(1).mean() == pytest.approx(0.3**2 / 2, rel=1e-3)  # of an even disc
    for z in (0.7, 2.5, 6.0):
        there = o + d * ((z - (o - eye) @ forward) / (d @ forward))[:, None]
        seen = eye + along * (z / (along @ forward))
        spread = np.sqrt(2 * ((there - seen) ** 2).sum(1).mean())
        assert there.mean(0) == pytest.approx(seen, abs=1e-4)
        assert spread == pytest.approx(0.3 * abs(1 - z / pose.focus), rel=2e-3, abs=2e-6)


EDGE_DEPTH, R = 6.0, 0.25


def half_plane(focus, depth=EDGE_DEPTH, **camera):
    """A light that fills the right half of the picture, at that depth before a camera looking along −z."""
    light = Shape("light", Parallelogram((0, -9, -depth), (9, 0, 0), (0, 18, 0)), 0, (1.0,) * 3)
    pose = Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), 40.0, aperture=R, focus=focus, **camera)
    return Scene("edge", None, (light,), (diffuse(),), (), pose, 64, 32)


def edge_of_disc(x, radius):
    """Light at the distance x (pixels) from a straight edge that is blurred by an even disc, the lit side positive."""
    x = np.clip(x / radius, -1, 1)
    return 0.5 + (np.arcsin(x) + x * np.sqrt(1 - x * x)) / np.pi


@pytest.mark.parametrize("method", ["path", "progressive"])
@pytest.mark.parametrize("focus", [2.0, 20.0])
def test_an_edge_out_of_focus_is_that_of_the_circle_of_confusion(method, focus):
    """r = R·|1/z − 1/F|·f with f = 32/tan 20° pixels; a box filter of 0.75 pixels is integrated over. (Not the plain
    box, so that kernels are compiled for these tests and those of filters at once.)"""
    radius = R * abs(1 / EDGE_DEPTH - 1 / focus) * 32 / math.tan(math.radians(20))
    settings = settings_of(render={"method": method, "filter": "box", "filter_radius": 0.75}, photons={"N": 100})
    planes = rendered(half_plane(focus), settings, 128).film.planes()
    row = planes[..., PLANES["emission"]].mean(axis=(0, 2), dtype=float)
    x = np.arange(64)[:, None] - 32 + 0.5 + 1.5 * ((np.arange(16) + 0.5) / 16 - 0.5)
    fits = {s: np.std(row - edge_of_disc(x, s * radius).mean(1)) for s in (0.96, 1.0, 1.04)}
    print(f"radius {radius:.2f} px, deviation {fits}")
    assert fits[1.0] < 0.003
    assert fits[1.0] < min(fits[0.96], fits[1.04])


def test_outlines_are_marked_as_far_as_the_lens_spreads_them():
    pose = resolve_camera(half_plane(2.0), CameraSettings())
    radius = R * abs(1 / EDGE_DEPTH - 1 / 2.0) * 32 / math.tan(math.radians(20))
    columns = outline_pixels(half_plane(2.0), pose).reshape(32, 64).mean(axis=0)
    seen = np.abs(np.arange(64) + 0.5 - 32) < radius + 0.5
    assert columns[seen].min() == 1
    assert seen.sum() <= columns.sum() <= 1.3 * seen.sum() + 4
    sharp = outline_pixels(half_plane(EDGE_DEPTH), resolve_camera(half_plane(EDGE_DEPTH), CameraSettings()))
    assert sharp.reshape(32, 64).sum(axis=1).max() <= 6


def test_a_closed_lens_is_a_pinhole():
    """The same record, and so the same kernels and the same film, as a camera that never had one."""
    scene = cornell_box(size=16)
    lens = replace(scene, camera=replace(scene.camera, aperture=0.1, focus=1.0))
    closed = Settings(camera=CameraSettings(aperture=0.0))
    eyes = [
        eye_record(resolve_camera(s, settings.camera), settings, 3)
        for s, settings in ((scene, Settings()), (lens, closed))
    ]
    assert eyes[0].dtype == EYE_DTYPE
    assert eyes[0].tobytes() == eyes[1].tobytes()
    few = {"photons": {"N": 500}}
    films = [rendered(s, settings_of(**few, **more), 2).film.sums for s, more in ((scene, {}), (lens, closed_camera()))]
    assert np.array_equal(*films)


def closed_camera():
    return {"camera": {"aperture": 0.0}}


def test_automatic_focus_is_on_the_surface_in_the_middle():
    ball = Shape("ball", Sphere((0, 0, -5.0), 1.0), 0, (1.0,) * 3)
    scene = Scene("ball", None, (ball,), (diffuse(),), (), Camera((0, 0, 2), (0, 0, 0), (0, 1, 0), 40.0), 40, 40)
    flat = flatten(scene)
    open_lens = resolve_camera(scene, CameraSettings(aperture=0.1))
    assert focused(flat, open_lens).focus == pytest.approx(6.0, rel=1e-5)
    assert focused(flat, replace(open_lens, focus=3.0)).focus == 3.0
    assert focused(flat, resolve_camera(scene, CameraSettings())).focus is None
    assert distance_at(flat, open_lens, 0.0, 0.0) == pytest.approx(2.0)  # of the target, past the ball
    # A place aside: depth along the view, not along the ray. x = 24 of 40 is 0.2·tan 20° off the axis.
    t = 0.2 * math.tan(math.radians(20))
    depth = (7 - math.sqrt(49 - 48 * (1 + t * t))) / (1 + t * t)
    assert distance_at(flat, open_lens, 24.0, 20.0) == pytest.approx(depth, rel=1e-4)


@pytest.mark.parametrize(("aperture", "focus"), [(1e15, 1e-12), (1e15, 1e15), (1e-300, 1.0)])
def test_lenses_that_no_one_has(aperture, focus):
    """The largest and the least numbers that the settings take: nothing is lost, and no pixel is no number."""
    camera = {"aperture": aperture, "focus": focus}
    values = {"render": {"filter": "box", "filter_radius": 0.75}, "photons": {"N": 100}, "camera": camera}
    for method in ("path", "progressive"):
        values["render"]["method"] = method
        made = rendered(half_plane(2.0), settings_of(**values), 2)
        assert np.isfinite(made.film.planes()).all()
        assert made.tally.dropped["samples"] == 0


def test_a_footprint_is_the_pixel_and_its_circle_of_confusion():
    """Seen straight from above, distance z: pixel area s² plus πR²(1 − z/F)²; in focus the pixel's alone."""
    z, n = 3.0, 64
    floor = Shape("floor", Parallelogram((-10, 0, -10), (0, 0, 20), (20, 0, 0)), 0)
    s = 2 * math.tan(math.radians(10)) * z / n
    for focus in (3.0, 1.5, 8.0):
        camera = Camera((0, z, 0), (0, 0, 0), (0, 0, 1), 20.0, aperture=0.1, focus=focus)
        scene = Scene("floor", None, (floor,), (diffuse(),), (), camera, n, n)
        found, _, _ = traced(scene, replace(SHOWN, pixel=(32, 32)), 64)
        area = s * s + math.pi * (0.1 * (1 - z / focus)) ** 2
        assert found.global_.footprints == pytest.approx(1 / area, rel=0.01)


def test_what_else_sees_the_lens():
    scene = half_plane(2.0)
    plain = replace(scene, camera=replace(scene.camera, aperture=0.0))
    own, without = (resolve_camera(s, CameraSettings()) for s in (scene, plain))
    assert analyse(scene).lenses == {"auto"}
    assert analyse(plain).lenses == frozenset()
    named = tuple(NamedCamera(name, s.camera, 64, 32) for name, s in (("sharp", plain), ("soft", scene)))
    assert analyse(replace(plain, cameras=named)).lenses == {"2", "soft"}
    assert not own.sees_like(without)
    assert not own.sees_like(replace(own, focus=3.0))
    assert own.sees_like(replace(own, target=(0, 0, -5)))
    free = resolve_view(scene, settings_of(free_camera={"on": True}), np.zeros(3), 1.0)
    assert free.aperture == 0
    # 6 units away, f = 32/tan 20° pixels
    assert own.confusion(np.array([2.0, 6.0])) == pytest.approx([0, R / 3 * 32 / math.tan(math.radians(20))])
