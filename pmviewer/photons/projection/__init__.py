"""Projection maps: where photons have to be emitted to meet certain surfaces."""
