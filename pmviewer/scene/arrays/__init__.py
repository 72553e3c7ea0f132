"""From descriptions to the arrays and records that kernels read."""
