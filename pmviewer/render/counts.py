"""What kernels count in a pass. A file of its own, since what kernels import decides when they are compiled again: not
when a setting or the description of scenes has changed."""

from __future__ import annotations

N_COUNTS = 7
C_RAYS, C_SHADOW_RAYS, C_DROPPED, C_SAVED, C_CACHED, C_GATHERED, C_CUT = range(N_COUNTS)
"""All rays, those of them that test visibility towards a light sample, samples dropped, and shadow rays not cast,
because shadow photons know; with an irradiance cache, surface points that it served and those that gathered
themselves; paths from the camera that `max_depth` ended."""
