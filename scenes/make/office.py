"""A long office of twenty desks, of which the camera sees one (course guide 2002, figures 3.7 to 3.10)."""

from __future__ import annotations

import numpy as np

from make.document import BLACK, MadeScene, bsdf, diffuse, mesh, number, panel, rgb
from make.mesh import F8, Mesh, block, joined, lathe, quad, room

LENGTH, HEIGHT, DEPTH = 20.0, 2.8, 6.0
DESKS = 10
"""Along either long wall."""
TOP = 0.74
"""Height of a desk."""
SEEN = 1
"""Number of the desk in view along the back wall."""


def _moved(shape: Mesh, x: float, z: float, turned: bool) -> Mesh:
    """At (x, z); turned by half a turn for the desks of the front wall."""
    sign = -1.0 if turned else 1.0
    vertices = shape.vertices * (sign, 1.0, sign) + (x, 0.0, z)
    normals = None if shape.normals is None else shape.normals * (sign, 1.0, sign)
    return Mesh(vertices, shape.faces, normals)


def _smooth(*shapes: Mesh) -> Mesh:
    """One mesh of several that have normals."""
    both = joined(*shapes)
    return Mesh(both.vertices, both.faces, np.concatenate([s.normals for s in shapes if s.normals is not None]))


def _leaning(x: float, z: float, width: float, height: float, turn: float) -> tuple[Mesh, Mesh]:
    """Frame and picture of a photo stand on a desk, leaning back by 15°, turned about the upright."""
    lean, thick = np.deg2rad(15.0), 0.012
    forward = np.array([np.sin(turn), 0.0, np.cos(turn)])
    right = np.array([np.cos(turn), 0.0, -np.sin(turn)])
    up = np.cos(lean) * np.array([0.0, 1.0, 0.0]) - np.sin(lean) * forward
    out = np.cross(right, up)
    foot = np.array([x, TOP + 0.003, z])

    def corners(half: float, low: float, high: float, depth: float) -> list[F8]:
        return [
            foot + a * right + b * up + depth * out for a, b in ((-half, low), (half, low), (half, high), (-half, high))
        ]

    near, far = corners(width / 2, 0, height, 0.0), corners(width / 2, 0, height, -thick)
    sides = [quad(far[i], far[(i + 1) % 4], near[(i + 1) % 4], near[i]) for i in range(4)]
    frame = joined(quad(*near), quad(*far[::-1]), *sides)
    return frame, quad(*corners(width / 2 - 0.018, 0.018, height - 0.018, 0.0008))


def _desk() -> Mesh:
    """Top and two side panels with a modesty board; it stands with its back to -z at the origin."""
    return joined(
        block((-0.8, TOP - 0.03, 0.0), (0.8, TOP, 0.75)),
        block((-0.8, 0, 0.02), (-0.76, TOP - 0.03, 0.73)),
        block((0.76, 0, 0.02), (0.8, TOP - 0.03, 0.73)),
        block((0.35, 0.1, 0.05), (0.76, TOP - 0.03, 0.7)),
    )


def _chair() -> Mesh:
    """Seat, back, column and a cross of two feet."""
    return joined(
        block((-0.24, 0.44, 0.85), (0.24, 0.5, 1.3)),
        block((-0.22, 0.58, 1.27), (0.22, 1.0, 1.32)),
        block((-0.03, 0.5, 1.29), (0.03, 0.58, 1.31)),
        block((-0.025, 0.06, 1.05), (0.025, 0.44, 1.1)),
        block((-0.28, 0.0, 1.05), (0.28, 0.06, 1.1)),
        block((-0.025, 0.0, 0.8), (0.025, 0.06, 1.35)),
    )


LAMP = (0.55, 0.36)
"""Place of a lamp's head on its desk: x, z."""
BULB = TOP + 0.40


def _lamp_stand() -> Mesh:
    """Foot, post and arm."""
    x, z = LAMP
    return joined(
        block((x - 0.08, TOP, 0.06), (x + 0.08, TOP + 0.02, 0.2)),
        block((x - 0.01, TOP + 0.02, 0.1), (x + 0.01, BULB + 0.1, 0.12)),
        block((x - 0.01, BULB + 0.08, 0.12), (x + 0.01, BULB + 0.1, z)),
    )


def _shade() -> Mesh:
    """A truncated cone, open below, closed above."""
    x, z = LAMP
    profile = np.array([(0.14, BULB - 0.03), (0.05, BULB + 0.08)])
    lid = np.array([(0.05, BULB + 0.08), (0.0, BULB + 0.08)])
    return _moved(lathe([profile, lid], 20), x, z, False)


def _shelf(x: float) -> list[Mesh]:
    """A shelf unit in the middle of the room, 1.6 m long and 1.5 m high, open on both sides."""
    z = DEPTH / 2
    boards = [block((x - 0.8, y, z - 0.17), (x + 0.8, y + 0.025, z + 0.17)) for y in (0.0, 0.5, 1.0, 1.475)]
    ends = [block((x + e, 0.025, z - 0.17), (x + e + 0.025, 1.475, z + 0.17)) for e in (-0.8, 0.775)]
    return [*boards, *ends]


def _books(x: float, salt: int) -> list[Mesh]:
    """Rows of binders on a shelf unit; their sizes follow from fractions of multiples of the golden ratio."""
    found, z = [], DEPTH / 2
    for row, y in enumerate((0.025, 0.525, 1.025)):
        at, i = x - 0.74, 0
        while at < x + 0.62:
            a, b = (((salt * 31 + row * 17 + i) * g) % 1.0 for g in (0.6180339887, 0.7548776662))
            wide, high = 0.05 + 0.03 * a, 0.26 + 0.1 * b
            if a + b > 0.45:
                found.append(block((at, y, z - 0.13), (at + wide, y + high, z + 0.13)))
            at, i = at + wide + 0.004, i + 1
    return found


def office() -> MadeScene:
    """Desks along both long walls, each with a lamp; shelves between them, a row of dim panels under the ceiling."""
    hull = room((0, 0, 0), (LENGTH, HEIGHT, DEPTH))
    step = LENGTH / DESKS
    places = [(step * (i + 0.5), 0.02, False) for i in range(DESKS)]
    places += [(step * (i + 0.5), DEPTH - 0.02, True) for i in range(DESKS)]
    shelves = [step * (i + 0.5) for i in range(0, DESKS, 2)]
    x, z, _ = places[SEEN]
    stands = [
        _leaning(x - 0.5, z + 0.16, 0.2, 0.26, 0.35),
        _leaning(x - 0.2, z + 0.12, 0.26, 0.2, 0.1),
        _leaning(x + 0.12, z + 0.14, 0.16, 0.22, -0.15),
    ]
    meshes = {
        "walls": joined(*(hull[side] for side in ("ceiling", "left", "right", "front"))),
        "back": hull["back"],
        "floor": hull["floor"],
        "desks": joined(*(_moved(_desk(), *place) for place in places)),
        "chairs": joined(*(_moved(_chair(), *place) for place in places)),
        "stands": joined(*(_moved(_lamp_stand(), *place) for place in places)),
        "shades": _smooth(*(_moved(_shade(), *place) for place in places)),
        "shelves": joined(*(part for at in shelves for part in _shelf(at))),
        "books": joined(*(part for i, at in enumerate(shelves) for part in _books(at, i))),
        "pad": joined(*(_moved(block((-0.42, TOP + 0.0005, 0.28), (0.22, TOP + 0.006, 0.68)), *p) for p in places)),
        "frames": joined(*(frame for frame, _ in stands)),
        "photo_a": stands[0][1],
        "photo_b": stands[1][1],
        "photo_c": stands[2][1],
        "pot": _moved(lathe([_pot()], 40), x - 0.62, z + 0.42, False),
    }
    ggx = '<string name="distribution" value="ggx"/>'
    none = '<string name="material" value="none"/>'
    enamel = (ggx, number("alpha", 0.2), rgb("diffuse_reflectance", 0.08, 0.22, 0.14))
    pad = (none, ggx, number("alpha", 0.1), rgb("specular_reflectance", 0.5))
    frames = (rgb("eta", 0.16, 0.14, 0.13), rgb("k", 4.0, 3.1, 2.3), ggx, number("alpha", 0.3))
    lamps = []
    for place in places:
        at = _moved(Mesh(np.array([[LAMP[0], BULB, LAMP[1]]]), np.zeros((0, 3), np.int32)), *place).vertices[0]
        lamps.append(panel(tuple(at.tolist()), (0.035, 0, 0), (0, 0, 0.035), "black", (420, 350, 255)))
    ceiling = [
        panel((step * (i + 1), HEIGHT - 0.01, z), (0.3, 0, 0), (0, 0, 0.15), "black", (11, 12, 13.5))
        for i in range(0, DESKS, 2)
        for z in (1.7, DEPTH - 1.7)
    ]
    return MadeScene(
        "An office with a glossy pad",
        "Twenty desks with lamps, chairs and shelves in a room of 20 m; the camera looks at one desk, its glossy pad "
        "and the photos on it.",
        "Most photons land where nobody looks: importance, and what it asks for behind a glossy reflection.",
        (x - 0.22, 1.45, 1.85),
        (x + 0.02, 0.92, 0.15),
        52,
        [
            diffuse("white", 0.76, 0.75, 0.72),
            diffuse("wallpaper", 0.62, 0.6, 0.5),
            diffuse("carpet", 0.2, 0.23, 0.28),
            diffuse("beech", 0.58, 0.42, 0.27),
            diffuse("cloth", 0.15, 0.18, 0.3),
            diffuse("steel", 0.3, 0.3, 0.31),
            diffuse("paper", 0.5, 0.22, 0.17),
            diffuse("photo_a", 0.65, 0.3, 0.12),
            diffuse("photo_b", 0.2, 0.42, 0.62),
            diffuse("photo_c", 0.3, 0.5, 0.2),
            bsdf("roughplastic", "enamel", *enamel, two_sided=True),
            bsdf("roughconductor", "pad", *pad, two_sided=True),
            bsdf("roughconductor", "frames", *frames, two_sided=True),
            BLACK,
        ],
        [
            mesh("walls", "white", flat=True),
            mesh("back", "wallpaper", flat=True),
            mesh("floor", "carpet", flat=True),
            mesh("desks", "beech", flat=True),
            mesh("chairs", "cloth", flat=True),
            mesh("stands", "steel", flat=True),
            mesh("shades", "enamel"),
            mesh("shelves", "beech", flat=True),
            mesh("books", "paper", flat=True),
            mesh("pad", "pad", flat=True),
            mesh("frames", "frames", flat=True),
            *(mesh(f"photo_{c}", f"photo_{c}", flat=True) for c in "abc"),
            mesh("pot", "photo_b"),
            *lamps,
            *ceiling,
        ],
        meshes,
        aspect=(320, 240),
    )


def _pot() -> F8:
    """A pen pot, a cylinder open above with a wall of 4 mm."""
    low, high = TOP + 0.001, TOP + 0.11
    return np.array([(0.0, low), (0.045, low), (0.045, high), (0.041, high), (0.041, low + 0.005), (0.0, low + 0.005)])
