"""What two pictures differ by, as rows of text: figures first, then settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pmviewer.settings.access import SETTINGS, Settings, flat
from pmviewer.viewer.format import duration, grouped, si
from pmviewer.viewer.sides import Side
from pmviewer.viewer.value_text import value_text

NOT_COMPARED = ("compare.", "display.", "overlays.")
"""Settings that make no other picture."""
UNKNOWN = "–"
_FIGURES: tuple[tuple[str, str, Callable[[float], str]], ...] = (
    ("Passes", "passes", lambda v: grouped(int(v))),
    ("CPU time", "cpu_seconds", duration),
    ("Rendering time", "seconds", duration),
    ("Photons emitted", "photons_emitted", lambda v: grouped(int(v))),
    ("Photons stored, caustic", "photons_stored.caustic", lambda v: grouped(int(v))),
    ("Photons stored, global", "photons_stored.global", lambda v: grouped(int(v))),
    ("Radius, caustic", "radius.caustic", lambda v: si(v, "m")),
    ("Radius, global", "radius.global", lambda v: si(v, "m")),
    ("Rays", "rays", lambda v: grouped(int(v))),
)


@dataclass(frozen=True)
class Row:
    """What, of A, of B, and A over B where both are numbers."""

    name: str
    a: str
    b: str
    ratio: str = ""


def figure_rows(a: Side, b: Side, errors: tuple[float | None, float | None]) -> list[Row]:
    """relMSE against the reference and the counts that either picture has; those that are 0 in both are left out."""
    rows = [Row("Size", *(f"{w}×{h}" for w, h in (a.size, b.size)))]
    if errors != (None, None):
        rows.append(_row("relMSE", errors, lambda v: f"{v:.3e}"))
    for name, key, text in _FIGURES:
        values = a.fact(key), b.fact(key)
        if any(values):
            rows.append(_row(name, values, text))
    return rows


def _row(name: str, values: tuple[float | None, float | None], text: Callable[[float], str]) -> Row:
    a, b = (UNKNOWN if value is None else text(value) for value in values)
    ratio = f"{values[0] / values[1]:.3g}" if values[0] is not None and values[1] else ""
    return Row(name, a, b, ratio)


def setting_rows(a: Side, b: Side) -> list[Row]:
    """Settings that differ; none where those of either picture aren't known."""
    if a.settings is None or b.settings is None:
        return []
    return [
        Row(path, *(value_text(SETTINGS[path], value) for value in values))
        for path, values in differing(a.settings, b.settings).items()
    ]


def differing(a: Settings, b: Settings) -> dict[str, tuple[object, object]]:
    """Values that differ of settings that make another picture, by full name."""
    one, other = flat(a), flat(b)
    return {
        path: (value, other[path])
        for path, value in one.items()
        if value != other[path] and not path.startswith(NOT_COMPARED)
    }
