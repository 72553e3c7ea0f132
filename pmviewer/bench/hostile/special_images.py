"""Pictures that are bombs, or that say they have more pixels than they can."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from functools import partial

from pmviewer.bench.hostile.bombs import zeros
from pmviewer.bench.hostile.seeds import TEXTURED, exr, hdr, png, scene
from pmviewer.bench.hostile.special import Files, Maker, Special

_WINDOW = struct.pack("<4i", 0, 0, 7, 3)
"""Of `seeds.exr`."""
_SIZE = b"-Y 4 +X 8"
"""Of `seeds.hdr`."""


def specials() -> list[tuple[str, Maker]]:
    """All of this kind."""
    side = 30_000
    table: list[tuple[str, str, Callable[[], bytes]]] = [
        ("PNG of 2^31 pixels a side", "tex.png", lambda: png(2**31 - 1, 2**31 - 1, zlib.compress(b"\0"))),
        ("PNG of no pixels", "tex.png", lambda: png(0, 0, zlib.compress(b""))),
        ("PNG bomb", "tex.png", lambda: png(side, side, zeros(side * (3 * side + 1)))),
        ("PNG text bomb", "tex.png", _text_bomb),
        ("HDR of 10^10 pixels", "sky.hdr", lambda: hdr().replace(_SIZE, b"-Y 100000 +X 100000")),
        ("HDR of negative size", "sky.hdr", lambda: hdr().replace(_SIZE, b"-Y -4 +X 8")),
        ("HDR without end of header", "sky.hdr", lambda: b"#?RADIANCE\n" + b"A=1\n" * 500_000),
        ("EXR of 10^10 pixels", "sky.exr", lambda: _exr(0, 0, 99_999, 99_999)),
        ("EXR inside out", "sky.exr", lambda: _exr(7, 3, -(2**31), 2**31 - 1)),
        ("EXR attribute of 4 GiB", "sky.exr", lambda: exr()[:23] + b"\xff" * 4 + exr()[27:]),
    ]
    return [(name, partial(_made, picture, content)) for name, picture, content in table]


def _made(picture: str, content: Callable[[], bytes]) -> Special:
    sky = picture if picture.startswith("sky") else "sky.hdr"
    files: Files = {"scene.xml": scene(TEXTURED.format(sky=sky)), "tex.png": png(), "sky.hdr": hdr()}
    return Special(f"{picture[-3:].upper()} image", "scene.xml", files | {picture: content()})


def _exr(*window: int) -> bytes:
    return exr().replace(_WINDOW, struct.pack("<4i", *window))


def _text_bomb() -> bytes:
    picture, body = png(), b"Comment\0\0" + zeros(1 << 30)
    chunk = struct.pack(">I", len(body)) + b"zTXt" + body + struct.pack(">I", zlib.crc32(b"zTXt" + body))
    return picture[:33] + chunk + picture[33:]
