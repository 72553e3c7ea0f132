"""Virtual lights in numpy: shooting, weights and gathering walks in a closed box with a panel light, ray by ray.

Written from the formulas alone (Szirmay-Kalos and Szécsi 2003, with 1 − s and the albedo where they belong) and sharing
nothing with the package: slabs for walls, one rectangle for the light, diffuse and grey.
"""

from __future__ import annotations

import numpy as np

AXES = np.eye(3)


class Box:
    """[-1, 1]³ with albedos (6,) of -x, +x, -y, +y, -z, +z and a black panel of half size h at y, shining down."""

    def __init__(self, albedos, half=0.4, y=0.9, radiance=5.0):
        self.albedo, self.half, self.y = np.asarray(albedos, float), half, y
        self.area = (2 * half) ** 2
        self.power = np.pi * self.area * radiance

    def hits(self, o, d):
        """Wall (n,), 6 for the panel, point (n, 3), inward normal (n, 3), of rays from inside."""
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (np.sign(d) - o) / d
        t[~np.isfinite(t)] = np.inf
        axis = t.argmin(axis=1)
        rows = np.arange(len(o))
        distance = t[rows, axis]
        wall = 2 * axis + (d[rows, axis] > 0)
        normal = -np.sign(d[rows, axis])[:, None] * AXES[axis]
        with np.errstate(divide="ignore", invalid="ignore"):
            s = (self.y - o[:, 1]) / d[:, 1]
            q = o + s[:, None] * d
        inside = (np.abs(q[:, 0]) < self.half) & (np.abs(q[:, 2]) < self.half)
        panel = (s > 1e-9) & (s < distance) & inside
        p = np.where(panel[:, None], q, o + distance[:, None] * d)
        normal = np.where(panel[:, None], -np.sign(d[:, 1:2]) * AXES[1], normal)
        return np.where(panel, 6, wall), p, normal

    def visible(self, a, b):
        """Whether the panel leaves the way between points a and b (n, 3) free."""
        with np.errstate(divide="ignore", invalid="ignore"):
            s = (self.y - a[:, 1]) / (b - a)[:, 1]
            q = a + s[:, None] * (b - a)
        blocked = (s > 1e-9) & (s < 1 - 1e-9) & (np.abs(q[:, 0]) < self.half) & (np.abs(q[:, 2]) < self.half)
        return ~blocked

    def light_points(self, n, rng):
        u = rng.uniform(-self.half, self.half, (n, 2))
        return np.stack([u[:, 0], np.full(n, self.y), u[:, 1]], axis=1)


def cosine_directions(normal, rng):
    """Unit directions (n, 3) around the normals, cosine-distributed."""
    v = rng.normal(size=normal.shape)
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    d = normal + (1 - 1e-12) * v
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def shoot(box, N, rng):
    """Virtual lights of N photons: point, normal, albedo, Φ, q by estimator, whether at the first hit."""
    z0 = box.light_points(N, rng)
    d = cosine_directions(np.tile([0.0, -1.0, 0.0], (N, 1)), rng)
    o, alive = z0.copy(), np.arange(N)
    q1, f1, s1 = np.zeros(N), np.ones(N), np.zeros(N)
    modified = np.ones(N)
    lights = []
    for bounce in range(200):
        wall, p, n = box.hits(o, d)
        keep = wall < 6
        alive, wall, p, n, d = alive[keep], wall[keep], p[keep], n[keep], d[keep]
        if not len(alive):
            break
        a = box.albedo[wall]
        f = a / np.pi
        if bounce == 0:
            away = p - z0[alive]
            d2 = (away**2).sum(axis=1)
            p_omega = -d[:, 1] / np.pi
            q1[alive] = d2 / (p_omega * -(n * d).sum(axis=1))
            f1[alive], s1[alive] = f, a
            ratio = np.ones(len(alive))
        else:
            ratio = f / f1[alive]
            blocked = ~box.visible(p, box.light_points(len(p), rng)) | (p[:, 1] > box.y)
            modified[alive] *= np.where(blocked, 1 / a, 1.0)
        q = q1[alive] * ratio / N
        weights = {
            "every vertex": q,
            "full path": q * (1 - s1[alive]),
            "modified": q * (1 - s1[alive]) * modified[alive],
        }
        lights.append((p, n, a, np.full(len(p), box.power / N), weights))
        go = rng.random(len(alive)) < a
        alive, o, n = alive[go], p[go], n[go]
        d = cosine_directions(n, rng)
    joined = [np.concatenate([light[i] for light in lights]) for i in range(4)]
    return (*joined, {name: np.concatenate([light[4][name] for light in lights]) for name in lights[0][4]})


def sums(box, x, nx, ax, lights):
    """ΣF, and ΣG/a_x by estimator, at the point x."""
    p, n, a, Phi, weights = lights
    w = p - x
    d2 = (w**2).sum(axis=1)
    w = w / np.sqrt(d2)[:, None]
    geometry = np.maximum(w @ nx, 0) * np.maximum(-(w * n).sum(axis=1), 0) / d2
    geometry *= box.visible(np.tile(x, (len(p), 1)), p)
    S = ax / np.pi * geometry
    return (S * a / np.pi * Phi).sum(), {name: (S / ax * q).sum() for name, q in weights.items()}


def walks(box, x, nx, n, rng):
    """Means of what n gathering walks from x count, by estimator; "single step": the share that meets a wall."""
    o, d = np.tile(x, (n, 1)), cosine_directions(np.tile(nx, (n, 1)), rng)
    counted = dict.fromkeys(("single step", "every vertex", "full path", "modified"), 0.0)
    every = np.ones(n, bool)  # walks that go on with probability s
    longer = np.ones(n, bool)  # walks that also go on where they see no light
    for step in range(200):
        wall, p, normal = box.hits(o, d)
        on = wall < 6
        if step == 0:
            counted["single step"] = on.mean()
        every, longer, p, normal, wall = every[on], longer[on], p[on], normal[on], wall[on]
        if not len(p):
            break
        a = box.albedo[wall]
        sees = box.visible(p, box.light_points(len(p), rng)) & (p[:, 1] < box.y)
        counted["every vertex"] += (every & sees).sum() / n
        counted["full path"] += ((1 - a) * (every & sees)).sum() / n
        counted["modified"] += ((1 - a) * (longer & sees)).sum() / n
        u = rng.random(len(p))
        every &= u < a
        longer &= (u < a) | ~sees
        go = every | longer
        o, every, longer = p[go], every[go], longer[go]
        d = cosine_directions(normal[go], rng)
    return counted
