"""Mutations of files as bytes and as text: what a broken disk, an unfinished download or a careless editor makes."""

from __future__ import annotations

import random
import re
import struct

NUMBER = re.compile(rb"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])")
WORD = re.compile(rb"[A-Za-z_][\w.]{1,40}")
NUMBERS = (b"1e308", b"-1e308", b"nan", b"inf", b"-inf", b"1e-320", b"0", b"-0", b"-1", b"2147483647", b"2147483648",
           b"4294967295", b"-2147483649", b"9223372036854775808", b"1e18", b"100000000", b"1000000000000", b"", b"abc",
           b"1e", b"--1", b"0x10", b"1,5", "٣".encode(), b"1" * 5000, b"0." + b"0" * 400 + b"1", b"1e999999", b"1_0",
           b"NaN", b"-nan(ind)", b"1.#QNAN", b"$res", b"1 2 3 4 5 6 7")  # fmt: skip
INTEGERS = (0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 100_000_000, 1 << 24)
FLOATS = (float("nan"), float("inf"), -float("inf"), 3.4e38, -3.4e38, 1e-45, 0.0, -1.0)


def _some(data: bytes | bytearray, chance: random.Random) -> int:
    return chance.randrange(len(data)) if data else 0


def flip_bits(data: bytes, chance: random.Random) -> bytes:
    """Single bits anywhere, one to forty of them."""
    out = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 8, 40))):
        if out:
            out[_some(out, chance)] ^= 1 << chance.randrange(8)
    return bytes(out)


def truncate(data: bytes, chance: random.Random) -> bytes:
    """An unfinished download: the end is missing from some byte on."""
    return data[: _some(data, chance)]


def cut_out(data: bytes, chance: random.Random) -> bytes:
    """Some bytes are missing in the middle, so that all behind them stand at wrong offsets."""
    at = _some(data, chance)
    return data[:at] + data[at + chance.choice((1, 4, 16, 200)) :]


def repeat_slice(data: bytes, chance: random.Random) -> bytes:
    """A piece stands there two, three or fifty times."""
    at, length = _some(data, chance), chance.choice((1, 4, 40, 400))
    return data[:at] + data[at : at + length] * chance.choice((2, 3, 50)) + data[at + length :]


def insert_noise(data: bytes, chance: random.Random) -> bytes:
    """Random bytes in the middle, up to a thousand."""
    at = _some(data, chance)
    return data[:at] + chance.randbytes(chance.choice((1, 3, 16, 1000))) + data[at:]


def overwrite_integer(data: bytes, chance: random.Random) -> bytes:
    """Four bytes anywhere, aligned or not, in either order."""
    if len(data) < 4:
        return data + b"\xff" * 4
    at = chance.randrange(len(data) - 3)
    order = chance.choice("<>")
    return data[:at] + struct.pack(f"{order}I", chance.choice(INTEGERS)) + data[at + 4 :]


def overwrite_float(data: bytes, chance: random.Random) -> bytes:
    """Four bytes become a float32 that nobody expects: NaN, an infinity, the largest or the smallest there is."""
    if len(data) < 4:
        return data + struct.pack("<f", float("nan"))
    at = chance.randrange(len(data) - 3)
    return data[:at] + struct.pack("<f", chance.choice(FLOATS)) + data[at + 4 :]


def append_noise(data: bytes, chance: random.Random) -> bytes:
    """Random bytes behind the end that the header tells."""
    return data + chance.randbytes(chance.choice((1, 100, 5000)))


def empty(data: bytes, chance: random.Random) -> bytes:
    """Nothing, or hardly more than a signature."""
    return chance.choice((b"", b"\0", b"\n", b" " * 1000, b"\xef\xbb\xbf", data[:1], data[:4], data[:12], data[:84]))


def other_encoding(data: bytes, chance: random.Random) -> bytes:
    """The text in another encoding or with other line ends, with zero bytes or a byte order mark."""
    text = data.decode("latin-1")
    kind = chance.choice(("utf-16", "utf-32", "utf-16-be", "utf-7", "bom", "cr", "crlf", "nul", "latin"))
    if kind == "bom":
        return b"\xef\xbb\xbf" + data
    if kind == "cr":
        return data.replace(b"\n", b"\r")
    if kind == "crlf":
        return data.replace(b"\n", b"\r\n")
    if kind == "nul":
        return data.replace(b" ", b"\0", 3)
    if kind == "latin":
        return data.replace(b"e", b"\xe9", 5)
    return text.encode(kind, "replace")


def change_number(data: bytes, chance: random.Random) -> bytes:
    """One number, or each with some probability, becomes another or none at all."""
    found = list(NUMBER.finditer(data))
    if not found:
        return overwrite_integer(data, chance)
    chosen = [chance.choice(found)] if chance.random() < 0.7 else [m for m in found if chance.random() < 0.1]
    value = chance.choice(NUMBERS)
    for match in sorted(chosen, key=lambda m: -m.start()):
        data = data[: match.start()] + value + data[match.end() :]
    return data


def change_word(data: bytes, chance: random.Random) -> bytes:
    """A word becomes long, another word of the file, or nothing."""
    found = list(WORD.finditer(data))
    if not found:
        return flip_bits(data, chance)
    match, other = chance.choice(found), chance.choice(found)
    word = chance.choice(
        (b"", b"A" * 100_000, other[0], match[0].upper(), b"%s%n", b"\xff\xfe", "ß\u202e😀".encode(), b"../x")
    )
    return data[: match.start()] + word + data[match.end() :]


def move_lines(data: bytes, chance: random.Random) -> bytes:
    """Lines deleted, doubled, exchanged, shuffled, or one of them twenty thousand times."""
    lines = data.split(b"\n")
    kind = chance.choice(("delete", "repeat", "swap", "shuffle", "many"))
    i, j = _some(data, chance) % len(lines), _some(data, chance) % len(lines)
    if kind == "delete":
        del lines[i]
    elif kind == "repeat":
        lines.insert(j, lines[i])
    elif kind == "swap":
        lines[i], lines[j] = lines[j], lines[i]
    elif kind == "shuffle":
        chance.shuffle(lines)
    else:
        lines[i:i] = [lines[i]] * 20_000
    return b"\n".join(lines)


def join_lines(data: bytes, chance: random.Random) -> bytes:
    """Line ends become spaces, nothing, continuations or empty lines."""
    return data.replace(b"\n", chance.choice((b" ", b"", b"\\\n", b"\n\n\n")))


BYTE_MUTATIONS = (flip_bits, truncate, cut_out, repeat_slice, insert_noise, overwrite_integer, overwrite_float,
                  append_noise, empty)  # fmt: skip
TEXT_MUTATIONS = (change_number, change_number, change_number, change_word, change_word, move_lines, join_lines,
                  other_encoding, truncate, flip_bits, cut_out, repeat_slice)  # fmt: skip
