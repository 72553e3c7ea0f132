"""Session files bring back scene and settings exactly; whatever is wrong with one is said in one sentence."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from pmviewer.errors import OutputError, PmviewerError, SceneError, SettingError
from pmviewer.output.session_file import read_session, write_session
from pmviewer.settings.access import SETTINGS, SettingInfo, Settings, with_values


def values_of(info: SettingInfo) -> st.SearchStrategy:
    """What the schema allows for one setting."""
    if info.choices:
        plain: st.SearchStrategy = st.sampled_from(info.choices)
    elif info.scale == "name":
        plain = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
    elif info.scale == "edits":
        names = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=9)
        plain = st.dictionaries(names.map("light.{}.power".format), st.tuples(st.floats(0.0, 1e9)), max_size=3)
    elif info.scale == "vector":
        plain = st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3)
    elif info.kind is bool:
        plain = st.booleans()
    elif info.kind is int:
        plain = st.integers(int(info.lower), int(info.upper))
    else:
        plain = st.floats(info.lower, info.upper)
    return st.one_of(st.just("auto"), plain) if info.auto else plain


some_settings = st.fixed_dictionaries({}, optional={path: values_of(info) for path, info in SETTINGS.items()})
texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


@given(some_settings, st.integers(0, 1_000_000), st.dictionaries(texts, texts, max_size=3))
@hypothesis_settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_any_session_comes_back(tmp_path, values, passes, parameters):
    settings = with_values(Settings(), values)
    write_session(tmp_path / "a.toml", settings, "cornell_caustic", passes, parameters)
    got = read_session(tmp_path / "a.toml")
    assert got.settings == settings
    assert (got.scene, got.passes, got.parameters) == ("cornell_caustic", passes, parameters)


def test_only_what_differs_from_the_defaults_is_written(tmp_path):
    write_session(tmp_path / "plain.toml", Settings(), "cornell_diffuse", 64)
    settings = with_values(Settings(), {"photons.N": 1000, "overlays.global.show": True})
    write_session(tmp_path / "changed.toml", settings, "cornell_diffuse", 64, {"res": "64"})
    plain = tomllib.loads((tmp_path / "plain.toml").read_text("utf-8"))
    changed = tomllib.loads((tmp_path / "changed.toml").read_text("utf-8"))
    program = plain.pop("program")
    assert program.startswith("pmviewer ")
    assert plain == {"format": 1, "scene": "cornell_diffuse", "passes": 64}
    assert changed["settings"] == {"photons": {"N": 1000}, "overlays": {"global": {"show": True}}}
    assert changed["parameters"] == {"res": "64"}


def make_scene(path: Path) -> str:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("<scene/>")
    return str(path)


@pytest.mark.parametrize(
    ("scene", "stored"),
    [
        ("work/box.xml", "./box.xml"),
        ("work/scenes/box.xml", "./scenes/box.xml"),
        ("models/box.xml", "../models/box.xml"),
        ("work/box room.glb", "./box room.glb"),
    ],
)
def test_scene_near_the_session_moves_with_it(tmp_path, scene, stored):
    source = make_scene(tmp_path / scene)
    (tmp_path / "work").mkdir(exist_ok=True)
    session = tmp_path / "work" / "a.toml"
    write_session(session, Settings(), source, 1)
    assert tomllib.loads(session.read_text("utf-8"))["scene"] == stored
    assert read_session(session).scene == source
    moved = tmp_path.with_name(tmp_path.name + "-moved")
    os.rename(tmp_path, moved)
    assert read_session(moved / "work" / "a.toml").scene == str(moved / scene)


def test_scene_far_away_is_stored_by_its_whole_path(tmp_path):
    source = make_scene(tmp_path / "models" / "box.xml")
    folder = tmp_path / "a" / "b" / "c"
    folder.mkdir(parents=True)
    write_session(folder / "s.toml", Settings(), source, 1)
    assert tomllib.loads((folder / "s.toml").read_text("utf-8"))["scene"] == source
    assert read_session(folder / "s.toml").scene == source


def test_scene_given_relative_to_the_working_folder(tmp_path, monkeypatch):
    make_scene(tmp_path / "models" / "box.xml")
    (tmp_path / "out").mkdir()
    monkeypatch.chdir(tmp_path)
    write_session("out/a.toml", Settings(), "models/box.xml", 1)
    monkeypatch.chdir("/")
    assert read_session(tmp_path / "out" / "a.toml").scene == str(tmp_path / "models" / "box.xml")


def test_scene_folder_is_not_taken_for_a_bundled_name(tmp_path):
    make_scene(tmp_path / "cornell_caustic" / "scene.xml")
    write_session(tmp_path / "a.toml", Settings(), str(tmp_path / "cornell_caustic"), 1)
    assert read_session(tmp_path / "a.toml").scene == str(tmp_path / "cornell_caustic")


def test_bundled_scene_is_stored_by_name_however_it_was_opened(tmp_path, monkeypatch):
    bundled = tmp_path / "program" / "scenes"
    make_scene(bundled / "box" / "scene.xml")
    monkeypatch.setattr("pmviewer.output.session_file.data_folder", lambda name: bundled)
    for scene in ("box", str(bundled / "box"), str(bundled / "box" / "scene.xml")):
        write_session(tmp_path / "a.toml", Settings(), scene, 1)
        assert read_session(tmp_path / "a.toml").scene == "box"


def test_file_names_written_by_hand_are_relative_to_the_session(tmp_path):
    (tmp_path / "a.toml").write_text('format = 1\nscene = "box.xml"\n')
    got = read_session(tmp_path / "a.toml")
    assert got.scene == str(tmp_path / "box.xml")
    assert got.settings == Settings()
    assert (got.passes, got.parameters) == (0, {})


def test_numbers_as_parameters_are_texts(tmp_path):
    (tmp_path / "a.toml").write_text('format = 1\nscene = "box"\n[parameters]\nres = 64\neta = 1.5\n')
    assert read_session(tmp_path / "a.toml").parameters == {"res": "64", "eta": "1.5"}


GOOD = 'format = 1\nscene = "cornell_caustic"\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("format = 1\nscene = \n", r"a\.toml:2: This is not a session file: invalid value"),
        (GOOD + "[settings\n", r"a\.toml:3: This is not a session file: expected ']'"),
        (GOOD + "format = 1\n", r"a\.toml:3: .*cannot overwrite a value"),
        ("a = " + "[" * 5000, r"not a session file"),
        ("a = " + "9" * 5000, r"not a session file"),
        ("", r"a\.toml: format is missing; this program reads session files with format = 1"),
        ('format = 2\nscene = "box"\n', r"a\.toml: format = 2; this program reads .* format = 1"),
        ("format = 1\n", r"a\.toml: scene is missing: expected a bundled scene's name or a file"),
        ("format = 1\nscene = 3\n", r"a\.toml: scene is missing"),
        (GOOD + "speed = 3\n", r"a\.toml: there is no key 'speed' in a session file. Known are format, program, scene"),
        (GOOD + "passes = -1\n", r"a\.toml: passes = -1 is not allowed: expected a whole number from 0 to 1000000"),
        (GOOD + "passes = true\n", r"passes = True is not allowed"),
        (GOOD + "parameters = 3\n", r"parameters is not allowed as it is: expected a table"),
        (GOOD + "[parameters]\nres = [1]\n", r"parameters\.res = \[1\] is not allowed: expected a text or a number"),
        (GOOD + "settings = 3\n", r"settings is not allowed as it is: expected tables"),
        (GOOD + "[settings]\nphotons = 3\n", r"a\.toml: There is no setting 'photons'"),
        (GOOD + "[settings.photons]\nM = 3\n", r"There is no setting 'photons.M'. Did you mean .*photons.N"),
        (
            GOOD + "[settings.photons.N]\nx = 3\n",
            r"photons\.N = \{'x': 3\} is not allowed: expected a whole number from",
        ),
        (
            GOOD + "[settings.photons]\nN = 0\n",
            r"photons.N = 0 is not allowed: expected a whole number from 1 to 50,000,000",
        ),
        (GOOD + "[settings.photons]\nq = nan\n", r"photons.q = nan is not allowed: expected a number from 0.001 to 1"),
        (GOOD + "[settings.photons]\nq = 1979-05-27\n", r"photons\.q = .* is not allowed"),
        (GOOD + f"[settings.estimate]\nradius = {'9' * 400}\n", r"estimate\.radius = 9+ is not allowed"),
        (
            GOOD + "[settings.camera]\norigin = [1, 2]\n",
            r"camera\.origin = \[1, 2\] is not allowed: expected three numbers",
        ),
    ],
)
def test_what_is_wrong_is_said(tmp_path, text, said):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(PmviewerError, match=said) as caught:
        read_session(tmp_path / "a.toml")
    assert str(tmp_path / "a.toml") in str(caught.value)
    assert isinstance(caught.value, SceneError | SettingError)


def test_bytes_that_are_no_text_are_explained(tmp_path):
    (tmp_path / "a.toml").write_bytes(b'format = 1\nscene = "\xff\xfe"\n')
    with pytest.raises(SceneError, match=r"a\.toml:2: .*not UTF-8"):
        read_session(tmp_path / "a.toml")


@given(st.binary(max_size=200))
@hypothesis_settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_any_bytes_are_explained(tmp_path, data):
    (tmp_path / "a.toml").write_bytes(data)
    with pytest.raises((SceneError, SettingError), match=r"a\.toml"):
        read_session(tmp_path / "a.toml")


def test_windows_line_ends_and_missing_files(tmp_path):
    (tmp_path / "a.toml").write_bytes(GOOD.replace("\n", "\r\n").encode())
    assert read_session(tmp_path / "a.toml").scene == "cornell_caustic"
    with pytest.raises(SceneError, match="no such file"):
        read_session(tmp_path / "none.toml")


def test_wrong_target_is_explained(tmp_path):
    with pytest.raises(OutputError, match=r"unknown format '.txt'. Use .toml"):
        write_session(tmp_path / "a.txt", Settings(), "box", 1)
