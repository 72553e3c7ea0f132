"""Pictures of every panel at three sizes of the window, for `panels.md`: `xvfb-run -a -s "-screen 0 2560x1440x24"
python docs/panels.py [PANEL …]`."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from PIL import Image

from pmviewer.settings.access import Settings, with_values
from pmviewer.viewer.app import ViewerApp
from pmviewer.viewer.shot import Shot
from pmviewer.viewer.start import start_viewer

DOCS = Path(__file__).parent
SIZES: dict[str, tuple[tuple[int, int], float]] = {
    "small": ((800, 600), 1.0), "usual": ((1280, 800), 1.0), "large": ((2560, 1440), 2.0),
}  # fmt: skip
"""Of the window and the scale of its interface, by the name in the files."""
PANELS = (
    "Settings", "Scene", "Overlays", "Inspector", "Statistics", "Importance", "Error", "Snapshots", "Comparison",
    "Film", "Log",
)  # fmt: skip
SCENE, PINNED = "cornell_caustic", (200, 250)
VALUES = {"render.passes": 8, "importance.map": "average", "display.compile_ahead": False}
"""With importance, for its panel."""
WIDTH = 640
"""Of a picture on the page."""


@dataclass
class Shots(Shot):
    """One picture of the window for each panel, which is in front."""

    waiting: list[str] = field(default_factory=list)

    def _end(self) -> None:
        if self.error is not None or not self.waiting:
            super()._end()
            return
        self.panel = self.waiting.pop(0)
        self.path = self.path.with_name(f"{self.panel}.png")
        self._still = 0
        self._to_the_front()


def main() -> None:
    """Make the pictures of the panels asked for, all by default. Each size has a process of its own: a window's
    interface is set up once."""
    if sys.argv[1:2] == ["--size"]:
        return _window(sys.argv[2], Path(sys.argv[3]), sys.argv[4:])
    unknown = sorted(set(sys.argv[1:]) - set(PANELS))
    if unknown:
        sys.exit(f"there is no panel {', '.join(unknown)}; there are {', '.join(PANELS)}")
    for size in SIZES:
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, __file__, "--size", size, folder, *(sys.argv[1:] or PANELS)]
            subprocess.run(command, check=True)
            for file in sorted(Path(folder).iterdir()):
                _keep(file, DOCS / "images" / "panels" / f"{file.stem.lower()}-{size}.png")


def _window(size: str, folder: Path, panels: list[str]) -> None:
    (window_size, scale), first = SIZES[size], panels[0]
    shots = Shots(folder / f"{first}.png", pinned=PINNED, panel=first, waiting=panels[1:])
    make = partial(ViewerApp, remember=False, shot=shots, window_size=window_size, scale=scale)
    start_viewer(make, SCENE, with_values(Settings(), VALUES), None, {})
    if shots.error is not None:
        raise shots.error


def _keep(file: Path, target: Path) -> None:
    shot = Image.open(file).convert("RGB")
    small = shot.resize((WIDTH, round(shot.height * WIDTH / shot.width)), Image.Resampling.LANCZOS)
    target.parent.mkdir(exist_ok=True)
    small.quantize(64, dither=Image.Dither.NONE).save(target, optimize=True)
    print(f"{target.relative_to(DOCS)}: {target.stat().st_size // 1024} KiB", flush=True)


if __name__ == "__main__":
    main()
