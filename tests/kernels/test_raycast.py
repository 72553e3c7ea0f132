"""Ray casting against the naive tracer, and where float32 and degenerate input could hurt."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from pmviewer.kernels.accel import bvh, occlusion, raycast
from pmviewer.kernels.accel.quadric import CYLINDER, DISK, QUADRIC_FLOATS, SPHERE, quadric_normal, quadric_project
from pmviewer.kernels.compile.jit import kernel
from tests.support import naive_rays

NO_TRIANGLES = np.empty((0, 3, 3), np.float32)
NO_QUADRICS = np.empty((0, QUADRIC_FLOATS), np.float32)
SCALES = (1e-4, 1.0, 1e5)


class Tracer:
    """A tree with its scene record; keeps both alive."""

    def __init__(self, triangles=NO_TRIANGLES, quadrics=NO_QUADRICS):
        self.tree = bvh.build(np.asarray(triangles, np.float32), np.asarray(quadrics, np.float32))
        self.scene = np.zeros(1, np.dtype(bvh.BVH_FIELDS))
        self.tree.store(self.scene[0])

    def closest(self, origins, directions, tmin=0.0, tmax=np.inf):
        rays = self._rays(origins, directions, tmin, tmax)
        n = len(rays[0])
        t, primitive, uv = np.empty(n, np.float32), np.empty(n, np.int32), np.empty((n, 2), np.float32)
        raycast.cast_closest(self.scene[0], *rays, t, primitive, uv)
        return t, primitive, uv

    def occluded(self, origins, directions, tmin=0.0, tmax=np.inf):
        rays = self._rays(origins, directions, tmin, tmax)
        hit = np.empty(len(rays[0]), np.bool_)
        occlusion.cast_occluded(self.scene[0], *rays, hit)
        return hit

    @staticmethod
    def _rays(origins, directions, tmin, tmax):
        directions = np.ascontiguousarray(np.atleast_2d(directions), np.float32)
        n = len(directions)
        origins = np.array(np.broadcast_to(origins, (n, 3)), np.float32, order="C")
        limits = [np.array(np.broadcast_to(x, n), np.float32) for x in (tmin, tmax)]
        return origins, directions, *limits


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def random_triangles(generator, n, scale):
    corners = generator.uniform(-1, 1, (n, 1, 3)) + generator.uniform(-0.2, 0.2, (n, 3, 3))
    return (scale * corners).astype(np.float32)


def random_quadrics(generator, m, scale):
    rows = np.zeros((m, QUADRIC_FLOATS), np.float32)
    rows[:, 0] = np.arange(m) % 3
    rows[:, 1:4] = scale * generator.uniform(-1, 1, (m, 3))
    rows[:, 4:7] = unit(generator.normal(size=(m, 3)))
    rows[:, 7] = scale * generator.uniform(0.05, 0.3, m)
    rows[:, 8] = scale * generator.uniform(0.1, 1.0, m)
    return rows


def quadric(kind, center=(0, 0, 0), axis=(0, 0, 1), radius=1.0, length=1.0):
    return np.array([kind, *center, *axis, radius, length, 0, 0, 0], np.float32)


def sphere_mesh(subdivisions, radius=1.0):
    return (trimesh.creation.icosphere(subdivisions=subdivisions).triangles * radius).astype(np.float32)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(("n", "m"), [(1, 0), (0, 1), (2, 1), (9, 0), (0, 9), (300, 40), (3000, 0), (0, 300)])
def test_agrees_with_naive(n, m, scale):
    generator = np.random.default_rng(n + 17 * m)
    triangles, quadrics = random_triangles(generator, n, scale), random_quadrics(generator, m, scale)
    rays = 1000 if n + m < 1000 else 300
    # Half of the rays aim at a primitive, so that even a scene of one is hit.
    targets = np.concatenate([triangles.mean(1), quadrics[:, 1:4]])[generator.integers(0, n + m, rays)]
    origins = (scale * generator.uniform(-1.5, 1.5, (rays, 3))).astype(np.float32)
    directions = unit(np.where(np.arange(rays)[:, None] % 2, targets - origins, generator.normal(size=(rays, 3))))
    directions = directions.astype(np.float32)
    tmin = (scale * generator.uniform(0.0, 0.1, rays)).astype(np.float32)
    tmax = (scale * generator.uniform(0.5, 5.0, rays)).astype(np.float32)
    tracer = Tracer(triangles, quadrics)

    t, primitive, _ = tracer.closest(origins, directions, tmin, tmax)
    expected_t, expected = naive_rays.closest_hit(triangles, quadrics, origins, directions, tmin, tmax)

    assert (expected >= 0).sum() > 50
    differs = primitive != expected
    assert differs.sum() <= 2  # a ray within rounding of an edge may go either way
    np.testing.assert_allclose(t[~differs], expected_t[~differs], rtol=1e-4, atol=1e-5 * scale)
    np.testing.assert_array_equal(tracer.occluded(origins, directions, tmin, tmax), primitive >= 0)


def test_barycentrics_give_the_hit_point():
    generator = np.random.default_rng(3)
    triangles = random_triangles(generator, 200, 1.0)
    origins = generator.uniform(-1.5, 1.5, (2000, 3)).astype(np.float32)
    directions = unit(generator.normal(size=(2000, 3))).astype(np.float32)
    t, primitive, uv = Tracer(triangles).closest(origins, directions)
    hit = primitive >= 0
    corners = triangles[primitive[hit]].astype(np.float64)
    u, v = uv[hit, :1].astype(np.float64), uv[hit, 1:].astype(np.float64)
    points = corners[:, 0] * (1 - u - v) + corners[:, 1] * u + corners[:, 2] * v
    assert hit.sum() > 200
    np.testing.assert_allclose(points, origins[hit] + directions[hit] * t[hit, None], atol=2e-5)


@pytest.mark.parametrize("scale", SCALES)
def test_no_ray_leaves_a_closed_mesh(scale):
    generator = np.random.default_rng(4)
    tracer = Tracer(sphere_mesh(6, scale))
    rays = 200_000
    origins = scale * 0.5 * unit(generator.normal(size=(rays, 3)))
    directions = unit(generator.normal(size=(rays, 3)))
    assert (tracer.closest(origins, directions)[1] >= 0).all()
    assert tracer.occluded(origins, directions).all()


def test_no_ray_leaves_through_vertices_and_edges():
    triangles = sphere_mesh(4)
    tracer = Tracer(triangles)
    origin = np.array([0.11, -0.23, 0.05], np.float32)
    middles = 0.5 * (triangles + np.roll(triangles, 1, axis=1))
    targets = np.concatenate([triangles.reshape(-1, 3), middles.reshape(-1, 3)])
    assert (tracer.closest(origin, unit(targets - origin))[1] >= 0).all()


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("start", [0, -5, -12])
def test_axis_parallel_rays_in_slab_planes(axis, sign, start):
    """Along the faces of boxes 0/0 and 0·inf lurk: a grid of squares with integer corners, rays at integer places."""
    n = 12
    other = [k for k in range(3) if k != axis]
    i, j = (x.ravel() for x in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    corners = np.zeros((n * n, 4, 3), np.float32)
    for k, (a, b) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
        corners[:, k, other[0]], corners[:, k, other[1]] = start + i + a, start + j + b
    tracer = Tracer(np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]]))
    x, y = (x.ravel() for x in np.meshgrid(np.arange(n + 1), np.arange(n + 1) / 2, indexing="ij"))
    origins, directions = np.zeros((len(x), 3)), np.zeros((len(x), 3))
    origins[:, other[0]], origins[:, other[1]], origins[:, axis] = start + x, start + y, -3.0 * sign
    directions[:, axis] = sign
    for zero in (0.0, -0.0):
        directions[:, other] = zero
        t, primitive, _ = tracer.closest(origins, directions)
        assert (primitive >= 0).all()
        np.testing.assert_allclose(t, 3.0, rtol=1e-6)
        assert tracer.occluded(origins, directions).all()


def test_limits_are_exclusive_and_nothing_is_hit_beyond_them():
    triangle = [[[-1, -1, 0], [2, -1, 0], [-1, 2, 0]]]
    tracer = Tracer(triangle, [quadric(SPHERE, (0, 0, 5))])
    below, up = (0, 0, -1), (0, 0, 1)
    assert tracer.closest(below, up, 0.0, 10.0)[1] == 0
    assert tracer.closest(below, up, 1.0, 10.0)[1] == 1
    assert tracer.closest(below, up, 0.0, 1.0)[1] == -1
    assert not tracer.occluded(below, up, 0.0, 1.0)
    t, primitive, _ = tracer.closest(below, up, 5.5, 10.0)
    assert primitive == 1
    assert t == pytest.approx(7.0)
    t, primitive, _ = tracer.closest(below, up, -5.0, 0.5)
    assert (t, primitive) == (np.float32(0.5), -1)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("place", range(6))
def test_non_finite_rays_hit_nothing(bad, place):
    tracer = Tracer(sphere_mesh(3), [quadric(SPHERE, radius=2.0)])
    ray = np.array([0.1, 0.2, 0.3, 0.5, 0.6, 0.7])
    ray[place] = bad
    t, primitive, _ = tracer.closest(ray[:3], ray[3:], 0.0, 7.0)
    assert (t, primitive) == (np.float32(7.0), -1)
    assert not tracer.occluded(ray[:3], ray[3:])


def test_rays_without_direction_or_limit_hit_nothing():
    tracer = Tracer(sphere_mesh(3), [quadric(kind) for kind in (SPHERE, CYLINDER, DISK)])
    assert tracer.closest((0.1, 0.2, 0.3), (0, 0, 0))[1] == -1
    assert tracer.closest((0.1, 0.2, 0.3), (0, 0, 1), 0.0, np.nan)[1] == -1
    assert not tracer.occluded((0.1, 0.2, 0.3), (0, 0, 0))


@pytest.mark.parametrize(
    "triangles",
    [
        np.zeros((1000, 3, 3)),
        np.full((1000, 3, 3), 3e38),
        np.full((100, 3, 3), np.nan),
        np.repeat([[[0, 0, 0], [1, 1, 1], [2, 2, 2]]], 50, axis=0),
        np.zeros((0, 3, 3)),
    ],
    ids=["points", "huge points", "nan", "collinear", "none"],
)
def test_degenerate_scenes_hit_nothing(triangles):
    tracer = Tracer(triangles)
    assert tracer.closest((-1, 0.5, 0.5), (1, 0, 0))[1] == -1
    assert not tracer.occluded((-1, 0.5, 0.5), (1, 0, 0))


def test_identical_and_exponentially_spaced_triangles():
    """A thousand equal centroids can't be split by place; powers of two make the most lopsided splits."""
    triangle = np.array([[0, -1, -1], [0, 2, -1], [0, -1, 2]], np.float32)
    same = np.repeat(triangle[None], 1000, axis=0)
    spread = (
        triangle[None] * np.float32(0.5) + np.array([1, 0, 0], np.float32) * 2.0 ** np.arange(-60, 60)[:, None, None]
    )
    spread[:, :, 1:] = triangle[None, :, 1:]
    tracer = Tracer(np.concatenate([same, spread]).astype(np.float32))
    t, primitive, _ = tracer.closest((-1, 0, 0), (1, 0, 0))
    assert t == pytest.approx(1.0)
    assert 0 <= primitive[0] < 1000
    t, primitive, _ = tracer.closest((2.0**58 * 1.5, 0, 0), (1, 0, 0))
    assert primitive == 1000 + 119


def test_bad_triangles_keep_the_ids_of_good_ones():
    good = np.array([[-1, -1, 0], [2, -1, 0], [-1, 2, 0]], np.float32)
    triangles = np.stack([np.full((3, 3), np.nan), np.zeros((3, 3)), good])
    tracer = Tracer(triangles, [quadric(SPHERE, (np.nan, 0, 0)), quadric(SPHERE, (0, 0, 5))])
    assert tracer.closest((0, 0, -1), (0, 0, 1))[1] == 2
    assert tracer.closest((0, 0, 1), (0, 0, 1))[1] == 4


@pytest.mark.parametrize("scale", SCALES)
def test_sphere_from_its_own_surface(scale):
    """A ray from the surface inwards finds the other side, outwards nothing, with tmin at the rounding error."""
    generator = np.random.default_rng(5)
    center = np.array([0.3, -0.7, 0.2]) * scale
    tracer = Tracer(quadrics=[quadric(SPHERE, center, radius=0.5 * scale)])
    normals = unit(generator.normal(size=(20_000, 3)))
    directions = unit(generator.normal(size=(20_000, 3)))
    cosine = (normals * directions).sum(1)
    clear = np.abs(cosine) > 1e-2
    origins = (center + 0.5 * scale * normals).astype(np.float32)
    t, primitive, _ = tracer.closest(origins, directions, 1e-4 * scale)
    inwards = clear & (cosine < 0)
    assert (primitive[inwards] == 0).all()
    assert (primitive[clear & (cosine > 0)] == -1).all()
    np.testing.assert_allclose(t[inwards], -cosine[inwards] * scale, rtol=1e-3)  # the origin's rounding over the cosine


def test_small_distant_sphere():
    """Far away the naive float32 discriminant is all rounding; the hit must still lie on the sphere."""
    generator = np.random.default_rng(6)
    row = quadric(SPHERE, (1000, 0, 0), radius=0.01)
    offsets = generator.uniform(-0.009, 0.009, (1000, 2)) / np.sqrt(2)
    directions = np.stack([np.full(1000, 1000.0), *offsets.T], 1).astype(np.float32)
    t, primitive, _ = Tracer(quadrics=[row]).closest((0, 0, 0), directions)
    assert (primitive == 0).all()
    points = directions.astype(np.float64) * t[:, None]
    assert np.abs(np.linalg.norm(points - row[1:4], axis=1) - 0.01).max() < 1e-4


def test_cylinder_is_open_and_has_two_walls():
    tracer = Tracer(quadrics=[quadric(CYLINDER, (0, 0, -1), (0, 0, 1), 1.0, 2.0)])
    assert tracer.closest((0.5, 0, -5), (0, 0, 1))[1] == -1
    assert tracer.closest((-3, 0, 0), (1, 0, 0))[0] == pytest.approx(2.0)
    assert tracer.closest((-3, 0, 0), (1, 0, 0), 2.5)[0] == pytest.approx(4.0)
    assert tracer.closest((-3, 0, 1.1), (1, 0, 0))[1] == -1
    # In above the rim, out through the far wall: the near root is clipped, the far one counts.
    assert tracer.closest((-2, 0, 2), unit(np.array([3.0, 0, -2])))[0] == pytest.approx(np.sqrt(13.0), rel=1e-5)


@kernel
def _surface(scene, j, points, normals, projected):
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        normals[i, 0], normals[i, 1], normals[i, 2] = quadric_normal(scene, j, x, y, z)
        projected[i, 0], projected[i, 1], projected[i, 2] = quadric_project(scene, j, x, y, z)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("j", range(3))
def test_normals_and_projection(j, scale):
    generator = np.random.default_rng(7)
    rows = random_quadrics(generator, 3, scale)
    tracer = Tracer(quadrics=rows)
    points = (rows[j, 1:4] + rows[j, 7] * unit(generator.normal(size=(500, 3)))).astype(np.float32)
    normals, projected = np.empty_like(points), np.empty_like(points)
    _surface(tracer.scene[0], j, points, normals, projected)
    expected, _ = naive_rays.project(rows[j], points)
    np.testing.assert_allclose(normals, expected, atol=1e-5)
    _, distance = naive_rays.project(rows[j], projected)
    assert np.abs(distance).max() < 4e-7 * scale
