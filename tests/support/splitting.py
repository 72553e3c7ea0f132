"""One variant of kernels for scenes with and without smooth glass."""

from __future__ import annotations

from dataclasses import replace

from pmviewer.engine import method


def may_always_split(monkeypatch):
    """Kernels follow both ways at glass whether there is some or not (`pmviewer.render.split`): one variant in place
    of two, of the same picture."""
    splits = method._splits
    glassy = {"has_smooth_glass": True}
    monkeypatch.setattr(method, "_splits", lambda *of: splits(of[0], replace(of[1], **glassy), *of[2:]))
