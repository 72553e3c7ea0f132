"""Choosing files, and writing them."""
