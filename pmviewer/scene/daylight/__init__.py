"""Sun and clear sky: where the sun stands, what it and the sky bring, and both as an image environment."""
