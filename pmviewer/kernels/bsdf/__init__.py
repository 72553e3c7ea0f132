"""Materials: one interface (`scattering`), three implementations of it, one file for each model."""
