"""Settings of comparisons: two pictures beside each other, and the comparison with and without importance."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Literal

from pmviewer.settings.needs import Need
from pmviewer.settings.schema.base import Group, setting

TRACED = Need(lambda f: f.plan.photons, "This method traces no photons, or no surface stores them.")
DECIDED_BY_IMPORTANCE = Need(
    lambda f: f.plan.chooses_photons,
    "Importance decides nothing now: choose a rule that uses it, such as importance.deposition.",
)
AT_EQUAL_ERROR = Need(lambda f: f.settings.compare.equal == "error", "Only at equal error (compare.equal).")


COMPARED = Need(lambda f: f.settings.compare.mode != "off", "Only while two pictures are compared (compare.mode).")
IN_DIFFERENCES = Need(lambda f: f.settings.compare.mode == "difference", "Only with differences (compare.mode).")
FLIP = Need(lambda f: find_spec("flip_evaluator") is not None, "Needs FLIP's evaluator: pip install 'pmviewer[flip]'.")
LIVE, REFERENCE, LAST = "live", "reference", "last"
"""Pictures that are no snapshots, and the snapshot that was taken last."""


class Compare(Group):
    """Comparison"""

    mode: Literal["off", "wipe", "flip", "side by side", "difference"] = setting(
        "off",
        "How the viewport shows two pictures A and B: on both sides of a line that the mouse drags, one at a time "
        "(Y changes), beside each other with one zoom, or what they differ by in false colours.",
        stage="display",
        scale="choice",
    )
    a: str = setting(
        LIVE,
        "The first picture, which is judged: 'live', 'reference', 'last' for the snapshot taken last, or the number of "
        "a snapshot.",
        stage="display",
        scale="name",
        title="picture A",
        needs=(COMPARED,),
    )
    b: str = setting(
        LAST,
        "The second picture, by which the first is judged: named as the first one.",
        stage="display",
        scale="name",
        title="picture B",
        needs=(COMPARED,),
    )
    linked: bool = setting(
        False,
        "A snapshot that is compared is rendered again, by its own settings and with as many passes as it has, as the "
        "live picture's camera sees the scene. Off, it stays the picture that it is.",
        stage="display",
        scale="switch",
        title="link cameras",
        needs=(COMPARED,),
    )
    difference: Literal["signed", "absolute", "relative", "relMSE", "MAPE", "FLIP"] = setting(
        "relMSE",
        "What is shown of A and B, by pixel: luminance of A − B; |A − B|; (A − B)/(B + 0.1) of luminances; "
        "(A − B)²/(B² + 0.01); |A − B|/(B + 0.1) in percent; or what an eye sees when they alternate (HDR-FLIP).",
        stage="display",
        scale="choice",
        needs=(IN_DIFFERENCES,),
        choice_needs={"FLIP": (FLIP,)},
    )
    split: float = setting(
        0.5,
        "Where the first picture ends and the second begins; drag the line.",
        stage="display",
        scale="linear",
        ge=0.0,
        le=1.0,
    )
    equal: Literal["photons", "error"] = setting(
        "photons",
        "What is equal. photons: without importance N is lowered until as many photons are stored. error: with that N, "
        "passes are added until the error is that with importance, or the limit is reached.",
        stage="display",
        scale="choice",
        title="equal",
        section="with and without importance",
        needs=(TRACED, DECIDED_BY_IMPORTANCE),
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
        needs=(TRACED, DECIDED_BY_IMPORTANCE),
    )
    limit: float = setting(
        16.0,
        "At equal error, so many times the passes at most without importance.",
        stage="display",
        scale="log",
        unit="× passes",
        ge=1.0,
        le=1000.0,
        needs=(TRACED, DECIDED_BY_IMPORTANCE, AT_EQUAL_ERROR),
    )
