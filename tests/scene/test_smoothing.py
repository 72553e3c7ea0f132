"""Vertex normals with sharp edges (maxSmoothAngle of Mitsuba 0.6)."""

from pathlib import Path

import numpy as np
import pytest

from pmviewer.scene.arrays.primitives import cube, sphere
from pmviewer.scene.description import Mesh
from pmviewer.scene.meshes.smoothing import smoothed
from tests.scene.helpers import load


def normals_of_faces(mesh: Mesh) -> np.ndarray:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def shared_cube() -> Mesh:
    """A cube of eight vertices."""
    places, index = np.unique(cube().vertices, axis=0, return_inverse=True)
    return Mesh(places, index.reshape(-1)[cube().faces].astype(np.int32))


def test_edges_beyond_the_angle_stay_sharp() -> None:
    mesh = smoothed(shared_cube(), 80.0)
    assert len(mesh.vertices) == 24
    np.testing.assert_allclose(
        mesh.normals[mesh.faces], np.repeat(normals_of_faces(mesh)[:, None], 3, axis=1), atol=1e-12
    )


def test_edges_within_the_angle_are_smooth() -> None:
    mesh = smoothed(Mesh(cube().vertices, cube().faces), 100.0)
    assert len(mesh.vertices) == 8  # those that the file has three times are joined
    np.testing.assert_allclose(mesh.normals, mesh.vertices / np.sqrt(3), atol=1e-12)


def test_a_fine_sphere_is_smooth_and_a_flat_angle_is_not() -> None:
    ball = sphere(16, 32)
    ball = Mesh(ball.vertices.round(12), ball.faces)
    ball = Mesh(ball.vertices, ball.faces[np.linalg.norm(np.cross(
        ball.vertices[ball.faces[:, 1]] - ball.vertices[ball.faces[:, 0]],
        ball.vertices[ball.faces[:, 2]] - ball.vertices[ball.faces[:, 0]]), axis=1) > 1e-9])  # fmt: skip
    mesh = smoothed(ball, 60.0)
    assert np.abs((mesh.normals * mesh.vertices).sum(axis=1)).min() > 0.99
    flat = smoothed(ball, 0.0)
    cosine = (flat.normals[flat.faces] * normals_of_faces(flat)[:, None]).sum(axis=2)
    assert cosine.min() == pytest.approx(1, abs=1e-6)


def test_seams_of_texture_coordinates_stay(tmp_path: Path) -> None:
    mesh = smoothed(cube(), 180.0)
    assert mesh.uv is not None
    assert len(mesh.vertices) > 8
    corners = {(*v, *t) for v, t in zip(mesh.vertices[mesh.faces].reshape(-1, 3), mesh.uv[mesh.faces].reshape(-1, 2))}
    old = cube()
    assert corners == {(*v, *t) for v, t in zip(old.vertices, old.uv)}


def test_as_a_property(tmp_path: Path) -> None:
    roof = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 1\nv 1 1 1\nf 1 2 3\nf 1 3 4\nf 2 5 6\nf 2 6 3\n"
    (tmp_path / "roof.obj").write_text(roof, "utf-8")
    shape = (
        '<shape type="obj"><string name="filename" value="roof.obj"/><float name="maxSmoothAngle" value="{}"/></shape>'
    )
    scene = load(tmp_path, shape.format(30), shape.format(120))
    sharp, smooth = (s.geometry for s in scene.shapes)
    assert (len(sharp.vertices), len(smooth.vertices)) == (8, 6)
    assert np.abs(np.abs(sharp.normals).max(axis=1) - 1).max() < 1e-12
    assert scene.warnings == ()
