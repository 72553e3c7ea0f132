"""Device functions can't be called from Python: they say so instead of crashing."""

import os
import subprocess
import sys

import pytest

from pmviewer.kernels.jit import CACHE_FOLDER, source_hash, user_cache_root
from pmviewer.kernels.vector import dot


def test_device_function_called_from_python_is_an_error():
    with pytest.raises(TypeError, match="dot is a device function"):
        dot((1.0, 0.0, 0.0), (1.0, 0.0, 0.0))


def test_compiled_code_is_kept_under_a_hash_of_the_sources():
    assert CACHE_FOLDER.name == source_hash()
    assert CACHE_FOLDER.is_relative_to(user_cache_root())


def test_unwritable_cache_falls_back_to_the_temporary_folder(tmp_path):
    blocked = tmp_path / "file"
    blocked.touch()
    run = subprocess.run(
        [sys.executable, "-c", "from pmviewer.kernels.jit import CACHE_FOLDER as c; print(c)"],
        env={**os.environ, "PMVIEWER_CACHE": str(blocked), "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    assert run.stdout.startswith(str(tmp_path / "pmviewer-kernels-"))
