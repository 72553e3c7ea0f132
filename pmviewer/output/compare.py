"""A picture against its reference: reading one, checking that the two fit, and the errors as text."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.output.exr import read_reference
from pmviewer.output.metric import BLOCK, DROP, Metrics, channel_ratios, metrics, squared_error


@dataclass(frozen=True)
class Reference:
    """`image` (h, w, 3) float32, linear radiance, finite everywhere."""

    path: Path
    image: NDArray[np.float32]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.image.shape[1], self.image.shape[0]

    def check_size(self, size: tuple[int, int]) -> None:
        """Raises SceneError when a picture of that width and height can't be compared with it."""
        if size != self.size:
            raise SceneError(
                f"The reference has {_pixels(self.size)} pixels, the picture {_pixels(size)}.",
                self.path,
                hint="Only pictures of the same size can be compared.",
            )


def load_reference(path: str | Path) -> Reference:
    """The beauty image of an EXR file. Raises SceneError when it can't be read, has no colours or isn't finite."""
    if Path(path).suffix.lower() != ".exr":
        raise SceneError("Errors are those of radiance, which only EXR files hold.", path, hint="Give an .exr file.")
    image = read_reference(path)
    broken = int((~np.isfinite(image)).any(axis=-1).sum())
    if broken:
        raise SceneError(f"{broken} of its pixels are not finite: it can't serve for a comparison.", path)
    return Reference(Path(path), image)


def compare_files(image: str | Path, reference: str | Path) -> str:
    """The text of `pmviewer compare`. Raises SceneError."""
    target, picture = load_reference(reference), load_reference(image)
    target.check_size(picture.size)
    measured = metrics(picture.image, target.image)
    red, green, blue = channel_ratios(picture.image, target.image)
    rows = [
        ("size", f"{_pixels(target.size)} pixels"),
        ("relMSE", f"{measured.relmse_all:.4e}"),
        (f"relMSE without the worst {DROP:.1%}", f"{measured.relmse_drop:.4e}"),
        (f"error of {BLOCK}×{BLOCK} blocks", f"{measured.block_error:.4e}"),
        ("mean ratio", f"{measured.mean_ratio:.5f}"),
        ("mean ratio R, G, B", f"{red:.5f}  {green:.5f}  {blue:.5f}"),
    ]
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:{width}s}  {text}" for name, text in rows)


ERROR_COLUMNS = f"{'pass':>6s} {'seconds':>9s} {'relMSE':>11s} {'drop 0.1 %':>11s} {'mean ratio':>11s}"


def error_row(passes: int, seconds: float, measured: Metrics) -> str:
    """A line under `ERROR_COLUMNS`."""
    errors = f"{measured.relmse_all:11.4e} {measured.relmse_drop:11.4e} {measured.mean_ratio:11.5f}"
    return f"{passes:6d} {seconds:9.2f} {errors}"


def pixel_error(image: NDArray[Any], reference: Reference, x: int, y: int) -> float:
    """Relative squared error of one pixel of an image that may be coarser than the reference, x and y in its pixels."""
    rows, columns = image.shape[:2]
    width, height = reference.size
    there = image[y * rows // height, x * columns // width]
    return float(squared_error(there, reference.image[y, x]))


def _pixels(size: tuple[int, int]) -> str:
    return f"{size[0]}×{size[1]}"
