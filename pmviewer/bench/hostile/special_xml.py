"""Mitsuba scenes that nest, double, repeat or include themselves, and serialized meshes that promise too much."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from functools import partial

from pmviewer.bench.hostile.bombs import zeros
from pmviewer.bench.hostile.seeds import MESHES, png, scene
from pmviewer.bench.hostile.special import Files, Maker, Special

XML, INCLUDE, SERIALIZED = "Mitsuba XML", "Mitsuba XML, include", "Mitsuba XML with serialized"
SPHERE = '<shape type="sphere"/>'


def specials() -> list[tuple[str, Maker]]:
    """All of this kind."""
    table: list[tuple[str, str, Callable[[], Files]]] = [
        ("includes itself", INCLUDE, lambda: _one('<include filename="scene.xml"/>')),
        ("includes in a circle", INCLUDE, _include_circle),
        ("includes that double", INCLUDE, _include_doubling),
        ("50 nested groups", XML, partial(_nested, '<shape type="shapegroup" id="g">', SPHERE, "</shape>")),
        ("50 nested materials", XML, lambda: _one(f'<shape type="sphere">{_nested_bsdf()}</shape>')),
        ("chain of 3000 groups", XML, lambda: _one(_groups(3000, 1))),
        ("copies that double 40 times", XML, lambda: _one(_groups(40, 2))),
        ("50 000 shapes", XML, lambda: _one(SPHERE * 50_000)),
        ("50 000 lamps", XML, lambda: _one('<emitter type="point"/>' * 50_000)),
        ("parameters that double", XML, lambda: _one(_parameters(30))),
        ("parameters in a circle", XML, _parameter_circle),
        ("references in a circle", XML, _reference_circle),
        ("picture of 10^9 pixels a side", XML, partial(_wide, b"1000000000")),
        ("picture of -1 pixels", XML, partial(_wide, b"-1")),
        ("fine displacement", XML, partial(_displaced, 4000)),
        ("finest displacement", XML, partial(_displaced, 2**31 - 1)),
        ("serialized of 2^40 vertices", SERIALIZED, lambda: _mesh(_serialized(2**40, 1))),
        ("serialized of 10^8 triangles", SERIALIZED, lambda: _mesh(_serialized(3, 10**8))),
        ("serialized bomb", SERIALIZED, lambda: _mesh(_packed(zeros(3 << 30), 1))),
        ("serialized of 2^32 meshes", SERIALIZED, lambda: _mesh(_serialized(3, 1)[:-4] + b"\xff" * 4)),
        ("serialized that points out of itself", SERIALIZED, lambda: _mesh(_serialized(3, 1, at=2**60))),
    ]
    return [(name, partial(_made, format_, files)) for name, format_, files in table]


def _made(format_: str, files: Callable[[], Files]) -> Special:
    return Special(format_, "scene.xml", files())


def _one(middle: str) -> Files:
    return {"scene.xml": scene(middle)}


def _piece(content: str) -> bytes:
    return f'<scene version="3.0.0">{content}</scene>'.encode()


def _include_circle() -> Files:
    more = {"b.xml": _piece('<include filename="c.xml"/>'), "c.xml": _piece('<include filename="b.xml"/>')}
    return _one('<include filename="b.xml"/>') | more


def _include_doubling() -> Files:
    pieces = {f"p{i}.xml": _piece(f'<include filename="p{i + 1}.xml"/>' * 2) for i in range(40)}
    return _one('<include filename="p0.xml"/>') | pieces | {"p40.xml": _piece(SPHERE)}


def _nested(start: str, inside: str, end: str) -> Files:
    return _one(start * 50 + inside + end * 50)


def _nested_bsdf() -> str:
    return '<bsdf type="twosided">' * 50 + '<bsdf type="diffuse"/>' + "</bsdf>" * 50


def _groups(count: int, copies: int) -> str:
    text = f'<shape type="shapegroup" id="g0">{SPHERE}</shape>'
    for i in range(1, count):
        instance = f'<shape type="instance"><ref id="g{i - 1}"/></shape>'
        text += f'<shape type="shapegroup" id="g{i}">{instance * copies}</shape>'
    return text + f'<shape type="instance"><ref id="g{count - 1}"/></shape>'


def _parameters(count: int) -> str:
    lines = ['<default name="a0" value="xxxxxxxxxx"/>']
    lines += [f'<default name="a{i + 1}" value="{f"$a{i}" * 10}"/>' for i in range(count)]
    return "".join(lines) + f'<shape type="$a{count}"/>'


def _parameter_circle() -> Files:
    return _one('<default name="a" value="$b"/><default name="b" value="$a"/><shape type="$a"/>')


def _reference_circle() -> Files:
    return _one('<bsdf type="twosided" id="a"><ref id="b"/></bsdf><bsdf type="twosided" id="b"><ref id="a"/></bsdf>')


def _wide(pixels: bytes) -> Files:
    return {"scene.xml": scene(SPHERE).replace(b'value="$res"', b'value="' + pixels + b'"')}


def _displaced(subdivisions: int) -> Files:
    text = '<shape type="rectangle"><bsdf type="displacement">'
    text += f'<integer name="subdivisions" value="{subdivisions}"/><texture type="bitmap">'
    return _one(text + '<string name="filename" value="tex.png"/></texture></bsdf></shape>') | {"tex.png": png()}


def _mesh(content: bytes) -> Files:
    return _one(MESHES.format(kind="serialized", file="m.serialized", more="")) | {"m.serialized": content}


def _packed(stream: bytes, count: int, at: int = 0) -> bytes:
    """A `.serialized` file of one mesh that is said to lie at byte `at`."""
    return struct.pack("<HH", 0x041C, 4) + stream + struct.pack("<QI", at, count)


def _serialized(vertices: int, triangles: int, at: int = 0) -> bytes:
    head = struct.pack("<I", 0x1000) + b"x\0" + struct.pack("<QQ", vertices, triangles)
    return _packed(zlib.compress(head + b"\0" * 48), 1, at)
