"""Large meshes are cleaned in pieces: what is left is what NumPy picks from the whole."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from pmviewer.scene import clean
from pmviewer.scene.description import Mesh


def test_pieces_keep_the_whole_triangles_in_their_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clean, "_AT_ONCE", 64)
    rng = np.random.default_rng(5)
    vertices, faces = rng.normal(size=(500, 3)), rng.integers(0, 490, (300, 3)).astype(np.int32)
    vertices[[3, 77]] = np.nan
    faces[64:128, 1] = faces[64:128, 0]  # a piece of which nothing is left
    dropped: Counter[str] = Counter()
    mesh = clean.clean_mesh(Mesh(vertices, faces), dropped)
    corners = vertices[faces]
    broken = np.isnan(corners).any(axis=(1, 2))
    flat = np.logical_not(broken) & np.any(faces == np.roll(faces, 1, axis=1), axis=1)
    assert mesh is not None
    assert np.array_equal(mesh.vertices[mesh.faces], corners[np.logical_not(broken | flat)])
    used = np.unique(faces[np.logical_not(broken | flat)])
    assert np.array_equal(mesh.vertices, vertices[used])
    assert sorted(dropped.values()) == sorted([int(broken.sum()), int(flat.sum())])
