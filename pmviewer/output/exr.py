"""OpenEXR files: one channel group per layer, metadata as typed attributes."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.output.files import read_file, write_file

Compression = Literal["none", "rle", "zips", "zip", "piz"]
Value = str | int | float
Layers = dict[str, NDArray[np.float32]]

PREFIX = "pmviewer."
"""Begins the name of every attribute of ours, so that it never collides with a standard one."""
BEAUTY = ""
"""Name of the layer whose channels have no layer name: what every program shows first."""
ALWAYS_FLOAT = ("N", "depth")
"""Layers that half precision would spoil: 11 bits of depth show as steps."""
_COMPONENTS = {1: "Y", 3: "RGB", 4: "RGBA"}
_OWN_COMPONENTS = {"N": "XYZ", "depth": "Z"}
_COMPRESSION = {
    "none": OpenEXR.NO_COMPRESSION,
    "rle": OpenEXR.RLE_COMPRESSION,
    "zips": OpenEXR.ZIPS_COMPRESSION,
    "zip": OpenEXR.ZIP_COMPRESSION,
    "piz": OpenEXR.PIZ_COMPRESSION,
}


def channel_names(layer: str, count: int) -> tuple[str, ...]:
    """Channels of a layer: the normal has `N.X …`, the depth `depth.Z`, any other layer `name.R …` (3), also with
    `name.A` (4), or `name.Y` (1), and those of `BEAUTY` stand without a layer name."""
    components = _OWN_COMPONENTS.get(layer) or _COMPONENTS.get(count, "")
    if len(components) != count:
        raise ValueError(f"layer '{layer}' can't have {count} channels")
    return tuple(f"{layer}.{c}" if layer else c for c in components)


def write_exr(
    path: str | Path,
    layers: Mapping[str, NDArray[Any]],
    metadata: Mapping[str, Value] | None = None,
    half: bool = False,
    compression: Compression = "zip",
) -> None:
    """Write layers of one size as channels of one image.

    Parameters
    ----------
    path: a file ending in .exr.
    layers: (h, w, c) or (h, w) by name; see `channel_names`.
    metadata: attributes; their names get the prefix `pmviewer.`.
    half: 16-bit floats, except for `ALWAYS_FLOAT`; values beyond ±65504 are cut there, so that none becomes infinite.
    compression: one of OpenEXR's lossless ones.

    Raises OutputError; the old file then stays.
    """
    write_file(path, encode_exr(layers, metadata, half, compression), (".exr",))


def encode_exr(
    layers: Mapping[str, NDArray[Any]],
    metadata: Mapping[str, Value] | None = None,
    half: bool = False,
    compression: Compression = "zip",
) -> bytes:
    """The bytes of the file that `write_exr` writes."""
    header: dict[str, Any] = {"compression": _COMPRESSION[compression], "type": OpenEXR.scanlineimage}
    header |= {PREFIX + name: _attribute(value) for name, value in (metadata or {}).items()}
    channels: dict[str, NDArray[Any]] = {}
    for layer, array in layers.items():
        planes = array[..., None] if array.ndim == 2 else array
        for i, name in enumerate(channel_names(layer, planes.shape[2])):
            channels[name] = _channel(planes[..., i], half and layer not in ALWAYS_FLOAT)
    if len({channel.shape for channel in channels.values()}) != 1:
        raise ValueError(f"layers of one file have one size, not {sorted({c.shape for c in channels.values()})}")
    # Into memory, not to the file: the library's own file output doesn't notice a full disk.
    buffer = io.BytesIO()
    OpenEXR.File(header, channels).write(buffer)
    return buffer.getvalue()


def _channel(plane: NDArray[Any], half: bool) -> NDArray[Any]:
    """The library reads memory row by row, whatever the strides say, and knows no float64."""
    if half:
        limit = float(np.finfo(np.float16).max)
        return np.ascontiguousarray(np.clip(plane, -limit, limit), np.float16)
    return np.ascontiguousarray(plane, np.float32)


def _attribute(value: Value) -> Any:
    """Floats as doubles and whole numbers beyond 32 bits too: the library would cut the former to float32 and turn the
    latter into 0."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | np.integer) and -(2**31) <= value < 2**31:
        return int(value)
    if isinstance(value, int | float | np.integer | np.floating):
        return np.array([value], np.float64)
    return str(value)


def read_exr(path: str | Path) -> tuple[Layers, dict[str, Value]]:
    """Layers (h, w, c) float32 by name, the inverse of `write_exr`, and the `pmviewer.` attributes without prefix.

    Files of other programs work too: half or float, `R,G,B` with or without `A`, grey, tiles; the first part of a
    multi-part file. Raises SceneError for a file that is missing, broken or not a plain image.
    """
    return decode_exr(read_file(path), path)


def decode_exr(data: bytes, path: str | Path | None = None) -> tuple[Layers, dict[str, Value]]:
    """The same for a file's content; `path` is for error messages alone."""
    try:
        file = OpenEXR.File(io.BytesIO(data), separate_channels=True)
        header, channels = file.header(), file.channels()
        pixels = {name: np.asarray(channel.pixels) for name, channel in channels.items()}
    except UnicodeDecodeError:
        raise SceneError("This is not a whole OpenEXR file (a name in it is no text).", path) from None
    except (RuntimeError, ValueError, TypeError, OSError, MemoryError) as error:
        raise SceneError(f"This is not a whole OpenEXR file ({error}).", path) from None
    if len({plane.shape for plane in pixels.values()}) != 1 or any(plane.ndim != 2 for plane in pixels.values()):
        raise SceneError("Deep images and subsampled channels can't be read.", path)
    metadata = {n.removeprefix(PREFIX): _value(v) for n, v in header.items() if n.startswith(PREFIX)}
    return _layers(pixels), metadata


def read_reference(path: str | Path) -> NDArray[np.float32]:
    """The beauty image (h, w, 3) of an EXR file; grey is repeated. Raises SceneError."""
    layers, _ = read_exr(path)
    image = layers.get(BEAUTY)
    if image is None or image.shape[2] == 2:
        others = ", ".join(name for name in layers if name)
        raise SceneError(f"The file has no channels R, G, B{f', only the layers {others}' if others else ''}.", path)
    return np.ascontiguousarray(np.repeat(image, 3, axis=2) if image.shape[2] == 1 else image[..., :3])


def _value(value: Any) -> Value:
    if isinstance(value, np.ndarray) and value.size == 1:
        return float(value.reshape(-1)[0])
    return value if isinstance(value, str | int | float) else str(value)


def _layers(pixels: Mapping[str, NDArray[Any]]) -> Layers:
    """Channels by what stands before their last dot. Without a dot, R, G, B, A or a lone Y are the beauty image and
    any other is a layer of its own."""
    groups: dict[str, dict[str, str]] = {}
    for name in pixels:
        prefix, _, component = name.rpartition(".")
        if not prefix and component not in (("R", "G", "B", "A") if "R" in pixels else ("Y",)):
            prefix = component
        groups.setdefault(prefix, {})[component] = name
    layers = {}
    for prefix, components in groups.items():
        # Alphabetical order suits X, Y, Z; colours have their own.
        order = "RGBA" if "R" in components else ""
        chosen = sorted(components, key=lambda c: (order.find(c) if c in order else len(order), c))
        stack = np.stack([pixels[components[c]] for c in chosen], axis=-1)
        layers[prefix] = np.ascontiguousarray(stack, np.float32)
    return layers
