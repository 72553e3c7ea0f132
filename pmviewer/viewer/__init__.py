"""The window: viewport, overlays, panels and camera controls. The only package that knows OpenGL and Dear ImGui."""
