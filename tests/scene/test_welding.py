"""Corners of loose triangles joined, and vertices merged in cells, against NumPy's own."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.kernels.meshes.cells import cell_means, spanning
from pmviewer.scene.meshes.welding import FACET, Welder


def welded(corners: np.ndarray, pieces: int) -> tuple[np.ndarray, np.ndarray]:
    welder = Welder(len(corners))
    for piece in np.array_split(corners, pieces):
        facets = np.empty(len(piece), FACET)
        facets["corners"] = piece
        welder.add(facets)
    mesh = welder.mesh()
    return mesh.vertices, mesh.faces


@pytest.mark.parametrize("places", [12, 300, 10**6])
def test_each_place_has_one_vertex(places: int) -> None:
    """A few places for all corners, a mesh's share of them, and loose triangles, for which the table must grow."""
    rng = np.random.default_rng(places)
    corners = rng.normal(size=(places, 3)).astype(np.float32)[rng.integers(places, size=(500, 3))]
    vertices, faces = welded(corners, 7)
    assert np.array_equal(vertices[faces], corners)
    rows, first = np.unique(corners.reshape(-1, 3), axis=0, return_index=True)
    assert len(vertices) == len(rows)
    assert np.array_equal(vertices, corners.reshape(-1, 3)[np.sort(first)])


@pytest.mark.parametrize("places", [12, 300, 10**6])
@pytest.mark.parametrize("parts", [2, 3])
def test_parts_joined_are_what_one_makes_of_all(places: int, parts: int) -> None:
    """Vertices, their order and the faces, whether parts share nearly all places or none."""
    rng = np.random.default_rng(places + parts)
    corners = rng.normal(size=(places, 3)).astype(np.float32)[rng.integers(places, size=(500, 3))]
    corners[7, 1, 2], corners[300, 0, 0] = np.nan, -0.0
    whole = None
    for piece in np.array_split(corners, parts):
        welder = Welder(len(piece) if whole else len(corners))
        facets = np.empty(len(piece), FACET)
        facets["corners"] = piece
        welder.add(facets)
        if whole:
            whole.join(welder)
        else:
            whole = welder
    assert whole is not None
    mesh, (vertices, faces) = whole.mesh(), welded(corners, 1)
    assert np.array_equal(mesh.vertices, vertices, equal_nan=True)
    assert np.array_equal(mesh.faces, faces)


def test_minus_zero_is_zero_and_what_is_no_number_stays() -> None:
    corners = np.zeros((2, 3, 3), np.float32)
    corners[0, :, 0], corners[1, :, 0] = (0, 1, 2), (-0.0, 3, np.nan)
    vertices, faces = welded(corners, 1)
    assert faces.tolist() == [[0, 1, 2], [0, 3, 4]]
    assert not np.signbit(vertices[0, 0])
    assert np.isnan(vertices[4, 0])


def test_cells() -> None:
    """The means of the vertices in each cell, and the first triangle between each three: by loops over all."""
    rng = np.random.default_rng(3)
    vertices, cells, size, start = rng.uniform(-1.5, 1.5, (400, 3)), 5, 0.4, np.full(3, -1.0)
    faces = rng.integers(0, 12, (300, 3)).astype(np.int32)
    key, mean = np.empty(400, np.int32), np.empty((7**3, 3))
    cell_means(vertices, start, size, cells, key, mean)
    at = [tuple(min(max(int(np.floor(c)), -1), cells) + 1 for c in (v - start) / size) for v in vertices]
    assert key.tolist() == [(x * 7 + y) * 7 + z for x, y, z in at]
    for k in set(key.tolist()):
        assert np.allclose(mean[k], vertices[key == k].mean(axis=0))
    sets = [frozenset(at[j] for j in f) for f in faces]
    firsts = [i for i, cells_of in enumerate(sets) if len(cells_of) == 3 and cells_of not in sets[:i]]
    assert firsts != [i for i, cells_of in enumerate(sets) if len(cells_of) == 3]
    for most in (300, len(firsts), len(firsts) - 1):
        kept = np.full(most, -1, np.int64)
        count = spanning(faces, key, np.empty(1024, np.int32), kept)
        assert count == min(len(firsts), most + 1)
        assert kept[:count].tolist() == firsts[:most]
