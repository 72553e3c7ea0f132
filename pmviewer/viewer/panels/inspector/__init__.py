"""The tab "Inspector": what made the pinned pixel."""
