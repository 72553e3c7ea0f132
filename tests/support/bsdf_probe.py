"""Kernels and grids that evaluate and sample the lobes of a material at many directions, for tests."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from pmviewer.kernels.bsdf import lobes
from pmviewer.kernels.bsdf import principled as principled_bsdf
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.scene import M_METALLIC, MATERIAL_COLUMNS
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Material, Shape, Sphere
from tests.support.scenes import diffuse_box

STORED, FOLLOWED = np.int32(1), np.int32(2)
EVERYTHING_STORED, EVERYTHING_FOLLOWED = np.float32(0.0), np.float32(100.0)
Z = np.array([0, 0, 1], np.float32)
X = np.array([1, 0, 0], np.float32)


@device
def _vectors(frame):
    ng, ns, tangent = frame
    return (ng[0], ng[1], ng[2]), (ns[0], ns[1], ns[2]), (tangent[0], tangent[1], tangent[2])


@kernel
def _evaluate(scenes, material, glossy, group, frame, wo, wi, f, pdf, compression):
    p = lobes.material_params(scenes[0], material)
    n, s, t = _vectors(frame)
    for k in range(len(wo)):
        o, i = (wo[k, 0], wo[k, 1], wo[k, 2]), (wi[k, 0], wi[k, 1], wi[k, 2])
        b = lobes.bsdf_at(scenes[0], material, p, n, s, t, o, glossy)
        value, density = lobes.bsdf_f_pdf(b, group, o, i)
        for c in range(3):
            f[k, c] = value[c]
        pdf[k] = density
        compression[k] = lobes.bsdf_compression(b, o, i)


@kernel
def _sample(scenes, material, glossy, group, frame, wo, u, wi, weight, pdf, compression):
    p = lobes.material_params(scenes[0], material)
    n, s, t = _vectors(frame)
    for k in range(len(u)):
        o = (wo[k, 0], wo[k, 1], wo[k, 2])
        b = lobes.bsdf_at(scenes[0], material, p, n, s, t, o, glossy)
        i, w, density, factor = lobes.bsdf_sample(b, group, o, u[k, 0], u[k, 1], u[k, 2])
        for c in range(3):
            wi[k, c] = i[c]
            weight[k, c] = w[c]
        pdf[k] = density
        compression[k] = factor


@kernel
def _describe(scenes, material, glossy, ng, ns, wo, groups, share, albedo, flags):
    p = lobes.material_params(scenes[0], material)
    n, s = (ng[0], ng[1], ng[2]), (ns[0], ns[1], ns[2])
    for k in range(len(wo)):
        o = (wo[k, 0], wo[k, 1], wo[k, 2])
        b = lobes.bsdf_at(scenes[0], material, p, n, s, (np.float32(0), np.float32(0), np.float32(0)), o, glossy)
        groups[k] = lobes.bsdf_groups(b)
        share[k] = lobes.followed_share(b, o)
        a = lobes.bsdf_albedo(b, o)
        for c in range(3):
            albedo[k, c] = a[c]
        flags[k, 0] = lobes.bsdf_is_delta(b)
        flags[k, 1] = lobes.bsdf_is_lambertian(b)
        flags[k, 2] = lobes.sees_side(b, lobes.FOLLOWED, n, o, (-o[0], -o[1], -o[2]))


@kernel
def _evaluate_principled(scenes, material, glossy, group, frame, wo, wi, f, pdf, compression):
    p = lobes.material_params(scenes[0], material)
    metallic = load_f4(scenes[0].materials, material * MATERIAL_COLUMNS + M_METALLIC)
    n, s, t = _vectors(frame)
    for k in range(len(wo)):
        o, i = (wo[k, 0], wo[k, 1], wo[k, 2]), (wi[k, 0], wi[k, 1], wi[k, 2])
        b = principled_bsdf.bsdf_at(scenes[0], material, p, metallic, n, s, t, o, glossy)
        value, density = principled_bsdf.bsdf_f_pdf(b, group, o, i)
        for c in range(3):
            f[k, c] = value[c]
        pdf[k] = density
        compression[k] = principled_bsdf.bsdf_compression(b, o, i)


@kernel
def _sample_principled(scenes, material, glossy, group, frame, wo, u, wi, weight, pdf, compression):
    p = lobes.material_params(scenes[0], material)
    metallic = load_f4(scenes[0].materials, material * MATERIAL_COLUMNS + M_METALLIC)
    n, s, t = _vectors(frame)
    for k in range(len(u)):
        o = (wo[k, 0], wo[k, 1], wo[k, 2])
        b = principled_bsdf.bsdf_at(scenes[0], material, p, metallic, n, s, t, o, glossy)
        i, w, density, factor = principled_bsdf.bsdf_sample(b, group, o, u[k, 0], u[k, 1], u[k, 2])
        for c in range(3):
            wi[k, c] = i[c]
            weight[k, c] = w[c]
        pdf[k] = density
        compression[k] = factor


@kernel
def _describe_principled(scenes, material, glossy, ng, ns, wo, groups, share, albedo, flags):
    p = lobes.material_params(scenes[0], material)
    metallic = load_f4(scenes[0].materials, material * MATERIAL_COLUMNS + M_METALLIC)
    n, s = (ng[0], ng[1], ng[2]), (ns[0], ns[1], ns[2])
    tangent = (np.float32(0), np.float32(0), np.float32(0))
    for k in range(len(wo)):
        o = (wo[k, 0], wo[k, 1], wo[k, 2])
        b = principled_bsdf.bsdf_at(scenes[0], material, p, metallic, n, s, tangent, o, glossy)
        groups[k] = b.groups
        share[k] = principled_bsdf.followed_share(b, o)
        for c in range(3):
            albedo[k, c] = b.albedo[c]
        flags[k, 0] = b.delta
        flags[k, 1] = principled_bsdf.bsdf_is_lambertian(b)
        flags[k, 2] = principled_bsdf.sees_side(b, lobes.FOLLOWED, n, o, (-o[0], -o[1], -o[2]))


class Probe:
    """The lobes of some materials at a surface with these normals and tangent; directions are float32 (n, 3)."""

    kernels = (_evaluate, _sample, _describe)

    def __init__(self, materials: list[Material]) -> None:
        box = diffuse_box()
        self.first = len(box.materials)
        shapes = [Shape(m.name, Sphere((0, 0, 0), 0.1), self.first + i) for i, m in enumerate(materials)]
        scene = replace(box, materials=(*box.materials, *materials), shapes=(*box.shapes, *shapes))
        self.materials = materials
        self.flat = flatten(scene)
        self.record = self.flat.record
        self.ng = self.ns = Z
        self.tangent = X

    def index(self, material):
        return self.first + self.materials.index(material)

    def evaluate(self, material, group, wo, wi, glossy=EVERYTHING_STORED):
        """f (n, 3) and pdf (n,) in float64, and the compression."""
        wi = np.ascontiguousarray(wi, np.float32)
        wo = np.array(np.broadcast_to(wo, wi.shape), np.float32, order="C")
        f, pdf, compression = np.empty_like(wi), np.empty(len(wi), np.float32), np.empty(len(wi), np.float32)
        frame = (self.ng, self.ns, self.tangent)
        self.kernels[0](self.record, self.index(material), glossy, group, frame, wo, wi, f, pdf, compression)
        return f.astype(float), pdf.astype(float), compression.astype(float)

    def sample(self, material, group, wo, u, glossy=EVERYTHING_STORED):
        """wi, weight, pdf, compression for numbers u (n, 3)."""
        u = np.ascontiguousarray(u, np.float32)
        wo = np.array(np.broadcast_to(wo, u.shape), np.float32, order="C")
        wi, weight = np.empty_like(u), np.empty_like(u)
        pdf, compression = np.empty(len(u), np.float32), np.empty(len(u), np.float32)
        frame = (self.ng, self.ns, self.tangent)
        self.kernels[1](self.record, self.index(material), glossy, group, frame, wo, u, wi, weight, pdf, compression)
        return wi, weight.astype(float), pdf.astype(float), compression.astype(float)

    def describe(self, material, wo, glossy=EVERYTHING_STORED):
        """groups, followed share, albedo, and whether delta, Lambertian, transmissive; each for every wo."""
        wo = np.ascontiguousarray(wo, np.float32)
        groups, share = np.empty(len(wo), np.int32), np.empty(len(wo), np.float32)
        albedo, flags = np.empty_like(wo), np.empty((len(wo), 3), np.bool_)
        frame = (self.ng, self.ns)
        self.kernels[2](self.record, self.index(material), glossy, *frame, wo, groups, share, albedo, flags)
        return groups, share, albedo, flags


class PrincipledProbe(Probe):
    """The same in a scene that has principled materials."""

    kernels = (_evaluate_principled, _sample_principled, _describe_principled)


class Grid:
    """Cells over one hemisphere, in z and φ, fine around a direction; each with a Gauss quadrature of its own."""

    CELLS = (24, 32)
    NODES = 7

    def __init__(self, centre, width, azimuth, lower=False, edge=0.0) -> None:
        """`width`, `azimuth`: angles of the finest cells in and across the plane of incidence; `edge`: cosine at which
        the density jumps, which becomes a border between cells."""
        sin = max(float(np.hypot(centre[0], centre[1])), width)
        low, high = (-1.0, 0.0) if lower else (0.0, 1.0)
        self.z = _Warp(float(centre[2]), width * sin + width**2, low, high, self.CELLS[0], -edge if lower else edge)
        self.phi = _Warp(0.0, min(azimuth / sin, 3.0), -np.pi, np.pi, self.CELLS[1])
        self.turn = float(np.arctan2(centre[1], centre[0]))

    def quadrature(self):
        """Directions (n, 3) and their solid angles (n,), cell after cell."""
        z, dz = self.z.nodes(self.NODES)
        phi, dphi = self.phi.nodes(self.NODES)
        n = self.NODES
        order = [x.reshape(self.CELLS[0], 1, n, 1) for x in (z, dz)] + [
            x.reshape(1, self.CELLS[1], 1, n) for x in (phi, dphi)
        ]
        z, dz, phi, dphi = (np.broadcast_to(x, (*self.CELLS, n, n)).ravel() for x in order)
        r = np.sqrt(np.maximum(0, 1 - z * z))
        return np.stack([r * np.cos(phi + self.turn), r * np.sin(phi + self.turn), z], 1), dz * dphi

    def sums(self, values):
        """Sum over each cell's nodes."""
        return values.reshape(self.CELLS[0] * self.CELLS[1], -1).sum(1)

    def counts(self, directions):
        """How many directions fall into each cell, those of the other hemisphere left out."""
        d = directions.astype(float)
        d = d[(d[:, 2] >= self.z.low) & (d[:, 2] <= self.z.high)]
        phi = (np.arctan2(d[:, 1], d[:, 0]) - self.turn + np.pi) % (2 * np.pi) - np.pi
        cell = self.z.cell(d[:, 2]) * self.CELLS[1] + self.phi.cell(phi)
        return np.bincount(cell, minlength=self.CELLS[0] * self.CELLS[1])


@functools.cache
def _gauss(n):
    """Nodes and weights in [−1, 1]."""
    return np.polynomial.legendre.leggauss(n)


class _Warp:
    """An interval cut into cells that are fine, `width`, around the centre and grow away from it."""

    def __init__(self, centre, width, low, high, cells, edge=0.0) -> None:
        self.centre, self.width, self.low, self.high = centre, width, low, high
        self.borders = np.linspace(*(np.arcsinh((x - centre) / width) for x in (low, high)), cells + 1)
        if low < edge < high:
            at = np.arcsinh((edge - centre) / width)
            self.borders[1 + np.argmin(np.abs(self.borders[1:-1] - at))] = at

    def nodes(self, n):
        x, w = _gauss(n)
        step = np.diff(self.borders)[:, None]
        y = self.borders[:-1, None] + step * (x + 1) / 2
        return self.centre + self.width * np.sinh(y), w * step / 2 * self.width * np.cosh(y)

    def cell(self, value):
        y = np.arcsinh((value - self.centre) / self.width)
        return np.clip(np.searchsorted(self.borders, y) - 1, 0, len(self.borders) - 2)
