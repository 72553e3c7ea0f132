"""Settings of the comparison with and without importance."""

from __future__ import annotations

from typing import Literal

from pmviewer.settings.schema.base import Group, setting


class Compare(Group):
    """Comparison without importance"""

    equal: Literal["photons", "error"] = setting(
        "photons",
        "What is equal. photons: without importance N is lowered until as many photons are stored. error: with that N, "
        "passes are added until the error is that with importance, or the limit is reached.",
        stage="display",
        scale="choice",
        title="equal",
    )
    passes: int = setting(
        8,
        "Passes with importance. Without a reference that fits, four times as many at full N tell the error.",
        stage="display",
        scale="log",
        unit="passes",
        ge=1,
        le=100_000,
    )
    limit: float = setting(
        16.0,
        "At equal error, so many times the passes at most without importance.",
        stage="display",
        scale="log",
        unit="× passes",
        ge=1.0,
        le=1000.0,
    )
    split: float = setting(
        0.5,
        "Where the picture with importance ends and that without begins; drag the line.",
        stage="display",
        scale="linear",
        ge=0.0,
        le=1.0,
    )
