"""Differential testing: random small scenes, rendered by every method and by Mitsuba 3 (`pmviewer bench agree`)."""
