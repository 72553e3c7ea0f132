"""Where a texture lies on a surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmviewer.scene.texture import Affine

if TYPE_CHECKING:
    from pmviewer.scene.formats.mitsuba.document import Properties


def to_uv(p: Properties) -> Affine:
    """How the texture's coordinates follow from the surface's: `to_uv`, or `uscale`, `uoffset`, … of version 0.x,
    which count as s·(u + o), as Mitsuba 3 upgrades them."""
    if "to_uv" in p:
        matrix = p.transform("to_uv")
        a, b, d, e = (float(x) for x in matrix[:2, :2].reshape(-1))
        return (a, b, float(matrix[0, 3]), d, e, float(matrix[1, 3]))
    su, sv = p.number("uscale", 1.0), p.number("vscale", 1.0)
    return (su, 0.0, su * p.number("uoffset", 0.0), 0.0, sv, sv * p.number("voffset", 0.0))
