"""`python scenes/make [--to FOLDER] [NAME …]`: write scene.xml, meshes and scene.toml of the scenes."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

if __package__ in (None, ""):  # run as a folder
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from make.catalogue import SCENES
from make.document import write_scene


def main() -> None:
    """Write the scenes asked for, all by default, and say where."""
    parser = argparse.ArgumentParser(
        prog="python scenes/make", description="Write the bundled scenes that are made from formulas."
    )
    parser.add_argument("--to", type=Path, default=Path(__file__).resolve().parents[1], help="folder of the scenes")
    parser.add_argument("names", nargs="*", help="scenes to write, all by default")
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.names) - SCENES.keys())
    if unknown:
        parser.error(f"there is no scene {', '.join(unknown)}; there are {', '.join(SCENES)}")
    for name in arguments.names or SCENES:
        folder = write_scene(arguments.to / name, SCENES[name]())
        size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
        print(f"{folder}: {size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
