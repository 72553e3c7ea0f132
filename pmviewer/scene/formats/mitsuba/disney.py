"""Disney's BSDF (Burley 2012, 2015) under the names that others give it and its parts, as `principled`."""

from __future__ import annotations

import math

from pmviewer.scene.formats.mitsuba.document import Properties
from pmviewer.scene.formats.mitsuba.interface import bounded, share
from pmviewer.scene.formats.mitsuba.xml import Element

PARTS = {"disneydiffuse": {"eta": 1.0}, "disneymetal": {"metallic": 1.0}, "disneyglass": {"spec_trans": 1.0}}
"""What makes `principled` one lobe: without a step of the index it mirrors nothing."""
NAMES = {"specular_transmission": "spec_trans", "specular_tint": "spec_tint", "subsurface": "flatness"}
"""Mitsuba's names by others'."""


def as_principled(p: Properties, word: str) -> None:
    """Rename and add what a BSDF with the type `word` has, for `principled` to read."""
    for name, ours in NAMES.items():
        if name in p and ours not in p:
            p.values[ours] = p.values.pop(name)
    for name, value in PARTS.get(word, {}).items():
        _set(p, name, value)
    if "specular" in p and "eta" in p and share(p, "spec_trans") == 0:
        # There `specular` scales what the index reflects head-on, here it stands for 0.08 of it.
        eta = bounded(p, "eta", p.number("eta", 1.5), 1e-3, 1e3)
        head_on = ((eta - 1) / (eta + 1)) ** 2
        _set(p, "specular", p.roughness("specular", 0.5) * head_on / 0.08)
        del p.values["eta"]


def _set(p: Properties, name: str, value: float) -> None:
    if math.isfinite(value):
        p.values[name] = Element("float", {"name": name, "value": repr(value)}, p.element.line, file=p.element.file)
