"""Photon maps: the photon record, spatial structures over it and the estimates they give."""
