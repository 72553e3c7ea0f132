"""A scene as loaders describe it: frozen, validated, independent of how kernels store it.

Lengths are in scene units (metres unless the file says otherwise), radiance in W/(m² sr) per RGB channel, intensity in
W/sr. Directions and winding follow Mitsuba 3: an area light emits, and a one-sided BSDF reflects, on the side that the
geometric normal points to.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.bsdf.kinds import KINDS
from pmviewer.scene.dispersion import Dispersion
from pmviewer.scene.medium import Medium as Medium
from pmviewer.scene.texture import LUMINANCE as LUMINANCE
from pmviewer.scene.texture import Texture

RGB = tuple[float, float, float]
Vec3 = tuple[float, float, float]
Matrix = NDArray[np.float64]

BLACK: RGB = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Mesh:
    """Triangles. `vertices` (V, 3) float64 in world space, `faces` (F, 3) int32 counter-clockwise seen from the front,
    `normals` (V, 3) float64 unit shading normals or None for flat shading, `uv` (V, 2) float64 texture coordinates or
    None, `colours` (V, 3) float64 linear RGB at vertices or None."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    normals: NDArray[np.float64] | None = None
    uv: NDArray[np.float64] | None = None
    colours: NDArray[np.float64] | None = None


Frame = tuple[Vec3, Vec3, Vec3]
"""Unit x, y and z axes of a round shape's own coordinates in world space, which its texture coordinates refer to. Left-
handed when the shape was mirrored."""


@dataclass(frozen=True)
class Sphere:
    """Normals point outwards, or inwards with `flip_normals`. Texture coordinates are azimuth / 2π about the frame's z
    axis and polar angle / π; without `frame` the world's axes count."""

    center: Vec3
    radius: float
    flip_normals: bool = False
    frame: Frame | None = None


@dataclass(frozen=True)
class Cylinder:
    """An open tube from `p0` to `p1`. Normals point away from the axis, or towards it with `flip_normals`. Texture
    coordinates are azimuth / 2π about the frame's z axis (that from p0 to p1) and height / length."""

    p0: Vec3
    p1: Vec3
    radius: float
    flip_normals: bool = False
    frame: Frame | None = None


@dataclass(frozen=True)
class Disk:
    """A flat round disk; it faces `normal` (unit length, flipping already applied). Texture coordinates are distance
    from the centre / radius and azimuth / 2π in the frame's x-y plane."""

    center: Vec3
    normal: Vec3
    radius: float
    frame: Frame | None = None


@dataclass(frozen=True)
class Parallelogram:
    """corner + u·edge_u + v·edge_v for u, v in [0, 1]; it faces edge_u × edge_v. (u, v) are its texture coordinates,
    with `swap_uv` (v, u)."""

    corner: Vec3
    edge_u: Vec3
    edge_v: Vec3
    swap_uv: bool = False


Geometry = Mesh | Sphere | Cylinder | Disk | Parallelogram


@dataclass(frozen=True)
class Principled:
    """What a principled material has beyond the numbers of others; names and ranges are Mitsuba 3's, all from 0 to 1.

    `spec_trans` is the share that transmits. `clearcoat_gloss` goes from a rough coat (0) to a smooth one (1).
    """

    metallic: float = 0.0
    spec_trans: float = 0.0
    spec_tint: float = 0.0
    sheen: float = 0.0
    sheen_tint: float = 0.0
    flatness: float = 0.0
    clearcoat: float = 0.0
    clearcoat_gloss: float = 0.0


ThinGlass = Literal["", "by setting", "exact", "ignored", "tinted", "tinted and reflecting"]
THIN_GLASS: tuple[ThinGlass, ...] = get_args(ThinGlass)
"""How light passes a pane of glass; "" is not said."""


@dataclass(frozen=True)
class Material:
    """A BSDF. `reflectance` scales reflection (albedo of a diffuse surface or base, specular reflectance of conductors
    and dielectrics), `transmittance` scales refraction; `eta` is inside IOR over outside IOR. `two_sided` makes the
    back of an opaque material reflect like its front; without it the back is black. Raises ValueError for a `kind`
    that is not in `pmviewer.kernels.bsdf.kinds.KINDS`.

    `specular` is the colour of a coat (plastic) or of the glossy lobe (ward; schlick: at normal incidence). `alpha` is
    the roughness along the tangent and across it; for `schlick` the square root of Schlick's factor. `metal` is the
    complex index of a conductor, real and imaginary part per channel; without it it reflects the same at all angles.
    `nonlinear`: colours of a coated base shift by what the coat sends back to it. `absorption` is that of a
    dielectric's inside, per channel and scene unit (Beer–Lambert).

    A "principled" material is Disney's (Burley 2012, 2015) as Mitsuba 3's `principled` has it: `reflectance` is its
    base colour, `alpha` its roughness squared (with the aspect of anisotropy), `eta` the index that its specular
    reflection comes from; see `Principled` for the rest. A "blend" is `parts[0]` and `parts[1]` in the shares 1 −
    `weight` and `weight`, or the front and the back of the surface; all else of its own that counts is `opacity`.
    A "diffuse transmitter" lets `transmittance` of the light through, alike in all directions, and reflects nothing.
    "null" is no surface: where a medium begins or ends that nothing bounds.
    """

    name: str
    kind: str
    reflectance: RGB = (0.5, 0.5, 0.5)
    transmittance: RGB = (1.0, 1.0, 1.0)
    eta: float = 1.5
    two_sided: bool = False
    specular: RGB = (1.0, 1.0, 1.0)
    alpha: tuple[float, float] = (0.1, 0.1)
    distribution: Literal["ggx", "beckmann"] = "ggx"
    metal: tuple[RGB, RGB] | None = None
    nonlinear: bool = False
    absorption: RGB = BLACK
    textures: Mapping[str, Texture] = field(default_factory=dict, hash=False)
    """By slot (`pmviewer.scene.texture.SLOTS`). A texture replaces the number of its slot's name, which is its mean."""
    bump_scale: float = 1.0
    """Multiplies the heights of `textures["bump"]`."""
    opacity: float = 1.0
    """Share of rays that meet the surface; the others pass straight through it."""
    alpha_cutoff: float | None = None
    """With it the surface is opaque where `opacity` or its filtered texture is at least that, and a hole elsewhere."""
    vertex_colours: bool = False
    """Are `reflectance` and its texture multiplied by the colours at a mesh's vertices?"""
    principled: Principled | None = None
    parts: tuple[Material, ...] = ()
    weight: float = 0.5
    by_side: bool = False
    """Of a blend: is `parts[0]` what the front shows and `parts[1]` what the back does, whatever the weight?"""
    thin_glass: ThinGlass = ""
    """Of a dielectric or thin dielectric: what becomes of light and rays there (`thin_rule`)."""
    dispersion: Dispersion | None = None
    """Of a dielectric or rough dielectric: how its index depends on the wavelength; `eta` is that at 587.6 nm."""
    mirrored_maps: bool = False
    """Seen from behind, do mapped normals turn round only across the surface, as if its picture were mirrored
    (Mitsuba's `twosided` around a map), or as a whole, as those of a thin sheet with bumps do?"""

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"unknown kind of material: {self.kind}")

    @property
    def veiled(self) -> bool:
        """Is it less than opaque somewhere?"""
        return "opacity" in self.textures or self.opacity < (1.0 if self.alpha_cutoff is None else self.alpha_cutoff)

    @property
    def passable(self) -> bool:
        """Do some rays pass straight through it? None do where its inside absorbs light, for then a ray would have to
        know where it entered."""
        return self.veiled and not (self.kind in ("dielectric", "rough dielectric") and any(self.absorption))

    @property
    def thin_rule(self) -> ThinGlass:
        """How light passes it (`pmviewer.kernels.bsdf.thin_glass`); a thin dielectric that does not say goes by the
        setting `render.thin_glass`, all other glass is exact."""
        if self.kind not in ("dielectric", "thin dielectric"):
            return "exact"
        return self.thin_glass or ("by setting" if self.kind == "thin dielectric" else "exact")

    @property
    def disperses(self) -> bool:
        """Does it bend wavelengths differently?"""
        return self.dispersion is not None and self.kind in ("dielectric", "rough dielectric")

    @property
    def transparent(self) -> bool:
        """Does it let light through to its other side by a lobe?"""
        return self.kind in ("dielectric", "rough dielectric", "thin dielectric", "diffuse transmitter")


@dataclass(frozen=True)
class Shape:
    """Geometry with a material (index into `Scene.materials`) and, when it is a light, its emitted `radiance`, which
    is the mean of `emission` if that is given. `media`: those inside and outside of it, where one begins or ends at the
    surface (indices into `Scene.media`, −1 for none); None where it separates nothing."""

    name: str
    geometry: Geometry
    material: int
    radiance: RGB | None = None
    emission: Texture | None = None
    media: tuple[int, int] | None = None

    @property
    def shines(self) -> bool:
        """Is it a light?"""
        return self.radiance is not None and max(self.radiance) > 0


@dataclass(frozen=True, eq=False)
class Group:
    """Shapes in coordinates of their own, stored once and shown by instances; none of them is a light."""

    name: str
    shapes: tuple[Shape, ...]


@dataclass(frozen=True, eq=False)
class Instance:
    """A copy of a group in the scene. `to_world` (4, 4) is affine and can be inverted; it may shear and mirror, and
    what was the outside of a surface stays its outside."""

    name: str
    group: Group
    to_world: Matrix


@dataclass(frozen=True)
class PointLight:
    """`intensity` in W/sr, equal in all directions."""

    name: str
    position: Vec3
    intensity: RGB


@dataclass(frozen=True)
class ConstantEnvironment:
    """The same `radiance` arriving from everywhere outside."""

    name: str
    radiance: RGB


@dataclass(frozen=True)
class SpotLight:
    """A point that shines around the unit vector `axis`: `intensity` (W/sr) up to the angle `beam` off the axis, then
    falling linearly to nothing at `cutoff` (degrees, beam ≤ cutoff ≤ 180)."""

    name: str
    position: Vec3
    axis: Vec3
    intensity: RGB
    cutoff: float
    beam: float


@dataclass(frozen=True, eq=False)
class ProjectorLight:
    """A point that throws a picture: `pixels` (h, w, 3) float32, finite and not negative, is the irradiance in W/m² on
    the plane at distance 1 across its axis, and bilinear between the lines `columns` (w,) and `rows` (h,), shares of
    the picture's width and height that ascend from 0 to 1, at least two; where two lines coincide it jumps.

    `to_world` (3, 3) is orthonormal; it takes the direction of the picture's middle (0, 0, 1), its top (0, 1, 0) and
    its left (1, 0, 0) to the scene's: pixel (0, 0) is at the top left as the projector sees it. `half` are half the
    picture's width and height on that plane.
    """

    name: str
    position: Vec3
    to_world: Matrix
    half: tuple[float, float]
    pixels: NDArray[np.float32]
    columns: NDArray[np.float64]
    rows: NDArray[np.float64]


@dataclass(frozen=True)
class DirectionalLight:
    """Parallel light travelling along the unit vector `direction`; `irradiance` in W/m² on what faces it."""

    name: str
    direction: Vec3
    irradiance: RGB


@dataclass(frozen=True)
class ImageEnvironment:
    """Radiance from outside by direction: `pixels` (h, w, 3) float32, finite and not negative, h ≥ 3, w ≥ 2, in the
    lat-long layout of Mitsuba's `envmap`. `to_world` (3, 3) is orthonormal; it takes the image's up (0, 1, 0), its
    middle (0, 0, 1) and the middle of its left half (1, 0, 0) to the scene's."""

    name: str
    pixels: NDArray[np.float32]
    to_world: Matrix


Environment = ConstantEnvironment | ImageEnvironment
Light = PointLight | SpotLight | ProjectorLight | DirectionalLight | Environment


FilterKind = Literal["box", "tent", "Gaussian", "Mitchell-Netravali", "Catmull-Rom", "Lanczos"]


@dataclass(frozen=True)
class PixelFilter:
    """A reconstruction filter, separable, 0 farther than `radius` pixels from the pixel's middle on either axis; its
    formula is in `pmviewer.render.filter`. `shape`: the standard deviation of a Gaussian; B and C of
    Mitchell-Netravali; empty for all others."""

    kind: FilterKind
    radius: float
    shape: tuple[float, ...] = ()


@dataclass(frozen=True)
class Camera:
    """Perspective or orthographic camera. `up` need not be orthogonal to the view direction. `fov` in degrees,
    measured along `fov_axis`. The image's x axis runs to the viewer's right, its y axis down.

    An orthographic camera's picture is `width` scene units wide and `fov` does not count; what lies behind the plane
    through `origin` is not seen. `shift` moves the picture without turning the camera, in widths and heights of the
    picture: (0.1, 0) shows more of what is on the right, (0, 0.1) more of what is below, as Mitsuba's
    `principal_point_offset_x` and `_y` do.
    """

    origin: Vec3
    target: Vec3
    up: Vec3
    fov: float
    fov_axis: Literal["x", "y", "diagonal", "smaller", "larger"] = "x"
    near: float = 0.0
    far: float = math.inf
    projection: Literal["perspective", "orthographic"] = "perspective"
    width: float = 1.0
    shift: tuple[float, float] = (0.0, 0.0)
    mirrored: bool = False
    """True when the file's camera frame has the other handedness: the image is then flipped left to right."""
    aperture: float = 0.0
    """Radius of the thin lens, 0 for a pinhole."""
    focus: float | None = None
    """Distance along the view of the plane that the lens shows sharp; None: the file does not say."""
    filter: PixelFilter | None = None
    """Of the film; None: the file does not say."""
    medium: int = -1
    """The medium that the file says the camera is in, −1 for none."""
    hides_lights: bool = False
    """Whether the file says that the picture shows no lights, nor the sky."""


@dataclass(frozen=True)
class NamedCamera:
    """A camera of the file with the size of its picture in pixels."""

    name: str
    camera: Camera
    width: int
    height: int


@dataclass(frozen=True)
class Scene:
    """Everything a loader found. `warnings` are complete sentences ("line 12: texture 'bitmap' is ignored …");
    `dropped` counts what was unusable, by reason ("degenerate triangle": 3)."""

    name: str
    path: Path | None
    shapes: tuple[Shape, ...]
    materials: tuple[Material, ...]
    lights: tuple[Light, ...]
    camera: Camera
    width: int
    height: int
    warnings: tuple[str, ...] = ()
    dropped: Mapping[str, int] = field(default_factory=dict)
    instances: tuple[Instance, ...] = ()
    cameras: tuple[NamedCamera, ...] = ()
    """All cameras of the file; `camera` is the first or the one that was asked for. Without any, `camera` is a
    makeshift until one is chosen (`pmviewer.scene.defaults.completion`)."""
    up: Literal["y", "z"] | None = None
    """The vertical axis, where the file's format has one."""
    exposure: float | None = 0.0
    """Exposure in EV that the scene is meant to be shown with; None: to be chosen from the picture."""
    media: tuple[Medium, ...] = ()

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """The groups that instances show, each once, in the order of their first instance."""
        return tuple(dict.fromkeys(instance.group for instance in self.instances))

    @cached_property
    def all_shapes(self) -> tuple[Shape, ...]:
        """The scene's own shapes, then those of its groups: everything that is stored."""
        return self.shapes + tuple(shape for group in self.groups for shape in group.shapes)
