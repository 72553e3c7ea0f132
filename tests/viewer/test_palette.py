"""Commands and settings found by name, presets, changed settings, bundled scenes: what the menus and keys reach."""

from __future__ import annotations

from imgui_bundle import imgui

from pmviewer.settings.access import SETTINGS, Settings, with_values
from pmviewer.settings.presets import PRESETS
from pmviewer.viewer.panels.palette import entries, found
from tests.viewer.driver import chord, drive, item

K = imgui.Key
NO_ERROR = imgui.test_engine.TestOpFlags_.no_error


def test_every_command_and_setting_is_found_by_its_name(app):
    everything = entries()
    actions = {entry.action for entry in everything if entry.action}
    assert actions == set(app.commands.table), "no command without an entry, no entry without a command"
    for path, info in SETTINGS.items():
        assert any(e.setting is info for e in found(path, everything)[:3]), path
    assert found("undo", everything)[0].action == "undo"
    assert found("light pass n", everything)[0].setting.path == "photons.N"
    assert found("no such thing at all", everything) == []


def test_the_palette_runs_commands_and_edits_settings_from_the_keyboard(app, session):
    def wanted(c, text):
        c.key_press(chord(K.p, K.mod_ctrl))
        c.yield_(3)
        c.key_chars(text)
        c.yield_(2)
        c.key_press(K.enter)
        c.yield_(3)

    def script(c):
        wanted(c, "pause or")
        assert session.paused
        assert not app.commands.palette.is_open
        wanted(c, "photons.indirect_caustics")
        assert session.settings.photons.indirect_caustics is False
        assert app.commands.palette.is_open, "for the next setting"
        c.key_press(K.escape)
        c.yield_(2)
        wanted(c, "photons.N")
        c.key_chars_replace_enter("4321")
        c.yield_(2)
        assert session.settings.photons.N == 4321
        c.key_press(K.escape)
        c.yield_(3)
        assert not app.commands.palette.is_open
        wanted(c, "preset knaus")
        assert session.settings.photons.sequence == "independent"
        app.state.undo()
        assert session.settings.photons.N == 4321
        assert session.settings.photons.sequence == "sobol"

    drive(app, script)
    assert [m for m in app.state.log if m.level == "error"] == []


def test_changed_settings_are_listed_and_reset_each(app, session):
    session.settings = with_values(Settings(), {"gather.rays": 9, "overlays.paths.count": 7, "estimate.k": 3})

    def script(c):
        c.yield_(2)
        assert c.item_info(item("gather.rays"), NO_ERROR).id_ == 0, "its group is closed"
        c.menu_click("//##MainMenuBar/Edit/Changed settings")
        c.yield_(3)
        for path in ("gather.rays", "overlays.paths.count", "estimate.k"):
            assert c.item_info(item(path), NO_ERROR).id_ != 0
        assert c.item_info(item("photons.glossy"), NO_ERROR).id_ == 0
        c.item_click("//Settings/**/\uf0e2##reset.overlays.paths.count")
        c.yield_(2)
        assert session.settings.overlays.paths.count == Settings().overlays.paths.count
        assert session.settings.gather.rays == 9
        c.key_press(chord(K.l, K.mod_ctrl))
        c.yield_(2)
        assert c.item_info(item("photons.glossy"), NO_ERROR).id_ != 0

    drive(app, script)


def test_presets_and_bundled_scenes_are_in_the_menus(app, session):
    preset = next(p for p in PRESETS if p.name == "Pharr")

    def script(c):
        c.menu_click("//##MainMenuBar/Edit/Presets/Pharr")
        c.yield_(2)
        assert session.settings == with_values(Settings(), preset.assignments())
        c.key_press(chord(K.z, K.mod_ctrl))
        c.yield_(2)
        assert session.settings == Settings()
        c.menu_action(imgui.test_engine.TestAction.hover, "//##MainMenuBar/File/Bundled scenes/cornell_diffuse")
        c.yield_(30)
        c.menu_click("//##MainMenuBar/File/Bundled scenes/cornell_diffuse")
        c.yield_(3)

    drive(app, script)
    assert session.opened[-1] == "cornell_diffuse"
