"""Which photons are stored, with which power, and what became of the others."""
