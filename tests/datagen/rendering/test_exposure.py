"""Developing: middle greys stay, highlights roll off, blacks are lifted by glare, and exposure keeps highlights."""

from __future__ import annotations

import numpy as np
import pytest

from datagen.rendering.exposure import CUT_OFF, GLARE, KNEE, automatic_exposure, develop


def grey(level: float) -> np.ndarray:
    return np.full((1, 1, 3), level, np.float32)


@pytest.mark.parametrize("level", [0.01, 0.05, 0.18, 0.35])
def test_below_the_knee_light_is_encoded_as_srgb_has_it(level: float) -> None:
    """Against the standard's own formula, glare included."""
    light = level + GLARE
    assert light < KNEE
    expected = round(255 * (1.055 * light ** (1 / 2.4) - 0.055))
    assert develop(grey(level), 1.0)[0, 0, 0] == expected


def test_brighter_is_never_darker_and_white_is_far_away() -> None:
    levels = np.linspace(0.0, 8.0, 2000, dtype=np.float32)
    picture = develop(np.repeat(levels[None, :, None], 3, 2), 1.0)[0, :, 0].astype(int)
    assert (np.diff(picture) >= 0).all()
    assert np.diff(picture)[20:].max() <= 2
    # Cut off at 1, three quarters of this ramp would be white.
    assert picture[levels < 3.0].max() < 255
    assert picture[-1] == 255


def test_black_is_lifted_and_colours_fade_towards_white() -> None:
    assert 0 < develop(grey(0.0), 1.0).max() < 10
    assert develop(grey(-1.0), 1.0).max() == develop(grey(0.0), 1.0).max()
    red = np.array([[[1.0, 0.2, 0.1]]], np.float32)
    dim, bright = (develop(red, exposure)[0, 0].astype(int) for exposure in (0.3, 2.5))
    assert bright[2] / bright[0] > 1.3 * dim[2] / dim[0]
    assert (bright < 255).all()


def test_exposure_is_limited_by_the_highlights() -> None:
    dark = np.full((20, 20, 3), 0.02, np.float32)
    assert automatic_exposure(dark, 0.18) == pytest.approx(9.0)
    window = np.full((20, 20, 3), 0.2, np.float32)
    window[:2] = 1.5  # A tenth of the picture.
    assert automatic_exposure(window, 0.18) == pytest.approx(1.1 / 1.5)


def test_a_lamp_darkens_a_room_by_one_stop_at_most_and_is_not_cut_off() -> None:
    room = np.full((20, 20, 3), 0.02, np.float32)
    room[:2] = (0.5, 0.4, 0.3)
    log_average = np.exp(0.9 * np.log(0.02) + 0.1 * np.log(room[0, 0] @ (0.2126, 0.7152, 0.0722)))
    assert automatic_exposure(room, 0.18) == pytest.approx(0.18 / log_average / 2, rel=1e-5)
    room[:2] = (8.0, 5.0, 3.0)
    exposure = automatic_exposure(room, 0.18)
    assert exposure == pytest.approx(CUT_OFF / 8.0)
    picture = develop(room, exposure)
    assert picture.max() < 255
    assert (develop(room, 1.03 * exposure)[:2, :, 0] == 255).all()
