"""One type of scene for tests of materials, so that all of them run the same kernels.

What isn't there is not met, and changes nothing; `test_same_picture.py` compares with kernels for less.
"""

from __future__ import annotations

import pytest

from pmviewer.scene.arrays import flatten


@pytest.fixture
def every_surface(monkeypatch):
    """Scenes are opened as if every kind of material, texture and light were in them."""
    features_of = flatten._features
    monkeypatch.setattr(flatten, "_features", lambda *of: {**features_of(*of), **dict.fromkeys(flatten.SURFACES, True)})
