"""Volumes whose headers lie: about sizes, kinds and lengths."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import partial

from pmviewer.bench.hostile.seeds import VOLUME, npy, scene, vol
from pmviewer.bench.hostile.special import Maker, Special

_SHAPE = b"(2, 3, 4)"
"""Of `seeds.npy`."""


def specials() -> list[tuple[str, Maker]]:
    """All of this kind."""
    table: list[tuple[str, str, Callable[[], bytes]]] = [
        ("VOL of 2^31 places a side", "vol", lambda: vol((2**31 - 1,) * 3)),
        ("VOL of 16,000 places a side", "vol", lambda: vol((16_000,) * 3)),
        ("VOL whose size overflows to what is there", "vol", lambda: vol((1 << 11, 1 << 11, 1 << 10), channels=3)),
        ("VOL of negative size", "vol", lambda: vol((-4, -3, 2))),
        ("VOL of no places", "vol", lambda: vol((0, 0, 0))),
        ("VOL of 2^31 channels", "vol", lambda: vol(channels=2**31 - 1)),
        ("VOL of numbers that are none", "vol", lambda: vol(numbers=struct.pack("<24f", *([float("nan")] * 24)))),
        ("VOL of infinite numbers", "vol", lambda: vol(numbers=struct.pack("<24f", *([float("inf")] * 24)))),
        ("VOL of the largest numbers", "vol", lambda: vol(numbers=struct.pack("<24f", *([3.4e38] * 24)))),
        ("VOL in a box of no numbers", "vol", lambda: vol(box=(float("nan"),) * 6)),
        ("VOL in a box of infinite size", "vol", lambda: vol(box=(-3.4e38, 0, 0, 3.4e38, 1, 1))),
        ("NPY of 10^12 places", "npy", lambda: _reshaped(b"(9999,9999,9999)")),
        ("NPY of negative size", "npy", lambda: _reshaped(b"(-2, -3, 4)")),
        ("NPY of sizes that are no numbers", "npy", lambda: _reshaped(b"(2, 3, 1j)")),
        ("NPY with a header of 4 GiB", "npy", lambda: b"\x93NUMPY\x02\x00\xff\xff\xff\xff" + npy()[10:]),
        ("NPY with a header of brackets", "npy", lambda: b"\x93NUMPY\x01\x00\xa0\x0f" + b"(" * 4000),
        ("NPY of sizes without end", "npy", lambda: _reshaped(b"(2,3,4,,,)")),
        ("NPY of pickled objects", "npy", lambda: npy().replace(b"'<f4'", b"'|O' ")),
    ]
    return [(name, partial(_made, ending, content)) for name, ending, content in table]


def _reshaped(shape: bytes) -> bytes:
    data = npy()
    at = data.index(_SHAPE)
    end = data.index(b"\n")
    header = data[10:at] + shape + data[at + len(_SHAPE) : end]
    return data[:10] + header.rstrip().ljust(end - 10) + data[end:]


def _made(ending: str, content: Callable[[], bytes]) -> Special:
    name = f"smoke.{ending}"
    files = {"scene.xml": scene(VOLUME.format(file=name)), name: content()}
    return Special(f"{ending.upper()} volume", "scene.xml", files)
