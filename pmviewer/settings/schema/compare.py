"""Settings of the comparison with and without importance."""

from __future__ import annotations

from typing import ClassVar, Literal

from pmviewer.settings.needs import Need, Needs
from pmviewer.settings.schema.base import Group, setting

TRACED = Need(lambda f: f.plan.photons, "This method traces no photons, or no surface stores them.")
DECIDED_BY_IMPORTANCE = Need(
    lambda f: f.plan.chooses_photons,
    "Importance decides nothing now: choose a rule that uses it, such as importance.deposition.",
)
AT_EQUAL_ERROR = Need(lambda f: f.settings.compare.equal == "error", "Only at equal error (compare.equal).")


class Compare(Group):
    """Comparison without importance"""

    needs: ClassVar[Needs] = (
        TRACED,
        DECIDED_BY_IMPORTANCE,
    )

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
        title="passes compared",
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
        needs=(AT_EQUAL_ERROR,),
    )
    split: float = setting(
        0.5,
        "Where the picture with importance ends and that without begins; drag the line.",
        stage="display",
        scale="linear",
        ge=0.0,
        le=1.0,
    )
