"""More camera rays for some pixels.

What is seen over mirrors and glass is drawn together or apart by them: a pixel may see half a room, and most of the
variance of a picture's first passes sits there, or where edges cross pixels. These are known beforehand
(`pmviewer.render.mirrored`, `pmviewer.render.edges`), and get several samples a pass, each along the whole way that the
eye pass follows. Which pixels depends on scene and camera alone, as with outlines of lights
(`pmviewer.render.direct.outline`), so that the mean stays what it is. After some passes others are known by their
noise, and have twice, four or eight times as many (`pmviewer.render.adaptive`).

Sample s of the m of pass i has the index i·m + s in all of the pixel's sequences: samples of a pass complement one
another as those of passes do, and since m never falls none comes twice. Random numbers are drawn by the eye record's
`index`, which is set from sample to sample; whoever calls kernels gives them a record of their own (`own_eye`).

Eye records without the field `mirror_rays` have one sample everywhere, and compile none of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.render.given import PassData

OUTLINED, MIRRORED, EDGED, DOUBLINGS = 1, 2, 4, 3
"""Marks of pixels, uint8: the outline of a light crosses it; it shows a mirror or glass; an edge crosses it; and the
bit from which on stands how often its samples are doubled."""
SAMPLE_FIELDS: list[tuple[str, str]] = [("mirror_rays", "i4"), ("edge_rays", "i4")]
"""Of eye records: samples a pass of pixels that are MIRRORED, and of those that are EDGED; their product of pixels that
are both. Before they are doubled."""
_f4 = np.float32
_i8 = np.int64
_u4 = np.uint32


def own_eye(given: PassData) -> PassData:
    """With an eye record that no other call sees."""
    return given._replace(eye=given.eye.copy())


def with_doublings(marks: NDArray[np.uint8], doublings: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Marks (pixels,), or (0,) for none, with how often samples are doubled, (pixels,)."""
    doubled = doublings << np.uint8(DOUBLINGS)
    return doubled | marks if len(marks) else doubled


def without_doublings(marks: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """As they were before."""
    return marks & np.uint8((1 << DOUBLINGS) - 1)


def samples_by_marks(marks: NDArray[np.uint8], mirror_rays: int, edge_rays: int) -> NDArray[np.int64]:
    """Samples a pass of pixels with these marks."""
    samples = np.where(marks & MIRRORED, np.int64(mirror_rays), np.int64(1))
    samples *= np.where(marks & EDGED, np.int64(edge_rays), np.int64(1))
    return np.left_shift(samples, marks >> DOUBLINGS, dtype=np.int64)


@device
def _samples_by(mark, mirror_rays, edge_rays):
    """Samples a pass of a pixel with that mark."""
    m = _i8(mirror_rays) if mark & MIRRORED != 0 else _i8(1)
    if mark & EDGED != 0:
        m *= _i8(edge_rays)
    return m << (_i8(mark) >> DOUBLINGS)


@specialised
def samples_of(eye, marks, number):
    """Samples of a pixel in the pass. marks: uint8 (pixels,), or (0,) where no pixel has any."""
    if not has(eye, "mirror_rays"):
        return lambda eye, marks, number: _i8(1)
    return lambda eye, marks, number: (
        _samples_by(marks[number], eye.mirror_rays, eye.edge_rays) if len(marks) > 0 else _i8(1)
    )


@specialised
def take_sample(eye, index):
    """Have the eye record's random numbers be those of that index."""
    if not has(eye, "mirror_rays"):
        return lambda eye, index: None

    def taken(eye, index):
        eye.index = _u4(index)

    return taken


@specialised
def share_of(eye, samples):
    """What each of so many samples counts; None for 1."""
    if not has(eye, "mirror_rays"):
        return lambda eye, samples: None
    return lambda eye, samples: _f4(1.0) / _f4(samples)
