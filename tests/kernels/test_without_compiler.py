"""The pure functions give the same numbers without numba's compiler: nothing depends on how it promotes types."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

PROGRAM = """
import json, warnings
from types import SimpleNamespace
import numpy as np
from pmviewer.kernels import random, vector, warp
from pmviewer.kernels.accel import bvh
from pmviewer.kernels.bsdf import specular
from pmviewer.kernels.random import INDEPENDENT, SOBOL

from tests.support.device import from_python

def callable_from_python(module, names):
    return SimpleNamespace(**{name: from_python(getattr(module, name)) for name in names.split()})

vector = callable_from_python(vector, "normalize from_basis luminance dot cross")
names = "square_to_sphere square_to_disk square_to_cosine_hemisphere square_to_cone square_to_triangle"
warp = callable_from_python(warp, names)
fresnel_dielectric, reflect = vars(callable_from_python(specular, "fresnel_dielectric reflect")).values()
draw1, draw4, hash3 = vars(callable_from_python(random, "draw1 draw4 hash3")).values()

warnings.simplefilter("ignore", RuntimeWarning)  # uint32 products are meant to overflow
f, u4 = np.float32, np.uint32
exact, rounded = [], []
for i in range(40):
    exact.append(float(hash3(u4(i), u4(3 * i + 1), u4(7))))
    for sequence in (INDEPENDENT, SOBOL):
        numbers = draw4(sequence, u4(9), u4(77 * i), i)
        exact += [float(x) for x in numbers] + [float(draw1(sequence, u4(9), u4(77 * i), i))]
        a, b = f(numbers[0]), f(numbers[1])
        n = vector.normalize((f(a - f(0.5)), f(b - f(0.5)), f(numbers[2] - f(0.4))))
        d = warp.square_to_sphere(a, b)
        rounded += [*warp.square_to_disk(a, b), *warp.square_to_cosine_hemisphere(a, b), *d,
                    *warp.square_to_cone(a, b, f(0.25)), *warp.square_to_triangle(a, b)]
        rounded += [*n, *vector.from_basis(n, a, b, f(0.5)), vector.luminance(n), vector.dot(n, d), *vector.cross(n, d)]
        rounded += [*reflect(d, n), *fresnel_dielectric(a, f(1.5)), *fresnel_dielectric(a, f(0.6))]
generator = np.random.default_rng(1)
quadrics = np.zeros((12, 12), f)
quadrics[:, 1:4], quadrics[:, 6:8], quadrics[:, 9] = generator.uniform(-1, 1, (12, 3)), (1, 0.1), 1
tree = bvh.build(generator.uniform(-1, 1, (60, 3, 3)).astype(f), quadrics)
exact += tree.nodes.view(np.int32).ravel().tolist() + tree.blocks.view(np.int32).ravel().tolist()
print(json.dumps([exact, [float(x) for x in rounded]]))
"""


def numbers(disabled: str) -> list[list[float]]:
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env={**os.environ, "NUMBA_DISABLE_JIT": disabled, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        cwd=os.getcwd(), capture_output=True, text=True, check=True, timeout=300,
    )  # fmt: skip
    return json.loads(run.stdout)


@pytest.mark.extensive
def test_same_numbers_without_compiler():
    compiled, interpreted = numbers("0"), numbers("1")
    assert interpreted[0] == compiled[0]
    assert len(compiled[1]) == len(interpreted[1]) > 1000
    difference = np.abs(np.subtract(compiled[1], interpreted[1])).max()
    print(f"largest difference of compiled and interpreted vector functions: {difference:.1e}")
    assert difference < 2e-6  # contraction and reassociation of float32 sums
