"""The settings schema: complete, consistent, and clear about what it refuses."""

from __future__ import annotations

import typing

import pytest

from pmviewer.errors import SettingError
from pmviewer.settings.access import (
    SETTINGS,
    Scale,
    Settings,
    Stage,
    changed_stages,
    flat,
    from_tree,
    get,
    info_of,
    parse_assignments,
    range_text,
    with_values,
)


@pytest.mark.parametrize("path", SETTINGS)
def test_every_setting_is_described(path):
    info = SETTINGS[path]
    assert info.path == path
    assert info.title
    assert info.group
    assert info.description.endswith(".")
    assert len(info.description) > 9
    assert info.scale in typing.get_args(Scale)
    assert info.stage in typing.get_args(Stage)
    assert info.kind in (int, float, bool, str, tuple, dict)
    assert (info.scale == "choice") == bool(info.choices)
    assert (info.scale in ("choice", "name")) == (info.kind is str)
    assert (info.scale == "switch") == (info.kind is bool)
    assert (info.scale == "vector") == (info.kind is tuple)
    assert (info.scale == "edits") == (info.kind is dict)
    if info.kind in (int, float):
        assert info.lower is not None
        assert info.upper is not None
        assert info.lower < info.upper
        if info.scale == "log":
            assert info.lower > 0
    if info.choices:
        assert info.default in info.choices
    if info.default == "auto":
        assert info.auto or "auto" in info.choices or info.scale == "name"


@pytest.mark.parametrize("path", SETTINGS)
def test_defaults_and_bounds_are_accepted_and_what_lies_beyond_is_not(path):
    info = SETTINGS[path]
    settings = Settings()
    assert get(settings, path) == info.default
    assert get(with_values(settings, {path: info.default}), path) == info.default
    allowed, refused = list(info.choices), []
    if info.kind in (int, float):
        allowed += [info.kind(info.lower), info.kind(info.upper)]
        refused += [info.lower - 1, info.upper + 1, info.upper * 2 + 1, float("nan"), float("inf"), "many", None]
    elif info.kind is bool:
        allowed += [True, False]
        refused += ["perhaps", 2, None]
    elif info.kind is dict:
        return  # sentences of their own: tests/scene/test_editing.py
    elif info.kind is tuple:
        allowed += [(1.0, 2.0, -3.0)]
        refused += [(1.0, 2.0), (1.0, float("nan"), 0.0), "here", 1.0, None]
    else:
        refused += [1, None] if info.scale == "name" else ["nothing of the sort", 1, None]
    open_to_auto = info.auto or "auto" in info.choices or info.scale == "name"
    for value in [*allowed, *(["auto"] if info.auto else [])]:
        assert get(with_values(settings, {path: value}), path) == value
    for value in [*refused, *([] if open_to_auto else ["auto"])]:
        with pytest.raises(SettingError) as refusal:
            with_values(settings, {path: value})
        text = str(refusal.value)
        assert text.startswith(f"{path} = ")
        assert text.endswith(f"expected {range_text(info)}.")
        assert "\n" not in text


def test_settings_are_immutable():
    settings = Settings()
    with pytest.raises(Exception, match="frozen"):
        settings.photons.N = 5
    other = with_values(settings, {"photons.N": 5000})
    assert settings == Settings()
    assert other.photons.N == 5000
    assert hash(other.photons) != hash(settings.photons)


def test_aliased_groups():
    """The global map's overlay is called `global`, which Python does not allow as a name."""
    settings = with_values(Settings(), {"overlays.global.show": True, "overlays.caustic.size": 5.0})
    assert settings.overlays.global_.show
    assert get(settings, "overlays.global.show") is True
    assert not get(settings, "overlays.caustic.show")
    assert info_of("overlays.global.show").group == "global photons"


def test_unknown_settings_name_their_neighbours():
    with pytest.raises(SettingError, match=r"no setting 'photons\.n'.*photons\.N"):
        info_of("photons.n")
    with pytest.raises(SettingError, match=r"no setting 'photon\.N'"):
        with_values(Settings(), {"photon.N": 5})
    with pytest.raises(SettingError, match=r"no setting 'photons'"):
        with_values(Settings(), {"photons": 5})
    with pytest.raises(SettingError, match=r"no setting 'zzz'\.$"):
        get(Settings(), "zzz")


def test_trees_of_session_files():
    assert from_tree({}) == Settings()
    tree = {"photons": {"N": 5000}, "overlays": {"global": {"show": True}}, "camera": {"origin": [1, 2, 3]}}
    settings = from_tree(tree)
    assert settings.photons.N == 5000
    assert settings.overlays.global_.show
    assert settings.camera.origin == (1.0, 2.0, 3.0)
    for broken, name in (
        ({"photons": {"M": 1}}, "photons.M"),
        ({"fotons": {}}, "fotons"),
        ({"photons": 3}, "photons"),
        ({"camera": {"origin": [1, 2]}}, "camera.origin"),
        ({"overlays": {"global": {"size": 99}}}, "overlays.global.size"),
    ):
        with pytest.raises(SettingError, match=name.replace(".", r"\.")):
            from_tree(broken)


def test_settings_survive_their_own_tree():
    values = {"camera.origin": (1, 2, 3), "estimate.radius": 0.01, "overlays.global.show": True, "direct.mis": False}
    changed = with_values(Settings(), values)
    assert from_tree(changed.model_dump(by_alias=True)) == changed
    assert with_values(Settings(), flat(changed)) == changed


def test_assignments_of_the_command_line():
    values = parse_assignments(
        ["photons.N=2e5", "photons.q = 0.25", "direct.mis=false", "camera.origin=1, 2,3", "camera.target=4 5 6",
         "camera.up=auto", "render.method=global map", "camera.width=1_024", "estimate.radius=auto",
         "overlays.global.show=true"]
    )  # fmt: skip
    settings = with_values(Settings(), values)
    assert settings.photons.N == 200_000
    assert settings.photons.q == 0.25
    assert settings.direct.mis is False
    assert settings.camera.origin == (1.0, 2.0, 3.0)
    assert settings.camera.target == (4.0, 5.0, 6.0)
    assert settings.camera.up == settings.estimate.radius == "auto"
    assert settings.render.method == "global map"
    assert settings.camera.width == 1024
    assert settings.overlays.global_.show


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("photons.N", "name=value"),
        ("photons.N=", "whole number"),
        ("photons.N=12.5", "whole number from 1"),
        ("photons.N=1e99", "photons.N"),
        ("photons.N=nan", "whole number"),
        ("photons.N=inf", "whole number"),
        ("photons.q=much", "a number from 0.001 to 1"),
        ("photons.q=2", "photons.q = '2'"),
        ("direct.mis=maybe", "true or false"),
        ("camera.origin=1,2", "three numbers"),
        ("camera.origin=1,2,x", "three numbers"),
        ("render.method=magic", "one of progressive, gather, virtual lights, path"),
        ("estimate.radius=0", "or auto"),
        ("=3", "no setting ''"),
        ("photons.X=3", "no setting 'photons.X'"),
    ],
)
def test_bad_assignments_get_one_clear_sentence(text, message):
    with pytest.raises(SettingError) as refusal:
        with_values(Settings(), parse_assignments([text]))
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_changed_stages():
    a = Settings()
    assert changed_stages(a, a) == set()
    assert changed_stages(a, with_values(a, {"photons.N": 1000})) == {"photons"}
    assert changed_stages(a, with_values(a, {"display.exposure": 1.0, "overlays.global.size": 3.0})) == {"display"}
    assert changed_stages(a, with_values(a, {"render.passes": 7, "camera.fov": 50.0})) == {"stop", "image"}
    assert changed_stages(a, with_values(a, {"estimate.radius": 0.1})) == {"maps"}


def test_ranges_in_words():
    assert range_text(info_of("photons.q")) == "a number from 0.001 to 1"
    assert range_text(info_of("photons.N")) == "a whole number from 1 to 50,000,000"
    assert range_text(info_of("render.seed")) == "a whole number from 0 to 2,147,483,647"
    assert range_text(info_of("estimate.radius")) == "a number from 1e-07 to 10 or auto"
    assert range_text(info_of("direct.mis")) == "true or false"
    assert range_text(info_of("camera.origin")) == "three numbers (x, y, z) or auto"
    assert range_text(info_of("photons.sequence")) == "one of sobol, independent"
