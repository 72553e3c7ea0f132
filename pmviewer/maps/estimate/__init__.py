"""Estimates from the photons of one look-up: discs and their filters, hulls, differential checking, any BSDF."""
