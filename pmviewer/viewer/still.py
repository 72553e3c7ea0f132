"""A picture at another size than the window's: rendered beside the session, with the legend of its view."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pmviewer.errors import PmviewerError, SettingError
from pmviewer.settings.access import Settings, with_values
from pmviewer.viewer.background import FILMS, Background, Work
from pmviewer.viewer.session_link import SessionLike

if TYPE_CHECKING:  # numba, which the window doesn't wait for
    from pmviewer.engine.frame import Frame
    from pmviewer.engine.pool import WorkPool

LARGEST = 16384


@dataclass
class Still:
    """What the next one is like; the height follows the width."""

    width: int = 1920
    passes: int = 64
    legend: bool = True
    format: str = ".png"

    def height(self, aspect: float) -> int:
        """For a picture of that width over height."""
        return min(max(round(self.width / aspect), 1), LARGEST)


class StillExport:
    """One at a time is rendered; further ones wait for it, as films do."""

    def __init__(self, session: SessionLike, background: Background) -> None:
        self.still = Still()
        self._session = session
        self._background = background
        self._work: Work | None = None

    def export(self, path: Path, aspect: float, view: str) -> None:
        """Render the scene by the present settings at that size and write the view, or all layers for EXR. Raises
        SettingError."""
        from pmviewer.engine.pool import WorkPool

        still, opened = self.still, self._session.opened_scene
        if opened is None:
            raise SettingError("There is nothing to export yet: open a scene first.")
        size = {"camera.width": still.width, "camera.height": still.height(aspect), "render.passes": still.passes}
        settings = with_values(self._session.settings, {**size, "display.view": view, "compare.mode": "off"})
        legend, pool = still.legend, WorkPool(self._session.threads, behind_window=True)
        work: list[Work] = []

        def run() -> str:
            return _render(path, opened, settings, legend, pool, work[0])

        title = f"rendering {still.width} × {still.height(aspect)}"
        work.append(Work(title, FILMS, run, pool.cancel.set))
        self._work = self._background.take(work[0])


def _render(path: Path, opened: Any, settings: Settings, legend: bool, pool: WorkPool, work: Work) -> str:
    from pmviewer.engine.pool import lower_priority
    from pmviewer.engine.series.render import series
    from pmviewer.output.frame_export import write_frame_exr

    def tell(text: str, share: float) -> None:
        work.share = share

    lower_priority()
    try:
        (frame,) = series(opened, [settings], pool, tell)
        if path.suffix.lower() == ".exr":
            write_frame_exr(path, frame)
        else:
            _write_png(path, frame, legend)
    except MemoryError:
        raise PmviewerError("Not enough memory for a picture of that size.") from None
    finally:
        pool.close()
    return f"wrote {path.absolute()}"


def _write_png(path: Path, frame: Frame, legend: bool) -> None:
    from pmviewer.output.diagnostic_views import DIAGNOSTICS
    from pmviewer.output.false_look import look_of
    from pmviewer.output.frame_export import frame_texts, shown_pixels
    from pmviewer.output.legend_sheet import with_legend
    from pmviewer.output.png import write_png
    from pmviewer.output.tone import to_uint8

    display = frame.settings.display
    pixels = to_uint8(shown_pixels(frame, display.view, display))
    if legend and display.view in DIAGNOSTICS:
        pixels = with_legend(pixels, display.view, frame.image(display.view), look_of(display))
    write_png(path, pixels, frame_texts(frame))
