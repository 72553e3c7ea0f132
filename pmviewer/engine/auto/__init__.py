"""Automatic mode: which way of rendering suits a scene and the time that there is, found by a short measured trial."""
