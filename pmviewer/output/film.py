"""Films of pictures: MP4 (H.264, by ffmpeg through `imageio-ffmpeg`, the extra `film`), GIF and WebP."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Generator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pmviewer.errors import OutputError
from pmviewer.output.files import check_target, write_file

FORMATS = (".mp4", ".gif", ".webp")
Pixels = NDArray[np.uint8]
NO_FFMPEG = "MP4 needs the extra 'film': pip install 'pmviewer[film]' (imageio-ffmpeg). GIF and WebP need nothing."
QUALITY = 8
"""Of 10: hardly to be told from the pictures."""


def numbered(path: Path, number: int, count: int) -> Path:
    """The file of one picture of `count`: its number, from 1, behind the name."""
    return path.with_stem(f"{path.stem}_{number:0{max(4, len(str(count)))}d}")


class Film:
    """Takes the pictures (h, w, 3) of a film one after the other; `close` writes the file, whole or not at all."""

    def __init__(self, path: Path, fps: float) -> None:
        """Raises OutputError for another format, a missing folder, and MP4 without ffmpeg."""
        check_target(path, FORMATS)
        self.path, self.fps = path, fps
        self._pictures: list[Image.Image] = []
        self._encoder: Generator[None, Any, None] | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        if path.suffix.lower() == ".mp4":
            try:
                import imageio_ffmpeg  # noqa: F401 - tried before anything is rendered
            except ImportError:
                raise OutputError(f"{path}: {NO_FFMPEG}") from None

    def add(self, picture: Pixels) -> None:
        """The next picture. All are of one size."""
        if self.path.suffix.lower() != ".mp4":
            self._pictures.append(Image.fromarray(np.ascontiguousarray(picture)))
            return
        even = np.pad(picture, [(0, picture.shape[0] % 2), (0, picture.shape[1] % 2), (0, 0)], "edge")  # H.264's wish
        if self._encoder is None:
            self._encoder = self._begin((even.shape[1], even.shape[0]))
        try:
            self._encoder.send(np.ascontiguousarray(even))
        except OSError as error:
            raise OutputError(f"{self.path}: the film can't be encoded ({error}).") from None

    def close(self) -> None:
        """Write the file. Raises OutputError; the old file then stays."""
        if self._encoder is not None:
            assert self._folder is not None
            self._encoder.close()
            with self._folder as folder:
                data = (Path(folder) / "film.mp4").read_bytes()
            if not data:
                raise OutputError(f"{self.path}: the film can't be encoded.")
            write_file(self.path, data, FORMATS)
        elif self._pictures:
            write_file(self.path, self._animated(), FORMATS)

    def drop(self) -> None:
        """Give it up: nothing is written."""
        self._pictures = []
        if self._encoder is not None:
            self._encoder.close()
            self._encoder = None
        if self._folder is not None:
            self._folder.cleanup()

    def _begin(self, size: tuple[int, int]) -> Generator[None, Any, None]:
        import imageio_ffmpeg

        self._folder = tempfile.TemporaryDirectory(prefix="pmviewer-film-")
        path = str(Path(self._folder.name) / "film.mp4")
        encoder: Generator[None, Any, None] = imageio_ffmpeg.write_frames(
            path, size, fps=self.fps, quality=QUALITY, macro_block_size=2, ffmpeg_log_level="error"
        )
        encoder.send(None)
        return encoder

    def _animated(self) -> bytes:
        """GIF or WebP, endless."""
        kind = self.path.suffix[1:].upper()
        first, *others = self._pictures
        more: dict[str, Any] = {"quality": 90} if kind == "WEBP" else {"optimize": True}
        duration = max(round(1000 / self.fps), 20)  # what viewers show faster, they show slowly
        buffer = io.BytesIO()
        first.save(buffer, kind, save_all=True, append_images=others, duration=duration, loop=0, **more)
        return buffer.getvalue()
