"""Frames along curves."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import kernel


@kernel
def carry_frames(tangents, first, across):
    """A unit vector across each of the unit tangents (n, 3) of curves, whose rings are [first[i], first[i + 1]), turned
    about the curve as little as can be: each is the one before less what lies along the tangent. They become `across`
    (n, 3)."""
    for c in range(len(first) - 1):
        x, y, z = 0.0, 0.0, 0.0
        for i in range(first[c], first[c + 1]):
            tx, ty, tz = tangents[i, 0], tangents[i, 1], tangents[i, 2]
            along = x * tx + y * ty + z * tz
            x, y, z = x - along * tx, y - along * ty, z - along * tz
            length = np.sqrt(x * x + y * y + z * z)
            if not length > 1e-6:
                # None yet, or a turn straight across: any will do.
                if abs(tx) < 0.6:
                    x, y, z = 1.0 - tx * tx, -tx * ty, -tx * tz
                else:
                    x, y, z = -ty * tx, 1.0 - ty * ty, -ty * tz
                length = max(np.sqrt(x * x + y * y + z * z), 1e-300)
            x, y, z = x / length, y / length, z / length
            across[i, 0], across[i, 1], across[i, 2] = x, y, z
