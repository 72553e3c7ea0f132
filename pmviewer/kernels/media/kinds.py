"""Kinds of phase functions, for descriptions of scenes and for kernels."""

RAYLEIGH = 2.0
"""In place of Henyey and Greenstein's g: molecules, which scatter forward and backward alike."""
