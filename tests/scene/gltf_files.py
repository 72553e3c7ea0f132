"""glTF files for tests, made from arrays."""

import json
import struct
from pathlib import Path

import numpy as np

from pmviewer.scene.description import Mesh, Scene

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
COMPONENTS = {"b": 5120, "B": 5121, "h": 5122, "H": 5123, "I": 5125, "f": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class Gltf:
    """A file that grows: buffers, views, accessors and whatever else the header is to hold."""

    def __init__(self, **parts) -> None:
        self.data = b""
        self.header = {"asset": {"version": "2.0"}, "bufferViews": [], "accessors": [], **parts}

    def view(self, data: bytes, **more) -> int:
        """A buffer view of these bytes."""
        self.data += b"\0" * (-len(self.data) % 4)
        row = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **more}
        self.header["bufferViews"].append(row)
        self.data += data
        return len(self.header["bufferViews"]) - 1

    def accessor(self, count: int, component: str, width: int, **more) -> int:
        """An accessor of no view unless one is given."""
        row = {"componentType": COMPONENTS[component], "count": count, "type": TYPES[width], **more}
        self.header["accessors"].append(row)
        return len(self.header["accessors"]) - 1

    def array(self, values, component: str = "f", **more) -> int:
        """An accessor with these values in a view of its own."""
        array = np.array(values, component)
        array = array.reshape(len(array), -1)
        view = self.view(array.astype(array.dtype.newbyteorder("<")).tobytes())
        return self.accessor(len(array), component, array.shape[1], bufferView=view, **more)

    def mesh(self, primitives: list | dict, **more) -> int:
        """A mesh; a primitive may be just its attributes."""
        rows = [primitives] if isinstance(primitives, dict) else primitives
        rows = [row if "attributes" in row else {"attributes": row} for row in rows]
        self.header.setdefault("meshes", []).append({"primitives": rows, **more})
        return len(self.header["meshes"]) - 1

    def triangle(self, **more) -> int:
        """A mesh of one triangle with these additions to its primitive."""
        attributes = {"POSITION": self.array(TRIANGLE), **more.pop("attributes", {})}
        return self.mesh({"attributes": attributes, **more})

    def write(self, folder: Path, name: str = "a.glb", **parts) -> Path:
        """The file; without nodes, one that shows the first mesh."""
        header = {"nodes": [{"mesh": 0}], **self.header, **parts}
        if isinstance(header["nodes"], list):
            header.setdefault("scenes", [{"nodes": list(range(len(header["nodes"])))}])
        if self.data:
            header.setdefault("buffers", [{"byteLength": len(self.data)}])
        path = folder / name
        if path.suffix == ".gltf":
            path.write_text(json.dumps(header))
            return path
        text = json.dumps(header).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        if self.data:
            chunks += struct.pack("<II", len(self.data), 0x004E4942) + self.data
        path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)
        return path


def meshes(scene: Scene) -> list[Mesh]:
    """The scene's meshes, without what a studio adds."""
    return [s.geometry for s in scene.shapes if isinstance(s.geometry, Mesh)]


def corners(mesh: Mesh) -> list:
    """(n, 3, 3) corners of the triangles, in their order."""
    return np.round(mesh.vertices[mesh.faces], 6).tolist()
