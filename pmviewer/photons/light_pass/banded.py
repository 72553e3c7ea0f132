"""Photons are stored with the band of their wavelengths, in scenes with dispersive glass."""

from __future__ import annotations

from pmviewer.kernels.bsdf.dispersion import band_of
from pmviewer.kernels.compile.specialise import absent, specialised
from pmviewer.maps.photon_words import write_banded, write_photon


@specialised
def write_of_wave(rows, row, p, wi, n, power, flags, light, wave):
    """`write_photon` of a photon with that wave (`pmviewer.kernels.bsdf.dispersion`), None in scenes without
    dispersion."""
    if absent(wave):
        return lambda rows, row, p, wi, n, power, flags, light, wave: write_photon(
            rows, row, p, wi, n, power, flags, light
        )
    return lambda rows, row, p, wi, n, power, flags, light, wave: write_banded(
        rows, row, p, wi, n, power, flags, light, band_of(wave)
    )
