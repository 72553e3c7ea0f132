"""Checkpoints: a rendering in a file, from which another process goes on bit for bit."""
