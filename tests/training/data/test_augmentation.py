"""After augmentation a pair is still a rectified pair with its disparity: checked on closed-form worlds."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.training.synthetic import NO_AUGMENTATION, random_layer, render
from training.data.augmentation import (
    IDENTITY_CURVE,
    AugmentationConfig,
    StereoPair,
    TrainingSample,
    Window,
    augment,
    cut,
    draw_shear,
    draw_tone_curves,
    draw_window,
    mirror,
    right_only_growth,
    sample_bilinear,
)

HEIGHT, WIDTH = 96, 160
GEOMETRY = replace(NO_AUGMENTATION, translation=0.4, log_zoom=(-0.1, 0.5), log_squeeze=(-0.2, 0.2))


def slanted_plane(seed: int) -> StereoPair:
    """A plane all over the image, textured with waves long enough for bilinear sampling to be accurate."""
    rng = np.random.default_rng(seed)
    slopes = (rng.uniform(-0.08, 0.08), rng.uniform(-0.1, 0.1))
    layer = random_layer(rng, rng.uniform(24, 30), slopes, longest_wave_px=80, shortest_wave_px=20)
    return render([layer], HEIGHT, WIDTH)


def warp_error(sample: TrainingSample) -> float:
    """RMS difference of the left image and the right one sampled at x - d, where that is inside."""
    height, width = sample.disparity.shape
    columns = np.arange(width) + 0.5 - sample.disparity
    inside = (columns > 1) & (columns < width - 1)
    assert inside.mean() > 0.2
    errors = []
    for y in range(height):
        for channel in range(3):
            row = np.interp(columns[y], np.arange(width) + 0.5, sample.right[y, :, channel])
            errors.append((row - sample.left[y, :, channel])[inside[y]])
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), flip=st.booleans(), upside_down=st.booleans())
def test_right_image_warped_by_the_disparity_is_the_left_one(
    seed: int, flip: bool, upside_down: bool
) -> None:
    config = replace(GEOMETRY, horizontal_flip=float(flip), vertical_flip=float(upside_down))
    pair = slanted_plane(seed)
    check_warp(augment(np.random.default_rng(seed), pair, (64, 96), config))


@pytest.mark.parametrize("shear", [0.3, -0.3])
@pytest.mark.parametrize("seed", range(8))
def test_sheared_right_image_warped_by_the_disparity_is_the_left_one(seed: int, shear: float) -> None:
    window = Window(20.5, 10.25, 1.2, 1.1)
    check_warp(cut(slanted_plane(seed), window, (64, 128), (IDENTITY_CURVE, IDENTITY_CURVE), shear))


def check_warp(sample: TrainingSample) -> None:
    assert (sample.disparity >= 0).all()
    # What remains at the right disparity is 8-bit rounding; half a pixel more or less must show.
    error = warp_error(sample)
    for wrong_by in (-0.5, 0.5):
        assert error < 0.5 * warp_error(replace(sample, disparity=sample.disparity + np.float32(wrong_by)))


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), flip=st.booleans(), upside_down=st.booleans())
def test_gradient_is_the_slope_of_the_zoomed_surface(seed: int, flip: bool, upside_down: bool) -> None:
    """On a plane, disparity differences over many pixels give the slope that the gradient must state."""
    config = replace(GEOMETRY, horizontal_flip=float(flip), vertical_flip=float(upside_down))
    sample = augment(np.random.default_rng(seed), slanted_plane(seed), (64, 96), config)
    span_x = (sample.disparity[:, -1] - sample.disparity[:, 0]).mean() / 95
    span_y = (sample.disparity[-1] - sample.disparity[0]).mean() / 63
    stated = np.nanmean(sample.gradient, axis=(0, 1))
    assert np.nanstd(sample.gradient, axis=(0, 1)).max() < 1e-4
    # Nearest sampling displaces either end by half a source pixel at most.
    np.testing.assert_allclose(stated, [span_x, span_y], atol=0.003)


def test_identity_window_returns_the_source() -> None:
    pair = slanted_plane(0)
    whole = cut(pair, Window(0, 0, 1, 1), (HEIGHT, WIDTH), (IDENTITY_CURVE, IDENTITY_CURVE))
    np.testing.assert_allclose(whole.left * 255, pair.left, atol=1e-4)
    np.testing.assert_allclose(whole.right * 255, pair.right, atol=1e-4)
    np.testing.assert_array_equal(whole.disparity, pair.disparity_left)
    expected = pair.disparity_left[:-1, 1:] - pair.disparity_left[:-1, :-1]
    np.testing.assert_array_equal(whole.gradient[:-1, :-1, 0], expected)
    assert np.isnan(whole.gradient[:, -1]).all()
    assert np.isnan(whole.gradient[-1]).all()


def test_shifted_window_is_a_slice() -> None:
    pair = slanted_plane(0)
    part = cut(pair, Window(5, 7, 1, 1), (20, 30), (IDENTITY_CURVE, IDENTITY_CURVE))
    np.testing.assert_allclose(part.left * 255, pair.left[7:27, 5:35], atol=1e-4)
    np.testing.assert_array_equal(part.disparity, pair.disparity_left[7:27, 5:35])


def test_disparity_is_never_interpolated_across_edges() -> None:
    """Where neighbours lie on different surfaces, every value is the zoom times a value of the source, and missing ones
    stay missing."""
    rng = np.random.default_rng(0)
    pair = slanted_plane(0)
    truth = rng.choice(np.float32([0, 2, 7, np.nan]), (HEIGHT, WIDTH))
    sample = cut(
        replace(pair, disparity_left=truth), Window(3.3, 2.7, 1.7, 0.9), (64, 96), (IDENTITY_CURVE,) * 2
    )
    found = np.unique(sample.disparity[~np.isnan(sample.disparity)])
    np.testing.assert_allclose(found, np.float32(1.7) * np.float32([0, 2, 7]))
    assert np.isnan(sample.disparity).mean() == pytest.approx(0.25, abs=0.03)


def test_a_zoomed_plane_is_exact() -> None:
    """The nearest pixel's value would be off by up to half a pixel times the slope."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    truth = (3 + 0.3 * rows + 0.2 * columns).astype(np.float32)
    window = Window(3.3, 2.7, 1.7, 1.3)
    sample = cut(replace(slanted_plane(0), disparity_left=truth), window, (64, 96), (IDENTITY_CURVE,) * 2)
    v, u = np.mgrid[:64, :96] + 0.5
    expected = 1.7 * (3 + 0.3 * (2.7 + v / 1.3) + 0.2 * (3.3 + u / 1.7))
    np.testing.assert_allclose(sample.disparity, expected, rtol=1e-5)


def test_bilinear_sampling_against_a_loop() -> None:
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (7, 9, 3), np.uint8)
    rows, columns = rng.uniform(0, 7, 5), rng.uniform(0, 9, 6)
    rows.sort()
    columns.sort()
    got = sample_bilinear(image, rows, columns, IDENTITY_CURVE)
    for i, j in np.ndindex(5, 6):
        y, x = np.clip(rows[i] - 0.5, 0, 6), np.clip(columns[j] - 0.5, 0, 8)
        y0, x0 = min(int(y), 5), min(int(x), 7)
        wy, wx = y - y0, x - x0
        corners = image[y0 : y0 + 2, x0 : x0 + 2] / 255
        expected = np.einsum("i,j,ijc->c", [1 - wy, wy], [1 - wx, wx], corners)
        np.testing.assert_allclose(got[i, j], expected, atol=1e-6)


def test_rows_with_columns_of_their_own() -> None:
    rng = np.random.default_rng(1)
    image = rng.integers(0, 256, (7, 9, 3), np.uint8)
    rows, columns = np.sort(rng.uniform(0, 7, 5)), np.sort(rng.uniform(-2, 11, (5, 6)))
    got = sample_bilinear(image, rows, columns, IDENTITY_CURVE)
    for index in range(5):
        alone = sample_bilinear(image, rows[index : index + 1], columns[index], IDENTITY_CURVE)
        np.testing.assert_allclose(got[index], alone[0], atol=1e-6)


@pytest.mark.parametrize("shear", [0.4, -0.4])
def test_sheared_rows_gain_disparity_and_slope(shear: float) -> None:
    """The left view stays; disparities grow by the shear from row to row and are nowhere less than they were."""
    pair, window = slanted_plane(4), Window(5, 7, 1.25, 0.8)
    plain = cut(pair, window, (48, 96), (IDENTITY_CURVE, IDENTITY_CURVE))
    leant = cut(pair, window, (48, 96), (IDENTITY_CURVE, IDENTITY_CURVE), shear)
    np.testing.assert_array_equal(leant.left, plain.left)
    gained = leant.disparity - plain.disparity
    expected = shear * np.arange(48) * 1.25 / 0.8
    np.testing.assert_allclose(gained, np.repeat((expected - expected.min())[:, None], 96, 1), atol=1e-4)
    np.testing.assert_allclose(
        leant.gradient - plain.gradient, np.full((48, 96, 2), [0, shear * 1.25 / 0.8]), atol=1e-6
    )


def test_a_quarter_of_the_pairs_are_sheared() -> None:
    config = replace(NO_AUGMENTATION, shear=0.5)
    rng = np.random.default_rng(0)
    drawn = np.array([draw_shear(rng, config) for _ in range(2000)])
    assert 0.72 < (drawn == 0).mean() < 0.78
    assert (np.abs(drawn) <= 0.5).all()
    assert drawn.min() < -0.45
    assert drawn.max() > 0.45


def test_mirroring_twice_is_nothing() -> None:
    pair = slanted_plane(1)
    again = mirror(mirror(pair))
    np.testing.assert_array_equal(again.left, pair.left)
    np.testing.assert_array_equal(again.disparity_left, pair.disparity_left)


def test_pairs_without_the_right_truth_are_not_mirrored() -> None:
    """With the same draws as for a pair that has it: only the mirroring is left out."""
    pair = slanted_plane(2)
    plain = replace(GEOMETRY, horizontal_flip=0.0)
    without = augment(
        np.random.default_rng(3), replace(pair, disparity_right=None), (64, 96),
        replace(GEOMETRY, horizontal_flip=1.0),
    )  # fmt: skip
    expected = augment(np.random.default_rng(3), pair, (64, 96), plain)
    np.testing.assert_array_equal(without.left, expected.left)
    np.testing.assert_array_equal(without.disparity, expected.disparity)
    with pytest.raises(ValueError, match="without the right view's disparity cannot be mirrored"):
        mirror(replace(pair, disparity_right=None))


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10_000), crop=st.sampled_from([(384, 768), (128, 320), (540, 960)]))
def test_windows_stay_inside(seed: int, crop: tuple[int, int]) -> None:
    window = draw_window(np.random.default_rng(seed), (540, 960), crop, AugmentationConfig())
    assert 0 <= window.left_px <= 960 - crop[1] / window.zoom_x + 1e-9
    assert 0 <= window.top_px <= 540 - crop[0] / window.zoom_y + 1e-9


def test_released_ranges() -> None:
    """Zoom exp U(-.2, .6) and squeeze exp U(-.3, .3), as far as small crops let all of them fit."""
    rng = np.random.default_rng(0)
    windows = [draw_window(rng, (540, 960), (64, 64), AugmentationConfig()) for _ in range(2000)]
    zoom = np.log([np.sqrt(w.zoom_x * w.zoom_y) for w in windows])
    squeeze = np.log([np.sqrt(w.zoom_x / w.zoom_y) for w in windows])
    for values, low, high in ((zoom, -0.2, 0.6), (squeeze, -0.3, 0.3)):
        assert low <= values.min() < low + 0.01
        assert high - 0.01 < values.max() <= high


def test_right_only_changes_grow() -> None:
    assert right_only_growth(0) == 0.5
    assert right_only_growth(50_000) == pytest.approx(0.75)
    assert right_only_growth(10_000_000) == pytest.approx(1.0)


def test_both_views_change_alike_but_for_a_little() -> None:
    rng = np.random.default_rng(0)
    curves = [draw_tone_curves(rng, AugmentationConfig(), 0) for _ in range(100)]
    shared = np.mean([np.abs(left - IDENTITY_CURVE).mean() for left, _ in curves])
    between = np.mean([np.abs(left - right).mean() for left, right in curves])
    assert 0 < between < shared / 10
    left, right = draw_tone_curves(rng, replace(AugmentationConfig(), right_only=0.0), 0)
    np.testing.assert_array_equal(left, right)


def test_noise_differs_between_the_views() -> None:
    grey = np.full((64, 64, 3), 128, np.uint8)
    zero = np.zeros((64, 64), np.float32)
    sample = augment(
        np.random.default_rng(0),
        StereoPair(grey, grey, zero, zero),
        (64, 64),
        replace(NO_AUGMENTATION, noise=0.06),
    )
    left, right = sample.left - 128 / 255, sample.right - 128 / 255
    assert 0.001 < left.std() < 0.06
    assert abs(np.corrcoef(left.ravel(), right.ravel())[0, 1]) < 0.05


def test_a_crop_larger_than_the_image_is_refused() -> None:
    with pytest.raises(ValueError, match="200x64 crop does not fit into a 160x96 image"):
        augment(np.random.default_rng(0), slanted_plane(0), (64, 200), GEOMETRY)
