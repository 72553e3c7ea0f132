"""Participating media in the pictures: transmittance, in-scattered light, paths that scatter in them."""
