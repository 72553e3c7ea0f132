"""Readers of scene files, one folder or file a format."""
