"""Scenes opened as if more were in them than is, so that tests run the same kernels. What isn't there is not met, and
changes nothing; `tests/render/test_same_picture.py` compares with kernels for less."""

from __future__ import annotations

from dataclasses import replace

from pmviewer.engine import method
from pmviewer.scene.arrays import flatten

EVERY_SURFACE = (*flatten.SURFACES, "colours")
"""For `flatten`'s `features_at_least`."""


def every_surface(monkeypatch):
    """As if every kind of material, texture, colour and light were in all scenes."""
    _open_as_if(monkeypatch, "", *EVERY_SURFACE)


def any_light_in_media(monkeypatch):
    """As if every kind of light were in scenes with media."""
    _open_as_if(monkeypatch, "media", "lights")


def _open_as_if(monkeypatch, where, *features):
    """These are in all scenes, or in those that have the feature `where`."""
    features_of = flatten._features

    def widened(*of):
        own = features_of(*of)
        return {**own, **dict.fromkeys(features, True)} if not where or own[where] else own

    monkeypatch.setattr(flatten, "_features", widened)


def may_always_split(monkeypatch):
    """Kernels follow both ways at glass whether there is some or not (`pmviewer.render.split`): one variant in place
    of two, of the same picture."""
    splits = method._splits
    glassy = {"has_smooth_glass": True}
    monkeypatch.setattr(method, "_splits", lambda *of: splits(of[0], replace(of[1], **glassy), *of[2:]))
