"""Overlays of light's ways and the diagnostic views, in the window on the real engine."""

from __future__ import annotations

import numpy as np
import pytest
from imgui_bundle import ImVec2, imgui

from pmviewer.output.diagnostic_views import DIAGNOSTICS, coloured
from pmviewer.output.exr import read_exr
from pmviewer.output.falsecolour import COLOURS
from pmviewer.output.frame_export import layer_name
from pmviewer.output.tone import to_uint8
from pmviewer.photons.projection.light_map import ProjectionMap
from pmviewer.settings.access import get
from pmviewer.viewer.gl.palette import FATE_PALETTE, LIGHT_PALETTE, LIT_COLOUR, SHADOW_COLOUR
from pmviewer.viewer.gl.records import directions, encoded
from pmviewer.viewer.overlays.gather_rays import gather_lines
from pmviewer.viewer.overlays.irradiance_cache import circles
from pmviewer.viewer.overlays.projection_maps import cell_corners
from pmviewer.viewer.panels.light_list import top_lights
from tests.support import naive_maps as naive
from tests.viewer.driver import (
    app_on_engine,
    chord,
    drive,
    finished,
    on_window_thread,
    overlay_item,
    viewport_pixels,
    wait_until,
)

K = imgui.Key
SIZE = 64
VALUES = {
    "camera.width": SIZE,
    "camera.height": SIZE,
    "photons.N": 5_000,
    "photons.q": 0.5,
    "photons.projection": "on",
    "render.passes": 2,
    "render.method": "gather",
    "gather.radiance_photons": "1/4",
    "direct.shadow_photons": True,
    "direct.shadow_N": 20_000,
    "importance.map": "average",
    "importance.N": 2_000,
    "importance.deposition": "density control",
    "importance.convergence": "square",
    "importance.f": 0.05,
    "display.shading": 0.0,
}


@pytest.fixture
def app(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with app_on_engine(tmp_path, "cornell_caustic", VALUES) as app:
        yield app


def test_views_are_made_on_demand_in_the_legends_colours(app, tmp_path):
    """Each view shows its plane in false colours, without a new pass; the exported EXR holds the plane."""
    seen, frames, refused = {}, [], []

    def script(c):
        wait_until(c, lambda: finished(app))
        frames.append(app.state.frame)
        for view in DIAGNOSTICS:
            if app.state.refused_view(view) is not None:
                refused.append(view)
                continue
            app.state.change({"display.view": view})
            wait_until(c, lambda view=view: view in app.state.frame.diagnostics)
            c.yield_(3)
            frames.append(app.state.frame)
            seen[view] = on_window_thread(c, lambda: app.viewport.capture(overlays=False))
        app.commands.exports.exr(tmp_path / "a.exr")
        app.state.change({"display.view": "radiance cells", "render.method": "path"})
        wait_until(c, lambda: finished(app) and app.state.frame.settings.render.method == "path")
        c.yield_(2)
        assert app.state.shown_display.view == "beauty"
        assert "gather" in app.state.refused_view("radiance cells")
        assert "stored" in app.state.refused_view("storing probability")

    drive(app, script)
    estimation = ["estimation mask", "gathered points", "subdivision level", "reprojected share"]
    media = [
        "optical depth",
        "mean free path",
        "volume radius",
        "volume photon count",
        "extinction slice",
        "photon slice",
    ]
    unlike = ["storing probability", "virtual light error", "sum of weights", "normalisation"]
    assert refused == [*unlike, *estimation, *media]
    for frame, (view, pixels) in zip(frames[1:], seen.items(), strict=True):
        assert frame.planes is frames[0].planes
        expected = to_uint8(coloured(view, frame.image(view)))
        near = np.abs(pixels.astype(int) - expected).max(axis=-1) <= 4  # a step of the colour table
        assert near.mean() > 0.99, view
        assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 1
    layers, metadata = read_exr(tmp_path / "a.exr")
    last = [view for view in seen if view in frames[-1].diagnostics]
    for view in last:
        np.testing.assert_array_equal(layers[layer_name(view)], frames[-1].image(view))
        unit = [value for name, value in metadata.items() if name.endswith(f"units.{layer_name(view)}")]
        assert unit == [DIAGNOSTICS[view].unit]
    assert list(seen)[-1] in last


def test_every_way_of_light_is_drawn_by_its_key(app):
    """Paths, gather rays of the pixel under the mouse, projection maps, and shadow photons in two colours."""
    changed, colours = {}, {}

    def script(c):
        wait_until(c, lambda: finished(app))
        c.yield_(3)
        plain = viewport_pixels(c, app)

        def difference(name, ready):
            wait_until(c, ready)
            c.yield_(4)
            pixels = viewport_pixels(c, app)
            changed[name] = (pixels != plain).any(axis=-1).mean()
            return pixels

        serial = app.state.frame.statistics.passes
        c.key_press(K.p)
        difference("paths", lambda: app.state.frame.inspection.paths is not None)
        c.item_click(overlay_item("photon paths##overlays.paths.show"))
        c.yield_(2)
        assert not app.state.settings.overlays.paths.show
        c.key_press(K.j)
        x, y = app.viewport.origin
        w, h = app.viewport.size
        c.mouse_move_to_pos(ImVec2(x + 0.5 * w, y + 0.9 * h))
        c.key_press(K.i)
        difference("gather", lambda: app.state.frame.inspection.gathered is not None)
        assert app.viewport.inspected == app.viewport.pixel_under_mouse()
        c.key_press(K.j)
        c.key_press(K.m)
        app.state.change({"overlays.projection.map": "caustic", "overlays.projection.depth": False})
        difference("projection", lambda: get(app.state.settings, "overlays.projection.show"))
        c.key_press(K.m)
        c.key_press(chord(K.c, K.mod_shift))
        pixels = difference("shadow", lambda: get(app.state.settings, "overlays.shadow.show"))
        for name, colour in (("lit", LIT_COLOUR), ("shadow", SHADOW_COLOUR)):
            near = np.abs(pixels.astype(int) - np.array(colour) * 255).max(axis=-1) <= 2
            colours[name] = near.mean()
        app.state.change({"overlays.shadow.lit": False})
        c.yield_(4)
        pixels = viewport_pixels(c, app)
        colours["hidden"] = (np.abs(pixels.astype(int) - np.array(LIT_COLOUR) * 255).max(axis=-1) <= 2).mean()
        assert app.state.frame.statistics.passes == serial

    drive(app, script)
    assert all(share > 0.002 for share in changed.values()), changed
    assert colours["lit"] > 0.05 > colours["shadow"] > 0.001
    assert colours["hidden"] < 0.01 * colours["lit"]


def test_importance_is_drawn_by_its_keys(app):
    """Importons in false colours, of one map or both; photons by fate; the lights; and the panel with its figures."""
    shares = {}

    def near(pixels, colours):
        seen, count = np.unique(pixels.reshape(-1, 3), axis=0, return_counts=True)
        off = np.abs(seen[:, None].astype(int) - np.round(np.array(colours) * 255)).max(axis=-1)
        return count[(off <= 2).any(axis=-1)].sum() / count.sum()

    def script(c):
        app.state.change({"importance.deposition": "Keller-Wald", "display.view": "storing probability"})
        wait_until(c, lambda: finished(app) and "storing probability" in app.state.frame.diagnostics)
        c.yield_(3)
        shares["probability"] = near(viewport_pixels(c, app), COLOURS)
        app.state.change({"display.view": "beauty"})
        c.yield_(3)
        passes = app.state.frame.statistics.passes
        c.window_focus("//Importance")
        c.key_press(chord(K.m, K.mod_shift))
        app.state.change({"overlays.importons.colour": "map", "overlays.importons.depth": False})
        c.yield_(4)
        pixels = viewport_pixels(c, app)
        shares["both maps"] = min(near(pixels, [colour]) for colour in LIGHT_PALETTE[:2])
        app.state.change({"overlays.importons.map": "global"})
        c.yield_(4)
        pixels = viewport_pixels(c, app)
        shares["global alone"] = near(pixels, [LIGHT_PALETTE[1]])
        shares["caustic hidden"] = 1 - near(pixels, [LIGHT_PALETTE[0]])
        for kind in ("screen", "footprint", "average", "importance"):
            app.state.change({"overlays.importons.colour": kind})
            c.yield_(4)
            shares[kind] = near(viewport_pixels(c, app), COLOURS[::3])
        c.key_press(chord(K.m, K.mod_shift))
        c.key_press(chord(K.f, K.mod_shift))
        wait_until(c, lambda: app.state.frame.inspection.fates is not None)
        c.yield_(4)
        pixels = viewport_pixels(c, app)
        shares["stored"], shares["rejected"] = (near(pixels, [colour]) for colour in FATE_PALETTE[:2])
        c.key_press(chord(K.f, K.mod_shift))
        assert not app.state.settings.overlays.fates.show
        before = viewport_pixels(c, app)
        c.key_press(K.l)
        wait_until(c, lambda: app.state.frame.known_lights is not None)
        c.yield_(4)
        assert top_lights(app.state.frame.known_lights, 5) == [0]
        shares["light"] = (viewport_pixels(c, app) != before).any(axis=-1).mean()
        assert app.state.frame.statistics.passes == passes

    drive(app, script)
    assert all(share > 0.0003 for share in shares.values()), shares
    assert shares["caustic hidden"] > 0.999


def test_gather_rays_become_coloured_lines():
    rows = np.zeros((3, 10), np.float32)
    rows[:, 3:6] = np.eye(3)
    rows[:, 6:9] = [[2.0, 1.0, 0.5], [0.0, 0.0, 0.0], [0.25, 0.0, 1.0]]
    rows[2, 9] = 1
    ends, unit = gather_lines(rows)
    assert unit == 2.0
    np.testing.assert_array_equal(ends[1::2, :3], rows[:, 3:6])
    words = ends[1::2].view(np.uint32)
    np.testing.assert_array_equal(words[:, 5] >> 16, [0, 0, 1])
    np.testing.assert_array_equal(words[:, 4] & 0xFFFF, naive.encode_power(rows[:, 6] / 2))
    values = np.random.default_rng(1).lognormal(0, 8, 1000).astype(np.float32)
    np.testing.assert_array_equal(encoded(values), naive.encode_power(values))


def test_circles_lie_in_the_records_planes_with_their_reach():
    rng = np.random.default_rng(2)
    n = rng.normal(size=(5000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    records = naive.pack(rng.uniform(-1, 1, (5000, 3)), n)
    np.testing.assert_allclose(directions(records), n, atol=8e-3)
    reach = rng.uniform(0.1, 1, 5000).astype(np.float32)
    ends = circles(records, reach).reshape(24, -1, 2, 6)
    assert ends.shape[1] == 1667, "every third"
    off = ends[..., :3] - records[::3, None, :3]
    np.testing.assert_allclose(
        np.linalg.norm(off, axis=-1), np.broadcast_to(reach[::3, None], off.shape[:-1]), rtol=1e-3
    )
    assert np.abs((off * directions(records[::3])[:, None]).sum(axis=-1)).max() < 1e-5


def test_cells_lie_on_the_shell_in_their_directions():
    on = np.zeros((4, 8), bool)
    on[0, 0] = on[3, 5] = True
    axes = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    cells = ProjectionMap("lamp", "directions", on, np.linspace(0, np.pi, 5), axes, np.array([1.0, 2.0, 3.0]), 0.1)
    corners = cell_corners(cells, 0.5) - cells.origin
    np.testing.assert_allclose(np.linalg.norm(corners, axis=-1), 0.5)
    np.testing.assert_allclose(corners[0, 0], [0.5, 0, 0], atol=1e-12)  # θ = 0
    np.testing.assert_allclose(corners[0, 1], 0.5 * (np.cos(np.pi / 4) * axes[2] + np.sin(np.pi / 4) * axes[0]))
    np.testing.assert_allclose(corners[1, 1], [-0.5, 0, 0], atol=1e-12)  # θ = π
