"""Small scene files for the tests of this folder."""

from __future__ import annotations

from pathlib import Path

from pmviewer.scene.description import Scene
from pmviewer.scene.load import load_scene

CAMERA = (
    '<sensor type="perspective"><float name="fov" value="40"/><transform name="to_world">'
    '<lookat origin="0 0 5" target="0 0 0" up="0 1 0"/></transform></sensor>'
)
SKY = '<emitter type="constant"><rgb name="radiance" value="1"/></emitter>'


def xml_file(folder: Path, *lines: str, version: str = "3.0.0") -> Path:
    """A scene file with one element a line; the first is in line 2."""
    path = folder / "test.xml"
    path.write_text(f'<scene version="{version}">\n' + "\n".join(lines) + "\n</scene>\n", "utf-8")
    return path


def load(
    folder: Path, *lines: str, camera: str = CAMERA, sky: str = SKY, version: str = "3.0.0", **parameters: str
) -> Scene:
    """The scene with these elements, a camera and a sky. Elements start in line 2."""
    return load_scene(xml_file(folder, *lines, camera, sky, version=version), parameters)
