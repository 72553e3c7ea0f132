"""The final gather: directions, guides, the irradiance cache, and gathering again in corners."""
