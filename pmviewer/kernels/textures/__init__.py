"""Textures at a hit: bitmaps, noise, coordinates, and the frames of bump and normal maps."""
