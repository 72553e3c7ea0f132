"""BSDFs of Mitsuba 0.6, and of Mitsuba 3's polarised modes, as the nearest that there is here, each with a sentence."""

from __future__ import annotations

import math
from dataclasses import replace

from pmviewer.scene.description import BLACK, RGB, Material
from pmviewer.scene.formats.mitsuba.document import Properties
from pmviewer.scene.formats.mitsuba.interface import alpha, bounded, distribution, relative_ior
from pmviewer.scene.texture import scaled


def _near(p: Properties, instead: str) -> None:
    p.document.warn(f"{p.element} is not supported: {instead}.", p.element)


def clear(name: str, opacity: float = 0.0) -> Material:
    """A surface that absorbs the share `opacity` of light and lets the rest pass straight through."""
    return Material(name, "diffuse", BLACK, opacity=opacity)


def is_clear(material: Material) -> bool:
    """Does all light pass the surface, as that of `null`?"""
    return material.kind == "diffuse" and material.opacity == 0 and "opacity" not in material.textures


def cut_diffuse(p: Properties, diffuse: RGB, specular: RGB) -> RGB:
    """The diffuse reflectance that the specular one leaves, with a warning when that changes it."""
    if max(d + s for d, s in zip(diffuse, specular)) <= 1 + 1e-9:
        return diffuse
    sentence = f"Diffuse and specular reflectance of {p.element} add up to more than 1: the diffuse one was cut."
    p.document.warn(sentence, p.element)
    r, g, b = (min(d, 1 - s) for d, s in zip(diffuse, specular))
    return (r, g, b)


def phong(p: Properties, name: str) -> Material:
    """Lobe cosⁿ about the mirror direction, as Ward's of the same width there: exp(−n δ²/2) = exp(−tan²(δ/2)/α²)."""
    exponent = bounded(p, "exponent", p.roughness("exponent", 30.0), 0.0, 1e6)
    _near(p, "Ward's lobe of the same width replaces Phong's")
    specular = p.bounded_colour("specular_reflectance", 0.2, 1)
    diffuse = cut_diffuse(p, p.bounded_colour("diffuse_reflectance", 0.5, 1), specular)
    rough = 1 / math.sqrt(2 * exponent + 1)
    return Material(name, "ward", diffuse, specular=specular, alpha=(rough, rough))


def rough_diffuse(p: Properties, name: str) -> Material:
    """`roughdiffuse`, Oren and Nayar's model, as plain diffuse, with a sentence."""
    p.known("alpha", "use_fast_approx")
    _near(p, "an even diffuse surface of its colour replaces it")
    return Material(name, "diffuse", p.bounded_colour(diffuse_name(p), 0.5, 1))


def diffuse_name(p: Properties) -> str:
    """`reflectance` may be called `diffuse_reflectance` in version 0.x."""
    return "diffuse_reflectance" if "diffuse_reflectance" in p else "reflectance"


def diffuse_transmitter(p: Properties, name: str) -> Material:
    """`difftrans`: what it lets through leaves alike in all directions."""
    colour = "diffuse_transmittance" if "diffuse_transmittance" in p else "transmittance"
    return Material(name, "diffuse transmitter", BLACK, p.bounded_colour(colour, 0.5, 1))


def hanrahan_krueger(p: Properties, name: str) -> Material:
    """Diffuse, with the albedo of single scattering in the layer."""
    _near(p, "a diffuse surface of its medium's albedo replaces it")
    p.known("material", "thickness", "sigma_t", "phase")
    if "albedo" in p:
        return Material(name, "diffuse", p.bounded_colour("albedo", 0.5, 1), two_sided=True)
    scattered, absorbed = p.bounded_colour("sigma_s", 1.0, None), p.bounded_colour("sigma_a", 1.0, None)
    r, g, b = (s / (s + a) if s + a > 0 else 0.0 for s, a in zip(scattered, absorbed))
    return Material(name, "diffuse", (r, g, b), two_sided=True)


def polarised_plastic(p: Properties, name: str) -> Material:
    """`pplastic` as rough plastic, with a sentence: colours are kept, polarisation isn't."""
    _near(p, "rough plastic replaces it, light is not polarised here")
    rough = alpha(p, "alpha")
    return Material(
        name,
        "rough plastic",
        reflectance=p.bounded_colour("diffuse_reflectance", 0.5, 1),
        specular=p.bounded_colour("specular_reflectance", 1.0, 1),
        eta=relative_ior(p, "polypropylene"),
        alpha=(rough, rough),
        distribution=distribution(p),
    )


def polariser(p: Properties, name: str) -> Material:
    """Half of unpolarised light passes, whichever way the filter is turned."""
    _near(p, "light is not polarised here, half of it passes")
    p.known("theta", "polarizing", "left_handed")
    r, g, b = p.bounded_colour("transmittance", 1.0, 1)
    return clear(name, 1 - (r + g + b) / 3 / 2)


def retarder(p: Properties, name: str) -> Material:
    """Turns polarisation and nothing else."""
    p.known("theta", "delta")
    r, g, b = p.bounded_colour("transmittance", 1.0, 1)
    return clear(name, 1 - (r + g + b) / 3)


def coating(p: Properties, name: str, inner: Material) -> Material:
    """A dielectric coat over another BSDF: plastic where that is diffuse, else the BSDF alone."""
    eta = relative_ior(p, "bk7")
    specular = p.bounded_colour("specular_reflectance", 1.0, 1)
    thickness = p.number("thickness", 1.0)
    sigma = p.bounded_colour("sigma_a", 0.0, None)
    rough = p.type == "roughcoating"
    across, normals = (alpha(p, "alpha"), distribution(p)) if rough else (0.1, "ggx")
    if inner.kind != "diffuse":
        _near(p, "the BSDF inside is shown without its coat")
        return inner
    # Mitsuba's coat refracts once in and once out and lets nothing back in between: plastic, with what the coat absorbs
    # on the shortest way through.
    r, g, b = (math.exp(-2 * s * max(thickness, 0.0)) for s in sigma)
    _near(p, "rough plastic of its numbers replaces it" if rough else "plastic of its numbers replaces it")
    tinted = {s: scaled(t, (r, g, b)) if s == "reflectance" else t for s, t in inner.textures.items()}
    base = inner.reflectance
    return replace(
        inner,
        name=name,
        kind="rough plastic" if rough else "plastic",
        reflectance=(base[0] * r, base[1] * g, base[2] * b),
        specular=specular,
        eta=eta,
        alpha=(across, across),
        distribution=normals,
        nonlinear=True,
        textures=tinted,
    )
