"""One type of scene for tests of materials, so that all of them run the same kernels.

What isn't there is not met, and changes nothing; `test_same_picture.py` compares with kernels for less.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from pmviewer.engine import method
from pmviewer.scene.arrays import flatten


@pytest.fixture
def every_surface(monkeypatch):
    """Scenes are opened as if every kind of material, texture and light were in them."""
    features_of = flatten._features
    monkeypatch.setattr(flatten, "_features", lambda *of: {**features_of(*of), **dict.fromkeys(flatten.SURFACES, True)})


@pytest.fixture(autouse=True)
def every_path_may_split(request, monkeypatch):
    """Kernels of tests follow both ways at glass whether there is some or not (`pmviewer.render.split`): one variant
    in place of two. Those without are in test_split.py, test_same_picture.py and all rooms but this one."""
    if request.path.name not in ("test_split.py", "test_same_picture.py"):
        splits = method._splits
        glassy = {"has_smooth_glass": True}
        monkeypatch.setattr(method, "_splits", lambda *of: splits(of[0], replace(of[1], **glassy), *of[2:]))
