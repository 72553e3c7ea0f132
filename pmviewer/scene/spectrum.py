"""The spectrum that paths draw their wavelengths from: wavelengths and their colours (T10)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.bsdf.kinds import BANDS, SPECTRUM_NODES
from pmviewer.scene.cie import colours_in_daylight
from pmviewer.scene.dispersion import LONGEST, SHORTEST, Dispersion

Float = NDArray[np.float64]


@lru_cache(maxsize=1)
def spectrum() -> Float:
    """Wavelengths in nm and their linear sRGB (SPECTRUM_NODES, 4) over a uniform number u from 0 to 1, to be joined by
    straight lines.

    White light has the spectrum of daylight (D65), as elsewhere (`pmviewer.scene.cie`). The colour of a single
    wavelength lies outside sRGB: its negative channels are set to 0, and each channel is scaled so that its mean is 1,
    so that all wavelengths together are white. The density of u is the mean of the three channels: each colour's
    channels have the sum 3.
    """
    nm = np.arange(SHORTEST, LONGEST + 0.05, 0.1)
    colours = np.maximum(colours_in_daylight(nm), 0.0)
    colours /= colours.mean(axis=0)
    share = colours.mean(axis=1)
    steps = np.concatenate([[0.0], np.cumsum((share[1:] + share[:-1]) / 2)])
    at = np.interp(np.linspace(0, 1, SPECTRUM_NODES), steps / steps[-1], nm)
    table = np.stack([np.interp(at, nm, colours[:, k]) for k in range(3)], axis=1)
    table *= 3 / table.sum(axis=1, keepdims=True)
    table /= over_spectrum(table)
    result = np.column_stack([at, table])
    result.setflags(write=False)
    return result


def over_spectrum(values: Float) -> Float:
    """Mean over u of values (SPECTRUM_NODES, …) that are joined by straight lines."""
    inner: Float = values[1:-1].sum(axis=0)
    return (inner + (values[0] + values[-1]) / 2) / (len(values) - 1)


def indices(dispersion: Dispersion, eta: float) -> Float:
    """Index (SPECTRUM_NODES,) over the spectrum relative to an outside against which n_d is eta."""
    return dispersion.index(spectrum()[:, 0]) * (eta / dispersion.n_d)


def channel_indices(dispersion: Dispersion, eta: float) -> tuple[float, float, float]:
    """Mean relative index of each channel's light."""
    r, g, b = over_spectrum(spectrum()[:, 1:] * indices(dispersion, eta)[:, None]).tolist()
    return r, g, b


def of_bands(bands: NDArray[np.integer]) -> Float:
    """Wavelengths in nm at the middle of bands (BANDS), NaN for band 0."""
    u = (np.asarray(bands, np.float64) - 0.5) / BANDS
    nm = np.interp(u, np.linspace(0, 1, SPECTRUM_NODES), spectrum()[:, 0])
    return np.where(np.asarray(bands) > 0, nm, np.nan)


def shown_colours() -> Float:
    """Colours (BANDS, 3) of the bands for a screen, each as bright as it can be, gamma-encoded."""
    u = (np.arange(BANDS) + 0.5) / BANDS
    nodes = np.linspace(0, 1, SPECTRUM_NODES)
    table = np.stack([np.interp(u, nodes, spectrum()[:, k]) for k in (1, 2, 3)], axis=1)
    shown: Float = (table / table.max(axis=1, keepdims=True)) ** (1 / 2.2)
    return shown
