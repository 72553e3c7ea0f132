"""How far a look-up reaches: the automatic largest radius (M3) and the shrinking radius of progressive passes (E6)."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.photon_words import decode_powers

_SAMPLE, _PROBES = 16384, 64
_f4 = np.float32
_u4 = np.uint32


@kernel
def _largest_luminance(words):
    """Largest luminance (Rec. 709) of the power of photons (n, 6), seen as uint32, in units of the map's power."""
    largest = _f4(0.0)
    for i in range(len(words)):
        red, green, blue = decode_powers(words[i, 4], words[i, 5])
        largest = max(largest, _f4(0.2126) * red + _f4(0.7152) * green + _f4(0.0722) * blue)
    return largest


def largest_power(photons: np.ndarray, power_unit: float) -> float:
    """Φ_max, the largest luminance of a power among photons (n, 6), in watts; 0 for an empty map."""
    photons = np.require(photons, np.float32, ["C", "W"])
    return float(_largest_luminance(photons.view(np.uint32))) * power_unit


def automatic_radius(k: int, phi_max: float, threshold: float) -> float:
    """Largest radius that a look-up of k photons needs: r_m = (1/π)·sqrt(k·Φ_max / L_t).

    Where k photons of the largest power Φ_max fill a disc of this radius, a white diffuse surface reflects the radiance
    L = k·Φ_max / (π·π·r²) = L_t; whatever needs a wider disc is darker than the threshold L_t (about 0.05 of display
    white after exposure), and looking no further changes nothing that can be seen (course guide §5.2).
    0 for an empty map or a map without power.
    """
    return math.sqrt(k * phi_max / threshold) / math.pi


def automatic_volume_radius(k: int, phi_max: float, sigma_s: float, threshold: float) -> float:
    """Largest radius that a look-up of k photons in a medium needs: r_m = ∛(3·k·Φ_max / (16·π²·σ_s·L_t)).

    Where k photons of the largest power Φ_max fill a ball of this radius, a medium that scatters alike in all
    directions sends on k·Φ_max / (4π·(4/3)·π·r³) per length, of in-scattered radiance L_t times σ_s (the source's form
    for volumes). Infinite where nothing scatters.
    """
    return math.cbrt(3 * k * phi_max / (16 * math.pi**2 * sigma_s * threshold)) if sigma_s > 0 else math.inf


def neighbourhood(positions: np.ndarray, neighbours: int = 64) -> float:
    """A radius within which about that many photons lie, where they are sparse rather than where they crowd: three
    quarters of them have more. positions: (n, 3). 0 for fewer than two photons.

    Measured at a few photons in a sample of all, both evenly spaced in the order in which they were emitted.
    """
    n = len(positions)
    if n < 2:
        return 0.0
    sample = positions[:: -(-n // _SAMPLE)].astype(np.float64)
    probes = sample[:: -(-len(sample) // _PROBES)]
    rank = min(max(round(neighbours * len(sample) / n), 1), len(sample) - 1)
    squared = ((probes**2).sum(axis=1)[:, None] + (sample**2).sum(axis=1)) - 2 * probes @ sample.T
    return math.sqrt(max(float(np.quantile(np.partition(squared, rank, axis=1)[:, rank], 0.75)), 0.0))


def progressive_radius(r1: float, i: int, alpha: float = 2.0 / 3.0, floor: float = 0.0, delay: float = 0.0) -> float:
    """Radius of pass i = 1, 2, …, without those before it (Knaus & Zwicker 2011, eq. 20).

    From r²_{i+1} = r²_i·(i+d+α)/(i+d+1) follows r²_i = r1²·Γ(i+d+α)·Γ(d+2) / (Γ(d+1+α)·Γ(i+d+1)). The source has
    d = 0; with a `delay` d the radius stays about the same for that many passes, and falls as fast in the end. Never
    less than `floor`.
    """
    log_ratio = math.lgamma(i + delay + alpha) - math.lgamma(delay + 1.0 + alpha)
    log_ratio -= math.lgamma(i + delay + 1.0) - math.lgamma(delay + 2.0)
    return max(r1 * math.exp(0.5 * log_ratio), floor)
