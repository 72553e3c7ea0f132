"""pmviewer: an interactive previewer for photon-mapping global illumination."""

__version__ = "0.1.0"
