"""Indirect light from virtual lights: connections, normalising walks, and the sums that a film keeps."""
