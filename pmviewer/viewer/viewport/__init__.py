"""The panel of the picture: drawing it, moving in it, what lies over it."""
