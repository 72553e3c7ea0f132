"""Lights: one interface (`light`), one file for each further kind."""
