"""Measuring: error against time, throughput, the papers' ratios, and how results are reported."""
