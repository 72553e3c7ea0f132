"""All hostile files that are not mutations."""

from __future__ import annotations

from functools import cache

from pmviewer.bench.hostile import bad_names, special_images, special_meshes, special_volumes, special_xml
from pmviewer.bench.hostile.special import Maker


@cache
def specials() -> list[tuple[str, Maker]]:
    """Names and makers of all; bombs are made when they are asked for."""
    modules = (special_xml, special_images, special_meshes, special_volumes, bad_names)
    return [entry for module in modules for entry in module.specials()]
