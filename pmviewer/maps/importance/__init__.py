"""Importance maps: what they store, look-ups, building."""
