"""Shadow rays that need not be cast, because shadow photons know (T8). Without them nothing is compiled."""

from __future__ import annotations

from pmviewer.kernels.compile.specialise import absent, specialised
from pmviewer.maps.shadow import LIT, SHADOW, UNKNOWN, visibility
from pmviewer.maps.variant import ABSENT

__all__ = ["LIT", "NO_SHADOWS", "SHADOW", "UNKNOWN", "known_visibility"]

NO_SHADOWS = ABSENT
"""Stands for shadow photons where there are none."""


@specialised
def known_visibility(shadows, p, n, light):
    """LIT, SHADOW or UNKNOWN: what is known of the light at the point p with normal n.

    `shadows` is the record of shadow photons, that of NO_SHADOWS, or None: with these, nothing is.
    """
    if absent(shadows):

        def nothing(shadows, p, n, light):
            return UNKNOWN

        return nothing

    def asked(shadows, p, n, light):
        return visibility(shadows, p, n, light)

    return asked
