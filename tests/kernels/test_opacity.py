"""Surfaces that rays pass in part: how many pass, independently of each other, and where opacity is looked up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.kernels.accel import occlusion, raycast
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Group, Instance, Material, Mesh, Parallelogram, Shape, Sphere
from pmviewer.scene.texture import Bitmap, Checkerboard
from tests.support.kinds import EVERY_SURFACE
from tests.support.scenes import diffuse, diffuse_box

N = 100_000


def cast(flat, origins, directions):
    """Distance and primitive of what the rays meet, and whether they meet anything before t = 1."""
    n = len(origins)
    t, prim, uv, hit = np.empty(n, np.float32), np.empty(n, np.int32), np.empty((n, 2), np.float32), np.empty(n, bool)
    rays = [np.ascontiguousarray(a, np.float32) for a in (origins, directions)]
    zero, inf = np.zeros(n, np.float32), np.full(n, np.inf, np.float32)
    raycast.cast_closest(flat.record[0], *rays, zero, inf, t, prim, uv)
    occlusion.cast_occluded(flat.record[0], *rays, zero, np.ones(n, np.float32), hit)
    return t, prim, hit


def down(n=N, seed=1, half=0.99):
    """Parallel rays from z = 1 down through the unit square around the axis."""
    origins = np.random.default_rng(seed).uniform(-half, half, (n, 3))
    origins[:, 2] = 1.0
    return origins, np.broadcast_to([0.0, 0.0, -1.0], (n, 3))


def sheet(z, material, name="sheet"):
    return Shape(name, Parallelogram((-1, -1, z), (2, 0, 0), (0, 2, 0)), material)


def scene_of(*shapes, veil=None, instances=(), features=EVERY_SURFACE):
    """The shapes within a large box of 14 triangles that holds a light, and the first id after those; material 1 is
    `veil`. As if these features were there, so that kernels are those of many tests."""
    box = diffuse_box(4.0)
    veil = veil or replace(diffuse(), opacity=0.3)
    scene = replace(box, shapes=(*box.shapes, *shapes), materials=(diffuse(), veil), instances=instances)
    return flatten(scene, features_at_least=features), 14


def share(hit, expected):
    """Within four and a half standard deviations."""
    assert hit.mean() == pytest.approx(expected, abs=4.5 * np.sqrt(max(expected * (1 - expected), 1e-9) / len(hit)))


def test_scenes_without_it_have_no_such_record():
    names = flatten(diffuse_box()).record.dtype.names
    assert "passable" not in names
    assert "colours" not in names


@pytest.mark.parametrize("opacity", [0.0, 0.02, 0.3, 0.9, 1.0])
def test_share_of_rays_that_stop(opacity):
    flat, first = scene_of(sheet(0.5, 1), sheet(-0.5, 1), veil=replace(diffuse(), opacity=opacity))
    t, prim, hit = cast(flat, *down())
    share((prim == first) | (prim == first + 1), opacity)
    share((prim == first + 2) | (prim == first + 3), (1 - opacity) * opacity)
    share(hit, opacity)
    assert np.isclose(t[prim < first], 5.0).all(), "the others see the box behind"
    if opacity in (0.0, 1.0):
        assert hit.all() == hit.any() == (opacity == 1.0)


def test_decisions_are_deterministic_and_independent_between_rays():
    """Neighbours on a fine lattice, rays that differ in one bit or in the sign of a direction: no correlation."""
    flat, first = scene_of(sheet(0.0, 1), veil=replace(diffuse(), opacity=0.5))
    x = (np.arange(300) + 0.5) / 300 * 1.9 - 0.95
    grid = np.stack([*np.meshgrid(x, x, indexing="ij"), np.ones((300, 300))], axis=-1).reshape(-1, 3).astype(np.float32)
    ahead = np.broadcast_to([0.0, 0.0, -1.0], grid.shape).astype(np.float32)
    stopped = (cast(flat, grid, ahead)[1] >= first).reshape(300, 300)
    again = (cast(flat, grid, ahead)[1] >= first).reshape(300, 300)
    assert (stopped == again).all()
    share(stopped.ravel(), 0.5)
    signs = np.where(stopped, 1.0, -1.0)
    one_bit = np.nextafter(grid[:, :1], np.float32(2)) * [1, 0, 0] + grid * [0, 1, 1]
    tilted = ahead + np.float32([2**-24, 0, 0])
    others = {
        "right": np.roll(signs, 1, 0),
        "down": np.roll(signs, 1, 1),
        "diagonal": np.roll(signs, (1, 1), (0, 1)),
        "a bit": np.where(cast(flat, one_bit, ahead)[1] >= first, 1.0, -1.0).reshape(300, 300),
        "direction": np.where(cast(flat, grid, tilted)[1] >= first, 1.0, -1.0).reshape(300, 300),
    }
    for name, other in others.items():
        assert abs((signs * other).mean()) < 4.5 / 300, name
    rows = stopped.sum(axis=1)  # binomial: variance n/4
    assert rows.var() / 75 == pytest.approx(1.0, abs=4.5 * np.sqrt(2 / 300))


def test_decisions_are_independent_between_surfaces():
    """Of many sheets, coincident ones among them, each stops its share of what reaches it; none is met twice."""
    heights = [0.9 - 0.1 * (k // 2) for k in range(12)]
    flat, first = scene_of(*(sheet(z, 1) for z in heights), veil=replace(diffuse(), opacity=0.2))
    t, prim, _ = cast(flat, *down())
    for k in range(6):
        share(np.isclose(t, 0.1 + 0.1 * k), (1 - 0.2) ** (2 * k) * (1 - 0.8**2))
    share(prim < first, 0.8**12)


def test_both_sides_of_a_sphere_decide_for_themselves():
    flat, first = scene_of(Shape("ball", Sphere((0, 0, 0), 0.9), 1), veil=replace(diffuse(), opacity=0.4))
    t, prim, _ = cast(flat, *down(half=0.1))
    ball = prim == first
    share(ball & (t < 0.3), 0.4)
    share(ball & (t > 1.5), 0.6 * 0.4)


def textured(texture, cutoff=None):
    return replace(diffuse(), textures={"opacity": texture}, alpha_cutoff=cutoff)


def test_texture_is_looked_up_where_rays_meet_the_surface():
    flat, first = scene_of(sheet(0.0, 1), veil=textured(Checkerboard((0.25,) * 3, (1.0,) * 3, (1, 0, 0, 0, 1, 0))))
    origins, directions = down()
    _, prim, _ = cast(flat, origins, directions)
    same = (origins[:, 0] > 0) == (origins[:, 1] > 0)
    share(prim[same] >= first, 0.25)
    assert (prim[~same] >= first).all()


@pytest.mark.parametrize("filter_", ["bilinear", "nearest"])
def test_cutoff_counts_after_the_filter(filter_):
    """Two texels 0 and 1: bilinear, their values rise linearly from u = ¼ to u = ¾."""
    pixels = np.array([[[0.0], [1.0]]], np.float32)
    flat, first = scene_of(sheet(0.0, 1), veil=textured(Bitmap(pixels, "clamp", filter_), cutoff=0.7))
    origins, directions = down()
    _, prim, _hit = cast(flat, origins, directions)
    u = (origins[:, 0].astype(np.float32) + 1) / 2
    edge = 0.25 + 0.5 * 0.7 if filter_ == "bilinear" else 0.5
    sure = np.abs(u - edge) > 1e-5
    np.testing.assert_array_equal(prim[sure] >= first, u[sure] > edge)


def test_constant_opacity_and_cutoff():
    for opacity, stops in ((0.5, True), (0.49, False)):
        material = replace(diffuse(), opacity=opacity, alpha_cutoff=0.5)
        assert material.passable != stops
        flat, first = scene_of(sheet(0.0, 1), veil=material)
        assert (cast(flat, *down(1000))[1] >= first).all() == stops


def test_through_instances():
    """A copy is passed as what it shows, with decisions of its own; textures lie on it as on the original."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    uv = (corners[:, :2] + 1) / 2
    mesh = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), uv=uv)
    group = Group("leaf", (Shape("leaf", mesh, 1), Shape("dot", Sphere((0, 0, 0.3), 0.02), 1)))

    def at(z, scale):
        m = np.diag([scale, scale, 0.5, 1.0])
        m[2, 3] = z
        return Instance(f"at {z}", group, m)

    veil = textured(Checkerboard((0.25,) * 3, (1.0,) * 3, (1, 0, 0, 0, 1, 0)))
    flat, _ = scene_of(veil=veil, instances=(at(0.5, 1.0), at(0.0, -1.0)))
    origins, directions = down()
    origins[:, :2] += np.where(np.abs(origins[:, :2]) < 0.05, 0.1, 0.0)  # beside the dots
    t, _, hit = cast(flat, origins, directions)
    same = (origins[:, 0] > 0) == (origins[:, 1] > 0)
    upper, lower = np.isclose(t, 0.5), np.isclose(t, 1.0)
    share(upper[same], 0.25)
    share(lower[same], 0.75 * 0.25)
    share(hit[same], 0.25)  # the lower one is not before t = 1
    assert upper[~same].all()


def test_glass_that_absorbs_is_never_passed():
    glass = Material("glass", "dielectric", opacity=0.5, absorption=(1.0, 0.0, 0.0))
    assert not glass.passable
    assert replace(glass, absorption=(0.0, 0.0, 0.0)).passable
    flat, first = scene_of(sheet(0.0, 1), veil=glass, features=())
    assert "passable" not in flat.record.dtype.names
    assert (cast(flat, *down(1000))[1] >= first).all()
