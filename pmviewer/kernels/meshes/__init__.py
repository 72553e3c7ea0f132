"""Compiled passes over meshes and their files, for loaders."""
