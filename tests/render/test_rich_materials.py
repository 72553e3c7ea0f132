"""Every kind of material in the whole program: photons and gathering agree with path tracing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.scene.description import Material, Mesh, Scene, Shape, Sphere
from tests.support.scenes import GLASS, MIRROR, box_camera, box_walls, diffuse, panel, rendered, settings_of

pytestmark = pytest.mark.usefixtures("every_surface")

COPPER = ((0.2, 0.9, 1.1), (3.9, 2.4, 2.2))
MATERIALS = {
    "rough conductor, looked up": Material("m", "rough conductor", (1.0,) * 3, alpha=(0.4, 0.4), metal=COPPER),
    "rough conductor, followed": Material("m", "rough conductor", (0.9,) * 3, alpha=(0.1, 0.1), metal=COPPER),
    "smooth metal": Material("m", "conductor", (1.0,) * 3, metal=COPPER),
    "plastic": Material("m", "plastic", (0.6, 0.4, 0.2)),
    "rough plastic, looked up": Material("m", "rough plastic", (0.6, 0.4, 0.2), alpha=(0.3, 0.3)),
    "rough plastic, followed": Material("m", "rough plastic", (0.6, 0.4, 0.2), alpha=(0.1, 0.1)),
    "schlick": Material("m", "schlick", (0.7, 0.5, 0.3), alpha=(0.5, 0.5)),
    "ward": Material("m", "ward", (0.3,) * 3, specular=(0.3,) * 3, alpha=(0.2, 0.5)),
}
SOLIDS = {
    "rough glass": Material("m", "rough dielectric", eta=1.5, alpha=(0.3, 0.3)),
    "thin glass": Material("m", "thin dielectric", eta=1.5),
    "coloured glass": Material("m", "dielectric", eta=1.5, absorption=(0.2, 1.0, 3.0)),
}


PICTURE, PHOTONS = 48, 16_000
"""The mean of a picture is as exact by many pixels and few photons as by few pixels and many photons, at a fifth of the
work: most of its noise comes from where pixels are sampled."""


def box(floor, ball):
    """A closed box, glossy floor, a ball on it that makes a caustic there, a large light."""
    materials = (diffuse(albedo=(0.5,) * 3), replace(floor, two_sided=not floor.transparent), ball)
    shapes = (
        *box_walls(1.0, (0, 0, 1, 0, 0, 0)),
        Shape("ball", Sphere((0.2, -0.6, -0.2), 0.35), 2),
        panel(half=0.7),
    )
    return Scene("box", None, shapes, materials, (), box_camera(), PICTURE, PICTURE)


def pass_means(scene, method, passes, **groups):
    """(passes,) mean of the image, pass by pass."""
    values = {"render": {"method": method}, "photons": {"N": PHOTONS}, "estimate": {"radius": 0.02}} | groups
    pool = WorkPool(2)
    renderer = Renderer(open_scene(scene), settings_of(**values), pool, StageStore(0))
    totals = []
    for _ in range(passes):
        renderer.step()
        totals.append(renderer.film.sums[:, :15].sum(1).mean() / 3)
    pool.close()
    assert sum(renderer.tally.dropped.values()) == 0
    return np.diff(np.array(totals), prepend=0)


def smooth_ball(material):
    """A ball of few triangles with a sphere's normals: its shading and geometric normals differ by up to 20°."""
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.35)
    vertices = np.array(ball.vertices)
    mesh = Mesh(vertices + (0.2, -0.6, -0.2), np.array(ball.faces, np.int32), vertices / 0.35)
    scene = box(diffuse(), material)
    shapes = tuple(replace(s, geometry=mesh) if s.name == "ball" else s for s in scene.shapes)
    return replace(scene, shapes=shapes)


SMOOTH = {
    "diffuse": diffuse(albedo=(0.7,) * 3),
    "mirror": MIRROR,
    "rough metal": MATERIALS["rough conductor, followed"],
}


@pytest.mark.extensive
@pytest.mark.parametrize("name", SMOOTH)
def test_photons_agree_with_path_tracing_on_smooth_coarse_meshes(name):
    """In the whole picture, and on the diffuse ball itself, where photons without correction show the triangles."""
    scene = smooth_ball(SMOOTH[name])
    images = {}
    for method, passes in (("path", 100), ("progressive", 32)):
        N = 60_000 if name == "diffuse" else PHOTONS  # few photons meet the ball itself
        values = {"render": {"method": method}, "photons": {"N": N}, "estimate": {"radius": 0.03}}
        images[method] = rendered(scene, settings_of(**values), passes, threads=2).frame(0)
    ours, path = images["progressive"].image().astype(float), images["path"].image().astype(float)
    print(f"{name}: mean {ours.mean():.5f}, path {path.mean():.5f}, ratio {ours.mean() / path.mean():.4f}")
    assert ours.mean() == pytest.approx(path.mean(), rel=0.012)
    if name == "diffuse":
        on_ball = images["path"].image("albedo")[..., 0] > 0.65
        a, b = images["progressive"].image("indirect")[on_ball], images["path"].image("indirect")[on_ball]
        print(f"indirect light on the ball: {a.mean():.5f}, path {b.mean():.5f}, {on_ball.sum()} pixels")
        assert on_ball.sum() > 80
        assert a.mean() == pytest.approx(b.mean(), rel=0.03)


ALIKE = ("smooth metal", "rough plastic, looked up", "rough plastic, followed", "schlick", "thin glass")
"""Lobes of their own that are stored or followed as others are; each by itself is tested in `tests/kernels`."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.extensive] if name in ALIKE else []) for name in (*MATERIALS, *SOLIDS)],
)
def test_progressive_and_gather_agree_with_path_tracing(name):
    if name in MATERIALS:
        scene = box(MATERIALS[name], GLASS)
    else:
        scene = box(diffuse(), SOLIDS[name])
    assert "bsdfs" in open_scene(scene).flat.record.dtype.names
    path = pass_means(scene, "path", 24)
    for method, passes in (("progressive", 10), ("gather", 5)):
        ours = pass_means(scene, method, passes)
        error = np.hypot(ours.std() / np.sqrt(len(ours)), path.std() / np.sqrt(len(path)))
        print(f"{name}, {method}: {ours.mean():.5f}, path {path.mean():.5f} ± {error:.5f}")
        assert abs(ours.mean() - path.mean()) < 4 * error + 0.006 * path.mean()
