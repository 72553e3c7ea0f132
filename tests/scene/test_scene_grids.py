"""Volume files and media on lattices: what is read, what is refused before anything is allocated, and what is said."""

from __future__ import annotations

import io
import struct
import tracemalloc

import numpy as np
import pytest

from pmviewer.bench.hostile.special_volumes import specials
from pmviewer.errors import SceneError
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.arrays.grids import grid_arrays
from pmviewer.scene.formats.volume_file import read_volume
from pmviewer.scene.grid import Grid
from pmviewer.scene.load import read_scene
from pmviewer.scene.medium import Medium
from tests.scene.test_scene_media import CUBE, INSIDE, scene_of

NUMBERS = np.arange(24, dtype=np.float32).reshape(2, 3, 4) / 24


def vol(values=NUMBERS, version=3, encoding=1, sides=None, channels=None, box=(0, 0, 0, 1, 1, 1), magic=b"VOL"):
    values = values[..., None] if values.ndim == 3 else values
    nx, ny, nz = sides or values.shape[2::-1]
    channels = values.shape[3] if channels is None else channels
    kind = {2: "<f2"}.get(encoding, "<f4")
    data = (values * 255).astype(np.uint8) if encoding == 3 else values.astype(kind)
    return struct.pack("<3sB5i6f", magic, version, encoding, nx, ny, nz, channels, *box) + data.tobytes()


def npy(values):
    file = io.BytesIO()
    np.save(file, values)
    return file.getvalue()


def read(tmp_path, data):
    path = tmp_path / "a.vol"
    path.write_bytes(data)
    return read_volume(path)


@pytest.mark.parametrize("encoding", [1, 2, 3])
def test_numbers_of_a_volume_file(tmp_path, encoding):
    found = read(tmp_path, vol(encoding=encoding, box=(-1, 0, 0, 1, 2, 3)))
    np.testing.assert_allclose(found.values[..., 0], NUMBERS, atol={1: 0, 2: 1e-3, 3: 1 / 255}[encoding])
    assert found.box == ((-1, 0, 0), (1, 2, 3))
    three = np.stack([NUMBERS, 2 * NUMBERS, 3 * NUMBERS], axis=3)
    np.testing.assert_array_equal(read(tmp_path, vol(three)).values, three)


@pytest.mark.parametrize("kind", [np.float32, np.float64, ">f4", np.uint8])
@pytest.mark.parametrize("order", ["C", "F"])
def test_numbers_of_a_numpy_file(tmp_path, kind, order):
    values = np.asarray(24 * NUMBERS, kind, order=order)
    found = read(tmp_path, npy(values))
    np.testing.assert_array_equal(found.values[..., 0], 24 * NUMBERS)
    assert found.values.dtype == np.float32
    assert found.box is None


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "no volume"),
        (b"VOL", "cut off in its header"),
        (vol(magic=b"PLY"), "no volume"),
        (vol(version=1), "has version 1"),
        (vol(encoding=4), "of kind 4"),
        (vol(channels=2), "2 numbers at a place"),
        (vol(channels=-1), "-1 numbers at a place"),
        (vol(sides=(0, 3, 2)), "each side has 1 to"),
        (vol(sides=(-4, 3, 2)), "each side has 1 to"),
        (vol(sides=(2**31 - 1, 3, 2)), "each side has 1 to"),
        (vol(sides=(16000, 16000, 16000)), "only 96 follow"),
        (vol(sides=(4, 3, 3)), "144 bytes, and only 96 follow"),
        (vol()[:-1], "only 95 follow"),
        (npy(NUMBERS)[:-1], "only 95 follow"),
        (npy(NUMBERS)[:40], "header of the NumPy file is broken"),
        (npy(np.array([None] * 8).reshape(2, 2, 2)), "no real numbers"),
        (npy(np.zeros((2, 2, 2), complex)), "no real numbers"),
        (npy(np.zeros((2, 2), np.float32)), "has 2 axes"),
        (npy(np.zeros(2, np.float32)), "has 1 axes"),
        (npy(NUMBERS).replace(b"(2, 3, 4)", b"(9, 9, 9)"), "only 96 follow"),
        (npy(NUMBERS).replace(b"(2, 3, 4)", b"(2, 3,-4)"), "each side has 1 to"),
        (npy(NUMBERS).replace(b"(2, 3, 4)", b"(2,3, [])"), "broken"),
    ],
)
def test_headers_that_lie_are_refused_before_anything_is_allocated(tmp_path, data, said):
    path = tmp_path / "a.vol"
    path.write_bytes(data)
    tracemalloc.start()
    with pytest.raises(SceneError) as error:
        read_volume(path)
    assert tracemalloc.get_traced_memory()[1] < 2**20
    tracemalloc.stop()
    assert said.replace("only ", "") in error.value.what.replace("only ", "")


def grid(inner="", name="sigma_t", file="a.vol"):
    return (
        f'<volume name="{name}" type="gridvolume"><string name="filename" value="{file}"/>'
        f'<transform name="to_world"><scale value="2"/><translate x="1"/></transform>{inner}</volume>'
    )


def medium_of(tmp_path, inner, data=None):
    (tmp_path / "a.vol").write_bytes(data or vol())
    medium = f'<medium type="heterogeneous" id="fog">{inner}</medium>'
    scene = scene_of(tmp_path, medium, CUBE.format(INSIDE))
    return (scene.media[0] if scene.media else None), scene.warnings


def test_a_medium_with_grids_is_read_as_it_stands(tmp_path):
    inner = grid() + grid(name="albedo") + '<float name="scale" value="3"/><phase type="hg"/>'
    medium, warnings = medium_of(tmp_path, inner)
    assert not warnings
    assert (medium.sigma_t, medium.albedo, medium.phase.g) == ((3.0,) * 3, (1.0,) * 3, 0.8)
    np.testing.assert_array_equal(medium.density.values[..., 0], NUMBERS)
    np.testing.assert_array_equal(medium.density.to_world, [[2, 0, 0, 1], [0, 2, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]])
    assert medium.albedo_grid is not None


def test_the_box_of_the_file_counts_where_it_is_asked_for(tmp_path):
    data = vol(box=(0, 0, 0, 2, 4, 6))
    medium, _ = medium_of(tmp_path, grid('<boolean name="use_grid_bbox" value="true"/>'), data)
    np.testing.assert_array_equal(np.diag(medium.density.to_world), [4, 8, 12, 1])
    medium, _ = medium_of(tmp_path, grid(), data)
    np.testing.assert_array_equal(np.diag(medium.density.to_world), [2, 2, 2, 1])


def constant(name, inner=""):
    return f'<volume name="{name}" type="constvolume"><rgb name="value" value="1 2 3"/>{inner}</volume>'


def test_a_constant_density_of_version_0_6_fills_its_shape(tmp_path):
    medium, warnings = medium_of(tmp_path, constant("density"))
    assert (medium.sigma_t, medium.density, medium.varies) == ((1, 2, 3), None, False)
    assert not warnings
    medium, _ = medium_of(tmp_path, constant("density") + grid(name="albedo"))
    np.testing.assert_array_equal(medium.density.to_world, medium.albedo_grid.to_world)


@pytest.mark.parametrize(
    ("inner", "box"),
    [
        (constant("sigma_t"), [1, 1, 1]),
        (constant("sigma_t", '<transform name="to_world"><scale x="2" y="3" z="4"/></transform>'), [2, 3, 4]),
        ('<float name="sigma_t" value="2"/>' + grid(name="albedo"), [1, 1, 1]),
    ],
)
def test_a_constant_extinction_fills_its_box_as_in_mitsuba_3(tmp_path, inner, box):
    """Its heterogeneous medium is where the box of sigma_t is: of a constant the unit cube, moved by `to_world`."""
    medium, warnings = medium_of(tmp_path, inner)
    assert medium.density.values.tolist() == [[[[1.0]]]]
    np.testing.assert_array_equal(np.diag(medium.density.to_world), [*box, 1])
    assert not warnings


@pytest.mark.parametrize(
    ("inner", "data", "said"),
    [
        (grid(file="b.vol"), None, "do not exist"),
        (grid(), vol(version=9), "has version 9"),
        (grid() + grid(name="albedo", file=""), None, "names no file"),
        (grid('<string name="filter_type" value="nearest"/>'), None, "is interpolated"),
        (grid('<string name="wrap_mode" value="repeat"/>'), None, "is not repeated"),
        (grid(name="albedo"), vol(5 * NUMBERS), "numbers above 1"),
        (grid(), vol(-NUMBERS), "23 numbers that are negative"),
        (grid(), vol(NUMBERS * np.float32(np.nan)), "24 numbers that are negative or not finite"),
        (grid().replace('<scale value="2"/>', '<scale z="0"/>'), None, "its box is flat"),
        (constant("sigma_t", '<transform name="to_world"><scale z="0"/></transform>'), None, "has a flat box"),
        ('<volume name="sigma_t" type="magic"/>', None, "is not supported"),
    ],
)
def test_what_is_not_shown_is_said(tmp_path, inner, data, said):
    _, warnings = medium_of(tmp_path, inner, data)
    assert any(said in warning for warning in warnings), warnings


def test_an_empty_grid_leaves_its_shape_clear(tmp_path):
    medium, warnings = medium_of(tmp_path, grid(), vol(0 * NUMBERS))
    assert medium is None
    assert not warnings


def test_only_scenes_with_grids_have_their_fields(tmp_path):
    (tmp_path / "a.vol").write_bytes(vol())
    for inner, expected in ((grid(), True), (constant("density"), False)):
        medium = f'<medium type="heterogeneous" id="fog">{inner}</medium>'
        flat = flatten(scene_of(tmp_path, medium, CUBE.format(INSIDE)))
        assert flat.has_media
        assert ("voxels" in flat.record.dtype.names) == expected


def test_blocks_are_never_below_what_is_interpolated():
    """Against all corners of each block's cells, one by one."""
    values = np.random.default_rng(1).random((9, 17, 8, 1)).astype(np.float32) ** 8
    found = grid_arrays((Medium("m", density=Grid(values)),))["grid_blocks"]
    padded = np.pad(values[..., 0], 1, mode="edge")
    cells = np.array(padded.shape) - 1
    at = 0
    for z in range(0, cells[0], 8):
        for y in range(0, cells[1], 8):
            for x in range(0, cells[2], 8):
                assert found[at] == padded[z : z + 9, y : y + 9, x : x + 9].max()
                at += 1
    assert at == len(found)


def test_bundled_smoke_is_read_without_a_word():
    scene = read_scene("cornell_smoke")
    assert scene.media[0].density.values.shape == (40, 72, 40, 1)
    assert not scene.warnings


@pytest.mark.parametrize(("name", "make"), specials(), ids=[name for name, _ in specials()])
def test_volumes_of_the_hostile_bench_are_answered_in_words(tmp_path, name, make):
    """All of them, where the bench's own test draws some; little is allocated, and nothing of Python's is heard."""
    made = make()
    for file, content in made.files.items():
        (tmp_path / file).write_bytes(content)
    tracemalloc.start()
    scene = read_scene(tmp_path / "scene.xml")
    assert tracemalloc.get_traced_memory()[1] < 2**20
    tracemalloc.stop()
    said = " ".join(scene.warnings)
    assert ("smoke." in said) != (name in {"VOL of the largest numbers", "VOL in a box of no numbers"}), said
    assert "Error" not in said
    assert "Traceback" not in said
