"""One variant of kernels for scenes with and without smooth glass."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def always_may_split(request):
    """Kernels without a way to follow both are run by test_split.py, test_same_picture.py and other rooms' tests."""
    if request.path.name not in ("test_split.py", "test_same_picture.py"):
        request.getfixturevalue("every_path_may_split")
