"""Mitsuba's XML scenes."""
