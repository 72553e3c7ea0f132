"""The share of light that the STORED lobes of a material throw back, as one number: luminance."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.plain import STORED
from pmviewer.kernels.bsdf.scattering import bsdf_sample, is_lambertian, is_plain
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import specialised
from pmviewer.kernels.vector import luminance

_f4 = np.float32
ACROSS = 4
"""Samples of a lobe along each of its numbers."""


@specialised
def stored_albedo(scene, b, wo):
    """∫ of the luminance of f·|cos| over the directions of the STORED lobes seen from wo; at most 1.

    Exact where they are Lambertian. Otherwise a sum over fixed samples, within some percent: always the same for the
    same BSDF and direction, which is what its users need (`pmviewer.maps.virtual_lights`).
    """
    if is_plain(b):
        return lambda scene, b, wo: luminance(b.albedo)

    def any_bsdf(scene, b, wo):
        if is_lambertian(b):
            return luminance(b.albedo)
        return min(_sampled(scene, b, wo), _f4(1.0))

    return any_bsdf


@device
def _sampled(scene, b, wo):
    total = _f4(0.0)
    n = _f4(ACROSS)
    for i in range(ACROSS):
        for j in range(ACROSS):
            u, v = (_f4(i) + _f4(0.5)) / n, (_f4(j) + _f4(0.5)) / n
            lobe = (_f4((i + 2 * j) % ACROSS) + _f4(0.5)) / n  # each lobe at each u and at each v
            _, weight, _, _ = bsdf_sample(scene, b, STORED, wo, lobe, u, v)
            total += luminance(weight)
    return total / (n * n)
