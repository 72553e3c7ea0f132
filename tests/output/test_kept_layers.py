"""Images on disk: what is kept comes back, takes no memory, and stays in memory where the disk refuses."""

from __future__ import annotations

import gc
import os
import sys
import tempfile

import numpy as np
import pytest

from pmviewer.output.kept_layers import KeptLayers, kept


def some_layers(height=37, width=53):
    rng = np.random.default_rng(0)
    planes = rng.normal(size=(height, width, 7)).astype(np.float32)
    planes[3, 4, 0], planes[0, 0, 1] = np.nan, np.inf
    return {"beauty": planes[..., :3], "depth": planes[..., 6:], "caustic": planes[..., 3:6]}


def test_what_is_kept_comes_back_as_it_was():
    layers = some_layers()
    on_disk = kept(layers)
    assert isinstance(on_disk, KeptLayers)
    assert list(on_disk) == list(layers)
    first = on_disk["beauty"]
    before = {name: layer.copy() for name, layer in layers.items()}
    for layer in layers.values():
        layer[...] = -1.0
    for name, layer in on_disk.items():
        np.testing.assert_array_equal(layer, before[name])
        assert layer.dtype == np.float32
        assert not layer.flags.writeable
    with pytest.raises(KeyError):
        on_disk["albedo"]
    del on_disk
    gc.collect()
    np.testing.assert_array_equal(first, before["beauty"])  # whoever holds one has it


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks Linux what is open, and what memory is taken")
def test_it_takes_no_memory_and_its_file_goes_with_it():
    def resident() -> float:
        with open("/proc/self/statm", encoding="ascii") as statm:
            return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20

    opened = len(os.listdir("/proc/self/fd"))
    layers = {"beauty": np.ones((2000, 2000, 3), np.float32)}
    before = resident()
    held = [kept(layers) for _ in range(3)]  # of 46 MiB
    assert [one["beauty"][1000, 1000, 1] for one in held] == [1.0] * 3
    assert resident() - before < 10
    del held
    gc.collect()
    assert len(os.listdir("/proc/self/fd")) == opened


def test_without_room_on_the_disk_it_stays_in_memory(monkeypatch):
    def refuse(*of, **named):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
    layers = some_layers()
    in_memory = kept(layers)
    before = layers["beauty"].copy()
    layers["beauty"][...] = -1.0
    np.testing.assert_array_equal(in_memory["beauty"], before)
