"""Curves as tubes: what files say, and surfaces that are worked out by hand."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from pmviewer.errors import SceneError
from pmviewer.scene.description import Mesh, Scene
from pmviewer.scene.formats.curve_file import read_curves
from pmviewer.scene.load import read_scene
from pmviewer.scene.meshes import tubes as tubes_module
from pmviewer.scene.meshes.tubes import Curves, tubes

BEND = np.array([[0, 0, 0, 0.2], [0, 0, 2, 0.2], [1, 0, 3, 0.1], [3, 0, 3, 0.1]], float)


def crosses(mesh: Mesh) -> np.ndarray:
    """Twice the area of each face, along its normal."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def test_a_straight_polygon_is_a_rod_with_round_ends() -> None:
    """A capsule of radius r and length l has the surface 2πr·l + 4πr², its volume is πr²·l + 4/3 πr³."""
    r, length = 0.5, 4.0
    mesh = tubes(Curves(np.array([[0, 0, 0, r], [0, 0, length, r]]), np.array([0, 2])), cubic=False)
    across = crosses(mesh)
    # But for a hole at each end of cos 85° of the radius.
    assert np.linalg.norm(across.sum(axis=0)) < 1e-12
    assert np.linalg.norm(across, axis=1).sum() / 2 == pytest.approx(
        2 * np.pi * r * length + 4 * np.pi * r * r, rel=0.04
    )
    volume = (mesh.vertices[mesh.faces[:, 0]] * across).sum() / 6
    octagon = np.pi / 8 / np.tan(np.pi / 8)  # its area over that of the circle with its circumference
    assert volume == pytest.approx(octagon * (np.pi * r * r * length + 4 / 3 * np.pi * r**3), rel=0.04)
    assert mesh.normals is not None
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1)
    assert ((mesh.normals[mesh.faces].mean(axis=1) * across).sum(axis=1) > 0).all()
    sides = np.abs(mesh.normals[:, 2]) < 1e-9
    assert np.allclose(
        mesh.normals[sides, :2], mesh.vertices[sides, :2] / np.linalg.norm(mesh.vertices[sides, :2], axis=1)[:, None]
    )


def test_all_points_of_a_bent_tube_are_as_far_from_its_curve_as_their_radius() -> None:
    bend = np.array([[0, 0, 0, 0.2], [0, 0, 2, 0.2], [0.3, 0, 4, 0.1], [0.9, 0, 6, 0.1]])
    curves = Curves(np.concatenate([bend, bend + [0, 5, 0, 0]]), np.array([0, 4, 8]))
    mesh = tubes(curves, cubic=False)
    sides = 8
    wide = np.pi / sides / np.sin(np.pi / sides)
    rings = mesh.vertices.reshape(2, -1, sides, 3)
    assert rings.shape[1] == 4 + 4  # two more at each end
    for curve, shift in zip(rings, (0, 5), strict=True):
        for ring, point in zip(curve[2:-2], bend, strict=True):
            assert ring.mean(axis=0) == pytest.approx(point[:3] + [0, shift, 0])
            assert np.linalg.norm(ring - ring.mean(axis=0), axis=1) == pytest.approx(point[3] * wide)
    assert (crosses(mesh)[:, None] @ mesh.normals[mesh.faces].mean(axis=1)[:, :, None] > 0).all()
    count = len(mesh.vertices) // 2
    assert not ((mesh.faces < count).any(axis=1) & (mesh.faces >= count).any(axis=1)).any()


def test_tubes_are_as_wide_between_sharp_corners_as_elsewhere() -> None:
    """A rod with round ends for each piece, which overlap at the corners: their volumes add up."""
    r = 0.1
    zigzag = np.array([[-1, 0, -1, r], [-0.5, 0, 1, r], [-0.25, 0, -1, r], [0, 0, 1, r], [1, 0, 1.1, r]])
    mesh = tubes(Curves(np.concatenate([zigzag, zigzag + [0, 3, 0, 0]]), np.array([0, 5, 10])), cubic=False)
    lengths = np.linalg.norm(np.diff(zigzag[:, :3], axis=0), axis=1)
    volume = (mesh.vertices[mesh.faces[:, 0]] * crosses(mesh)).sum() / 6
    octagon = np.pi / 8 / np.tan(np.pi / 8)
    rods = np.pi * r * r * lengths.sum() + len(lengths) * 4 / 3 * np.pi * r**3
    assert volume == pytest.approx(2 * octagon * rods, rel=0.04)


def test_cubic_curves_are_uniform_b_splines(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the knots the weights are 1/6, 4/6, 1/6, in the middle of a segment 1/48, 23/48, 23/48, 1/48."""
    mesh = tubes(Curves(np.concatenate([BEND, [[4, 0, 0, 0.1]]]), np.array([0, 5])), cubic=True)
    rings = mesh.vertices.reshape(-1, 8, 3)
    points = np.concatenate([BEND, [[4, 0, 0, 0.1]]])
    assert len(rings) == 2 * 4 + 1
    for at, weights in ((0, [1 / 6, 4 / 6, 1 / 6, 0, 0]), (2, [1 / 48, 23 / 48, 23 / 48, 1 / 48, 0]),
                        (4, [0, 1 / 6, 4 / 6, 1 / 6, 0]), (8, [0, 0, 1 / 6, 4 / 6, 1 / 6])):  # fmt: skip
        assert rings[at].mean(axis=0) == pytest.approx(np.array(weights) @ points[:, :3], abs=1e-12)
    monkeypatch.setattr(tubes_module, "MOST_TRIANGLES", 12)
    coarse = tubes(Curves(points, np.array([0, 5])), cubic=True)
    assert len(coarse.faces) == 2 * 3 * 2  # two segments of three sides


def test_files_of_curves(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(b"# strands\r\n\r\n0 0 0 .1\r\n 1 0 0 .2 \r\n\r\n\r\n0 1 0 .3\n0 2 0 .3\n# next\n1 1 1 1\n")
    curves = read_curves(path)
    assert curves.first.tolist() == [0, 2, 4, 5]
    assert curves.points[1].tolist() == [1, 0, 0, 0.2]
    assert len(curves.longer_than(2)) == 2
    path.write_text("0 0 0\n1 0 0\n\n2 0 0\n3 0 0\n")
    assert read_curves(path, 0.5).points[:, 3].tolist() == [0.5] * 4
    for text in ("0 0 0\n1 0 0\n", "", "0 0 0 1\n1 0 0\n", "a b\n"):
        path.write_text(text)
        with pytest.raises(SceneError):
            read_curves(path)


def test_binary_files_of_hair(tmp_path: Path) -> None:
    path = tmp_path / "a.hair"
    numbers = [np.inf, 0, 0, 0, 1, 0, 0, np.inf, 0, 1, 0, 0, 2, 0, 0, 3, 0]
    data = b"BINARY_HAIR" + struct.pack("<I17f", 5, *numbers)
    path.write_bytes(data)
    curves = read_curves(path, 0.25)
    assert curves.first.tolist() == [0, 2, 5]
    assert curves.points.tolist()[3] == [0, 2, 0, 0.25]
    for cut in (12, 40, len(data) - 4):
        path.write_bytes(data[:cut])
        with pytest.raises(SceneError, match="cut off"):
            read_curves(path, 0.25)


def scene(folder: Path, shape: str) -> Scene:
    (folder / "a.txt").write_text("0 0 0 .1\n1 0 0 .1\n2 0 0 .1\n3 0 0 .1\n\n5 5 5 1\n")
    (folder / "b.txt").write_text("0 0 0\n1 0 0\n\n0 1 0\n1 1 0\n")
    (folder / "scene.xml").write_text(f'<scene version="3.0.0">{shape}<emitter type="constant"/></scene>')
    return read_scene(folder / "scene.xml")


TWICE = '<transform name="to_world"><scale value="2"/></transform>'


@pytest.mark.parametrize(
    ("shape", "low", "high", "said"),
    [
        ('<shape type="linearcurve"><string name="filename" value="a.txt"/>{}</shape>', -0.1, 6.1, "1 curves of a.txt"),
        ('<shape type="bsplinecurve"><string name="filename" value="a.txt"/>{}</shape>', 2, 4, "1 curves of a.txt"),
        (
            '<shape type="hair"><string name="filename" value="b.txt"/><float name="radius" value=".1"/>{}</shape>',
            -0.2,
            2.2,
            "",
        ),
    ],
    ids=["linear", "B-spline", "hair"],
)
def test_curves_in_scenes(tmp_path: Path, shape: str, low: float, high: float, said: str) -> None:
    """`to_world` moves points; radii stay as they are, but those of hair. Ends of polygons are round."""
    found = scene(tmp_path, shape.format(TWICE))
    mesh = found.shapes[0].geometry
    assert isinstance(mesh, Mesh)
    assert mesh.vertices[:, 0].min() == pytest.approx(low, abs=0.002)
    assert mesh.vertices[:, 0].max() == pytest.approx(high, abs=0.002)
    assert any(said in w for w in found.warnings)
    flipped = scene(tmp_path, shape.format(TWICE + '<boolean name="flip_normals" value="true"/>')).shapes[0].geometry
    assert isinstance(flipped, Mesh)
    assert np.allclose(crosses(flipped).sum(axis=0), -crosses(mesh).sum(axis=0))
    assert np.allclose(flipped.normals, -np.asarray(mesh.normals))


def test_curves_that_can_not_be_read_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "c.txt").write_text("1 2\n")
    found = scene(
        tmp_path, '<shape type="sphere"/><shape type="linearcurve"><string name="filename" value="c.txt"/></shape>'
    )
    assert len(found.shapes) == 1
    assert any("c.txt" in w for w in found.warnings)
