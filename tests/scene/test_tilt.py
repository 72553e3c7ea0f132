"""Which vertex normals lean from their faces, and when that is said."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.scene.description import Material, Mesh
from pmviewer.scene.load import bundled_scenes, load_scene
from pmviewer.scene.meshes.tilt import leaning_share

TETRAHEDRON = """v 1 1 1\nv 1 -1 -1\nv -1 1 -1\nv -1 -1 1\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n"""
SCENE = """<scene version="3.0.0"><emitter type="constant"/>
<shape type="obj"><string name="filename" value="t.obj"/><boolean name="face_normals" value="{flat}"/>
<bsdf type="{bsdf}"/></shape></scene>"""


def quad(degrees: float) -> Mesh:
    """A unit square of two triangles whose normals at x = 0 lean by that angle."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    lean = [np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))]
    normals = np.array([lean, [0, 0, 1], [0, 0, 1], [0, 0, 1]], float)
    return Mesh(vertices, np.array([[0, 1, 2], [2, 3, 1]], np.int32), normals)


def test_the_share_is_that_of_the_faces_with_a_leaning_corner():
    assert leaning_share(quad(40)) == pytest.approx(0.5)
    assert leaning_share(quad(20)) == 0
    assert leaning_share(Mesh(quad(40).vertices, quad(40).faces)) == 0


@pytest.mark.parametrize(
    ("bsdf", "flat", "said"), [("conductor", "false", True), ("conductor", "true", False), ("diffuse", "false", False)]
)
def test_a_mirror_whose_computed_normals_lean_is_named_once(tmp_path, bsdf, flat, said):
    # A tetrahedron's vertex normals are 70.5° off its faces.
    (tmp_path / "t.obj").write_text(TETRAHEDRON)
    (tmp_path / "scene.xml").write_text(SCENE.format(bsdf=bsdf, flat=flat))
    scene = load_scene(tmp_path / "scene.xml")
    assert [("lean from their faces" in w) for w in scene.warnings].count(True) == said
    assert isinstance(scene.materials[0], Material)


def test_bundled_scenes_are_exact():
    for bundled in bundled_scenes():
        assert not any("lean from their faces" in w for w in load_scene(bundled.name).warnings), bundled.name
