"""OpenGL objects that several parts of the window use."""
