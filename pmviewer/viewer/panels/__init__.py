"""The docked panels and bars around the picture."""
