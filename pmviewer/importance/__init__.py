"""Visual importance: importons from the camera, and what they ask of the photons."""
