"""The picture that the window shows while the estimate is coarse or noisy (`display.preview`), frame by frame.

Where a pass takes long, the coarse frame is drawn out along the edges of the full size's first hits. Where only the
camera moved, diffuse light comes from the last picture, as far as that saw the same places; it counts as so many passes
as the last picture had, `MOST` at most, so that what it blurs is soon outweighed. With `denoised` a trained network
smooths what is there, until passes say that the estimate is `CLEAN` without. Everything happens to a copy: film and
frame's planes stay the estimate, and the frame says in words what its preview is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.frame import Frame, Preview
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.preview.first_hits import first_hits
from pmviewer.engine.preview.signals import guides_of, halved, picture_of, signals_of
from pmviewer.engine.published import Published
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages.eye import outline_of
from pmviewer.engine.stages.pass_data import RenderedPass
from pmviewer.errors import OutputError
from pmviewer.output.denoise import denoised
from pmviewer.render.camera import CameraPose
from pmviewer.render.planes import PLANES
from pmviewer.render.preview.guided import GUIDES, SIGNALS, VIEW, reproject, upsample, view_row
from pmviewer.settings.access import SETTINGS, Settings, get

F4 = NDArray[np.float32]
MOST = 8
"""Passes that the light of the last picture counts as, at most."""
CLEAN = 1e-3
"""Estimated relMSE from which a picture is shown as it is."""
LONG = 0.3
"""Seconds that the first pass must be expected to take for a coarse frame to be drawn out, which costs a third of a
quick one."""
MOST_PIXELS = 2_500_000
"""Larger pictures are shown as they are: previews would need as much memory again."""
ROWS = 32
"""Rows of a picture a task."""


@dataclass(frozen=True, eq=False)
class _Last:
    """The newest picture of passes, and the scene that it shows."""

    frame: Frame
    scene: int


@dataclass(frozen=True, eq=False)
class _Known:
    """Diffuse light over albedo that the last picture knows of a renderer's: (h, w, 3), how much of it belongs there,
    (h, w), and how many passes it counts as."""

    renderer: Renderer
    light: F4
    share: F4
    passes: int


class Previews:
    """Those of one session, for its worker thread."""

    def __init__(self, pool: WorkPool, published: Published) -> None:
        self._pool, self._published = pool, published
        self._last: _Last | None = None
        self._known: _Known | None = None
        self._shown: Preview | None = None
        self._denoises = True

    def draw_out(self, renderer: Renderer, frame: Frame, settings: Settings) -> None:
        """Show a coarse frame in the full size, where the first pass would be long in coming. Raises Cancelled."""
        self._known = self._shown = None
        if settings.display.preview == "off" or not can_preview(renderer) or renderer.coarse_pass is None:
            return
        more = renderer.camera.width * renderer.camera.height / (frame.planes.shape[0] * frame.planes.shape[1])
        if frame.statistics.cpu_seconds * more / self._pool.threads > LONG:
            self._shown = self._of_coarse(renderer, renderer.coarse_pass, frame, settings)
            self._published.preview(self._shown)

    def show(self, renderer: Renderer, frame: Frame, settings: Settings, last: bool, version: int) -> None:
        """Publish the frame of the film after a pass, with its preview where it has one; `last` if no other pass
        follows. The first picture since a change does not wait for the denoiser, unless a coarse one was denoised for
        it. Raises Cancelled."""
        passes, remaining = frame.statistics.passes, frame.statistics.remaining
        off = last or settings.display.preview == "off" or settings.region.on or not can_preview(renderer)
        if passes == 1 and self._known is None and not off:
            self._reprojected(renderer, self._banded(guides_of, GUIDES, frame.planes))
        self._last = _Last(frame, renderer.scene.uid) if can_preview(renderer) else None
        if self._known is not None and (self._known.renderer is not renderer or passes >= self._known.passes):
            self._known = None
        smooths = not off and self._smooths(settings) and (remaining is None or remaining.relmse > CLEAN)
        if off or (self._known is None and not smooths):
            self._shown = None
        elif self._shown is None and smooths:
            quick = self._made(renderer, frame, smooths=False) if self._known is not None else None
            self._published.show(replace(frame, preview=quick), version)
            self._shown = self._made(renderer, frame, smooths=True)
            self._published.preview(self._shown)
            return
        elif not smooths or is_due(passes):
            self._shown = self._made(renderer, frame, smooths)
        self._published.show(replace(frame, preview=self._shown), version)

    def _of_coarse(self, renderer: Renderer, seen: RenderedPass, frame: Frame, settings: Settings) -> Preview:
        camera, pool = renderer.camera, self._pool
        outline = np.zeros(0, np.uint8)
        if not renderer.plan.path:
            outline = outline_of(renderer.scene, camera, renderer.film, renderer.settings, renderer.store)
        planes = first_hits(seen.given, seen.maps, camera, renderer.settings, renderer.plan, outline, pool)
        small, small_guides = signals_of(frame.planes), guides_of(frame.planes)
        guides = self._banded(guides_of, GUIDES, planes)
        caption = "a coarse picture drawn out along edges"
        if self._smooths(settings):
            small = self._denoised(signals_of(frame.independent), frame.independent)
            caption = "a coarse picture, denoised and drawn out"
        signals = self._drawn_out(small, small_guides, camera, guides, camera.width / frame.planes.shape[1])
        known = self._reprojected(renderer, guides)
        if known is not None:
            share = known.share[..., None]
            signals[..., :3] += share * (known.light - signals[..., :3])
            caption = f"light of the last picture ({100 * float(share.mean()):.0f} %), {caption}"
        return Preview(self._banded(picture_of, 3, signals, planes), caption)

    def _made(self, renderer: Renderer, frame: Frame, smooths: bool) -> Preview:
        planes = frame.independent if smooths else frame.planes
        signals, passes, known = self._banded(signals_of, SIGNALS, planes), frame.statistics.passes, self._known
        caption = f"{passes} pass" if passes == 1 else f"{passes} passes"
        if known is not None:
            weight = (known.share * (known.passes / passes))[..., None]
            signals[..., :3] = (signals[..., :3] + weight * known.light) / (1.0 + weight)
            caption = f"{caption} with light of the last picture"
        if smooths and renderer.scene.traits.follows(renderer.settings.photons.glossy):
            picture = self._banded(picture_of, 3, signals, planes)
            return Preview(self._smoothed(picture, planes[..., PLANES["albedo"]], planes), f"{caption}, denoised")
        if smooths:  # nothing but edges is finer than what light does
            guides, small = self._banded(guides_of, GUIDES, planes), halved(planes)
            few = self._denoised(halved(signals), small)
            signals = self._drawn_out(few, np.ascontiguousarray(guides[1::2, 1::2]), frame.camera, guides, 2.0)
            caption = f"{caption}, denoised"
        return Preview(self._banded(picture_of, 3, signals, planes), caption)

    def _smooths(self, settings: Settings) -> bool:
        return settings.display.preview == "denoised" and self._denoises

    def _denoised(self, signals: F4, planes: F4) -> F4:
        """Both signals (h, w, 6) without noise; as they are where the denoiser refuses to work."""
        out, albedo = signals.copy(), planes[..., PLANES["albedo"]]
        for part, colour in ((slice(0, 3), np.ones_like(albedo)), (slice(3, 6), albedo)):
            if np.any(signals[..., part]):
                out[..., part] = self._smoothed(signals[..., part], colour, planes)
        return out

    def _smoothed(self, light: F4, albedo: F4, planes: F4) -> F4:
        normal = np.ascontiguousarray(planes[..., PLANES["normal"]])
        try:
            return self._pool.run([partial(denoised, light, albedo, normal, self._pool.threads, fast=True)])[0]
        except OutputError as error:
            self._denoises = False
            self._published.say("warning", f"{error} Pictures are shown as they are (display.preview).")
            return light

    def _drawn_out(self, small: F4, small_guides: F4, camera: CameraPose, guides: F4, shrink: float) -> F4:
        out = np.empty((*guides.shape[:2], small.shape[-1]), np.float32)
        self._by_rows(partial(upsample, small, small_guides, view_row(camera), guides, shrink, out), out)
        return out

    def _reprojected(self, renderer: Renderer, guides: F4) -> _Known | None:
        last = self._last
        if last is None or last.scene != renderer.scene.uid or not is_move(last.frame, renderer):
            return None
        seen = last.frame.planes
        before, before_guides = self._banded(signals_of, SIGNALS, seen), self._banded(guides_of, GUIDES, seen)
        light, share = np.zeros((*guides.shape[:2], 3), np.float32), np.zeros(guides.shape[:2], np.float32)
        views = view_row(last.frame.camera), view_row(renderer.camera)
        self._by_rows(partial(reproject, before, before_guides, *views, guides, light, share), light)
        self._known = _Known(renderer, light, share, min(last.frame.statistics.passes, MOST))
        return self._known

    def _banded(self, make: Callable[..., F4], channels: int, *images: F4) -> F4:
        """What `make` makes of images (h, w, …), band by band: (h, w, channels)."""
        out = np.empty((*images[0].shape[:2], channels), np.float32)

        def band(first: int, last: int) -> None:
            out[first:last] = make(*(image[first:last] for image in images))

        self._by_rows(band, out)
        return out

    def _by_rows(self, kernel: Callable[[int, int], None], out: F4) -> None:
        rows = range(0, len(out), ROWS)
        self._pool.run([partial(kernel, first, min(first + ROWS, len(out))) for first in rows])


def prepare_previews() -> None:
    """Compile the kernels, or load them."""
    signals, guides, view = (
        np.zeros((1, 1, SIGNALS), np.float32),
        np.zeros((1, 1, GUIDES), np.float32),
        np.zeros(VIEW, "f4"),
    )
    upsample(signals, guides, view, guides, 1.0, signals, 0, 0)
    reproject(signals, guides, view, view, guides, signals[..., :3].copy(), signals[..., 0].copy(), 0, 0)


def can_preview(renderer: Renderer) -> bool:
    """Whether first hits can be had of such passes: media have light between them, estimates are numbered by pixel, and
    weighted virtual lights divide sums."""
    plan, camera = renderer.plan, renderer.camera
    return not (plan.media or plan.virtual or plan.estimation) and camera.width * camera.height <= MOST_PIXELS


def is_due(passes: int) -> bool:
    """1, 2, 4, 8, 16 … passes: the denoiser takes as long as a pass."""
    return passes & (passes - 1) == 0


def is_move(frame: Frame, renderer: Renderer) -> bool:
    """Whether the frame shows what the renderer will, from elsewhere: nothing but cameras without a lens differs."""
    before, after = frame.settings, renderer.settings
    if frame.camera.aperture > 0 or renderer.camera.aperture > 0:
        return False
    return all(
        path.startswith(("camera.", "free_camera.")) or info.stage in ("display", "stop")
        for path, info in SETTINGS.items()
        if get(before, path) != get(after, path)
    )
