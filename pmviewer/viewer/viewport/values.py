"""The value under the mouse, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmviewer.engine.frame import Frame
from pmviewer.output.diagnostic_views import DENOISED, DIAGNOSTICS
from pmviewer.output.difference_views import DIFFERENCES
from pmviewer.viewer.pair import ShownPair

if TYPE_CHECKING:
    from pmviewer.output.compare import Reference
    from pmviewer.viewer.viewport.viewport import Viewport

RADIANCE = "W/(m² sr)"
_UNITS = {"albedo": "", "normal": "", "depth": "m"} | {view: info.unit for view, info in DIAGNOSTICS.items()}


def value_under_mouse(viewport: Viewport) -> str:
    """Pixel and value of what is shown there; nothing beside the picture."""
    pixel, pair = viewport.pixel_under_mouse(), viewport.state.shown_pair()
    if pixel is None:
        return ""
    if pair is not None:
        return f"{pixel[0]}, {pixel[1]}    {_of_pair(viewport, pair, pixel)}"
    frame = viewport.state.frame
    return "" if frame is None else f"{pixel[0]}, {pixel[1]}    {_of_frame(viewport, frame, pixel)}".rstrip()


def _of_pair(viewport: Viewport, pair: ShownPair, pixel: tuple[int, int]) -> str:
    """Of both pictures and their difference; of one that is shown alone, its value."""
    view = pair.display.view
    difference = viewport.state.pair.current(pair)
    if difference is not None:
        info = DIFFERENCES[difference.kind]
        value = f"{difference.values[pixel[1], pixel[0]]:.4g} {info.unit}".rstrip()
        sides = "    ".join(f"{n}: {_numbers(side.image(view), pair, pixel)}" for n, side in zip("AB", pair.sides))
        return f"{difference.kind} {value}    {sides}"
    side = viewport.side_at(pixel)
    if side is None:
        return ""
    letter = "AB"[side is pair.b]
    return f"{letter}: {_numbers(side.image(view), pair, pixel)}  {_UNITS.get(side.layer(view), RADIANCE)}".rstrip()


def _numbers(image: object, pair: ShownPair, pixel: tuple[int, int]) -> str:
    """Channels of a layer at a pixel of A's, which may be finer or coarser."""
    rows, columns = image.shape[:2]  # type: ignore[attr-defined]
    width, height = pair.a.size
    values = image[pixel[1] * rows // height, pixel[0] * columns // width]  # type: ignore[index]
    return "  ".join(f"{value:.4g}" for value in values)


def _of_frame(viewport: Viewport, frame: Frame, pixel: tuple[int, int]) -> str:
    rows, columns = frame.planes.shape[:2]
    x, y = pixel[0] * columns // frame.camera.width, pixel[1] * rows // frame.camera.height
    view = viewport.state.shown_display.view
    if view == "geometry":
        return ""
    reference = viewport.state.comparison.reference
    if view in ("reference", "error") and reference is not None:
        return _compared(frame, reference, view, *pixel)
    from pmviewer.render.planes import view_of

    if view in DIAGNOSTICS:
        info = DIAGNOSTICS[view]
        values = frame.image(view)[y, x]
        if values[0] < 0:
            return info.none
        if info.classes:
            return info.classes[int(values[0])]
        if info.cells:
            return f"cell {int(values[0])}{', beyond the cut-off' if values[0] % 1 else ''}"
    elif view == DENOISED:
        values = frame.image(view)[y, x]
    else:
        values = view_of(frame.planes[y : y + 1, x : x + 1], view)[0, 0]
    return "  ".join(f"{v:.4g}" for v in values) + f"  {_UNITS.get(view, RADIANCE)}"


def _compared(frame: Frame, reference: Reference, view: str, x: int, y: int) -> str:
    from pmviewer.output.compare import pixel_error

    if view == "error":
        return f"error {pixel_error(frame.image(), reference, x, y):.3g}"
    return "  ".join(f"{v:.4g}" for v in reference.image[y, x]) + f"  {RADIANCE}"
