"""What is in the world: descriptions, loaders, analysis and flattening into arrays."""
