"""`<texture type="bitmap">` and `checkerboard` as descriptions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmviewer.errors import SceneError
from pmviewer.scene.formats.texture_file import read_picture
from pmviewer.scene.texture import Affine, Bitmap, Checkerboard, Texture

if TYPE_CHECKING:
    from pmviewer.scene.formats.mitsuba.document import Properties

TYPES = ("bitmap", "checkerboard")


def read_texture(p: Properties) -> Texture:
    """The texture of an element of one of `TYPES`. Raises SceneError naming its line."""
    matrix = p.transform("to_uv")
    a, b, d, e = (float(x) for x in matrix[:2, :2].reshape(-1))
    to_uv: Affine = (a, b, float(matrix[0, 3]), d, e, float(matrix[1, 3]))
    if p.type == "checkerboard":
        texture: Texture = Checkerboard(
            p.bounded_colour("color0", 0.4, None), p.bounded_colour("color1", 0.2, None), to_uv
        )
        p.warn_unused()
        return texture
    raw = p.boolean("raw", False)
    name = p.string("filename", "")
    if not name:
        raise p.document.error(f"{p.element} needs a 'filename'.", p.element)
    path = p.document.file(name, p.element)
    key = (str(path), raw)
    if key not in p.document.pictures:
        try:
            pixels, sentence = read_picture(path, path.name, raw)
        except SceneError as error:
            raise p.document.error(error.what, p.element, error.hint) from None
        if sentence:
            p.document.warn(sentence, p.element)
        p.document.pictures[key] = pixels
    wrap = p.choice("wrap_mode", ("repeat", "mirror", "clamp"))
    filter = p.choice("filter_type", ("bilinear", "nearest"))
    p.known("accel", "format")
    p.warn_unused()
    return Bitmap(p.document.pictures[key], wrap, filter, to_uv, name=path.name)  # type: ignore[arg-type]
