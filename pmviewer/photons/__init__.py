"""The light pass: photons leave the lights, scatter, and are stored."""
