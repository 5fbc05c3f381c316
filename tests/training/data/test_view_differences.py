"""Differences between the views: they change images as they say, and disparity never."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter

from tests.training.data.test_augmentation import HEIGHT, WIDTH, slanted_plane
from tests.training.synthetic import NO_AUGMENTATION
from training.data.augmentation import (
    IDENTITY_CURVE,
    AugmentationConfig,
    Window,
    augment,
    cut,
    draw_tone_curves,
    sample_bilinear,
    smooth_for,
)
from training.data.view_differences import compressed, erased, one_view_blurred, vertical_shifts

ALL_ON = replace(
    NO_AUGMENTATION,
    antialias=True,
    vertical_misalignment=1.5,
    roll_deg=0.3,
    log_view_brightness=0.2,
    log_view_color=0.1,
    one_sided_blur=2.0,
    erasing=0.5,
    erased_size=(10.0, 30.0),
    jpeg=0.5,
)


def picture(seed: int) -> NDArray[np.float32]:
    return np.random.default_rng(seed).random((48, 64, 3), np.float32)


def test_nothing_is_drawn_unless_asked_for() -> None:
    """The runs of the presets without these changes draw what they drew before there were any."""
    first, second = np.random.default_rng(5), np.random.default_rng(5)
    augment(first, slanted_plane(0), (64, 96), AugmentationConfig())
    config = AugmentationConfig()
    second.random()  # horizontal flip
    second.random()  # vertical flip
    second.uniform(size=(4, 50))  # windows
    second.uniform(size=6)  # tone curves
    second.standard_normal(6)
    second.uniform(0, config.noise)
    for _ in "ab":  # places in the table of noise
        second.integers((1 << 22) // 2)
    assert first.random() == second.random()


@pytest.mark.parametrize("seed", range(4))
def test_disparity_and_gradient_stay_as_they_are(seed: int) -> None:
    pair = slanted_plane(seed)
    plain = augment(np.random.default_rng(seed), pair, (64, 96), NO_AUGMENTATION)
    changed = augment(np.random.default_rng(seed), pair, (64, 96), ALL_ON)
    np.testing.assert_array_equal(changed.disparity, plain.disparity)
    np.testing.assert_array_equal(changed.gradient, plain.gradient)
    assert np.abs(changed.right - plain.right).max() > 0.01


def test_a_misaligned_right_view_is_the_aligned_one_lower_down() -> None:
    pair, window, curves = slanted_plane(3), Window(5, 7, 1.0, 1.0), (IDENTITY_CURVE, IDENTITY_CURVE)
    plain = cut(pair, window, (60, 96), curves)
    low = cut(pair, window, (60, 96), curves, shifts=np.full(96, 3.0))
    np.testing.assert_array_equal(low.left, plain.left)
    np.testing.assert_allclose(low.right[3:], plain.right[:-3], atol=1e-6)


def test_a_vertical_misalignment_is_in_pixels_of_the_crop() -> None:
    """In a crop magnified twice, 3 px are 1.5 of the source, and the crop's content is 3 px lower."""
    pair, window, curves = slanted_plane(3), Window(5, 17, 2.0, 2.0), (IDENTITY_CURVE, IDENTITY_CURVE)
    plain = cut(pair, window, (60, 96), curves)
    low = cut(pair, window, (60, 96), curves, shifts=np.full(96, 3.0))
    np.testing.assert_allclose(low.right[3:], plain.right[:-3], atol=1e-5)


def test_a_roll_turns_about_the_middle() -> None:
    shifts = vertical_shifts(101, 0.5, 1.0)
    assert shifts[50] == pytest.approx(0.5)
    assert shifts[100] - shifts[0] == pytest.approx(100 * np.tan(np.pi / 180))


def test_rows_of_their_own_against_columns_one_by_one() -> None:
    rng = np.random.default_rng(1)
    image = rng.integers(0, 256, (7, 9, 3), np.uint8)
    rows, columns = np.sort(rng.uniform(-2, 9, (5, 6)), axis=0), np.sort(rng.uniform(0, 9, 6))
    got = sample_bilinear(image, rows, columns, IDENTITY_CURVE)
    for index in range(6):
        alone = sample_bilinear(image, rows[:, index], columns[index : index + 1], IDENTITY_CURVE)
        np.testing.assert_allclose(got[:, index], alone[:, 0], atol=1e-6)


def test_each_view_has_colours_of_its_own() -> None:
    config = replace(NO_AUGMENTATION, log_view_brightness=0.2, log_view_color=0.1)
    rng = np.random.default_rng(0)
    # Of a level far below white, a curve is its factor.
    factors = np.log(
        [[curve[50] / IDENTITY_CURVE[50] for curve in draw_tone_curves(rng, config, 0)] for _ in range(500)]
    )
    assert np.abs(factors).max() <= 0.3 + 1e-5
    assert np.abs(factors).max() > 0.28
    assert abs(np.corrcoef(factors[:, 0, 0], factors[:, 1, 0])[0, 1]) < 0.15
    channels = factors[..., 0] - factors[..., 1]
    assert 0.15 < np.abs(channels).max() <= 0.2 + 1e-5


def test_one_view_is_blurred_as_scipy_blurs() -> None:
    left, right = picture(0), picture(1)
    seen = set()
    for seed in range(20):
        views = one_view_blurred(np.random.default_rng(seed), left, right, 2.0)
        sigma = np.random.default_rng(seed).uniform(0, 2.0)
        changed = [not np.array_equal(a, b) for a, b in zip(views, (left, right), strict=True)]
        assert sum(changed) == 1
        which = changed.index(True)
        seen.add(which)
        expected = gaussian_filter(
            (left, right)[which],
            (sigma, sigma, 0),
            mode="nearest",
            radius=(int(np.ceil(3 * sigma)),) * 2 + (0,),
        )
        np.testing.assert_allclose(views[which], expected, atol=1e-5)
    assert seen == {0, 1}


def test_about_a_quarter_of_the_pairs_are_blurred() -> None:
    config, pair = replace(NO_AUGMENTATION, one_sided_blur=3.0), slanted_plane(0)
    plain = augment(np.random.default_rng(0), pair, (32, 32), NO_AUGMENTATION)
    samples = [augment(np.random.default_rng(seed), pair, (32, 32), config) for seed in range(200)]
    share = np.mean(
        [not np.array_equal(s.left, plain.left) or not np.array_equal(s.right, plain.right) for s in samples]
    )
    assert 0.17 < share < 0.33


def test_compressed_views_are_what_pillow_reads_of_such_a_file(tmp_path: Path) -> None:
    """libjpeg through another library, with the same tables and subsampling of colour."""
    smooth = gaussian_filter(picture(2), (3, 3, 0))
    smooth = (smooth - smooth.min()) / (smooth.max() - smooth.min())
    left, right = compressed(np.random.default_rng(0), smooth, smooth[::-1], (50, 50))
    path = tmp_path / "a.jpg"
    Image.fromarray(np.rint(smooth * 255).astype(np.uint8)).save(path, quality=50, subsampling=2)
    expected = np.asarray(Image.open(path)) / 255
    assert np.abs(left - expected).max() < 3 / 255
    assert np.abs(left - smooth).max() > 3 / 255
    assert right.dtype == np.float32


def test_lower_quality_costs_more() -> None:
    image = picture(3)
    errors = [
        np.abs(compressed(np.random.default_rng(0), image, image, (q, q))[0] - image).mean()
        for q in (95, 60, 20)
    ]
    assert errors[0] < errors[1] < errors[2]


def test_one_or_two_rectangles_of_the_mean_colour() -> None:
    image, shares = picture(4), []
    for seed in range(50):
        covered = erased(np.random.default_rng(seed), image, (8.0, 16.0))
        flat = (covered != image).all(axis=-1)
        np.testing.assert_allclose(
            covered[flat], np.broadcast_to(image.mean(axis=(0, 1)), (flat.sum(), 3)), atol=1e-6
        )
        np.testing.assert_array_equal(covered[~flat], image[~flat])
        shares.append(flat.sum())
    assert min(shares) > 0
    assert max(shares) <= 2 * 16 * 16
    assert max(shares) > 16 * 16


def test_only_the_right_view_is_erased() -> None:
    config = replace(NO_AUGMENTATION, erasing=1.0, erased_size=(10.0, 30.0))
    plain = augment(np.random.default_rng(0), slanted_plane(0), (64, 96), NO_AUGMENTATION)
    sample = augment(np.random.default_rng(0), slanted_plane(0), (64, 96), config)
    np.testing.assert_array_equal(sample.left, plain.left)
    assert 50 <= (sample.right != plain.right).any(axis=-1).sum() <= 2 * 30 * 30


def test_antialiasing_removes_what_a_small_crop_cannot_show() -> None:
    """Stripes of two pixels, made four times smaller, are grey; without the filter they would be a pattern."""
    pair = slanted_plane(0)
    stripes = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    stripes[:, ::2] = 255
    pair = replace(pair, left=stripes, right=stripes)
    window, curves = Window(0.3, 0.3, 0.27, 0.27), (IDENTITY_CURVE, IDENTITY_CURVE)
    rough = cut(pair, window, (24, 40), curves).left[4:-4, 4:-4]
    fine = cut(smooth_for(pair, window), window, (24, 40), curves).left[4:-4, 4:-4]
    assert rough.std() > 0.1
    assert fine.std() < 0.01
    assert fine.mean() == pytest.approx(0.5, abs=0.01)


def test_antialiasing_leaves_magnified_crops_alone() -> None:
    pair = slanted_plane(0)
    assert smooth_for(pair, Window(0, 0, 1.5, 1.0)) is pair
