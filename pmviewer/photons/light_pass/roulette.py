"""Russian roulette that keeps photon weights alike (T3): who survives a scattering, and how many photons are stored.

A photon's power before and after a scattering is Φ and Φ'; a survivor's is Φ' over the probability of surviving, so
that every rule is right in the mean. Powers are in units of what photons have when they leave the lights, whose
luminance Y is 1.

===============  ========================  ======================================================
rule             probability of surviving  what all photons have in common
===============  ========================  ======================================================
luminance        Y(Φ')/Y(Φ), at most 1     Y = 1, unless a scattering weighs more than 1
channel maximum  max Φ'/max Φ, at most 1   the largest channel; no channel ever grows beyond it
equal            Y(Φ'), at most 1          Y = 1, always
===============  ========================  ======================================================

The first is that of Pharr §0.2.2, the second of the course guide §2.1.2. "equal" is rejection sampling (Pharr, exercise
0.1): a direction proposed by the BSDF's sampling is accepted with its weight as probability, which gives accepted ones
exactly the distribution of f·cos. A weight above 1, from sampling that does not quite match its BSDF (for diffuse
surfaces, mirrors and smooth glass it does), can't be a probability: such a photon travels on with Y > 1, is stored as
⌊Y⌋ photons of Y = 1 or, with probability Y − ⌊Y⌋, as one more, and gets rid of the excess at its next scattering.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.vector import largest, luminance

RULES = ("luminance", "channel maximum", "equal")
"""Names of the rules; a rule's id is its place here."""
BY_LUMINANCE, BY_CHANNEL, EQUAL = range(len(RULES))

MOST_COPIES = 4
"""A photon is stored as at most so many; beyond that its copies weigh more."""

_f4 = np.float32


@device
def survival_probability(rule, before, beta, after):
    """Probability with which a photon survives the scattering from power `beta`, of luminance `before`, to `after`."""
    if rule == BY_CHANNEL:
        return min(largest(after) / largest(beta), _f4(1.0))
    if rule == EQUAL:
        return min(luminance(after), _f4(1.0))
    return min(luminance(after) / before, _f4(1.0))


@device
def copies(beta, u):
    """How many photons of equal luminance stand for the power beta, 0 … MOST_COPIES, and the factor for their power.

    Right in the mean over u in [0, 1).
    """
    Y = luminance(beta)
    if not _f4(0.0) < Y:
        return 0, _f4(0.0)
    if _f4(MOST_COPIES) < Y:
        return MOST_COPIES, _f4(1.0) / _f4(MOST_COPIES)
    return min(np.int64(np.floor(Y + u)), MOST_COPIES), _f4(1.0) / Y
