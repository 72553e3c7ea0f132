"""Meshes as arrays before kernels see them: displacement, smoothing, bounds, places."""
