"""The discs of the inspector: where a direction is in them, and what their colours say."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.inspector.report import Fisheye
from pmviewer.viewer.panels.inspector.fisheye import LESS, MORE, SIDE, described, disc, pictures, side_by_side

RINGS, SECTORS = 4, 8
X, Y, Z = np.eye(3)


def of(gathered, wo, **more):
    return Fisheye(gathered, Z, X, Y, np.asarray(wo, float) / np.linalg.norm(wo), **more)


@pytest.mark.parametrize(("wo", "right"), [((-1, 0, 1), X), ((0, 2, 1), -Y), ((0, 0, 1), None)])
def test_a_direction_is_where_the_eye_would_see_it(wo, right):
    """Viewed along the normal with the viewer to the left: cell (2, 1) lies at φ = 67.5°, sin²θ = 2.5/4 from X on."""
    cells = np.zeros((RINGS, SECTORS, 3))
    cells[2, 1] = 1.0
    picture = disc(cells, of(cells, wo), (0.5, 0.5, 0.5))
    assert picture[0, 0].tolist() == [0.5] * 3
    white = picture[..., 0] == 1
    assert white.sum() == pytest.approx(np.pi * (SIDE / 2) ** 2 / (RINGS * SECTORS), rel=0.03)
    if right is None:
        return
    phi, sin = np.radians(67.5), np.sqrt(2.5 / 4)
    d = sin * (np.cos(phi) * X + np.sin(phi) * Y)
    u, v = d @ right, d @ np.cross(Z, right)
    assert white[int((1 - v) / 2 * SIDE), int((1 + u) / 2 * SIDE)]
    assert not white[int((1 + v) / 2 * SIDE), int((1 - u) / 2 * SIDE)]


def test_difference_is_orange_where_reprojection_is_brighter():
    gathered = np.full((RINGS, SECTORS, 3), 0.5)
    told, shot = gathered.copy(), np.zeros((RINGS, SECTORS), bool)
    told[:, 0], told[:, 4], shot[:, 1] = 1.0, 0.0, True
    seen = of(gathered, (-1, 0, 1), reprojected=told, shot=shot)
    made = pictures(seen, (0.0, 0.0, 0.0))
    assert list(made) == ["gathered", "reprojected", "difference"]
    middle = SIDE // 2
    up_right, down_left = made["difference"][middle - 8, middle + 40], made["difference"][middle + 8, middle - 40]
    np.testing.assert_allclose(up_right, MORE, atol=1e-6)
    np.testing.assert_allclose(down_left, LESS, atol=1e-6)
    assert made["difference"][middle - 40, middle - 8].max() == 0
    text = described(seen)
    assert "88%" in text
    assert "1.57 W/m²" in text
    assert "gathers as usual" in text
    assert "takes 2.50 W/m²" in described(of(gathered, (-1, 0, 1), estimate=np.full(3, 2.5)))
    assert list(pictures(of(gathered, (0, 0, 1)), (0.0, 0.0, 0.0))) == ["gathered"]


def test_a_row_of_discs_on_white():
    """As `pmviewer shot --hemisphere` writes them: what is gathered to the left, white beside the discs."""
    gathered, told = np.zeros((RINGS, SECTORS, 3)), np.ones((RINGS, SECTORS, 3))
    seen = of(gathered, (-1, 0, 1), reprojected=told, shot=np.zeros((RINGS, SECTORS), bool))
    row, gap, middle = side_by_side(seen), SIDE // 20, SIDE // 2
    assert row.shape == (SIDE, 3 * SIDE + 2 * gap, 3)
    assert (row[middle, SIDE : SIDE + gap] == 255).all()
    assert (row[0, 0] == 255).all()
    assert (row[middle, middle] == 0).all()
    assert (row[middle, SIDE + gap + middle] == 255).all()
    assert side_by_side(of(gathered, (0, 0, 1))).shape == (SIDE, SIDE, 3)
