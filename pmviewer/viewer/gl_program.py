"""Shader programs from the files in `shaders/`."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import WindowError
from pmviewer.resources import data_folder


def load_program(context: moderngl.Context, name: str) -> moderngl.Program:
    """Compile and link `shaders/NAME.vert` and `.frag`. Raises WindowError with the driver's message."""
    folder = data_folder("shaders")
    try:
        return context.program(
            vertex_shader=(folder / f"{name}.vert").read_text(encoding="utf-8"),
            fragment_shader=(folder / f"{name}.frag").read_text(encoding="utf-8"),
        )
    except moderngl.Error as error:
        raise WindowError(f"The OpenGL driver refused the shader '{name}': {error}") from None


def set_uniforms(program: moderngl.Program, **values: Any) -> None:
    """Set uniforms by name; row-major (4, 4) arrays become column-major ones. Uniforms that the driver removed because
    they are unused are skipped."""
    for name, value in values.items():
        uniform = program.get(name, None)
        if not isinstance(uniform, moderngl.Uniform):
            continue
        if isinstance(value, np.ndarray) and value.shape == (4, 4):
            uniform.write(column_major(value))
        elif isinstance(value, np.ndarray):
            uniform.write(np.ascontiguousarray(value, np.float32).tobytes())
        else:
            uniform.value = value


def column_major(matrix: NDArray[np.floating]) -> bytes:
    """OpenGL's order of a row-major (4, 4) matrix, as float32."""
    return np.ascontiguousarray(matrix.T, np.float32).tobytes()
