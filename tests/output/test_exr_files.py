"""EXR files: what is written comes back bit for bit, other programs' files open, broken ones are explained."""

from __future__ import annotations

import numpy as np
import OpenEXR
import pytest

from pmviewer.errors import OutputError, SceneError
from pmviewer.output.exr import channel_names, read_exr, read_reference, write_exr

H, W = 6, 9


def noise(channels: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(H, W, channels)).astype(np.float32) * 100


def foreign(path, channels: dict, **header) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    OpenEXR.File(header, channels).write(str(path))


LAYERS = {"": noise(3), "direct": noise(3, 1), "mask": noise(1, 2), "paint": noise(4, 3), "N": noise(3, 4)}
LAYERS["depth"] = noise(1, 5)


@pytest.mark.parametrize("compression", ["none", "rle", "zips", "zip", "piz"])
def test_float_layers_come_back_bit_for_bit(tmp_path, compression):
    write_exr(tmp_path / "a.exr", LAYERS, compression=compression)
    layers, metadata = read_exr(tmp_path / "a.exr")
    assert set(layers) == set(LAYERS)
    for name, array in LAYERS.items():
        np.testing.assert_array_equal(layers[name], array, err_msg=name)
        assert layers[name].dtype == np.float32
    assert metadata == {}


def test_channels_have_their_usual_names(tmp_path):
    write_exr(tmp_path / "a.exr", LAYERS)
    channels = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).channels()
    assert set(channels) == {
        *("R", "G", "B", "direct.R", "direct.G", "direct.B", "mask.Y"),
        *("paint.R", "paint.G", "paint.B", "paint.A", "N.X", "N.Y", "N.Z", "depth.Z"),
    }
    np.testing.assert_array_equal(channels["G"].pixels, LAYERS[""][..., 1])


def test_half_keeps_normal_and_depth_in_float(tmp_path):
    write_exr(tmp_path / "a.exr", LAYERS, half=True)
    channels = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).channels()
    kinds = {name: channel.pixels.dtype for name, channel in channels.items()}
    assert {n for n, kind in kinds.items() if kind == np.float32} == {"N.X", "N.Y", "N.Z", "depth.Z"}
    layers, _ = read_exr(tmp_path / "a.exr")
    np.testing.assert_array_equal(layers["direct"], LAYERS["direct"].astype(np.float16))
    np.testing.assert_array_equal(layers["depth"], LAYERS["depth"])


def test_half_has_no_infinities_of_its_own(tmp_path):
    image = np.full((2, 2, 3), 1e6, np.float32)
    image[0, 0, 0] = -1e9
    write_exr(tmp_path / "a.exr", {"": image}, half=True)
    got = read_exr(tmp_path / "a.exr")[0][""]
    assert got.max() == 65504
    assert got.min() == -65504


def test_any_memory_layout_and_type_is_written_as_it_looks(tmp_path):
    image = noise(3).astype(np.float64)
    views = {
        "flipped": image[::-1],
        "mirrored": image[:, ::-1],
        "swapped": image[..., ::-1],
        "fortran": np.asfortranarray(image),
        "spread": np.repeat(image, 2, axis=1)[:, ::2],
        "grey": image[..., 0],
    }
    write_exr(tmp_path / "a.exr", views)
    layers, _ = read_exr(tmp_path / "a.exr")
    for name, view in views.items():
        np.testing.assert_array_equal(layers[name].squeeze(), view.astype(np.float32), err_msg=name)


def test_metadata_comes_back_with_its_types(tmp_path):
    metadata = {"text": "W/(m² sr)", "empty": "", "count": 412_000, "emitted": 7_400_000_000, "alpha": 2 / 3, "low": -5}
    write_exr(tmp_path / "a.exr", {"": noise(3)}, metadata)
    _, got = read_exr(tmp_path / "a.exr")
    assert got == metadata
    assert type(got["count"]) is int
    assert OpenEXR.File(str(tmp_path / "a.exr")).header()["pmviewer.count"] == 412_000


def test_not_finite_values_survive(tmp_path):
    image = noise(3)
    image[0, 0] = np.nan, np.inf, -np.inf
    write_exr(tmp_path / "a.exr", {"": image})
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr")[0][""], image)


def test_layers_of_different_sizes_are_refused(tmp_path):
    with pytest.raises(ValueError, match="one size"):
        write_exr(tmp_path / "a.exr", {"": noise(3), "direct": noise(3)[1:]})
    with pytest.raises(ValueError, match="2 channels"):
        channel_names("direct", 2)


def test_wrong_ending_is_an_error_and_writes_nothing(tmp_path):
    with pytest.raises(OutputError, match=r"unknown format '.tif'. Use .exr"):
        write_exr(tmp_path / "a.tif", {"": noise(3)})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", [np.float16, np.float32])
@pytest.mark.parametrize("name", ["RGB", "RGBA"])
def test_reference_of_another_program(tmp_path, kind, name):
    image = noise(len(name)).astype(kind)
    foreign(tmp_path / "a.exr", {name: image})
    got = read_reference(tmp_path / "a.exr")
    assert got.dtype == np.float32
    assert got.flags.c_contiguous
    np.testing.assert_array_equal(got, image[..., :3])


def test_other_channels_do_not_mix_with_the_image(tmp_path):
    rgb, depth = noise(3), noise(1)[..., 0]
    foreign(tmp_path / "a.exr", {"RGB": rgb, "Z": depth, "view.normal.X": depth})
    layers, _ = read_exr(tmp_path / "a.exr")
    assert {name: layer.shape[2] for name, layer in layers.items()} == {"": 3, "Z": 1, "view.normal": 1}
    np.testing.assert_array_equal(read_reference(tmp_path / "a.exr"), rgb)


def test_grey_reference_is_repeated(tmp_path):
    grey = noise(1)[..., 0]
    foreign(tmp_path / "a.exr", {"Y": grey})
    np.testing.assert_array_equal(read_reference(tmp_path / "a.exr"), np.stack([grey] * 3, -1))


def test_reference_without_colours_is_explained(tmp_path):
    write_exr(tmp_path / "a.exr", {"direct": noise(3)})
    with pytest.raises(SceneError, match="no channels R, G, B, only the layers direct"):
        read_reference(tmp_path / "a.exr")
    foreign(tmp_path / "b.exr", {"R": noise(1)[..., 0], "G": noise(1)[..., 0]})
    with pytest.raises(SceneError, match="no channels R, G, B"):
        read_reference(tmp_path / "b.exr")


def test_broken_files_are_explained(tmp_path):
    path = tmp_path / "a.exr"
    write_exr(path, LAYERS)
    whole = path.read_bytes()
    for data in (b"", b"\x89PNG" + bytes(60), whole[:3], whole[:200], whole[: len(whole) // 2], whole[:-5]):
        path.write_bytes(data)
        with pytest.raises(SceneError, match=r"a\.exr: This is not a whole OpenEXR file"):
            read_exr(path)
    with pytest.raises(SceneError, match="no such file"):
        read_exr(tmp_path / "none.exr")


def test_a_name_that_is_no_text_is_said_in_words(tmp_path):
    write_exr(tmp_path / "a.exr", {"": noise(3)}, {"note": "x"})
    data = (tmp_path / "a.exr").read_bytes()
    assert data.count(b"pmviewer.note\0") == 1
    (tmp_path / "a.exr").write_bytes(data.replace(b"pmviewer.note\0", b"pmviewer.n\xa9te\0"))
    with pytest.raises(SceneError, match="a name in it is no text"):
        read_exr(tmp_path / "a.exr")
