"""Textures, texture coordinates and shading frames against plain NumPy and closed forms."""

from __future__ import annotations

import math
from collections import namedtuple
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.bsdf.material_textures import texture_params
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.surface import surface_at
from pmviewer.kernels.textures.normal_map import LOWEST, reflecting_normal, shading_frame
from pmviewer.kernels.textures.texture import texture_gradient, texture_rgb
from pmviewer.kernels.textures.uv import barycentrics, hit_tangents, hit_uv
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Cylinder, Disk, Material, Mesh, Parallelogram, Shape, Sphere
from pmviewer.scene.texture import LUMINANCE, Bitmap, Checkerboard, evaluate
from tests.support.scenes import diffuse_box

RNG = np.random.default_rng(5)
COLOURS = RNG.random((5, 7, 3), dtype=np.float32)
GREYS = RNG.random((4, 6, 1), dtype=np.float32)
TURNED = (0.8, -0.6, 0.3, 0.5, 1.7, -0.2)
TEXTURES = {
    f"{wrap} {filter}": Bitmap(COLOURS, wrap, filter, TURNED, (1.0, 0.5, 2.0))
    for wrap in ("repeat", "mirror", "clamp")
    for filter in ("bilinear", "nearest")
}
TEXTURES["grey"] = Bitmap(GREYS)
TEXTURES["one pixel"] = Bitmap(np.full((1, 1, 3), 0.25, np.float32), "mirror")
TEXTURES["checkerboard"] = Checkerboard((0.9, 0.8, 0.7), (0.1, 0.2, 0.3), TURNED)


@kernel
def _look_up(scenes, texture, uv, rgb, gradient):
    for i in range(len(uv)):
        rgb[i] = texture_rgb(scenes[0], texture, uv[i, 0], uv[i, 1])
        gradient[i] = texture_gradient(scenes[0], texture, uv[i, 0], uv[i, 1])


@kernel
def _look(scenes, origins, directions, hit, out):
    scene = scenes[0]
    for i in range(len(origins)):
        o = (origins[i, 0], origins[i, 1], origins[i, 2])
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        t, prim, b1, b2 = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], np.float32(0), np.float32(np.inf))
        hit[i] = prim
        if prim >= 0:
            out.p[i], out.ng[i], s, _ = surface_at(scene, prim, b1, b2, o[0], o[1], o[2], d[0], d[1], d[2], t)
            q, n = (out.p[i, 0], out.p[i, 1], out.p[i, 2]), (out.ng[i, 0], out.ng[i, 1], out.ng[i, 2])
            out.uv[i] = hit_uv(scene, prim, b1, b2, q)
            out.du[i], out.dv[i] = hit_tangents(scene, prim, q, n)
            material = material_of(scene, prim)
            numbers = texture_params(scene, material, prim, b1, b2, q)
            out.reflectance[i] = numbers.reflectance
            out.alpha[i] = (numbers.ax, numbers.ay)
            out.ns[i], out.tangent[i] = shading_frame(scene, material, prim, b1, b2, q, n, s, n)
            c1, c2 = barycentrics(scene, prim, q)
            out.corners[i] = (c1 - b1, c2 - b2)


@kernel
def _keep_reflection(normals, ng, wo, out):
    for i in range(len(normals)):
        n = (normals[i, 0], normals[i, 1], normals[i, 2])
        w = (wo[i, 0], wo[i, 1], wo[i, 2])
        out[i] = reflecting_normal(n, (ng[0], ng[1], ng[2]), w)


def textured(geometry, **changes):
    """One shape with that material in a scene with a light."""
    material = replace(Material("it", "diffuse", (0.5,) * 3, two_sided=True), **changes)
    light = diffuse_box().shapes[-1]
    return replace(
        diffuse_box(), shapes=(Shape("it", geometry, 1), light), materials=(Material("a", "diffuse"), material)
    )


Seen = namedtuple("Seen", "p uv du dv reflectance alpha ng ns tangent corners")
"""Arrays of what the kernel says, by ray."""


def look(scene, origins, directions):
    """Rays that meet the scene: everything that the kernel says there, by name, of those that hit the first shape."""
    flat, n = flatten(scene), len(origins)
    width = {"uv": 2, "alpha": 2, "corners": 2}
    out = {name: np.zeros((n, width.get(name, 3)), np.float32) for name in Seen._fields}
    hit = np.zeros(n, np.int64)
    o, d = (np.ascontiguousarray(a, np.float32) for a in (origins, directions))
    _look(flat.record, o, d, hit, Seen(**out))
    own = hit >= 0
    own[own] = np.isin(hit[own], np.flatnonzero(np.ctypeslib.as_array(_materials(flat)) == 1))
    return {name: a[own].astype(float) for name, a in out.items()}


def _materials(flat):
    return next(
        a for a in flat.arrays.values() if a.dtype == np.int32 and len(a) == flat.n_triangles + flat.n_quadrics
    ).tolist()


def rays(n=2000, reach=0.3):
    d = RNG.normal(size=(n, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return RNG.normal(size=(n, 3)) * reach - 6 * d, d


@pytest.mark.parametrize("name", TEXTURES)
def test_look_up_is_the_plain_one(name):
    flat = flatten(textured(Parallelogram((0, 0, 0), (1, 0, 0), (0, 1, 0)), textures={"reflectance": TEXTURES[name]}))
    uv = np.float32(RNG.uniform(-3, 3, (4000, 2)))
    rgb, gradient = np.empty((4000, 3), np.float32), np.empty((4000, 2), np.float32)
    _look_up(flat.record, 0, uv, rgb, gradient)
    expected = evaluate(TEXTURES[name], uv.astype(float))
    # Flat fields jump where float32 rounds to the other side of an edge.
    assert np.mean(np.abs(rgb - expected).max(axis=1) < 2e-5) > (0.999 if "bilinear" in name else 0.997)
    if isinstance(TEXTURES[name], Bitmap) and TEXTURES[name].filter == "bilinear":
        step = 1e-5

        def height(du, dv):
            return evaluate(TEXTURES[name], uv + np.array([du, dv])) @ LUMINANCE

        slopes = [(height(*e) - height(*-e)) / (2 * step) for e in np.eye(2) * step]
        assert np.mean(np.abs(gradient - np.stack(slopes, 1)).max(axis=1) < 2e-3) > 0.995
    else:
        assert not gradient.any()


FRAME = ((0.6, 0.8, 0.0), (0.0, 0.0, 1.0), (0.8, -0.6, 0.0))
CENTER = np.array([0.1, -0.2, 0.3])


def local(p, frame=FRAME):
    return (p - CENTER) @ np.array(frame).T


def turn(x, y):
    return np.arctan2(y, x) / (2 * math.pi) % 1


def sphere_uv(p):
    x, y, z = local(p).T / 1.2
    return np.stack([turn(x, y), np.arccos(np.clip(z, -1, 1)) / math.pi], 1)


def cylinder_uv(p):
    x, y, z = local(p).T
    return np.stack([turn(x, y), z / 1.5], 1)


def disk_uv(p):
    x, y, _ = local(p).T
    return np.stack([np.hypot(x, y) / 0.9, turn(x, y)], 1)


EDGES = np.array([[1.0, 0.2, 0.0], [0.3, 1.1, 0.4]])


def rectangle_uv(p):
    return (p - CENTER) @ np.linalg.pinv(EDGES)


c = tuple(CENTER)
END = tuple(CENTER + 1.5 * np.array(FRAME[2]))
CORNERS = np.array([c, CENTER + EDGES[0], CENTER + EDGES[0] + EDGES[1], CENTER + EDGES[1]])
SHAPES = {
    "sphere": (Sphere(c, 1.2, False, FRAME), sphere_uv),
    "sphere inside": (Sphere(c, 1.2, True, FRAME), sphere_uv),
    "cylinder": (Cylinder(c, END, 0.7, False, FRAME), cylinder_uv),
    "disk": (Disk(c, FRAME[2], 0.9, FRAME), disk_uv),
    "rectangle": (Parallelogram(c, tuple(EDGES[0]), tuple(EDGES[1])), rectangle_uv),
    "swapped": (Parallelogram(c, tuple(EDGES[1]), tuple(EDGES[0]), True), rectangle_uv),
    "mesh": (
        Mesh(CORNERS, np.array([[0, 1, 2], [0, 2, 3]], np.int32), uv=np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])),
        rectangle_uv,
    ),
}


@pytest.mark.parametrize("name", SHAPES)
def test_coordinates_and_tangents_are_the_analytic_ones(name):
    geometry, expected = SHAPES[name]
    texture = Bitmap(COLOURS)
    found = look(textured(geometry, textures={"reflectance": texture}), *rays())
    assert len(found["p"]) > 100
    uv = expected(found["p"])
    away = np.abs(found["uv"] - uv)
    assert np.minimum(away, np.abs(away - 1)).max() < 2e-5
    assert np.quantile(np.abs(found["reflectance"] - evaluate(texture, uv)).max(axis=1), 0.99) < 1e-3
    assert np.abs(found["corners"]).max() < 1e-5
    # A step along the tangents moves the coordinates by that much.
    calm = np.ones(len(uv), bool) if "isk" not in name else uv[:, 0] > 0.1
    if "sphere" in name:
        calm = (uv[:, 1] > 0.05) & (uv[:, 1] < 0.95)
    for key, step in (("du", [1e-4, 0]), ("dv", [0, 1e-4])):
        moved = expected(found["p"] + 1e-4 * found[key]) - expected(found["p"])
        moved -= np.round(moved)
        assert np.abs(moved - step)[calm].max() < 3e-6
    assert np.abs(np.linalg.norm(found["tangent"], axis=1) - 1).max() < 1e-5
    assert np.abs((found["tangent"] * found["ns"]).sum(axis=1)).max() < 1e-5


def test_mesh_without_coordinates_uses_its_corners():
    mesh = Mesh(CORNERS[:3], np.array([[0, 1, 2]], np.int32))
    found = look(textured(mesh, textures={"reflectance": Checkerboard()}), *rays())
    weights = np.column_stack([1 - found["uv"].sum(1), found["uv"]])
    assert np.abs(weights @ CORNERS[:3] - found["p"]).max() < 1e-5
    assert np.abs((found["tangent"] * found["ng"]).sum(axis=1)).max() < 1e-5


def test_roughness_is_textured_and_keeps_its_ratio():
    rough = Bitmap(np.full((1, 1, 1), 0.3, np.float32))
    plate = SHAPES["rectangle"][0]
    even = look(textured(plate, kind="rough conductor", alpha=(0.1, 0.1), textures={"alpha": rough}), *rays(200))
    assert even["alpha"] == pytest.approx(0.3, rel=1e-5)
    brushed = look(textured(plate, kind="rough conductor", alpha=(0.1, 0.4), textures={"alpha": rough}), *rays(200))
    assert brushed["alpha"] == pytest.approx(np.tile([0.15, 0.6], (len(brushed["alpha"]), 1)), rel=1e-5)


def test_roughness_along_and_across_have_textures_of_their_own():
    plate, uv = SHAPES["rectangle"]
    along, across = Bitmap(GREYS), Checkerboard((0.2,) * 3, (0.7,) * 3)
    both = {"alpha": along, "alpha_across": across}
    found = look(textured(plate, kind="rough conductor", alpha=(0.1, 0.4), textures=both), *rays(400))
    expected = np.stack([evaluate(texture, uv(found["p"])) @ LUMINANCE for texture in both.values()], 1)
    assert np.mean(np.abs(found["alpha"] - expected).max(axis=1) < 1e-3) > 0.98  # edges of fields are sharp
    assert np.ptp(found["alpha"], axis=0).min() > 0.4


@pytest.mark.parametrize("name", ["sphere", "sphere inside", "cylinder", "rectangle", "swapped", "mesh"])
def test_bump_is_the_displaced_surfaces_normal(name):
    """The normal of p + h(u, v)·n, by differences over the surface, for a small h: exact to first order in h's size."""
    geometry, expected = SHAPES[name]
    x = np.arange(256) / 256 * 2 * math.pi
    pixels = (0.5 + 0.25 * np.sin(x)[None, :] + 0.25 * np.cos(x)[:, None]).astype(np.float32)[..., None]
    bump, size = Bitmap(pixels), 2e-3
    found = look(textured(geometry, textures={"bump": bump}, bump_scale=size), *rays())
    calm = slice(None)
    if "sphere" in name:
        v = expected(found["p"])[:, 1]
        calm = (v > 0.1) & (v < 0.9)
    p, ng, du, dv = (found[k][calm] for k in ("p", "ng", "du", "dv"))
    step = 2e-3
    uv = expected(p)

    def height(e):
        return size * (evaluate(bump, uv + np.array(e)) @ LUMINANCE)[:, None]

    # Differential geometry without a parametrisation: grad h = G⁻¹ (h_u, h_v) in the basis of the tangents.
    slope = np.stack(
        [(height((step, 0)) - height((-step, 0)))[:, 0], (height((0, step)) - height((0, -step)))[:, 0]], 1
    )
    gram = np.stack([np.stack([(a * b).sum(1) for b in (du, dv)], 1) for a in (du, dv)], 1)
    along = np.linalg.solve(gram, (slope / (2 * step))[..., None])[..., 0]
    expected_normal = ng - along[:, :1] * du - along[:, 1:] * dv
    expected_normal /= np.linalg.norm(expected_normal, axis=1, keepdims=True)
    tilt = np.linalg.norm(expected_normal - ng, axis=1)
    error = np.linalg.norm(found["ns"][calm] - expected_normal, axis=1)
    print(f"{name}: tilt up to {tilt.max():.4f}, error {error.max():.5f}")
    assert tilt.max() > 1e-3
    assert error.max() < 0.05 * tilt.max()


def test_normal_map_tilts_along_the_tangents():
    tilted = np.array([0.36, 0.48, 0.8])
    pixels = np.float32((tilted + 1) / 2).reshape(1, 1, 3)
    found = look(textured(SHAPES["rectangle"][0], textures={"normal": Bitmap(pixels)}), *rays(300))
    n = np.cross(*EDGES)
    n /= np.linalg.norm(n)
    s = EDGES[0] / np.linalg.norm(EDGES[0])
    expected = tilted[0] * s + tilted[1] * np.cross(n, s) + tilted[2] * n
    assert np.abs(found["ns"] - expected).max() < 1e-5


def test_maps_never_turn_the_normal_below_the_surface():
    pixels = RNG.random((16, 16, 3), dtype=np.float32)  # normals in all directions, half of them below
    found = look(textured(SHAPES["sphere"][0], textures={"normal": Bitmap(pixels, filter="nearest")}), *rays())
    cos = (found["ns"] * found["ng"]).sum(1)
    assert cos.min() > float(LOWEST) - 1e-5
    assert (cos < 0.06).mean() > 0.1
    assert np.abs(np.linalg.norm(found["ns"], axis=1) - 1).max() < 1e-5
    wild = look(textured(SHAPES["sphere"][0], textures={"bump": Bitmap(pixels)}, bump_scale=1e6), *rays())
    assert ((wild["ns"] * wild["ng"]).sum(1)).min() > float(LOWEST) - 1e-5


def test_mirror_directions_stay_above_the_surface():
    ng = np.array([0, 0, 1], np.float32)
    n, wo = (RNG.normal(size=(5000, 3)) for _ in range(2))
    for a in (n, wo):
        a[:, 2] = np.abs(a[:, 2]) + 1e-3
        a /= np.linalg.norm(a, axis=1, keepdims=True)
    n, wo = n.astype(np.float32), wo.astype(np.float32)
    out = np.empty_like(n)
    _keep_reflection(n, ng, wo, out)
    cos = (out * wo).sum(1, dtype=float)
    reflected = 2 * cos[:, None] * out - wo
    assert cos.min() > 0
    assert reflected[:, 2].min() > -1e-5
    fine = (2 * (n * wo).sum(1)[:, None] * n - wo)[:, 2] > 0.02
    facing = (n * wo).sum(1) > 1e-3
    assert np.array_equal(out[fine & facing], n[fine & facing])
    assert 0.1 < fine.mean() < 0.9


def test_plain_scene_has_the_plain_record():
    from pmviewer.kernels.scene import SCENE_DTYPE

    assert flatten(diffuse_box()).record.dtype == SCENE_DTYPE
    assert (
        "textures" in flatten(textured(SHAPES["disk"][0], textures={"reflectance": Checkerboard()})).record.dtype.names
    )
