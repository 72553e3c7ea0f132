"""Lobes that are followed ray by ray: what a scene is made of never changes the physics of a surface.

Truth is the path tracer with lights that paths can meet, or the photon methods where nothing is followed.
"""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.settings.access import Settings, with_values

pytestmark = pytest.mark.usefixtures("every_surface")

HEAD = """<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="{fov}"/><transform name="to_world">
<lookat origin="{origin}" target="{target}" up="0,0,1"/></transform><film type="hdrfilm">
<integer name="width" value="48"/><integer name="height" value="48"/><rfilter type="box"/></film></sensor>"""
POINT = """<emitter type="point"><point name="position" x="1" y="-1" z="3"/>
<rgb name="intensity" value="10"/></emitter>"""
BALL = """<shape type="sphere"><float name="radius" value="{radius}"/><point name="center" x="{x}" y="{y}" z="{z}"/>
{what}</shape>"""
MIRROR_BALL = BALL.format(radius=0.5, x=0, y=0, z=0.6, what='<bsdf type="conductor"/>')
FLOOR = """<shape type="rectangle"><transform name="to_world"><scale value="2"/></transform>{bsdf}</shape>"""
METAL = '<bsdf type="roughconductor"><float name="alpha" value="{alpha}"/></bsdf>'
SKY = '<emitter type="constant"/>'


def ball_light(radius: float) -> str:
    """As bright from afar as POINT."""
    L = 10 / (np.pi * radius * radius)
    emitter = f'<emitter type="area"><rgb name="radiance" value="{L}"/></emitter>'
    return BALL.format(radius=radius, x=1, y=-1, z=3, what=emitter)


def scene(tmp_path, *parts: str, origin="0,-4,2", target="0,0,0.3", fov=45.0) -> str:
    file = tmp_path / "scene.xml"
    file.write_text(HEAD.format(origin=origin, target=target, fov=fov) + "".join(parts) + "</scene>")
    return str(file)


def means(source: str, method: str, passes: int, **values) -> np.ndarray:
    """(passes,) mean of the image in each pass."""
    opened = open_scene(source, {})
    values = {"render.method": method, "photons.N": 16_000, **values}
    pool = WorkPool(1)
    renderer = Renderer(opened, with_values(Settings(), values), pool, StageStore(0))
    totals = []
    for _ in range(passes):
        renderer.step()
        totals.append(renderer.film.sums[:, :15].sum(axis=1).mean() / 3)
    pool.close()
    return np.diff(np.array(totals), prepend=0.0)


def agree(a: np.ndarray, b: np.ndarray, share: float = 0.0) -> bool:
    """Within four standard errors of the passes, and that share for bias."""
    error = np.hypot(a.std() / np.sqrt(len(a)), b.std() / np.sqrt(len(b)))
    print(f"{a.mean():.5f}, {b.mean():.5f} ± {error:.5f}, ratio {a.mean() / b.mean():.4f}")
    assert a.mean() > 0
    return abs(a.mean() - b.mean()) < 4 * error + share * b.mean()


@pytest.mark.parametrize("alpha", [0.5, 0.1], ids=["stored", "followed"])
@pytest.mark.parametrize("method", ["progressive", "gather"])
def test_metal_alone_is_lit(tmp_path, method, alpha):
    """Nothing is diffuse: rough metal stores photons from `photons.glossy` on, smoother metal is lit by samples."""
    floor = FLOOR.format(bsdf=METAL.format(alpha=alpha))
    source = scene(tmp_path, floor, MIRROR_BALL, ball_light(0.4))
    assert agree(means(source, method, 40), means(source, "path", 48), 0.01)


TILTED = """v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvn 0.8 0 0.6\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n"""
QUAD = '<shape type="obj"><string name="filename" value="quad.obj"/>{bsdf}</shape>'
TWO_SIDED = '<bsdf type="twosided">{bsdf}</bsdf>'


@pytest.mark.parametrize("method", ["progressive", "gather"])
def test_a_tilted_shading_normal_lets_no_light_through_the_surface(tmp_path, method):
    """Lobes of a normal that leans by 53° dip below the surface, where a constant sky is as bright as above."""
    (tmp_path / "quad.obj").write_text(TILTED)
    quad = QUAD.format(bsdf=TWO_SIDED.format(bsdf=METAL.format(alpha=0.1)))
    source = scene(tmp_path, quad, SKY, origin="0,-4,4", target="0,0,0", fov=15)
    ours = means(source, method, 24)
    assert agree(ours, means(source, "path", 48))
    assert ours.mean() < 0.9


@pytest.mark.parametrize("method", ["progressive", "path"])
def test_an_unseen_object_changes_no_mirror(tmp_path, method):
    """Mirrors of scenes with simple materials and of rich ones are the same: their normals are corrected alike."""
    (tmp_path / "quad.obj").write_text(TILTED)
    quad = QUAD.format(bsdf=TWO_SIDED.format(bsdf='<bsdf type="conductor"/>'))
    wall = FLOOR.format(bsdf=TWO_SIDED.format(bsdf='<bsdf type="diffuse"/>')).replace(
        '<scale value="2"/>', '<scale value="3"/><rotate y="1" angle="90"/><translate x="2.5"/>'
    )
    camera = {"origin": "-1,-3,1.5", "target": "0,0,0", "fov": 20}
    plain = means(scene(tmp_path, quad, wall, SKY, **camera), method, 17)
    hidden = BALL.format(radius=0.01, x=0, y=0, z=-9, what='<bsdf type="plastic"/>')
    rich = means(scene(tmp_path, quad, wall, hidden, SKY, **camera), method, 17)
    assert plain.mean() == pytest.approx(rich.mean(), rel=2e-3)


@pytest.mark.extensive
@pytest.mark.parametrize("lookup", ["radius", "nearest"])
def test_caustics_of_a_point_light_on_smooth_gloss(tmp_path, lookup):
    """A mirror ball over metal of roughness 0.15: below `photons.glossy` the lobe is followed, and only photons know
    the light that comes over the ball. Truth is the same floor with the lobe stored."""
    source = scene(tmp_path, FLOOR.format(bsdf=METAL.format(alpha=0.15)), MIRROR_BALL, POINT)
    followed = means(source, "progressive", 40, **{"estimate.lookup": lookup})
    stored = means(source, "progressive", 40, **{"estimate.lookup": lookup, "photons.glossy": 0.05})
    assert agree(followed, stored, 0.01)
    assert followed.mean() > 1.2 * means(source, "path", 5).mean()


@pytest.mark.extensive
@pytest.mark.parametrize("height", [1.2, -1.2], ids=["above", "below"])
def test_caustics_of_a_point_light_on_rough_glass(tmp_path, height):
    """The same on a pane of rough glass seen from either side; truth is a path tracer with a small ball for the light,
    which it can meet."""
    bsdf = '<bsdf type="roughdielectric"><float name="alpha" value="0.3"/></bsdf>'
    camera = {"origin": f"1.6,-1.2,{height}", "target": "0.9,-0.5,0", "fov": 25}
    with_ball = scene(tmp_path, FLOOR.format(bsdf=bsdf), MIRROR_BALL, ball_light(0.3), **camera)
    truth = means(with_ball, "path", 660)
    with_point = scene(tmp_path, FLOOR.format(bsdf=bsdf), MIRROR_BALL, POINT, **camera)
    assert agree(means(with_point, "progressive", 60, **{"photons.N": 40_000}), truth, 0.05)


def test_the_path_tracer_says_what_it_can_not_find(tmp_path):
    source = scene(tmp_path, FLOOR.format(bsdf=METAL.format(alpha=0.15)), MIRROR_BALL, POINT)
    pool = WorkPool(1)
    renderer = Renderer(open_scene(source, {}), with_values(Settings(), {"render.method": "path"}), pool, StageStore(0))
    renderer.step()
    assert any("path tracer finds no light" in w for w in renderer.frame(0).statistics.warnings)
    pool.close()
