"""Shader programs from the files in `shaders/`, and what everything that is drawn over the picture is told."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import WindowError
from pmviewer.output.false_look import Look
from pmviewer.render.camera import Matrix
from pmviewer.resources import data_folder

DEFAULT_LOOK = Look()


@dataclass(frozen=True)
class Drawing:
    """Where things are drawn over the picture: into the bound framebuffer, whose depth buffer holds the surfaces if
    any of them hides behind surfaces. `viewport` is the picture's width and height in pixels, `pixel_ratio` scales
    widths (HiDPI), `limit` is the most points of a cloud, None as many as the user wants, `look` the false
    colours."""

    view: Matrix
    projection: Matrix
    viewport: tuple[int, int]
    pixel_ratio: float = 1.0
    limit: int | None = None
    look: Look = DEFAULT_LOOK


class Shaders:
    """Programs of a context by name, each compiled when it is first used and freed in the frame that leaves it without
    vertices: with Mesa a program takes a megabyte and more."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self._programs: dict[str, moderngl.Program] = {}
        self._arrays: list[moderngl.VertexArray] = []
        self._has_compiled = self._has_dropped = False

    def get(self, name: str, constants: Callable[[], Mapping[str, Any]] = dict) -> moderngl.Program:
        """The program of that name; `constants` gives its uniforms that never change. Raises WindowError."""
        if name not in self._programs:
            program = self._programs[name] = load_program(self.context, name)
            self._has_compiled = True
            set_uniforms(program, **constants())
        return self._programs[name]

    def array(self, name: str, content: Sequence[tuple[Any, ...]]) -> moderngl.VertexArray:
        """Vertices for the program of that name, as moderngl's buffers with their layout and attributes, until they
        are dropped. Raises WindowError."""
        made = self.context.vertex_array(self.get(name), list(content))
        self._arrays.append(made)
        return made

    def drop(self, array: moderngl.VertexArray) -> None:
        """Free vertices."""
        self._arrays = [one for one in self._arrays if one is not array]
        self._has_dropped = True
        array.release()

    def rest(self) -> None:
        """Once per window frame, after drawing: free the programs that have no vertices any more, and what the driver's
        compiler holds once it has compiled. With Mesa that is six megabytes, and the next program takes 13 ms more."""
        if self._has_dropped:
            self._has_dropped = False
            drawn = [array.program for array in self._arrays]
            for name, program in list(self._programs.items()):
                if not any(program is one for one in drawn):
                    self._programs.pop(name).release()
        if self._has_compiled:
            self._has_compiled = False
            _release_compiler()

    def release(self) -> None:
        """Free what lies on the GPU."""
        for array in self._arrays:
            array.release()
        self._arrays.clear()
        for program in self._programs.values():
            program.release()
        self._programs.clear()


def _release_compiler() -> None:
    """OpenGL's glReleaseShaderCompiler, which moderngl does not have; nothing where the driver has none."""
    import glfw  # after imgui_bundle, which brings its library along

    address = glfw.get_proc_address("glReleaseShaderCompiler")
    if address:
        ctypes.CFUNCTYPE(None)(ctypes.cast(address, ctypes.c_void_p).value or 0)()


def load_program(context: moderngl.Context, name: str) -> moderngl.Program:
    """Compile and link `shaders/NAME.vert`, `.frag` and, if there is one, `.geom`. Raises WindowError with the driver's
    message."""
    folder = data_folder("shaders")
    geometry = folder / f"{name}.geom"
    try:
        return context.program(
            vertex_shader=_source(folder / f"{name}.vert"),
            fragment_shader=_source(folder / f"{name}.frag"),
            geometry_shader=_source(geometry) if geometry.exists() else None,
        )
    except moderngl.Error as error:
        raise WindowError(f"The OpenGL driver refused the shader '{name}': {error}") from None


def _source(path: Path) -> str:
    """The shader's text; a line `#include "FILE"` stands for a file beside it."""
    lines = path.read_text(encoding="utf-8").splitlines()
    prefix = '#include "'
    return "\n".join(
        _source(path.parent / line[len(prefix) : -1]) if line.startswith(prefix) else line for line in lines
    )


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
