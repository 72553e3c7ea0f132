"""Photons as arrays and as PLY files."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import pmviewer
from pmviewer.commands.cli import main
from pmviewer.errors import OutputError, SettingError
from tests.support.scenes import cornell_box, diffuse_box

COLUMNS = ("positions", "directions", "powers", "bounces", "path_classes", "lights")


def of_file(path):
    """Columns by trimesh's reader, and the header's lines."""
    mesh = trimesh.load(path)
    header = path.read_bytes().split(b"end_header\n")[0].decode("ascii").splitlines()
    return mesh.metadata["_ply_raw"]["vertex"]["data"], header


def test_photons_lie_on_the_walls_and_carry_what_the_light_emits():
    """A black light of 0.8×0.8 under the ceiling of a closed box emits π·L·A = π·5·0.64 W of each colour; all of it
    arrives directly, and after each bounce half of it again."""
    with pmviewer.open(diffuse_box(size=8), {"N": 20_000}, threads=2) as s:
        found = s.photons("global")
        frame = s.render(passes=1)
    flux = np.pi * 5 * 0.64
    direct = found.powers[found.path_classes == 0].sum(axis=0)
    assert direct == pytest.approx([flux] * 3, rel=2e-3)
    assert found.powers.sum(axis=0) == pytest.approx([2 * flux] * 3, rel=0.03)
    assert len(found) == len(found.positions) == len(found.bounces)
    walls = np.abs(np.abs(found.positions) - 1).min(axis=1) < 1e-3
    panel = np.abs(found.positions[:, 1] - 0.9) < 1e-3
    assert (walls | panel).all()
    assert np.linalg.norm(found.directions, axis=1) == pytest.approx(1, abs=1e-6)
    floor = (found.positions[:, 1] < -0.999) & (np.abs(found.positions[:, ::2]) < 0.99).all(axis=1)
    assert floor.sum() > 1000
    assert (found.directions[floor, 1] > -2e-3).all(), "they came from above, to a tenth of a degree"
    assert (found.bounces[found.path_classes == 0] == 0).all()
    assert (found.lights == 0).all()
    of_frame = frame.photons("global")
    assert all(np.array_equal(getattr(found, name), getattr(of_frame, name)) for name in COLUMNS)


@pytest.mark.parametrize("rule", ["pass", "pixel"])
def test_a_later_pass_has_other_photons_the_same_as_its_frame(rule):
    with pmviewer.open(cornell_box(size=8), {"N": 2000, "radius_rule": rule}, threads=2) as s:
        second = s.photons("caustic", passes=2)
        s.render(passes=1)
        frame = s.render(passes=1)
        assert np.array_equal(second.positions, frame.photons("caustic").positions)
        assert not np.array_equal(second.positions, s.photons("caustic").positions)
        assert s.passes == 2, "the film is left alone"
        assert set(np.unique(second.path_classes)) <= {2, 3}


def test_what_is_no_map_is_one_error():
    with pmviewer.open(diffuse_box(size=8), {"N": 1000}, threads=2) as s:
        with pytest.raises(SettingError, match="No caustic photons"):
            s.photons("caustic")
        with pytest.raises(SettingError, match="no photon map 'radiance'"):
            s.photons("radiance")
        with pytest.raises(SettingError, match="whole number from 1"):
            s.photons("global", passes=0)
        with pytest.raises(SettingError, match="No caustic photons"):
            s.render(passes=1).photons("caustic")
        s.set(method="path")
        with pytest.raises(SettingError, match="traces no photons"):
            s.photons("global")


def test_a_ply_file_holds_every_photon(tmp_path):
    with pmviewer.open(cornell_box(size=8), {"N": 2000, "q": 0.25, "seed": 7}, threads=2) as s:
        found = s.photons("caustic")
    found.save_ply(tmp_path / "caustic.ply")
    data, header = of_file(tmp_path / "caustic.ply")
    assert header[1] == "format binary_little_endian 1.0"
    for names, array in (("x y z", "positions"), ("nx ny nz", "directions"), ("power_r power_g power_b", "powers")):
        read = np.stack([data[name] for name in names.split()], axis=-1)
        assert np.array_equal(read, getattr(found, array))
    for name, array in (("bounces", "bounces"), ("path_class", "path_classes"), ("light", "lights")):
        assert np.array_equal(data[name], getattr(found, array))
    assert len(found) > 100
    for line in ("photons.N = 2000", "photons.q = 0.25", "render.seed = 7"):
        assert f"comment setting {line}" in header
    assert any(line.startswith("comment power_r power_g power_b: W") for line in header)
    with pytest.raises(OutputError, match="unknown format"):
        found.save_ply(tmp_path / "caustic.obj")


def test_the_command_writes_the_same_file(tmp_path, capsys):
    with pmviewer.open("cornell_caustic", {"N": 2000}) as s:
        s.photons("caustic", passes=2).save_ply(tmp_path / "library.ply")
    words = ["photons", "cornell_caustic", "-o", str(tmp_path / "command.ply"), "--map", "caustic", "--passes", "2"]
    with pytest.raises(SystemExit, match="0"):
        main([*words, "--set", "photons.N=2000", "--threads", "1"])
    assert "photons" in capsys.readouterr().out
    assert (tmp_path / "command.ply").read_bytes() == (tmp_path / "library.ply").read_bytes()
    for more, said in (["--map", "red"], "no photon map 'red'"), (["-o", "a.obj"], "unknown format"):
        with pytest.raises(SystemExit, match="2"):
            main([*words, *more])
        assert said in capsys.readouterr().err


def test_comments_are_ascii_and_of_one_line(tmp_path):
    from pmviewer.output.ply import write_ply

    write_ply(tmp_path / "a.ply", [("x", np.zeros(2, np.float32))], ["Küche\nend_header"])
    header = (tmp_path / "a.ply").read_bytes().split(b"\nend_header\n")[0]
    assert header.splitlines()[2] == b"comment K\\xfcche end_header"
