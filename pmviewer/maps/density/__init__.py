"""Density control: photons stored up to a required density."""
