"""Finding photons around a point: the grid of one radius, the kd-tree of k nearest."""
