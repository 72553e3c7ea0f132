"""What weak ways from the camera show where the method gathers: the global map, as gather rays do.

Over a coat, or the weaker way at glass, a surface sends the viewer a few percent of its light. To gather there costs as
much as where the viewer looks straight at, and thinning such ways out by roulette gives the rest the more weight. One
look-up in the global map brings all of that light in every pass. Its blur lies under the throughput of a weak way, and
goes with the radius. Near what the coat or glass stands on the map is dark, and its reflection is looked at: short ways
are left to the roulette.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.scattering import STORED, is_plain
from pmviewer.kernels.compile.specialise import has, part, specialised
from pmviewer.render.split import is_weak

CONTACT = np.float32(2.0)
"""Look-up radii that a way to the map is long, at least."""


@specialised
def shows_map(given, si, beta, u, length):
    """Whether `pmviewer.render.reflect.gathered` is what the camera sees of a surface's STORED lobes: after a way with
    the throughput beta and the number u for roulette, whose last ray is that long."""
    if is_plain(part(si, "bsdf")) and not has(part(given, "eye"), "splits"):
        return lambda given, si, beta, u, length: False

    def on_weak_ways(given, si, beta, u, length):
        eye = given.eye
        far = length >= max(eye.corner, CONTACT * eye.global_radius)
        return far and eye.gather_rays > 0 and si.bsdf.groups & STORED != 0 and is_weak(beta, u)

    return on_weak_ways
