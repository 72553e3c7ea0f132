"""`python scenes/make/preview.py [NAME …]`: render preview.png of scenes with the program itself."""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

SIZE = 256
"""Longer side of a preview in pixels."""


def preview(folder: Path, passes: int, method: str, settings: list[str]) -> None:
    """Render the scene at its own size and write a picture of at most SIZE pixels a side."""
    from PIL import Image

    with tempfile.TemporaryDirectory() as scratch:
        picture = Path(scratch) / "preview.png"
        command = [sys.executable, "-m", "pmviewer", "render", str(folder), "-o", str(picture), "--passes", str(passes)]
        for setting in ("photons.N=500000", f"render.method={method}", *settings):
            command += ["--set", setting]
        subprocess.run(command, check=True)
        with Image.open(picture) as image:
            small = image.convert("RGB")
            small.thumbnail((SIZE, SIZE), Image.Resampling.LANCZOS)
            small.save(folder / "preview.png", optimize=True)


def main() -> None:
    """Render the scenes asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="+", help="scenes")
    parser.add_argument("--passes", type=int, default=48)
    parser.add_argument("--method", default="gather", help="gather is smoothest; path shows what photons don't find")
    parser.add_argument("--set", action="append", default=[], dest="settings", help="settings besides")
    arguments = parser.parse_args()
    for name in arguments.names:
        preview(Path(__file__).resolve().parents[1] / name, arguments.passes, arguments.method, arguments.settings)


if __name__ == "__main__":
    main()
