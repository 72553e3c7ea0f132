"""Machine code put into memory from an object file as LLVM writes it: ELF for x86-64, relocatable.

LLVM's own loader keeps all of an object file twice for as long as the process lives, once for itself and once for a
debugger, and takes every name in it into its table: some 0.45 MiB for code of 0.1 MiB. An image is the code alone.
Source: System V Application Binary Interface, AMD64 Architecture Processor Supplement, chapter 4 (object files).
"""

from __future__ import annotations

import ctypes
import mmap
import platform
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

SECTION = np.dtype([
    ("name", "<u4"), ("type", "<u4"), ("flags", "<u8"), ("address", "<u8"), ("offset", "<u8"), ("size", "<u8"),
    ("link", "<u4"), ("info", "<u4"), ("align", "<u8"), ("entry", "<u8"),
])  # fmt: skip
SYMBOL = np.dtype([
    ("name", "<u4"), ("info", "u1"), ("other", "u1"), ("section", "<u2"), ("value", "<u8"), ("size", "<u8"),
])  # fmt: skip
RELOCATION = np.dtype([("offset", "<u8"), ("type", "<u4"), ("symbol", "<u4"), ("addend", "<i8")])

_MAGIC = b"\x7fELF\x02\x01"
_RELOCATABLE, _X86_64 = 1, 62
_PROGBITS, _SYMTAB, _RELA, _NOBITS = 1, 2, 4, 8
_WRITE, _ALLOC, _TLS = 1, 2, 0x400
_UNDEFINED, _COMMON = 0, 0xFFF2
_GLOBAL, _FUNCTION = 1, 2
_NOWHERE = np.uint64(2**64 - 1)
_ADD_64, _PC_32, _PLT_32, _PC_64 = 1, 2, 4, 24


class Unloadable(Exception):
    """An object file that has what is not provided for here."""


class Image(NamedTuple):
    """Code in memory, `size` bytes with constants and what fills pages, until the process ends: a thread may be in it
    even while Python is being taken down. `functions` has the addresses of those that the file exports."""

    functions: dict[str, int]
    size: int


def is_possible() -> bool:
    """Whether object files of this system are of the one kind that is read here."""
    return sys.platform.startswith("linux") and platform.machine() == "x86_64" and sys.maxsize > 1 << 32


def load(file: bytes, outside: Callable[[str], int], common: Callable[[str], int]) -> Image:
    """Put the code of an object file into memory. `outside` gives the address of a name that the file doesn't define, 0
    if there is none, `common` that of eight bytes which it shares with other files; both are asked for what the code
    refers to alone. Raises Unloadable when something in the file is of another kind, or OSError when the system does
    not let it be executed."""
    sections, symbols, names = _tables(file)
    places, written, size = _layout(sections)
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, prot=mmap.PROT_READ | mmap.PROT_WRITE)
    whole, base = np.frombuffer(memory, np.uint8), ctypes.addressof(ctypes.c_char.from_buffer(memory))
    for section, place in zip(sections, places, strict=True):
        if place != _NOWHERE and section["type"] != _NOBITS:
            start, length = int(section["offset"]), int(section["size"])
            whole[int(place) : int(place) + length] = np.frombuffer(file, np.uint8, length, start)
    within = np.minimum(symbols["section"], len(sections) - 1)
    inside = (symbols["section"] == within) & (places[within] != _NOWHERE)
    addresses = np.where(inside, base + places[within] + symbols["value"], 0).astype(np.uint64)

    def find(index: int) -> int:
        name, section = _name(names, symbols["name"][index]), symbols["section"][index]
        if section == _COMMON and symbols["size"][index] == 8:
            return common(name)
        return outside(name) if section == _UNDEFINED else 0

    for table in sections[sections["type"] == _RELA]:
        place = places[int(table["info"])]
        if place == _NOWHERE:
            continue
        entries = np.frombuffer(file, RELOCATION, int(table["size"]) // RELOCATION.itemsize, int(table["offset"]))
        for index in np.unique(entries["symbol"]):
            if not addresses[index]:
                addresses[index] = find(index)
            if not addresses[index]:
                raise Unloadable(f"Nothing is known of {_name(names, symbols['name'][index])!r}.")
        _relocate(whole, int(place) + entries["offset"], entries, addresses[entries["symbol"]], base)
    _protect(base, written)
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(memory))  # never unmapped
    exported = np.flatnonzero(inside & (symbols["info"] == (_GLOBAL << 4 | _FUNCTION)))
    return Image({_name(names, symbols["name"][i]): int(addresses[i]) for i in exported}, size)


def _tables(file: bytes) -> tuple[Any, Any, bytes]:
    """The sections, the symbols and their names."""
    if file[:6] != _MAGIC or int.from_bytes(file[16:18], "little") != _RELOCATABLE:
        raise Unloadable("It is no relocatable file of ELF, 64 bits.")
    if int.from_bytes(file[18:20], "little") != _X86_64:
        raise Unloadable("It is for another processor.")
    offset, count = int.from_bytes(file[40:48], "little"), int.from_bytes(file[60:62], "little")
    sections = np.frombuffer(file, SECTION, count, offset)
    tables = np.flatnonzero(sections["type"] == _SYMTAB)
    if len(tables) != 1:
        raise Unloadable("It has no table of symbols.")
    table = sections[tables[0]]
    symbols = np.frombuffer(file, SYMBOL, int(table["size"]) // SYMBOL.itemsize, int(table["offset"]))
    strings = sections[int(table["link"])]
    return sections, symbols, file[int(strings["offset"]) : int(strings["offset"] + strings["size"])]


def _name(names: bytes, start: int) -> str:
    return names[start : names.index(b"\0", start)].decode()


def _layout(sections: Any) -> tuple[Any, int, int]:
    """Where each section begins in memory, from which byte on it can be written at run time, and the size of all."""
    places = np.full(len(sections), _NOWHERE)
    kept = (sections["flags"] & _ALLOC != 0) & np.isin(sections["type"], (_PROGBITS, _NOBITS)) & (sections["size"] > 0)
    if np.any(sections["flags"][kept] & _TLS):
        raise Unloadable("It has variables of threads.")
    end = written = 0
    for writable in (False, True):
        for i in np.flatnonzero(kept & ((sections["flags"] & _WRITE != 0) == writable)):
            start = _up(end, max(int(sections["align"][i]), 1))
            places[i], end = start, start + int(sections["size"][i])
        end = _up(end, mmap.PAGESIZE)
        written = written if writable else end
    if end == 0:
        raise Unloadable("It has no code.")
    return places, written, end


def _up(size: int, multiple: int) -> int:
    return -(-size // multiple) * multiple


def _relocate(whole: Any, where: Any, entries: Any, addresses: Any, base: int) -> None:
    """Write addresses into `whole`, which begins at `base`."""
    values = addresses + entries["addend"].astype(np.uint64)
    relative = (values - (where + np.uint64(base))).astype(np.int64)
    for kinds, numbers in (((_ADD_64,), values), ((_PC_64,), relative), ((_PC_32, _PLT_32), relative.astype(np.int32))):
        chosen = np.isin(entries["type"], kinds)
        if numbers.dtype == np.int32 and np.any(numbers[chosen] != relative[chosen]):
            raise Unloadable("Something is too far away.")
        parts = numbers[chosen].view(np.uint8).reshape(-1, numbers.itemsize)
        whole[where[chosen][:, None] + np.arange(numbers.itemsize, dtype=np.uint64)] = parts
    if not np.all(np.isin(entries["type"], (_ADD_64, _PC_64, _PC_32, _PLT_32))):
        raise Unloadable(f"It has relocations of types {np.unique(entries['type'])}.")


def _protect(base: int, size: int) -> None:
    """Code and constants can be executed and not be written any more."""
    mprotect = ctypes.CDLL(None, use_errno=True).mprotect
    mprotect.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
    if size and mprotect(base, size, mmap.PROT_READ | mmap.PROT_EXEC) != 0:
        raise OSError(ctypes.get_errno(), "The system does not let code be executed.")
