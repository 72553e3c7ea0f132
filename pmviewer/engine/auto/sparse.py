"""Wider look-ups where gather rays end if photons lie far apart.

The automatic radius goes with the pixels, whatever number of photons it holds: mostly ten or so of those of a trial,
but in a large scene, or under a sky whose photons come down all over it, it may be less than one. What few photons
bring is noise then that all rays of a region share, and no number of rays takes away. Bias grows with the radius, too,
so that it is at most doubled. relMSE after 5 CPU seconds with twice the radius over that with the usual one, gather
with the cache, where that holds 0.2 to 2.4 photons in the mean: office 0.40 of what is no reference's noise,
rooms_10x10 0.68, skylight_room 0.8, a coated ball under a sky (file) 0.82, colonnade 0.87, five lamps over plates
(file) 0.99; with four times 0.27, 0.81, 0.87, 0.65, 0.92 and 1.04. Of scenes where it holds 4 to 11, a hall had 0.93, a
living room 0.99 and a staircase 1.13 with twice the radius (files, 8 CPU seconds).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.auto.candidates import Candidate
from pmviewer.engine.auto.measured import Widths
from pmviewer.engine.radius import FirstRadii
from pmviewer.settings.access import SETTINGS, Settings

HELD = 4
"""Other photons of a pass with the default N that a look-up around one holds in three of four places, or it is made
wider."""
LEAST, MOST = 1.1, 2.0
"""How much wider is worth a word, and how much it may be."""
SECONDS = 10.0
"""For longer, less wide: of n passes noise falls with n and squared bias goes with r², so that r⁴ ∝ 1/n is best."""
PROBES = 512
"""Photons that are looked around."""


def wider_by(positions: NDArray[np.float32], N: int, usual: float, seconds: float = 0.0) -> float:
    """How many times as wide as that radius, in scene units, look-ups are to be for so many CPU seconds, from photons
    of N trajectories at positions (n, 3); 1 where it does, or where there are no photons."""
    if len(positions) <= HELD:
        return 1.0
    from scipy.spatial import cKDTree  # takes a moment, and is needed once a trial

    probes = positions[:: -(-len(positions) // PROBES)]
    found, _ = cKDTree(positions).query(probes, k=[HELD + 1])  # the nearest is the photon itself
    apart = float(np.quantile(found, 0.75)) * math.sqrt(N / SETTINGS["photons.N"].default)
    wider = min(apart / usual, MOST) * (SECONDS / max(seconds, SECONDS)) ** 0.25
    return wider if wider >= LEAST else 1.0


def with_wider(candidate: Candidate, settings: Settings, first: FirstRadii, wider: float) -> Candidate:
    """The way to gather with look-ups in the global map so many times as wide as by the automatic radius. Those of
    caustics stay. settings: the candidate's; first: its radii, relative to the scene."""
    values = Widths(shown=wider).values(settings, first)
    said = f"photons lie far apart: look-ups of gather rays {wider:.2g} times as wide as usual (estimate.radius)"
    return candidate.having(values, said)
