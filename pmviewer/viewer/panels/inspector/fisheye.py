"""What a gather at the pixel sees, as a fisheye camera would: gathered, reprojected, and their difference."""

from __future__ import annotations

from functools import partial

import moderngl
import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from pmviewer.engine.inspector.report import Fisheye, Float, luminance
from pmviewer.output.tone import srgb_encode
from pmviewer.viewer import theme
from pmviewer.viewer.format import si
from pmviewer.viewer.gl.textures import HeldTexture, Same
from pmviewer.viewer.overlays.legend import wrapped
from pmviewer.viewer.panels.inspector.plots import on_hemisphere

SIDE = 320
"""Pixels of a disc across."""
BRIGHTEST = 98.0
"""Percentile of the luminance that is shown white, and of the difference that has its full colour."""
LESS, MORE = (0.30, 0.55, 1.0), (1.0, 0.55, 0.15)
"""Colours of what reprojection sees darker and brighter."""
LARGE = 20.0
"""Side of a disc under the mouse, in font sizes."""


def disc(cells: NDArray[np.floating], of: Fisheye, ground: tuple[float, float, float]) -> NDArray[np.float32]:
    """Display-encoded picture (SIDE, SIDE, 3) of display-encoded colours `cells` (rings, sectors, 3): the hemisphere
    seen from above, areas being projected solid angles, the viewer's side to the left; `ground` around it."""
    rings, sectors = cells.shape[:2]
    at = (np.arange(SIDE) + 0.5) * 2 / SIDE - 1
    x, y = np.meshgrid(at, -at)
    axes = on_hemisphere(np.stack([of.s, of.t]), of.n, of.wo)  # of the tangents in the plane of the picture
    u, v = x * axes[0, 0] + y * axes[0, 1], x * axes[1, 0] + y * axes[1, 1]
    r2, turn = u * u + v * v, np.arctan2(v, u) / (2 * np.pi) % 1.0
    j, k = np.minimum(r2 * rings, rings - 1).astype(int), np.minimum(turn * sectors, sectors - 1).astype(int)
    picture = np.where((r2 <= 1.0)[..., None], cells[j, k], np.asarray(ground))
    return np.ascontiguousarray(picture, np.float32)


def radiance_colours(radiance: Float, white: float) -> NDArray[np.float32]:
    """Display-encoded colours of radiance (rings, sectors, 3), `white` being the luminance of white."""
    return srgb_encode(np.clip(radiance / max(white, 1e-30), 0.0, 1.0).astype(np.float32))


def difference_colours(difference: Float, full: float) -> NDArray[np.float32]:
    """Display-encoded colours of differences in luminance (rings, sectors); black: none, full colour: `full`."""
    share = np.clip(difference / max(full, 1e-30), -1.0, 1.0)[..., None]
    return (np.maximum(share, 0.0) * MORE + np.maximum(-share, 0.0) * LESS).astype(np.float32)


def pictures(of: Fisheye, ground: tuple[float, float, float]) -> dict[str, NDArray[np.float32]]:
    """The discs by name."""
    white = float(np.percentile(luminance(of.gathered), BRIGHTEST))
    made = {"gathered": disc(radiance_colours(of.gathered, white), of, ground)}
    if of.reprojected is not None:
        made["reprojected"] = disc(radiance_colours(of.reprojected, white), of, ground)
        made["difference"] = disc(difference_colours(luminance(of.reprojected - of.gathered), white), of, ground)
    return made


def side_by_side(of: Fisheye) -> NDArray[np.uint8]:
    """All discs on white in a row, (SIDE, w, 3)."""
    gap = np.ones((SIDE, SIDE // 20, 3), np.float32)
    discs = [part for picture in pictures(of, (1.0, 1.0, 1.0)).values() for part in (picture, gap)][:-1]
    return np.round(np.concatenate(discs, axis=1) * 255).astype(np.uint8)


def described(of: Fisheye) -> str:
    """The figures of the discs and what their colours mean."""
    E = float(luminance(of.irradiance(of.gathered)))
    text = (
        f"Radiance of the {of.gathered.shape[0] * of.gathered.shape[1]} directions of a full gather here, latest pass, "
        f"seen along the normal, viewer to the left; white: {BRIGHTEST:g} % are darker. Irradiance {si(E, 'W/m²')}"
    )
    taken = "; the pass gathers as usual here"
    if of.estimate is not None:
        taken = f"; the pass takes {si(float(luminance(of.estimate)), 'W/m²')}"
    if of.reprojected is None or of.shot is None:
        return f"{text}{taken}."
    ours = float(luminance(of.irradiance(of.reprojected)))
    return (
        f"{text}; reprojected {si(ours, 'W/m²')}{taken}. {1 - of.shot.mean():.0%} of the directions are what full "
        "gathers near it know, the others are gathered here in both. Difference: orange where reprojection is "
        "brighter, blue where it is darker."
    )


class FisheyeDiscs:
    """Draws them; textures are made for another pass or pixel alone."""

    def __init__(self) -> None:
        self._textures: dict[str, HeldTexture] = {}

    def draw(self, of: Fisheye) -> None:
        """As many discs a row as there is room for."""
        ground = imgui.get_style().color_(imgui.Col_.window_bg)
        made: dict[str, NDArray[np.float32]] = {}

        def picture(name: str) -> NDArray[np.float32]:
            if not made:
                made.update(pictures(of, (ground.x, ground.y, ground.z)))
            return made[name]

        names = ("gathered",) if of.reprojected is None else ("gathered", "reprojected", "difference")
        room, gap = imgui.get_content_region_avail().x, imgui.get_style().item_spacing.x
        side = min(max((room - 2 * gap) / 3, 5.5 * imgui.get_font_size()), 12 * imgui.get_font_size(), room)
        large = LARGE * imgui.get_font_size()
        a_row = max(1, int((room + gap) / (side + gap)))
        for number, name in enumerate(names):
            if number % a_row:
                imgui.same_line()
            texture = self._textures.setdefault(name, HeldTexture(moderngl.get_context()))
            texture.take((Same(of), Same(theme.look)), partial(picture, name))
            imgui.begin_group()
            assert texture.texture is not None
            imgui.image(imgui.ImTextureRef(texture.texture.glo), (side, side))
            if imgui.begin_item_tooltip():
                imgui.image(imgui.ImTextureRef(texture.texture.glo), (large, large))
                imgui.end_tooltip()
            imgui.text_colored(imgui.ImVec4(*theme.DIM), name)
            imgui.end_group()
        wrapped(described(of))
