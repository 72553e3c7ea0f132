"""Film elements: the size of the picture, and which part of the film it is."""

from __future__ import annotations

from dataclasses import dataclass

from pmviewer.scene.clean import LARGEST_SIDE
from pmviewer.scene.formats.mitsuba.document import Properties

DEFAULT_SIZE = (768, 576)
_KNOWN = ("hdrfilm", "ldrfilm", "tiledhdrfilm", "mfilm", "specfilm")


@dataclass(frozen=True)
class Film:
    """`width` × `height` pixels cut out of `full` at the offset `left`, `top`."""

    width: int
    height: int
    full: tuple[int, int]
    left: int = 0
    top: int = 0

    @property
    def cropped(self) -> bool:
        """Whether the picture is a part of the film."""
        return (self.width, self.height) != self.full

    def shift(self, offset: tuple[float, float]) -> tuple[float, float]:
        """Where the middle of the picture lies beside the middle of the film moved by `offset` (in sizes of the film,
        to the right and down), in sizes of the picture."""
        x = offset[0] * self.full[0] + self.left + (self.width - self.full[0]) / 2
        y = offset[1] * self.full[1] + self.top + (self.height - self.full[1]) / 2
        return (x / self.width, y / self.height)


def read_film(sensor: Properties) -> Film:
    """The film of a sensor, 768 × 576 without one; sizes that can't be are cut with a warning. What else it says is
    about files and tone curves, which are chosen here by other means."""
    films = sensor.objects("film")
    if not films:
        return Film(*DEFAULT_SIZE, DEFAULT_SIZE)
    film = Properties(films[0], sensor.document)
    if film.type not in _KNOWN:
        film.document.warn(f"{film.element} is read as an hdrfilm.", film.element)
    default = (1, 1) if film.type == "mfilm" else DEFAULT_SIZE
    width, height = _size(film, film.integer("width", default[0]), film.integer("height", default[1]))
    across, down = film.integer("crop_width", width), film.integer("crop_height", height)
    left, top = film.integer("crop_offset_x", 0), film.integer("crop_offset_y", 0)
    if not (0 <= left < left + across <= width and 0 <= top < top + down <= height):
        film.document.warn(f"The crop window of {film.element} leaves the film: it is ignored.", film.element)
        return Film(width, height, (width, height))
    return Film(across, down, (width, height), left, top)


def _size(film: Properties, width: int, height: int) -> tuple[int, int]:
    """At least a pixel, at most 16 384 along each side; larger pictures keep their shape."""
    if 1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE:
        return width, height
    least = max(width, 1), max(height, 1)
    factor = min(1.0, LARGEST_SIDE / max(least))
    size = max(1, round(least[0] * factor)), max(1, round(least[1] * factor))
    what = f"The picture of {film.element} can't be {width} × {height} pixels: it has {size[0]} × {size[1]}."
    film.document.warn(what, film.element)
    return size
