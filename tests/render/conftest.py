"""One variant of kernels for scenes with and without mirrors and smooth glass."""

from __future__ import annotations

import pytest

AS_THEY_ARE = ("test_split.py", "test_pixel_samples.py", "test_same_picture.py")


@pytest.fixture(autouse=True)
def always_may_split(request):
    """Kernels with one way and one sample are run by the tests of these files, and by other rooms' tests."""
    if request.path.name not in AS_THEY_ARE:
        request.getfixturevalue("every_path_may_split")
