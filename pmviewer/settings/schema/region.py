"""Settings of the region of interest: a rectangle of the picture that is refined alone."""

from __future__ import annotations

from pmviewer.settings.needs import Need
from pmviewer.settings.schema.base import Group, setting

NOT_WEIGHED = Need(lambda f: not f.plan.virtual, "Virtual lights are weighed over the whole picture.")
REGION_ON = Need(lambda f: f.settings.region.on, "Only with a region (region.on).")


class Region(Group):
    """Region"""

    needs = (NOT_WEIGHED,)

    on: bool = setting(
        False,
        "Only a rectangle of the picture is refined; the rest stays as the first pass has made it. In the rectangle "
        "the picture is that of a whole one with as many passes, bit for bit.",
        stage="image",
        scale="switch",
        title="refine a region",
    )
    left: float = setting(
        0.25, "Where the region begins.", stage="image", scale="linear", unit="× width", ge=0, le=1, needs=(REGION_ON,)
    )
    top: float = setting(
        0.25,
        "Its upper end, from the top.",
        stage="image",
        scale="linear",
        unit="× height",
        ge=0,
        le=1,
        needs=(REGION_ON,),
    )
    right: float = setting(
        0.75, "Where it ends.", stage="image", scale="linear", unit="× width", ge=0, le=1, needs=(REGION_ON,)
    )
    bottom: float = setting(
        0.75,
        "Its lower end, from the top.",
        stage="image",
        scale="linear",
        unit="× height",
        ge=0,
        le=1,
        needs=(REGION_ON,),
    )

    def pixels(self, width: int, height: int) -> tuple[int, int, int, int]:
        """First and last + 1 column, first and last + 1 row of a picture of that size: x0, y0, x1, y1. One pixel at
        least, whichever end is named first."""
        x0, x1 = sorted((self.left * width, self.right * width))
        y0, y1 = sorted((self.top * height, self.bottom * height))
        column, row = min(round(x0), width - 1), min(round(y0), height - 1)
        return column, row, max(round(x1), column + 1), max(round(y1), row + 1)
