"""The committed scenes are what `scenes/make` makes, and parameters of made scenes do what they say."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from pmviewer.resources import data_folder
from pmviewer.scene.load import load_scene

SCENES = data_folder("scenes")
OWN = {"preview.png", "reference.exr"}
"""Rendered, not made."""


def files(folder: Path) -> dict[str, bytes]:
    found = (path for path in folder.rglob("*") if path.is_file() and path.name not in OWN)
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in found}


def test_committed_files_equal_what_the_generators_write(tmp_path: Path) -> None:
    subprocess.run([sys.executable, SCENES / "make", "--to", tmp_path], check=True, stdout=subprocess.DEVNULL)
    made = sorted(path.name for path in tmp_path.iterdir())
    assert len(made) >= 11
    for name in made:
        fresh, committed = files(tmp_path / name), files(SCENES / name)
        assert fresh.keys() == committed.keys(), name
        for file, content in fresh.items():
            assert content == committed[file], f"{name}/{file} differs: run python scenes/make {name}"


def test_unknown_scene_is_answered_with_the_known_ones(tmp_path: Path) -> None:
    command = [sys.executable, SCENES / "make", "--to", tmp_path, "teapot"]
    answer = subprocess.run(command, capture_output=True, text=True)
    assert answer.returncode == 2
    assert "there is no scene teapot; there are car_cabin" in answer.stderr
    assert not list(tmp_path.iterdir())


def test_parameters_move_the_middle_glass_alone() -> None:
    still, moved = load_scene("three_glasses"), load_scene("three_glasses", {"x": "0.02"})
    shift = [
        b.geometry.vertices - a.geometry.vertices
        for a, b in zip(still.shapes, moved.shapes, strict=True)
        if a.geometry.__class__.__name__ == "Mesh"
    ]
    moving = [i for i, d in enumerate(shift) if np.abs(d).max() > 1e-9]
    assert moving == [5, 6, 7]  # table and wall, then three meshes a glass
    for i in moving:
        np.testing.assert_allclose(shift[i], [[0.02, 0, 0]] * len(shift[i]), atol=1e-9)


def test_boundaries_of_a_filled_glass_meet_without_gap_or_overlap() -> None:
    """Each edge of glass, wet inside and surface together lies on as many triangles as a closed body needs."""
    meshes = {s.name.split()[0]: s.geometry for s in load_scene("cognac").shapes if "(" in s.name}
    parts = [meshes[name] for name in ("glass", "wet", "surface")]
    for pair in ((parts[0], parts[1]), (parts[1], parts[2])):  # the glass body; the liquid body
        count: dict[frozenset, int] = {}
        for mesh in pair:
            corners = np.round(mesh.vertices, 7) + 0.0
            for face in mesh.faces:
                places = [tuple(corners[i]) for i in face]
                for a, b in zip(places, places[1:] + places[:1], strict=True):
                    if a != b:
                        count[frozenset((a, b))] = count.get(frozenset((a, b)), 0) + 1
        assert set(count.values()) == {2}
