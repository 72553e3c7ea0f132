"""What the light pass counts, and where it books the light's energy."""

from __future__ import annotations

import numpy as np

N_COUNTS = 6
C_GLOBAL, C_CAUSTIC, C_RAYS, C_DROPPED, C_VOLUME, C_PIECES = range(N_COUNTS)
N_LEDGER = 6
E_EMITTED, E_STORED, E_ABSORBED, E_ESCAPED, E_TERMINATED, E_DROPPED = range(N_LEDGER)
"""Energy ledger: luminance of power in units of the map's. What roulette gives a survivor or takes from a victim counts
as absorbed, so that the ledger always balances and each entry is right in the mean. E_STORED is what arrived where
photons are stored, as often as it arrived; the others after E_EMITTED are how a trajectory ends. A photon whose power
becomes infinite or NaN is dropped with the power that it had before."""


def empty_ledger():
    """Ledgers (2, N_LEDGER) of the trajectories that fill the global map and of the others, float64."""
    return np.zeros((2, N_LEDGER))
