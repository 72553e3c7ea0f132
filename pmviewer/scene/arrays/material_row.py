"""A material as the numbers that kernels read: its row, and the tables that some materials need."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels import scene as K
from pmviewer.kernels.bsdf.kinds import (
    BLEND,
    CONDUCTOR,
    DIELECTRIC,
    KINDS,
    PLASTIC,
    PRINCIPLED,
    ROUGH_DIELECTRIC,
    ROUGH_PLASTIC,
    SCHLICK,
    SPECTRUM_NODES,
    THIN_DIELECTRIC,
)
from pmviewer.kernels.bsdf.microfacet import SMOOTHEST
from pmviewer.kernels.bsdf.tables import fill_coat, fill_schlick
from pmviewer.scene.arrays.blends import fill_blend, with_parts
from pmviewer.scene.arrays.material_lobes import coat_alpha, principled_of
from pmviewer.scene.description import Material, Scene
from pmviewer.scene.spectrum import channel_indices, indices

Float = NDArray[np.float32]
THIN_RULES = {
    "exact": K.THIN_EXACT,
    "ignored": K.THIN_IGNORED,
    "tinted": K.THIN_TINTED,
    "tinted and reflecting": K.THIN_REFLECTING,
    "by setting": K.THIN_BY_SETTING,
}
"""`Material.thin_rule` for kernels."""
_DISTRIBUTIONS = {"ggx": K.GGX, "beckmann": K.BECKMANN}
_PERFECT_MIRROR = ((0.0,) * 3, (1.0,) * 3)
"""The complex index that reflects everything: Mitsuba's metal 'none'."""
_CLEAR = 1e-4
"""An index this close to 1 bends nothing."""
_LEAST_BEND = 1e-3
"""A principled material that transmits has an index this far from 1 at least, as in Mitsuba."""


@dataclass(frozen=True)
class MaterialTable:
    """rows: float32 (materials, MATERIAL_COLUMNS), of the scene's `materials` and then of the parts of blends; tables:
    float32 (tables, BSDF_TABLE_SIZE), at least one; glasses: float32 (glasses + 1, SPECTRUM_NODES), indices of those
    that disperse; kinds: those that are used."""

    rows: Float
    tables: Float
    glasses: Float
    materials: tuple[Material, ...]
    kinds: frozenset[str]


def is_plain(m: Material) -> bool:
    """Can the kernels of simple scenes show it? Diffuse, mirrors the same at all angles, clear smooth glass, each
    without textures and colours at vertices."""
    if m.textures or m.vertex_colours:
        return False
    if m.kind == "conductor":
        return m.metal is None
    if m.kind == "dielectric":
        return not any(m.absorption) and not m.disperses
    return m.kind in ("diffuse", "null")


def used_materials(scene: Scene) -> list[Material]:
    """Materials that some shape has, instanced ones included, in the order of the scene's list, and parts of blends."""
    used = [scene.materials[i] for i in sorted({s.material for s in scene.all_shapes}) if i < len(scene.materials)]
    return with_parts(used)


def is_rich(scene: Scene) -> bool:
    """Does the scene need the kernels for all materials, or for shading normals on surfaces that store photons?"""
    return not all(is_plain(m) for m in used_materials(scene)) or any(
        getattr(shape.geometry, "normals", None) is not None
        and shape.material < len(scene.materials)
        and scene.materials[shape.material].kind == "diffuse"
        for shape in scene.all_shapes
    )


def material_table(scene: Scene) -> MaterialTable:
    """Rows of all materials; tables of those that are used."""
    materials, used = with_parts(scene.materials), used_materials(scene)
    counts, number_of = {id(m) for m in used}, {id(m): i for i, m in enumerate(materials)}
    tables: list[Float] = []
    rows = [_row(m, tables if id(m) in counts else None) for m in materials]
    for row, m in zip(rows, materials):
        if m.kind == "blend":
            fill_blend(row, m, number_of)
    glasses = [np.zeros(SPECTRUM_NODES, np.float32)]
    for row, m in zip(rows, materials):
        if m.disperses and id(m) in counts:
            _fill_dispersion(row, m, glasses)
    tables = tables or [np.zeros(K.BSDF_TABLE_SIZE, np.float32)]
    return MaterialTable(
        np.array(rows, np.float32).reshape(-1, K.MATERIAL_COLUMNS),
        np.array(tables, np.float32),
        np.array(glasses, np.float32),
        tuple(materials),
        frozenset(m.kind for m in used),
    )


def _row(m: Material, tables: list[Float] | None) -> list[float]:
    row = [0.0] * K.MATERIAL_COLUMNS
    kind = KINDS[m.kind].number
    if kind == ROUGH_DIELECTRIC and abs(m.eta - 1) < _CLEAR:
        kind = DIELECTRIC
    row[K.M_KIND], row[K.M_TWO_SIDED], row[K.M_ETA] = kind, m.two_sided, m.eta
    row[K.M_REFLECTANCE : K.M_REFLECTANCE + 3] = m.reflectance
    row[K.M_TRANSMITTANCE : K.M_TRANSMITTANCE + 3] = m.transmittance
    row[K.M_OPACITY : K.M_COLOURED + 1] = [*opacity_numbers(m), m.vertex_colours]
    row[K.M_THIN] = THIN_RULES[m.thin_rule]
    if kind == BLEND or (is_plain(m) and kind != CONDUCTOR):
        return row
    alpha_x, alpha_y = (max(float(SMOOTHEST), a) for a in m.alpha)
    row[K.M_ALPHA_X], row[K.M_ALPHA_Y] = alpha_x, alpha_y
    row[K.M_DISTRIBUTION], row[K.M_NONLINEAR] = _DISTRIBUTIONS[m.distribution], m.nonlinear
    if "normal" in m.textures or "bump" in m.textures:
        row[K.M_MAPPED] = K.MIRRORED_MAPS if m.mirrored_maps else 1
    eta, k = m.metal if m.metal is not None else _PERFECT_MIRROR
    row[K.M_ETA_RGB : K.M_ETA_RGB + 3], row[K.M_K_RGB : K.M_K_RGB + 3] = eta, k
    transparent = kind in (DIELECTRIC, ROUGH_DIELECTRIC, THIN_DIELECTRIC)
    row[K.M_SPECULAR : K.M_SPECULAR + 3] = m.absorption if transparent or kind == PRINCIPLED else m.specular
    if kind == PRINCIPLED:
        _fill_principled(row, m)
    if kind == PLASTIC:
        row[K.M_INNER] = inner_reflectance(m.eta)
    elif kind == ROUGH_PLASTIC and tables is not None:
        table, row[K.M_INNER] = _coat(alpha_x, alpha_y, row[K.M_DISTRIBUTION], m.eta)
        row[K.M_TABLE] = len(tables)
        tables.append(table)
    elif kind == SCHLICK and tables is not None:
        row[K.M_TABLE] = len(tables)
        tables.append(_schlick(alpha_x * alpha_y))
    return row


def _fill_dispersion(row: list[float], m: Material, glasses: list[Float]) -> None:
    assert m.dispersion is not None
    row[K.M_ETA_RGB : K.M_ETA_RGB + 3] = channel_indices(m.dispersion, m.eta)
    row[K.M_GLASS] = len(glasses)
    glasses.append(indices(m.dispersion, m.eta).astype(np.float32))


def opacity_numbers(m: Material) -> tuple[float, float, float]:
    """Opacity, no texture yet, and the cut-off or −1."""
    if not m.passable:
        return 1.0, -1.0, -1.0
    if m.alpha_cutoff is None:
        return min(max(m.opacity, 0.0), 1.0), -1.0, -1.0
    return 0.0, -1.0, max(m.alpha_cutoff, 0.0)


def _fill_principled(row: list[float], m: Material) -> None:
    p = principled_of(m)
    if p.spec_trans > 0 and abs(m.eta - 1) < _LEAST_BEND:
        row[K.M_ETA] = 1 + _LEAST_BEND
    row[K.M_METALLIC], row[K.M_SPEC_TRANS], row[K.M_SPEC_TINT] = p.metallic, p.spec_trans, p.spec_tint
    row[K.M_SHEEN], row[K.M_SHEEN_TINT], row[K.M_FLATNESS] = p.sheen, p.sheen_tint, p.flatness
    row[K.M_CLEARCOAT], row[K.M_COAT_ALPHA] = p.clearcoat, coat_alpha(m)


@lru_cache(maxsize=64)
def inner_reflectance(eta: float) -> float:
    """Share of diffuse light inside a medium of index `eta` that its smooth surface sends back: 2∫F(cos) cos dcos."""
    nodes, weights = np.polynomial.legendre.leggauss(256)
    critical = np.sqrt(max(0.0, 1 - 1 / eta**2))
    # Above the critical angle everything is reflected; below, the substitution cos = c + (1 − c)x² tames the root.
    x = (nodes + 1) / 2
    cos = critical + (1 - critical) * x**2
    sin2_t = np.minimum((1 - cos**2) * eta**2, 1.0)
    cos_t = np.sqrt(1 - sin2_t)
    s = (eta * cos - cos_t) / (eta * cos + cos_t)
    p = (cos - eta * cos_t) / (cos + eta * cos_t)
    below = float((weights / 2 * 2 * cos * (s**2 + p**2) / 2 * (1 - critical) * 2 * x).sum())
    return float(critical**2) + below


@lru_cache(maxsize=64)
def _coat(alpha_x: float, alpha_y: float, distribution: float, eta: float) -> tuple[Float, float]:
    table = np.empty(K.BSDF_TABLE_SIZE, np.float32)
    inner = fill_coat(table, np.float32(alpha_x), np.float32(alpha_y), np.int32(distribution), np.float32(eta))
    return table, inner


@lru_cache(maxsize=64)
def _schlick(alpha: float) -> Float:
    table = np.empty(K.BSDF_TABLE_SIZE, np.float32)
    fill_schlick(table, np.float32(alpha))
    return table
