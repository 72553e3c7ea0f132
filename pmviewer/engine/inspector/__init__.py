"""The pixel and photon inspector: what made one pixel, by naive sums over the photons of its look-ups (V4)."""
