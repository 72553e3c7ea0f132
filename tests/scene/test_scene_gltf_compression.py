"""Compressed geometry and pictures of glTF files, by the libraries of the extra [gltf]."""

import struct
import sys
import zlib
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pmviewer.errors import SceneError
from pmviewer.scene.load import load_scene
from pmviewer.scene.texture import Bitmap
from tests.scene.gltf_files import Gltf, corners, meshes

RNG = np.random.default_rng(5)
POINTS = RNG.uniform(-1, 1, (50, 3)).astype(np.float32)
FACES = np.stack([np.arange(48), np.arange(48) + 1, np.arange(48) + 2], axis=1).astype(np.uint32)


def draco_file(folder: Path, data: bytes, number=0) -> Path:
    f = Gltf(extensionsRequired=["KHR_draco_mesh_compression"])
    packed = {"bufferView": f.view(data), "attributes": {"POSITION": number}}
    f.mesh({
        "attributes": {"POSITION": f.accessor(len(POINTS), "f", 3)}, "indices": f.accessor(FACES.size, "I", 1),
        "extensions": {"KHR_draco_mesh_compression": packed},
    })  # fmt: skip
    return f.write(folder)


def test_draco(tmp_path: Path) -> None:
    draco = pytest.importorskip("DracoPy")
    data = draco.encode(POINTS, FACES, quantization_bits=14, preserve_order=True)
    (mesh,) = meshes(load_scene(draco_file(tmp_path, data)))
    # 14 bits over a cube of side 2: steps of 2/16384.
    assert mesh.vertices[mesh.faces] == pytest.approx(POINTS[FACES].astype(float), abs=2e-4)
    for damaged in (data[: len(data) // 2], b"DRACO" + bytes(40), b"nothing"):
        with pytest.raises(SceneError, match=r"[mM]esh 0"):
            load_scene(draco_file(tmp_path, damaged))
    for number in (7, [0], None):
        with pytest.raises(SceneError, match="mesh 0 lack POSITION"):
            load_scene(draco_file(tmp_path, data, number))


def meshopt_file(folder: Path, parts: list[tuple[bytes, dict]], attributes: dict, indices: int | None = None) -> Path:
    """Views packed by EXT_meshopt_compression; `attributes` are (view, component, width, more)."""
    f = Gltf(extensionsRequired=["EXT_meshopt_compression", "KHR_mesh_quantization"])
    for data, packed in parts:
        view = f.view(data)
        row = f.header["bufferViews"][view]
        packed |= {"buffer": 0, "byteOffset": row["byteOffset"], "byteLength": len(data)}
        size = packed["count"] * packed["byteStride"]
        f.header["bufferViews"][view] = {
            "buffer": 1,
            "byteLength": size,
            "extensions": {"EXT_meshopt_compression": packed},
        }
    counted = {key: f.accessor(len(POINTS), component, width, bufferView=view, **more)
               for key, (view, component, width, more) in attributes.items()}  # fmt: skip
    primitive = {"attributes": counted}
    if indices is not None:
        primitive["indices"] = f.accessor(FACES.size, "H", 1, bufferView=indices)
    f.mesh(primitive)
    fallback = {"byteLength": 10**9, "extensions": {"EXT_meshopt_compression": {"fallback": True}}}
    return f.write(folder, buffers=[{"byteLength": len(f.data)}, fallback])


@pytest.mark.parametrize("mode", ["TRIANGLES", "INDICES"])
def test_meshoptimizer_with_its_filters(tmp_path: Path, mode: str) -> None:
    meshopt = pytest.importorskip("meshopt")
    normals = RNG.normal(size=(50, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    signed = np.concatenate([normals, np.zeros((50, 1))], axis=1).astype(np.float32)
    packed = [
        (meshopt.encode_filter_exp(POINTS, 15), {"byteStride": 12, "filter": "EXPONENTIAL"}),
        (meshopt.encode_filter_oct(signed, 4, 8), {"byteStride": 4, "filter": "OCTAHEDRAL"}),
    ]
    parts = [
        (meshopt.encode_gltf_buffer(rows, "ATTRIBUTES"), {"count": 50, "mode": "ATTRIBUTES", **more})
        for rows, more in packed
    ]
    index = meshopt.encode_gltf_buffer(FACES.reshape(-1), mode)
    parts.append((index, {"count": FACES.size, "byteStride": 2, "mode": mode}))
    attributes = {"POSITION": (0, "f", 3, {}), "NORMAL": (1, "b", 3, {"normalized": True})}
    (mesh,) = meshes(load_scene(meshopt_file(tmp_path, parts, attributes, indices=2)))
    assert np.sort(mesh.vertices[mesh.faces].reshape(-1)) == pytest.approx(np.sort(POINTS[FACES].reshape(-1)), abs=1e-3)
    for vertex, normal in zip(mesh.vertices, mesh.normals, strict=True):
        true = normals[np.abs(POINTS - vertex).sum(axis=1).argmin()]
        assert normal @ true > 0.999


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ({"count": 10**9}, "more than its"),
        ({"count": 10**30}, "more than its"),
        ({"byteStride": 7}, "claims 50 elements of 7 bytes"),
        ({"mode": "PIXELS"}, "not described as it should be"),
        ({"count": 300}, "can't be decoded"),
        ({"mode": "INDICES", "byteStride": 4, "count": 5}, "can't be decoded"),
    ],
)
def test_damaged_meshoptimizer_data(tmp_path: Path, row: dict, words: str) -> None:
    meshopt = pytest.importorskip("meshopt")
    data = meshopt.encode_gltf_buffer(POINTS, "ATTRIBUTES")
    packed = {"count": 50, "byteStride": 12, "mode": "ATTRIBUTES", **row}
    with pytest.raises(SceneError, match=words):
        load_scene(meshopt_file(tmp_path, [(data, packed)], {"POSITION": (0, "f", 3, {})}))


def test_without_their_libraries_the_error_names_the_extra(tmp_path: Path, monkeypatch) -> None:
    for name in ("DracoPy", "meshopt"):
        monkeypatch.setitem(sys.modules, name, None)
    packed = {"count": 3, "byteStride": 12, "mode": "ATTRIBUTES"}
    paths = [
        draco_file(tmp_path, b"DRACO"),
        meshopt_file(tmp_path / "..", [(b"\xa0" + bytes(9), packed)], {"POSITION": (0, "f", 3, {})}),
    ]
    for path in paths:
        with pytest.raises(
            SceneError, match=r"not installed. Install it with pip install \"pmviewer\[gltf\]\""
        ) as error:
            load_scene(path)
        assert error.value.path == path


def test_draco_is_not_needed_where_plain_data_lie_beside_it(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    f = Gltf()
    f.triangle(extensions={"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}})
    (mesh,) = meshes(load_scene(f.write(tmp_path)))
    assert corners(mesh) == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]


def picture(kind: str, colour: tuple = (255, 0, 0)) -> bytes:
    stream = BytesIO()
    Image.new("RGB", (8, 8), colour).save(stream, kind, lossless=True)
    return stream.getvalue()


def textured(folder: Path, extension: str, data: bytes, **texture) -> Path:
    f = Gltf(extensionsUsed=[extension])
    f.triangle(material=0, attributes={"TEXCOORD_0": f.array([[0, 0], [1, 0], [0, 1]])})
    return f.write(
        folder,
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}],
        images=[{"bufferView": f.view(data)}, {"uri": "plain.png"}],
        textures=[{"extensions": {extension: {"source": 0}}, **texture}],
    )


def test_webp_pictures(tmp_path: Path) -> None:
    scene = load_scene(textured(tmp_path, "EXT_texture_webp", picture("WEBP")))
    assert scene.materials[0].reflectance == pytest.approx((1, 0, 0))
    assert not any("exture" in w for w in scene.warnings)


def ktx2(colour: tuple) -> bytes:
    return pytest.importorskip("alktx2").encode_bytes_to_ktx2(picture("PNG", colour), mime="image/png", codec="uastc")


def test_basis_universal_pictures(tmp_path: Path) -> None:
    scene = load_scene(textured(tmp_path, "KHR_texture_basisu", ktx2((255, 0, 0))))
    assert scene.materials[0].reflectance == pytest.approx((1, 0, 0), abs=0.02)
    damaged = load_scene(textured(tmp_path, "KHR_texture_basisu", ktx2((255, 0, 0))[:200]))
    assert damaged.materials[0].reflectance == (0.5, 0.5, 0.5)
    assert any("KTX 2 data are damaged" in w and "Grey replaces it" in w for w in damaged.warnings)


def plain_ktx2(layout: int, pixels: np.ndarray, scheme: int = 0, notes: dict[str, str] | None = None) -> bytes:
    """Written after the KTX 2.0 specification: header, index, level index of one level, data format descriptor, notes,
    pixels (h, w, channels)."""
    entries = [f"{key}\0{value}\0".encode() for key, value in (notes or {}).items()]
    noted = b"".join(struct.pack("<I", len(e)) + e + bytes(-len(e) % 4) for e in entries)
    level = pixels.astype(np.uint8).tobytes()
    packed = zlib.compress(level) if scheme == 3 else level
    described = struct.pack("<I", 4)
    at = 80 + 24 + len(described)
    header = b"\xabKTX 20\xbb\r\n\x1a\n" + struct.pack("<9I", layout, 1, *pixels.shape[1::-1], 0, 0, 1, 1, scheme)
    index = struct.pack("<4I2Q", 104, len(described), at, len(noted), 0, 0)
    levels = struct.pack("<3Q", at + len(noted), len(packed), len(level))
    return header + index + levels + described + noted + packed


RED_OVER_BLUE = np.array([[[255, 0, 0, 255]] * 4, [[0, 0, 255, 255]] * 4])


@pytest.mark.parametrize(
    ("layout", "channels", "scheme"),
    [(23, "rgb", 0), (29, "rgb", 3), (30, "bgr", 0), (36, "bgr", 0), (37, "rgba", 3), (43, "rgba", 0), (50, "bgra", 0)],
)
def test_plain_ktx2_pictures(tmp_path: Path, monkeypatch, layout: int, channels: str, scheme: int) -> None:
    """Bytes in the order of their Vulkan format, the upper row first, without any library."""
    monkeypatch.setitem(sys.modules, "alktx2", None)
    stored = RED_OVER_BLUE[..., ["rgba".index(c) for c in channels]]
    scene = load_scene(textured(tmp_path, "KHR_texture_basisu", plain_ktx2(layout, stored, scheme)))
    texture = scene.materials[0].textures["reflectance"]
    assert isinstance(texture, Bitmap)
    assert texture.pixels[0, 0] == pytest.approx([1, 0, 0])
    assert texture.pixels[1, 3] == pytest.approx([0, 0, 1])
    assert not any("exture" in w for w in scene.warnings)


def test_plain_ktx2_of_fewer_channels_and_with_notes(tmp_path: Path) -> None:
    """What a picture lacks is 0 unless its swizzle says otherwise; its rows may go upwards."""
    grey = np.array([[[255]] * 4, [[0]] * 4])
    both = {"KTXorientation": "ru", "KTXswizzle": "rrr1"}
    for notes, upper, lower in (({}, [1, 0, 0], [0, 0, 0]), (both, [0, 0, 0], [1, 1, 1])):
        scene = load_scene(textured(tmp_path, "KHR_texture_basisu", plain_ktx2(9, grey, notes=notes)))
        texture = scene.materials[0].textures["reflectance"]
        assert isinstance(texture, Bitmap)
        assert np.broadcast_to(texture.pixels[0, 0], 3) == pytest.approx(upper)
        assert np.broadcast_to(texture.pixels[1, 0], 3) == pytest.approx(lower)


@pytest.mark.parametrize("scheme", [0, 3])
def test_damaged_plain_ktx2(tmp_path: Path, scheme: int) -> None:
    whole = plain_ktx2(43, RED_OVER_BLUE, scheme)
    for damaged in (whole[:-9], whole[:90], whole[:80] + b"\xff" * 24 + whole[104:]):
        scene = load_scene(textured(tmp_path, "KHR_texture_basisu", damaged))
        assert scene.materials[0].reflectance == (0.5, 0.5, 0.5)
        assert any("KTX 2 data are damaged" in w for w in scene.warnings)


def test_basis_universal_without_its_library(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "alktx2", None)
    header = b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(8) + (8).to_bytes(4, "little") * 2 + bytes(100)
    scene = load_scene(textured(tmp_path, "KHR_texture_basisu", header))
    assert scene.materials[0].reflectance == (0.5, 0.5, 0.5)
    assert any('pip install "pmviewer[gltf]". Grey replaces it.' in w for w in scene.warnings)
    (tmp_path / "plain.png").write_bytes(picture("PNG", (0, 255, 0)))
    scene = load_scene(textured(tmp_path, "KHR_texture_basisu", header, source=1))
    assert scene.materials[0].reflectance == pytest.approx((0, 1, 0))
    assert not any("exture" in w for w in scene.warnings)
