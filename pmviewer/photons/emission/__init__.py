"""Guided emission: strata of the lights, test photons, shares."""
