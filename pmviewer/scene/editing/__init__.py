"""Changes to a scene as it was opened: lights, materials and objects, by name."""
