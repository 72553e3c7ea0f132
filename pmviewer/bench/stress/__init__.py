"""Stress suite: the extremes that nobody's scene has until somebody's has. `pmviewer.bench.stress.suite` runs it."""
