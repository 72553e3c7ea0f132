"""What is known of the error of a picture that is not finished."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Remaining:
    """relMSE that the picture is estimated to have, `bias` the part of it that look-ups blur or lose, None where nobody
    has measured it, and the interval that covers it in nine pictures of ten."""

    relmse: float
    bias: float | None
    low: float
    high: float
