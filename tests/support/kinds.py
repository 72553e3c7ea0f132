"""Scenes opened as if more were in them than is, so that tests run the same kernels. What isn't there is not met, and
changes nothing; `tests/render/test_same_picture.py` compares with kernels for less."""

from __future__ import annotations

from dataclasses import replace

from pmviewer.engine import method
from pmviewer.engine.stages import pass_data
from pmviewer.scene.arrays import flatten

EVERY_SURFACE = (*flatten.SURFACES, "projectors", "colours")
"""For `flatten`'s `features_at_least`."""


def every_surface(monkeypatch):
    """As if every kind of material, texture, colour and light were in all scenes."""
    _open_as_if(monkeypatch, "", *EVERY_SURFACE)


def any_light_in_media(monkeypatch):
    """As if lattices and every kind of light were in scenes with media."""
    _open_as_if(monkeypatch, "media", "lights", "grids")


def any_bsdf(monkeypatch):
    """As if rough surfaces were in all scenes: for kernels that only some tests need, which so take two thirds of the
    time to compile."""
    _open_as_if(monkeypatch, "", "bsdfs")


def any_bsdf_and_light(monkeypatch):
    """The same, and every kind of light: for kernels that two or three files need, some of them with such lights."""
    _open_as_if(monkeypatch, "", "bsdfs", "lights")


def _open_as_if(monkeypatch, where, *features):
    """These are in all scenes, or in those that have the feature `where`."""
    features_of = flatten._features

    def widened(*of):
        own = features_of(*of)
        return {**own, **dict.fromkeys(features, True)} if not where or own[where] else own

    monkeypatch.setattr(flatten, "_features", widened)


def may_always_split(monkeypatch):
    """Kernels follow both ways at glass, whether there is some or not (`pmviewer.render.split`): one variant in place
    of two, of the same picture."""
    splits = method._splits
    monkeypatch.setattr(
        method, "_splits", lambda settings, traits, plan: splits(settings, replace(traits, has_smooth_glass=True), plan)
    )


def room_for_split_paths(monkeypatch):
    """Records of photon methods have the fields of split paths and of several samples a pixel whatever is asked for,
    which may be none and one: the kernels of `may_always_split` serve where pixels have one path."""
    record_of = pass_data.eye_record

    def widened(camera, settings, index, evaluation):
        if settings.render.method == "path":
            return record_of(camera, settings, index, evaluation)
        record = record_of(camera, settings, index, replace(evaluation, splits=1, several=True))
        record["splits"] = evaluation.splits
        return record

    monkeypatch.setattr(pass_data, "eye_record", widened)
