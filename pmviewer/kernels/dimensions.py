"""The one table of random dimensions, and of the salts that keep streams apart.

A random number depends on (seed, index, dimension) alone (`pmviewer.kernels.random`). A stream is what draws with one
seed: the numbers of a pixel, of a photon. Kernels name their dimensions from here and nowhere write a number for one;
what two draws of a stream share would be correlated, so that a test computes every stream's ranges from this table and
from the limits of the settings, and finds that they are disjoint.

Several surfaces on one chain draw direct light and gather rays by the same dimensions: each surface's estimate is right
by itself, whatever the others draw, and nothing multiplies two of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

DEPTH, IMPORTON_DEPTH, BOUNCE = "surface of an eye path", "surface of an importon's path", "scattering of a photon"
LIGHT_SAMPLE = "light sample"
"""What a range runs over. Its length follows from the limits of the settings: `render.max_depth`, twice that and two (a
path to the first surface and one after it), `photons.max_bounces`, and of all ways to choose lights the most samples at
a surface."""

EYE, PATH, SECOND_GATHER, CACHE_RECORD = "eye pass", "path tracer", "secondary gather", "irradiance cache record"
PHOTON, SHADOW_PHOTON, IMPORTON = "photon", "shadow photon", "importon"
VIRTUAL_LIGHT = "virtual light"
STREAMS = (EYE, PATH, SECOND_GATHER, CACHE_RECORD, PHOTON, SHADOW_PHOTON, IMPORTON, VIRTUAL_LIGHT)


class Dimension(NamedTuple):
    """A line of the table: number i of what the range runs `over` (None: there is one) has dimension first + stride·i
    in each of the streams."""

    streams: tuple[str, ...]
    first: int
    over: str | None
    stride: int
    meaning: str


DIMENSIONS: list[Dimension] = []
SALTS: dict[int, str] = {}


def _dimension(
    streams: tuple[str, ...], first: int, meaning: str, over: str | None = None, stride: int = 1
) -> np.int64:
    DIMENSIONS.append(Dimension(streams, first, over, stride, meaning))
    return np.int64(first)


def _salt(number: int, meaning: str) -> int:
    if number in SALTS:
        raise ValueError(f"{SALTS[number]} and {meaning} have the same salt")
    SALTS[number] = meaning
    return number


# Pixels: seed of the pixel (PIXEL_SALT), index of the pass.
PIXEL = _dimension((EYE, PATH), 0, "place in the pixel")
BSDF = _dimension((EYE,), 1, "BSDF sample that no gather ray is")
CHAIN = _dimension((EYE,), 2, "lobe followed", DEPTH)
PATH_STRIDE = 2
"""A path takes two dimensions a surface."""
PATH_SCATTER = _dimension((PATH,), 2, "scattering and roulette", DEPTH, PATH_STRIDE)
PATH_LIGHT = _dimension((PATH,), 3, "light samples", DEPTH, PATH_STRIDE)
PATH_FLIGHT = _dimension((PATH,), 3000, "flight through media to a surface or collision", DEPTH)
GATHER = _dimension((EYE,), 2000, "gather ray by the BSDF, where all are")
GATHER_BESIDE = _dimension((EYE,), 2001, "gather ray by the BSDF, beside guided ones")
GATHER_GUIDED = _dimension((EYE,), 2002, "gather ray guided by photons")
OCCLUSION = _dimension((EYE,), 2003, "ray that tells whether something is near where records would be interpolated")
GATHER_FORK = _dimension((EYE, CACHE_RECORD), 2999, "which chain of a gather ray goes on, after a secondary gather")
GATHER_CHAIN = _dimension((EYE, CACHE_RECORD), 3000, "lobe that a gather ray follows", DEPTH)
CHAIN_LIGHT = _dimension((EYE,), 4000, "light samples at followed lobes", DEPTH)
OUTLINE = _dimension((EYE,), 5000, "camera ray for emission alone, and its place on the lens")
WAVE = _dimension((EYE, PATH, PHOTON, VIRTUAL_LIGHT), 0xE81A, "wavelength, in scenes with dispersive glass")
GATHER_WAVE = _dimension((EYE, CACHE_RECORD), 0xE81B, "wavelength of a gather ray")
LENS = _dimension((EYE, PATH), 5001, "place on the lens")
LIGHT = _dimension((EYE,), 5002, "light samples where photons are stored")
FURTHER_LIGHT = _dimension((EYE, PATH), 6000, "light sample after the first in media", LIGHT_SAMPLE)
VOLUME = _dimension((EYE,), 0x50000, "distance and lights of single scattering on a camera ray", DEPTH)
VOLUME_PHASE = _dimension((EYE,), 0x60000, "direction and distance by the phase function on a camera ray", DEPTH)
GATHER_VOLUME = _dimension((EYE,), 0x70000, "the same on a gather ray", DEPTH)
GATHER_VOLUME_PHASE = _dimension((EYE,), 0x80000, "the same on a gather ray, by the phase function", DEPTH)
VIRTUAL_SUBSET = _dimension((EYE,), 0x10000, "which virtual lights a pixel asks for")
WALK = _dimension((EYE,), 0x20000, "gathering walk's way from the surface that it normalises")
WALK_SCATTER = _dimension((EYE,), 0x20001, "gathering walk's scattering and roulette", BOUNCE)
WALK_LIGHT = _dimension((EYE,), 0x30000, "gathering walk's light sample", BOUNCE)
WALK_EMITTER = _dimension((EYE,), 0x40000, "gathering walk's choice of light", BOUNCE)

# Records of the irradiance cache: seed of pixel and pass (CACHE_SALT), index of the stratum.
HEMISPHERE = _dimension((CACHE_RECORD,), 5000, "direction within a stratum of the hemisphere")

# Secondary gathers: seed of the gather (SECOND_GATHER_SALT), index of its ray.
SECOND_LIGHT = _dimension((SECOND_GATHER,), 0, "light samples")
SECOND_RAY = _dimension((SECOND_GATHER,), 1, "ray")

# Photons: seed of the render, index of the photon over all passes.
EMISSION = _dimension((PHOTON, SHADOW_PHOTON, VIRTUAL_LIGHT), 0, "place and direction of emission")
PHOTON_SCATTER = _dimension((PHOTON, VIRTUAL_LIGHT), 1, "scattering and roulette", BOUNCE)
EMITTER = _dimension((PHOTON, VIRTUAL_LIGHT), 0xE817, "choice of light")
PROJECTION_ACCEPT = _dimension((PHOTON,), 0xE818, "cosine of the light in projection maps of the world's directions")
STRATUM = _dimension((PHOTON,), 0xE819, "finer digits of the choice of a stratum")
PHOTON_FLIGHT = _dimension((PHOTON,), 0x50000, "flight through media to a surface or collision", BOUNCE)
STORE = _dimension((PHOTON,), 0x10000, "whether the photon is stored", BOUNCE)
COPIES = _dimension((PHOTON,), 0x20000, "how often the photon is stored", BOUNCE)

# Shadow photons: seed of the render (SHADOW_SALT), index over all passes.
SHADOW_EMITTER = _dimension((SHADOW_PHOTON,), 1, "choice of light")

# Virtual lights: seed of the render (VIRTUAL_SALT), index of the trajectory over all passes.
SEEN_LIGHT = _dimension((VIRTUAL_LIGHT,), 0x30000, "light sample at a hit", BOUNCE)
SEEN_EMITTER = _dimension((VIRTUAL_LIGHT,), 0x40000, "its choice of light", BOUNCE)

# Importons: seed of the render (IMPORTON_SALT), index of the importon.
IMAGE_PLACE = _dimension((IMPORTON,), 0, "place in the image and on the lens")
IMPORTON_SCATTER = _dimension((IMPORTON,), 1, "scattering and roulette", IMPORTON_DEPTH)

# Salts: hashed with a seed or, where marked, added to it by exclusive or.
PIXEL_SALT = _salt(0xE7E, "pixels")
GUIDE_SALT = _salt(2002, "choice of the photons that guide gather rays, where there are too many")
CACHE_SALT = _salt(0xCAC4E, "records of the irradiance cache")
SECOND_GATHER_SALT = _salt(0x5EC0, "secondary gathers")
FURTHER_PHOTONS_SALT = _salt(0xE817, "photons after the first 2³², which is all that a Sobol set has")
OPACITY_SALT = _salt(0x0FAC17E, "surfaces that rays pass")
GLOW_SALT = _salt(0x610E, "places in media that emit: digits of the number of the lattice")
GLOW_SIDE_SALT = _salt(0x610F, "places in media that emit: two of their coordinates")
BLEND_SALT = _salt(0xB1E2D, "parts of blends")
STORING_SALT = _salt(0x4B57, "deposition rules' decisions")
ROUNDING_SALT = _salt(0xDE905, "rounding of photons' powers; by exclusive or, deposition rules")
BLUE_SALT = _salt(0x9E3779B9, "rounding of the third of a photon's powers")
BAND_SALT = _salt(0xBA2D, "rounding of the powers of photons with a wavelength")
REWEIGHT_SALT = _salt(1, "rounding of powers that deposition rules raise")
IMPORTON_SALT = _salt(0x1347, "importons, by exclusive or")
VIRTUAL_SALT = _salt(0x7117, "virtual lights, by exclusive or")
DISC_SALT = _salt(0xA5EA, "places that are asked of a disc around a virtual light")
GATHERED_SALT = _salt(0x6A7E, "places of a disc, and the photon, that are asked at the end of a gather ray")
SHADOW_SALT = _salt(0x5AD0, "shadow photons, by exclusive or")
SCATTERED_SALT = _salt(0x5CA77E, "importons scattered on, by exclusive or")
TEST_RAY_SALT = _salt(0x7E57, "test rays of deposition rules, by exclusive or")
TEST_PHOTON_SALT = _salt(0x7E57F01D, "test photons of guided emission, by exclusive or")
PIECE_SALT = _salt(0x59117, "pieces that photons are split into")
COVERED_SALT = _salt(0xC0E, "points of a disc that surfaces may cover: hashed with the place and the pass")
COVERED_FILTER_SALT = _salt(0xC0F, "whether the filter of look-ups takes them: hashed with the point")
