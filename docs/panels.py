"""Pictures of every panel at three sizes of the window, for `panels.md`: `xvfb-run -a -s "-screen 0 2560x1440x24"
python docs/panels.py [PANEL …]`."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).parent
SIZES = {"small": "800x600", "usual": "1280x800", "large": "2560x1440@2"}
"""What `pmviewer shot --window-size` is given, and the name in the files."""
PANELS = (
    "Settings", "Scene", "Overlays", "Inspector", "Statistics", "Importance", "Error", "Snapshots", "Comparison",
    "Film", "Log",
)  # fmt: skip
SHOWN = ("cornell_caustic", "--passes", "8", "--pin", "200,250", "--set", "importance.map=average")
"""The scene, with a pixel pinned for the inspector, and importance for its panel."""
WIDTH = 640
"""Of a picture on the page."""


def main() -> None:
    """Make the pictures of the panels asked for, all by default: one for each with its three sizes side by side."""
    unknown = sorted(set(sys.argv[1:]) - set(PANELS))
    if unknown:
        sys.exit(f"there is no panel {', '.join(unknown)}; there are {', '.join(PANELS)}")
    for panel in sys.argv[1:] or PANELS:
        with tempfile.TemporaryDirectory() as folder:
            _make(panel, Path(folder))


def _make(panel: str, folder: Path) -> None:
    shots = []
    for name, size in SIZES.items():
        file = folder / f"{name}.png"
        command = ["pmviewer", "shot", *SHOWN, "--window", "--window-size", size, "--panel", panel, "-o", str(file)]
        subprocess.run([sys.executable, "-m", *command], check=True)
        shots.append(Image.open(file).convert("RGB"))
    for name, shot in zip(SIZES, shots, strict=True):
        height = round(shot.height * WIDTH / shot.width)
        small = shot.resize((WIDTH, height), Image.Resampling.LANCZOS)
        target = DOCS / "images" / "panels" / f"{panel.lower()}-{name}.png"
        target.parent.mkdir(exist_ok=True)
        small.quantize(128, dither=Image.Dither.NONE).save(target, optimize=True)
        print(f"{target.relative_to(DOCS)}: {target.stat().st_size // 1024} KiB", flush=True)


if __name__ == "__main__":
    main()
