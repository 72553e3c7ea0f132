"""Random BSDFs and textures, with every parameter that both programs know."""

from __future__ import annotations

from typing import Any

from pmviewer.bench.agree.draw import Draw
from pmviewer.bench.agree.tree import MAPS, Node, innermost

METALS = ("Au", "Cu", "Al", "Ag", "Cr")
GLASSES = ("bk7", "water", "diamond")
TRANSPARENT = ("dielectric", "roughdielectric", "thindielectric")
METALLIC = ("conductor", "roughconductor")
COATED = ("plastic", "roughplastic")
PLAIN = ("diffuse", "diffuse", "conductor", "dielectric")
"""Kinds that don't need the code of rich materials; a conductor is then a mirror of one colour at all angles."""
RICH = ("diffuse", *METALLIC, *TRANSPARENT, *COATED)
LEAST_ALPHA = 0.05
"""Smoother lobes make single paths so bright that neither side converges."""


class Materials:
    """Draws BSDFs: `rich` allows every parameter, `textured` puts textures and maps on some of them."""

    def __init__(self, draw: Draw, rich: bool, textured: bool) -> None:
        self.draw, self.rich, self.textured = draw, rich, textured

    def of(self, kind: str) -> Node:
        """A BSDF of that type, opaque ones mostly with both sides, some behind a bump or normal map."""
        draw = self.draw
        node: Node = getattr(self, f"_{kind}")()
        if self.textured and draw.chance(0.3):
            node = self._mapped(node)
        if kind not in TRANSPARENT and draw.chance(0.8):
            node = {"type": "twosided", "inside": node}
        return node

    def colour(self, name: str, low: float, high: float) -> Node:
        """A colour by that name, or a texture in its place."""
        if self.textured and self.draw.chance(0.5):
            return {name: self.texture()}
        return {name: self.draw.colour(low, high)}

    def texture(self, kind: str = "colour", raw: bool = False) -> Node:
        """A bitmap or, for colours, a checkerboard."""
        draw = self.draw
        to_uv: list[Any] = [["scale", [draw.number(0.5, 4), draw.number(0.5, 4), 1.0]]]
        if draw.chance(0.5):
            to_uv += [["rotate", [0.0, 0.0, 1.0], draw.number(-180, 180)]]
            to_uv += [["translate", [draw.number(-1, 1), draw.number(-1, 1), 0.0]]]
        if kind == "colour" and draw.chance(0.4):
            return {
                "type": "checkerboard",
                "color0": draw.colour(0, 0.4),
                "color1": draw.colour(0.3, 0.9),
                "to_uv": to_uv,
            }
        picture = {"kind": kind, "seed": draw.seed(), "width": draw.integer(4, 24), "height": draw.integer(4, 24)}
        filter, wrap = draw.pick(("bilinear", "nearest")), draw.pick(("repeat", "mirror", "clamp"))
        return {"type": "bitmap", "picture": picture, "raw": raw or draw.chance(0.3), "filter_type": filter,
                "wrap_mode": wrap, "to_uv": to_uv}  # fmt: skip

    def _mapped(self, node: Node) -> Node:
        draw = self.draw
        if draw.chance(0.5):
            height = self.texture("height", raw=True)
            height["filter_type"] = "bilinear"
            return {"type": "bumpmap", "height": height, "scale": draw.number(0.02, 0.15),
                    "use_shadowing_function": False, "inside": node}  # fmt: skip
        normals = self.texture("normal", raw=True)
        return {"type": "normalmap", "normalmap": normals, "use_shadowing_function": False, "inside": node}

    def _diffuse(self) -> Node:
        return {"type": "diffuse", **self.colour("reflectance", 0.1, 0.9)}

    def _conductor(self) -> Node:
        if not self.rich:
            return {"type": "conductor", "specular_reflectance": self.draw.colour(0.5, 0.95)}
        return {"type": "conductor", **self._metal()}

    def _metal(self) -> Node:
        draw = self.draw
        node: Node = {}
        kind = draw.pick(("material", "index", "none"))
        if kind == "material":
            node["material"] = draw.pick(METALS)
        elif kind == "index":
            node |= {"eta": draw.colour(0.2, 3), "k": draw.colour(1, 5)}
        if kind == "none" or draw.chance(0.5):
            node |= self.colour("specular_reflectance", 0.4, 0.95)
        return node

    def _roughconductor(self) -> Node:
        node = {"type": "roughconductor", **self._metal(), **self._distribution()}
        if self.textured and self.draw.chance(0.3):
            return node | {"alpha": self.texture("roughness", raw=True)}
        return node | self._roughness()

    def _distribution(self) -> Node:
        return {"distribution": self.draw.pick(("ggx", "beckmann"))}

    def _roughness(self) -> Node:
        """Isotropic or, where textures give surfaces a direction anyway, sometimes anisotropic."""
        draw = self.draw
        if self.textured and draw.chance(0.3):
            return {"alpha_u": draw.log(2 * LEAST_ALPHA, 1), "alpha_v": draw.log(2 * LEAST_ALPHA, 1)}
        return {"alpha": draw.log(LEAST_ALPHA, 1)}

    def _indices(self, thin: bool = False) -> Node:
        draw = self.draw
        if draw.chance(0.3):
            return {"int_ior": draw.pick(GLASSES), "ext_ior": "air"}
        if draw.chance(0.2):  # an air bubble, or glass that is lighter than what is around it
            return {"int_ior": draw.number(1, 1.2), "ext_ior": draw.number(1.3, 1.6)}
        return {"int_ior": draw.number(1.1, 2.2), "ext_ior": 1.0}

    def _tints(self) -> Node:
        draw, node = self.draw, {}
        if draw.chance(0.4):
            node["specular_reflectance"] = draw.colour(0.4, 1)
        if draw.chance(0.5):
            node |= self.colour("specular_transmittance", 0.4, 1)
        return node

    def _dielectric(self) -> Node:
        return {"type": "dielectric", **self._indices(), **(self._tints() if self.rich else {})}

    def _roughdielectric(self) -> Node:
        alpha = {"alpha": self.draw.log(2 * LEAST_ALPHA, 0.7)}
        return {"type": "roughdielectric", **self._indices(), **self._tints(), **self._distribution(), **alpha}

    def _thindielectric(self) -> Node:
        return {"type": "thindielectric", **self._indices(), **self._tints()}

    def _coat(self) -> Node:
        draw = self.draw
        node: Node = {"int_ior": draw.number(1.2, 2), "nonlinear": draw.chance(0.5)}
        if draw.chance(0.5):
            node["specular_reflectance"] = draw.colour(0.3, 1)
        return node | self.colour("diffuse_reflectance", 0.1, 0.9)

    def _plastic(self) -> Node:
        return {"type": "plastic", **self._coat()}

    def _roughplastic(self) -> Node:
        alpha = {"alpha": self.draw.log(LEAST_ALPHA, 0.7)}
        return {"type": "roughplastic", **self._coat(), **self._distribution(), **alpha}


def is_delta(bsdf: Node) -> bool:
    """Whether light that the BSDF sends on can't be found by sampling point lights: smooth metal, glass and coats."""
    return innermost(bsdf)["type"] in ("conductor", "dielectric", "thindielectric", "plastic")


def is_mapped(bsdf: Node) -> bool:
    """Whether a bump or normal map stands around the BSDF."""
    while "inside" in bsdf:
        if bsdf["type"] in MAPS:
            return True
        bsdf = bsdf["inside"]
    return False
