"""Files of numbers and arrays: what is read is what was written, or one sentence."""

from __future__ import annotations

import errno
import io
import json
import random
import zipfile

import numpy as np
import pytest

from pmviewer.errors import OutputError, SceneError
from pmviewer.output import array_file
from pmviewer.output.array_file import read_about, read_arrays, write_arrays
from pmviewer.state import State

SUFFIX = ".kept"
ARRAYS = {
    "sums": np.arange(60, dtype=np.float64).reshape(4, 5, 3) / 7,
    "odd.name": np.array([np.nan, np.inf, -0.0], np.float32),
    "none": np.empty((0, 4), np.int32),
}
NUMBERS = {"passes": 3, "ratio": 0.1 + 0.2, "nothing": None, "text": "ä", "part": {"list": [1.5, 2.5]}}


@pytest.fixture
def kept(tmp_path):
    path = tmp_path / f"a{SUFFIX}"
    write_arrays(path, SUFFIX, {"kind": "test"}, State(NUMBERS, ARRAYS))
    return path


def test_what_is_read_is_what_was_written(kept):
    about, state = read_arrays(kept, "kept file")
    assert about == {"kind": "test"}
    assert state.numbers == NUMBERS
    assert {name: (a.dtype, a.shape, a.tobytes()) for name, a in state.arrays.items()} == {
        name: (a.dtype, a.shape, a.tobytes()) for name, a in ARRAYS.items()
    }
    assert read_about(kept, "kept file")["kind"] == "test"
    with np.load(kept, allow_pickle=False) as numpy_reads:
        assert numpy_reads["sums"].tobytes() == ARRAYS["sums"].tobytes()


def test_damage_is_found_or_changes_nothing(kept):
    good, chance = kept.read_bytes(), random.Random(1)
    refused = 0
    for case in range(400):
        data = bytearray(good)
        if case % 2:
            data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        else:
            del data[chance.randrange(len(data)) :]
        kept.write_bytes(data)
        try:
            about, state = read_arrays(kept, "kept file")
        except SceneError as error:
            refused += "no whole kept file" in str(error)
            continue
        assert (about, state.numbers) == ({"kind": "test"}, NUMBERS)
        assert {n: a.tobytes() for n, a in state.arrays.items()} == {n: a.tobytes() for n, a in ARRAYS.items()}
    assert refused > 300


def entry(shape: str, content: bytes) -> bytes:
    """A .npy of that header."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + content


@pytest.mark.parametrize(
    ("name", "data", "compression"),
    [
        ("bomb.npy", entry("(1000000000000,)", b""), zipfile.ZIP_STORED),
        ("negative.npy", entry("(-1,)", b""), zipfile.ZIP_STORED),
        ("more.npy", entry("(1,)", bytes(16)), zipfile.ZIP_STORED),
        ("packed.npy", entry("(1,)", bytes(8)), zipfile.ZIP_DEFLATED),
        ("pickle.npy", entry("(1,)", bytes(8)).replace(b"<f8", b"|O "), zipfile.ZIP_STORED),
        ("text.txt", b"hello", zipfile.ZIP_STORED),
    ],
)
def test_strange_entries_are_refused(tmp_path, name, data, compression):
    path = tmp_path / f"a{SUFFIX}"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("about.json", json.dumps({"numbers": {}}))
        archive.writestr(name, data, compression)
    with pytest.raises(SceneError, match="no whole kept file"):
        read_arrays(path, "kept file")


def test_a_full_disk_leaves_the_file_before(kept, monkeypatch):
    before = kept.read_bytes()
    for limit in (1, 2, 5, 8):
        written = [None] * limit

        def write(self, data, written=written):
            del written[-1:]
            if not written:  # and ever after
                raise OSError(errno.ENOSPC, "No space left on device")
            return len(data)

        def failing(*given, alone, write=write):
            return _failing(*given, write, alone)

        monkeypatch.setattr(array_file, "replacing", failing)
        with pytest.raises(OutputError, match="no room on the disk"):
            write_arrays(kept, SUFFIX, {}, State({}, {"big": np.zeros(1 << 18)}))
        monkeypatch.undo()
        assert kept.read_bytes() == before
        assert [path.name for path in kept.parent.iterdir()] == [kept.name]


def _failing(path, suffixes, size, write, alone):
    """`replacing` with a file whose writes end up on a disk that is full."""
    from contextlib import contextmanager

    from pmviewer.output.files import replacing

    @contextmanager
    def replaced():
        with replacing(path, suffixes, size, alone=alone) as file:
            yield type("Full", (io.BytesIO,), {"write": lambda self, data: write(self, data) and file.write(data)})()

    return replaced()


def test_what_is_no_file_is_refused(tmp_path):
    with pytest.raises(SceneError, match="no such file"):
        read_arrays(tmp_path / "none.kept", "kept file")
    with pytest.raises(SceneError, match="not a regular file"):
        read_arrays(tmp_path, "kept file")
