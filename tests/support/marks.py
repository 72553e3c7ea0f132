"""Marks that several files of tests use."""

from __future__ import annotations

import pytest

warnings_are_errors = pytest.mark.filterwarnings(
    "error", "default::ResourceWarning", "default::pytest.PytestUnraisableExceptionWarning"
)
"""But for those that the garbage collector gives, of what any test before may have left."""
