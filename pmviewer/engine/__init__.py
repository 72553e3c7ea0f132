"""Stages, the session that runs them in the background, and the frames it publishes."""
