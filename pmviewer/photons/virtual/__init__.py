"""Virtual lights: the photons that light the picture as point lights."""
