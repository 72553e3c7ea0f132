"""Translucent triangles of a colour each, over the picture: cells of directions, a plane."""

from __future__ import annotations

import moderngl

from pmviewer.viewer.gl.program import Drawing, Shaders, set_uniforms


def draw_cells(shaders: Shaders, array: moderngl.VertexArray, drawing: Drawing, opacity: float, depth: bool) -> None:
    """Draw an array for the program "cells"; `depth`: hidden behind surfaces."""
    context = shaders.context
    set_uniforms(shaders.get("cells"), view=drawing.view, projection=drawing.projection, opacity=opacity)
    context.enable_only(moderngl.BLEND | (moderngl.DEPTH_TEST if depth else 0))
    context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
    array.render(moderngl.TRIANGLES)
    context.disable(moderngl.BLEND)
