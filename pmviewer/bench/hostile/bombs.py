"""Streams that are small and decompress to gigabytes."""

from __future__ import annotations

import struct
import zlib
from functools import cache

BLOCK = 1 << 20


@cache
def zeros(count: int) -> bytes:
    """`count` zero bytes as a zlib stream (RFC 1950), put together from one block that stands for a mebibyte."""
    packer = zlib.compressobj(9, wbits=-15)
    block = packer.compress(b"\0" * BLOCK) + packer.flush(zlib.Z_FULL_FLUSH)
    packer = zlib.compressobj(9, wbits=-15)
    rest = packer.compress(b"\0" * (count % BLOCK)) + packer.flush()
    adler = (count % 65521) << 16 | 1  # of zeros alone
    return b"\x78\xda" + block * (count // BLOCK) + rest + struct.pack(">I", adler)
