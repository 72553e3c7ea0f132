"""One type of scene for tests of materials and one for media, so that all of them run the same kernels.

What isn't there is not met, and changes nothing; `test_same_picture.py` compares with kernels for less.
"""

from __future__ import annotations

import pytest

from pmviewer.scene.arrays import flatten
from tests.support.splitting import may_always_split


@pytest.fixture
def every_surface(monkeypatch):
    """Scenes are opened as if every kind of material, texture, colour and light were in them."""
    _open_as_if(monkeypatch, "", *flatten.SURFACES, "colours")


@pytest.fixture
def any_light_in_media(monkeypatch):
    """Scenes with media are opened as if every kind of light were in them."""
    _open_as_if(monkeypatch, "media", "lights")


def _open_as_if(monkeypatch, where, *features):
    """These are in all scenes, or in those that have the feature `where`."""
    features_of = flatten._features

    def widened(*of):
        own = features_of(*of)
        return {**own, **dict.fromkeys(features, True)} if not where or own[where] else own

    monkeypatch.setattr(flatten, "_features", widened)


@pytest.fixture(autouse=True)
def every_path_may_split(request, monkeypatch):
    """Kernels without a way to follow both are run by test_split.py, test_same_picture.py and other rooms' tests."""
    if request.path.name not in ("test_split.py", "test_same_picture.py"):
        may_always_split(monkeypatch)
