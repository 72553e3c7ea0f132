"""Makes the bundled scenes from formulas: `python scenes/make` writes them all, bit for bit the same every time."""
