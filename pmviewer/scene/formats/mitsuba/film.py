"""Film elements: the size of the picture, which part of the film it is, and how pixels are reconstructed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from pmviewer.scene.clean import LARGEST_SIDE
from pmviewer.scene.description import PixelFilter
from pmviewer.scene.formats.mitsuba.document import Properties

DEFAULT_SIZE = (768, 576)
WIDEST = 8.0
"""Pixels; the setting of a filter's radius has the same bound."""
_NARROWEST = 0.1
_KNOWN = ("hdrfilm", "ldrfilm", "tiledhdrfilm", "mfilm", "specfilm")


@dataclass(frozen=True)
class Film:
    """`width` × `height` pixels cut out of `full` at the offset `left`, `top`, with a reconstruction filter, None for
    the box."""

    width: int
    height: int
    full: tuple[int, int]
    left: int = 0
    top: int = 0
    filter: PixelFilter | None = None

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
        return Film(*DEFAULT_SIZE, DEFAULT_SIZE, filter=_gaussian(0.5))
    film = Properties(films[0], sensor.document)
    if film.type not in _KNOWN:
        film.document.warn(f"{film.element} is read as an hdrfilm.", film.element)
    chosen = _filter(film)
    default = (1, 1) if film.type == "mfilm" else DEFAULT_SIZE
    width, height = _size(film, film.integer("width", default[0]), film.integer("height", default[1]))
    across, down = film.integer("crop_width", width), film.integer("crop_height", height)
    left, top = film.integer("crop_offset_x", 0), film.integer("crop_offset_y", 0)
    if not (0 <= left < left + across <= width and 0 <= top < top + down <= height):
        film.document.warn(f"The crop window of {film.element} leaves the film: it is ignored.", film.element)
        return Film(width, height, (width, height), filter=chosen)
    return Film(across, down, (width, height), left, top, chosen)


def _filter(film: Properties) -> PixelFilter | None:
    """The film's <rfilter>, a Gaussian where there is none."""
    given = film.objects("rfilter")
    if not given:
        return _gaussian(0.5)
    p = Properties(given[0], film.document)
    kinds: dict[str, Callable[[], PixelFilter]] = {
        "box": lambda: PixelFilter("box", _positive(p, "radius", 0.5)),
        "tent": lambda: PixelFilter("tent", _positive(p, "radius", 1.0)),
        "gaussian": lambda: _gaussian(_positive(p, "stddev", 0.5)),
        "mitchell": lambda: PixelFilter("Mitchell-Netravali", 2.0, (p.number("b", 1 / 3), p.number("c", 1 / 3))),
        "catmullrom": lambda: PixelFilter("Catmull-Rom", 2.0),
        "lanczos": lambda: PixelFilter("Lanczos", float(p.integer("lobes", 3))),
    }
    if p.type not in kinds:
        p.document.warn(f"{p.element} is not known: the box filter replaces it.", p.element)
        return None
    found = kinds[p.type]()
    p.warn_unused()
    radius = min(max(found.radius, _NARROWEST), WIDEST)
    if radius != found.radius:
        what = f"{p.element} can't reach {found.radius:g} pixels far: {radius:g} are taken."
        p.document.warn(what, p.element)
        found = _gaussian(radius / 4) if p.type == "gaussian" else replace(found, radius=radius)
    return found


def _gaussian(deviation: float) -> PixelFilter:
    return PixelFilter("Gaussian", 4 * deviation, (deviation,))


def _positive(p: Properties, name: str, default: float) -> float:
    value = p.number(name, default)
    if value > 0:
        return value
    p.document.warn(f"'{name}' of {p.element} must be above zero: {default:g} replaces it.", p.values[name])
    return default


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
