"""The film: float64 sums of all samples, so that a thousand passes add up without drift."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import kernel
from pmviewer.render.moments import Moments
from pmviewer.render.planes import CHANNELS, TERMS_END
from pmviewer.render.share import OWN_COLUMNS
from pmviewer.state import State

Spans = tuple[tuple[int, int], ...]
"""First and last + 1 of runs of pixels, row by row."""


@kernel
def resolve(sums, passes, out, first, last):
    """Means of pixels first … last−1: sums (n, ≥ channels) float64, out (n, channels) float32."""
    inverse = 1.0 / passes
    for pixel in range(first, last):
        for c in range(out.shape[1]):
            out[pixel, c] = np.float32(sums[pixel, c] * inverse)


class Addable(Protocol):
    """What passes add, in whatever form."""

    def add_to(self, film: Film) -> None:
        """Add it to the film, whose `passes` and moments are the caller's."""


@dataclass(frozen=True, eq=False)
class Increment(Addable):
    """What passes add to pixels of a film: `sums` like the film's."""

    sums: NDArray[np.float64]

    def add_to(self, film: Film) -> None:
        film.add(self)


class Film:
    """Sums of `passes` samples per pixel: `sums` (height·width, channels + further) float64, `channels` being those of
    `pmviewer.render.planes`, with media MEDIA_CHANNELS, and `further` sums that a method keeps beside the planes, and
    with `unshared` the terms of each pixel's own samples, where a filter shares them;
    `radii` of the pixels' look-ups in the latest pass
    (`pmviewer.render.pixel_radius`), None where all have that of the pass; `moments`, what passes tell of the noise,
    None where nobody keeps them.

    A pass is one addition to each sum, however many samples it has there: passes that are rendered elsewhere and added
    in their order give the same film bit for bit."""

    numbered: int | None = None
    """Column of `sums` that is no sum but the highest of the numbers that passes put there, −1 for none."""

    def __init__(
        self, width: int, height: int, further: int = 0, channels: int = CHANNELS, unshared: bool = False
    ) -> None:
        self.width, self.height, self.channels = width, height, channels
        self._columns = channels + further
        terms = TERMS_END + channels - CHANNELS if unshared else 0
        self.sums: NDArray[np.float64] = np.zeros((width * height, self._columns + terms), np.float64)
        self.radii: NDArray[np.float32] | None = None
        self._samples: NDArray[np.float64] | None = None
        self.moments: Moments | None = None
        self.doublings: NDArray[np.uint8] | None = None
        """(pixels,) how often the samples of a pass are doubled (`pmviewer.render.adaptive`); None until that is
        decided."""
        self.passes = 0
        self.region: tuple[int, int, int, int] | None = None
        """Columns x0 … x1−1 and rows y0 … y1−1 of (x0, y0, x1, y1), which alone are rendered from the second pass on;
        None for all."""
        self.latest_alone = False
        """Whether sums are what the latest pass has added, and those of passes before are forgotten."""

    @property
    def blank(self) -> NDArray[np.float64]:
        """(columns,) sums of a pixel of an empty film."""
        blank = np.zeros(self.sums.shape[1])
        if self.numbered is not None:
            blank[self.numbered] = -1.0
        return blank

    def add(self, increment: Increment, first: int = 0) -> None:
        """Add to the pixels from `first` on. `passes` and moments are the caller's."""
        part = self.sums[first : first + len(increment.sums)]
        numbers = None
        if self.numbered is not None:
            numbers = np.maximum(part[:, self.numbered], increment.sums[:, self.numbered])
        part += increment.sums
        if self.numbered is not None:
            part[:, self.numbered] = numbers

    @property
    def own_samples(self) -> NDArray[np.float64]:
        """(pixels, columns + OWN_COLUMNS) what the pixels sample in a pass by themselves, before they share it
        (`pmviewer.render.share`): room that is made once, for one thread to ask first."""
        if self._samples is None:
            self._samples = np.zeros((len(self.sums), self._columns + OWN_COLUMNS))
        return self._samples

    def clear_own_samples(self, first: int, last: int) -> None:
        """Those of pixels first … last−1, as before a pass."""
        self.own_samples[first:last, : self._columns] = self.blank[: self._columns]
        self.own_samples[first:last, self._columns :] = 0.0

    @contextmanager
    def one_addition(self, first: int, last: int) -> Iterator[None]:
        """While it lasts the sums of pixels first … last−1 are what has been added to them meanwhile, and no more. In a
        film's first pass they are blank before."""
        sums = self.sums[first:last]
        before = None if self.latest_alone or self.passes == 0 else Increment(sums.copy())
        sums[:] = self.blank
        yield
        if before is not None:
            self.add(before, first)

    def spans(self, index: int | None = None, around: int = 0) -> Spans:
        """The pixels that pass `index` renders, the next one without; with those so far
        around them."""
        if self.region is None or (self.passes if index is None else index) == 0:
            return ((0, len(self.sums)),)
        x0, y0, x1, y1 = self.region
        x0, y0 = max(x0 - around, 0), max(y0 - around, 0)
        x1, y1 = min(x1 + around, self.width), min(y1 + around, self.height)
        return tuple((y * self.width + x0, y * self.width + x1) for y in range(y0, y1))

    @property
    def refined(self) -> NDArray[np.bool_] | None:
        """(pixels,) those of the region; None without one."""
        if self.region is None:
            return None
        x0, y0, x1, y1 = self.region
        inside = np.zeros((len(self.sums) // self.width, self.width), bool)
        inside[y0:y1, x0:x1] = True
        return inside.ravel()

    def samples(self, pixel: int) -> int:
        """How many passes a pixel has."""
        if self.region is None or self.passes == 0:
            return self.passes
        (x0, y0, x1, y1), (y, x) = self.region, divmod(pixel, self.width)
        return self.passes if x0 <= x < x1 and y0 <= y < y1 else 1

    def _as_sampled(self, means: NDArray[np.floating]) -> None:
        """Means (h, w, n) over `passes`, made those over each pixel's own."""
        if self.region is not None and self.passes > 1:
            x0, y0, x1, y1 = self.region
            inside = means[y0:y1, x0:x1].copy()
            means *= self.passes
            means[y0:y1, x0:x1] = inside

    def state(self) -> State:
        """What has been added so far, moments included."""
        arrays: dict[str, NDArray[Any]] = {"sums": self.sums}
        arrays |= {"radii": self.radii} if self.radii is not None else {}
        arrays |= {"doublings": self.doublings} if self.doublings is not None else {}
        size = {"width": self.width, "height": self.height, "passes": self.passes}
        moments = self.moments.state() if self.moments is not None else None
        return State.of_parts({**size, "region": self.region}, arrays, moments=moments)

    def restore(self, state: State) -> None:
        """Go on from there. Raises ValueError where that is no state of such a film."""
        if (state.number("width"), state.number("height")) != (self.width, self.height):
            raise ValueError("the film has another size")
        region = state.number("region")
        if (None if region is None else tuple(region)) != self.region:
            raise ValueError("the film has another region")
        pixels, columns = self.sums.shape
        self.sums = state.array("sums", (pixels, columns), np.float64)
        self.radii = None
        if "radii" in state.arrays:
            self.radii = state.array("radii", (pixels, None), np.float32)
        self.doublings = state.array("doublings", (pixels,), np.uint8) if "doublings" in state.arrays else None
        if self.moments is not None:
            self.moments.restore(state.part("moments"))
        self.passes = int(state.number("passes"))

    def planes(self) -> NDArray[np.float32]:
        """Means (height, width, channels) float32."""
        out = np.empty((self.height * self.width, self.channels), np.float32)
        resolve(self.sums, float(max(self.passes, 1)), out, 0, len(out))
        planes = out.reshape(self.height, self.width, self.channels)
        self._as_sampled(planes)
        return planes

    def unshared(self) -> NDArray[np.float32] | None:
        """Planes whose terms are means of each pixel's own samples, so that the noise of neighbours differs; None where
        `planes` are such or nobody keeps them."""
        if self.sums.shape[1] == self._columns:
            return None
        terms = (self.sums[:, self._columns :] / max(self.passes, 1)).reshape(self.height, self.width, -1)
        self._as_sampled(terms)
        planes = self.planes()
        planes[..., :TERMS_END], planes[..., CHANNELS:] = terms[..., :TERMS_END], terms[..., TERMS_END:]
        return planes
