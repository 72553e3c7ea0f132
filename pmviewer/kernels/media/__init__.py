"""Participating media in kernels: their numbers, boundaries, phase functions and free flights."""
