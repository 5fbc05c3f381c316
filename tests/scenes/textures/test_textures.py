"""Every texture generator: the promised array, the same each time, periodic, with detail."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from scenes.appearance.painting import finish, oklch_to_srgb, sample_palette, spectral_noise
from scenes.serialization import from_plain, to_plain
from scenes.spec import Texture
from scenes.textures import TEXTURES
from scenes.textures.sky import Sky

PICTURES = sorted(name for name, kind in TEXTURES.items() if kind.popularity > 0)
PATTERNED = sorted({*PICTURES} - {"NearTextureless"})
seeds = st.integers(0, 2**32 - 1)


def drawn(name: str, seed: int, size: int = 64) -> Texture:
    return TEXTURES[name].sample(np.random.default_rng(seed), size)


def test_there_are_many_kinds() -> None:
    assert len(PICTURES) >= 18


@pytest.mark.parametrize("name", PICTURES)
@settings(max_examples=10, deadline=None)
@given(seed=seeds)
def test_a_texture_is_bytes_survives_json_and_paints_the_same_again(name: str, seed: int) -> None:
    texture = drawn(name, seed)
    picture = texture.image()
    assert picture.shape == (64, 64, 3)
    assert picture.dtype == np.uint8
    again = from_plain(json.loads(json.dumps(to_plain(texture))), TEXTURES[name])
    assert again == texture
    assert np.array_equal(again.image(), picture)


def wrap_contrast(picture: NDArray[np.uint8], axis: int) -> float:
    """How much greater the step across the picture's border is than the largest of the steps inside."""
    grey = picture.astype(np.float64).mean(axis=2)
    steps = np.abs(grey - np.roll(grey, 1, axis=axis)).mean(axis=1 - axis)
    return float(steps[0] / np.sort(steps[1:])[-4:].mean())


@pytest.mark.parametrize("name", PICTURES)
def test_textures_repeat_without_a_seam(name: str) -> None:
    pictures = [drawn(name, seed, 128).image() for seed in range(6)]
    for axis in (0, 1):
        assert np.median([wrap_contrast(picture, axis) for picture in pictures]) < 1.25


def test_the_seam_measure_sees_a_seam() -> None:
    ramp = np.repeat(np.linspace(0, 255, 64).astype(np.uint8)[None, :, None], 64, axis=0).repeat(3, axis=2)
    assert wrap_contrast(ramp, 1) > 10
    assert wrap_contrast(np.random.default_rng(0).integers(0, 256, (64, 64, 3)).astype(np.uint8), 0) < 1.5


@pytest.mark.parametrize("name", PATTERNED)
def test_patterns_have_detail_at_the_scale_of_a_pixel(name: str) -> None:
    for seed in range(4):
        grey = drawn(name, seed, 128).image().astype(np.float64).mean(axis=2)
        assert np.abs(np.diff(grey, axis=1)).mean() > 1.5


def test_near_textureless_ones_are_faint_and_a_minority() -> None:
    deviations = [drawn("NearTextureless", seed, 128).image().std(axis=(0, 1)).max() for seed in range(10)]
    assert max(deviations) < 25
    total = sum(TEXTURES[name].popularity for name in PICTURES)
    assert TEXTURES["NearTextureless"].popularity / total < 0.1


@pytest.mark.parametrize("name", PICTURES)
def test_two_draws_are_two_pictures(name: str) -> None:
    rng = np.random.default_rng(1)
    textures = [TEXTURES[name].sample(rng, 32) for _ in range(8)]
    assert len({texture.image().tobytes() for texture in textures}) == 8


@settings(max_examples=10, deadline=None)
@given(seed=seeds)
def test_a_sky_is_twice_as_wide_as_high_bright_above_and_seamless_around(seed: int) -> None:
    picture = Sky.sample(np.random.default_rng(seed), 256).image()
    assert picture.shape == (128, 256, 3)
    assert picture[:60].mean() > picture[70:].mean()
    sky = picture[:60].astype(np.float64)
    across = np.abs(sky[:, 0] - sky[:, -1]).mean()
    assert across < 3 * np.abs(np.diff(sky, axis=1)).mean() + 1


def test_palettes_span_dark_and_light_and_are_neither_all_grey_nor_all_neon() -> None:
    rng = np.random.default_rng(0)
    palettes = [np.array(sample_palette(rng, 5), np.float64) for _ in range(300)]
    assert min(np.ptp(palette.mean(axis=1)) for palette in palettes) > 40
    saturation = np.array([1 - p.min(axis=1) / np.maximum(p.max(axis=1), 1) for p in palettes])
    assert 0.1 < np.mean(saturation < 0.25) < 0.6
    assert 0.05 < np.mean(saturation > 0.7) < 0.5


def test_oklch_reproduces_known_colours() -> None:
    # White, black, and sRGB red from Ottosson's table: L .6279, C .2577, h 29.23 degrees.
    lightness, chroma, hue = (
        np.array([1.0, 0.0, 0.6279]),
        np.array([0.0, 0.0, 0.2577]),
        np.radians([0, 0, 29.23]),
    )
    colors = oklch_to_srgb(lightness, chroma, hue)
    np.testing.assert_allclose(colors, [(255, 255, 255), (0, 0, 0), (255, 0, 0)], atol=2)


@pytest.mark.parametrize("slope", [0.5, 1.0, 2.0])
def test_spectral_noise_has_the_spectrum_asked_for(slope: float) -> None:
    noise = spectral_noise(np.random.default_rng(0), 512, slope, 4, 100)
    assert noise.mean() == pytest.approx(0.0, abs=1e-4)
    assert noise.std() == pytest.approx(1.0, abs=1e-4)
    power = np.abs(np.fft.fft2(noise.astype(np.float64))) ** 2
    cycles = np.hypot(*np.meshgrid(np.fft.fftfreq(512, 1 / 512), np.fft.fftfreq(512, 1 / 512)))
    bands = [(cycles >= low) & (cycles < 1.3 * low) for low in (6, 12, 24, 48)]
    fitted = np.polyfit(
        [np.log(cycles[band].mean()) for band in bands], [np.log(power[band].mean()) for band in bands], 1
    )
    assert -fitted[0] / 2 == pytest.approx(slope, abs=0.1)
    assert power[(cycles < 3.9) | (cycles > 101)].max() < 1e-6 * power.max()


def test_grain_is_relative_to_brightness_and_has_the_strength_asked_for() -> None:
    flat = np.full((3, 200, 200), 120.0, np.float32)
    grained = finish(flat, np.random.default_rng(0), 0.1).astype(np.float64)
    assert grained.mean() == pytest.approx(120, abs=1)
    assert grained.std() == pytest.approx(0.1 * 132 * np.sqrt(1.0**2 + 3 * 0.4**2), rel=0.05)
