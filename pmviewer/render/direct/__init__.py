"""Direct light: which lights are sampled, and which shadow rays are spared."""
