"""One variant of kernels for scenes with and without smooth glass."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def always_may_split(every_path_may_split):
    """In every test of this room."""
