"""Text can be read on every ground that it stands on."""

from __future__ import annotations

import itertools

import pytest

from pmviewer.viewer import theme
from pmviewer.viewer.overlays.light_importance import clear_of

WHITE, BLACK = (1.0, 1.0, 1.0, 1.0), (0.0, 0.0, 0.0, 1.0)
TEXTS = ("TEXT", "DIM", "FAINT", "ACCENT", "GOOD", "WARNING", "ERROR", "FREE")


def test_contrast_is_that_of_the_standard():
    assert theme.contrast(WHITE, BLACK) == pytest.approx(21.0)
    grey = (0x77 / 255, 0x77 / 255, 0x77 / 255, 1.0)
    assert theme.contrast(grey, WHITE) == pytest.approx(4.48, abs=0.005)  # the well-known #777 on white
    assert theme.contrast(WHITE, grey) == theme.contrast(grey, WHITE)


@pytest.mark.parametrize("look", theme.LOOKS)
def test_text_is_readable_on_every_ground(look):
    colours, grounds = theme.LOOKS[look], theme.text_grounds(look)
    assert len(grounds) > 8
    low = {
        (text, ground): ratio
        for text, (ground, colour) in itertools.product(TEXTS, grounds.items())
        if (ratio := theme.contrast(getattr(colours, text.lower()), colour)) < theme.READABLE
    }
    assert low == {}


@pytest.mark.parametrize("look", theme.LOOKS)
def test_greyed_names_are_readable_on_the_panels(look):
    ground = theme.text_grounds(look)["window_bg"]
    text = theme.LOOKS[look].dim
    assert theme.contrast(theme.over((*text[:3], theme.GREYED), ground), ground) >= theme.READABLE


@pytest.mark.parametrize("behind", [WHITE, BLACK])
@pytest.mark.parametrize("text", TEXTS)
def test_captions_are_readable_on_any_picture(text, behind):
    level, opacity = theme.OVER_PICTURE
    ground = theme.over((level, level, level, opacity), behind)
    assert theme.contrast(getattr(theme.DARK, text.lower()), ground) >= theme.READABLE


def test_labels_give_way_to_each_other():
    size, taken = (40.0, 20.0), []
    for place in [(10.0, 10.0), (12.0, 12.0), (30.0, 25.0), (200.0, 10.0), (10.0, 11.0)]:
        taken.append(clear_of(place, taken, size))
    for (ax, ay), (bx, by) in itertools.combinations(taken, 2):
        assert abs(ax - bx) >= size[0] or abs(ay - by) >= size[1]
    assert taken[0] == (10.0, 10.0)
    assert taken[3] == (200.0, 10.0)
