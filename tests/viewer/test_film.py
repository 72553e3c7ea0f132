"""The film of the window: keys by button and line of time, what is between them, undo, export, the session file."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from imgui_bundle import hello_imgui
from imgui_bundle import icons_fontawesome_6 as fa
from PIL import Image

from pmviewer.errors import SettingError
from pmviewer.output.session_file import read_session, write_session
from pmviewer.settings.access import Settings, with_values
from pmviewer.settings.film import FilmKey, FilmWay, from_tree, in_films
from tests.viewer.driver import app_on_engine, drive, finished, wait_until

SMALL = {"camera.width": 32, "camera.height": 32, "render.passes": 1, "photons.N": 2000}


def button(icon, name):
    return f"//Film/{icon}##film.{name}"


def test_a_film_is_made_gone_through_undone_and_written(tmp_path):
    with app_on_engine(tmp_path, "cornell_caustic", SMALL) as app:

        def script(c):
            state, film = app.state, app.state.film
            wait_until(c, lambda: finished(app))
            hello_imgui.get_runner_params().docking_params.dockable_window_of_name(
                "Film"
            ).focus_window_at_next_frame = True
            c.yield_(6)
            state.change({"camera.fov": 40.0, "photons.N": 1000})
            c.item_click(button(fa.ICON_FA_PLUS, "add_key"))
            state.change({"camera.fov": 60.0, "photons.N": 4000, "display.view": "normal"})
            c.item_click(button(fa.ICON_FA_PLUS, "add_key"))
            assert [key.at for key in film.keys] == [0.0, 2.0]
            film.go(1.0)
            assert state.settings.camera.fov == pytest.approx(50.0), "half-way"
            assert state.settings.photons.N == 2000, "of a logarithmic scale, by equal factors"
            assert state.settings.display.view == "normal", "the view is no part of it"
            c.item_click(button(fa.ICON_FA_TRASH, "remove"))
            assert len(film.keys) == 2, "there is no key here"
            c.item_click(button(fa.ICON_FA_FORWARD_STEP, "on"))
            assert film.at == 2.0
            c.item_click(button(fa.ICON_FA_TRASH, "remove"))
            assert len(film.keys) == 1
            state.undo()
            assert [key.at for key in film.keys] == [0.0, 2.0]
            assert film.move(1, 0.5) == 1
            film.play()
            before = len(state.history.done)
            wait_until(c, lambda: 0.1 < film.at < 0.4)
            assert 40 < state.settings.camera.fov < 60
            film.stop()
            fov = state.settings.camera.fov
            assert len(state.history.done) == before + 1, "playing is one step"
            film.play()
            wait_until(c, lambda: film.at > 0.1 and state.settings.camera.fov != fov)
            state.undo()
            assert not film.playing
            assert len(state.history.done) == before + 1, "undoing while it plays undoes the playing"
            assert state.settings.camera.fov == fov
            state.change({"display.view": "beauty"})
            film.export_as.fps, film.export_as.passes = 4.0, 1
            film.export(tmp_path / "film.webp")
            wait_until(c, lambda: not film.exporting)
            film.export_as.fps = 100.0
            film.export(tmp_path / "given_up.gif")
            film.cancel()
            wait_until(c, lambda: not film.exporting)
            app.commands.exports.session(tmp_path / "film.toml")
            wait_until(c, lambda: not state.background.running())

        drive(app, script)
        keys = app.state.film.keys
    with Image.open(tmp_path / "film.webp") as pictures:
        assert (pictures.n_frames, pictures.size) == (3, (32, 32))
        seen = []
        for number in range(3):
            pictures.seek(number)
            seen.append(np.asarray(pictures.convert("RGB"), float))
    assert all(np.abs(a - b).mean() > 1 for a, b in itertools.pairwise(seen)), "the camera zooms"
    assert not (tmp_path / "given_up.gif").exists()
    saved = read_session(tmp_path / "film.toml").film
    assert [key.at for key in saved] == [0.0, 0.5]
    assert [key.settings.camera.fov for key in saved] == [key.settings.camera.fov for key in keys] == [40.0, 60.0]


def test_between_keys_only_what_films_change_changes():
    first, second = (with_values(Settings(), {"gather.rays": rays}) for rays in (4, 16))
    way = FilmWay((1.0, 3.0), (first, second), ("gather.rays",))
    now = with_values(Settings(), {"render.passes": 7})
    assert [way.at(t, now).gather.rays for t in (0.0, 1.0, 2.0, 3.0, 9.0)] == [4, 4, 10, 16, 16]
    assert way.at(2.0, now).render.passes == 7
    assert [one.gather.rays for one in way.pictures(2.0, now)] == [4, 7, 10, 13, 16]
    assert not in_films("camera.width")
    assert not in_films("overlays.caustic.show")


def test_keys_in_a_session_file(tmp_path):
    keys = (FilmKey(0.5, with_values(Settings(), {"camera.origin": (1.0, 2.0, 3.0)})), FilmKey(4.0, Settings()))
    write_session(tmp_path / "a.toml", Settings(), "cornell_caustic", 1, film=keys)
    assert read_session(tmp_path / "a.toml").film == keys
    for rows in ({"at": 1}, [{"at": -1.0}], [{"at": 0.0}, {"at": 0}], [{"at": 1.0, "what": 2}], [{"settings": {}}]):
        with pytest.raises(SettingError, match="film"):
            from_tree(rows)
    with pytest.raises(SettingError):
        from_tree([{"at": 0.0, "settings": {"no.such": 1}}])
