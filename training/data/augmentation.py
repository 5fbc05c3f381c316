"""Random changes to a stereo pair that keep it a rectified pair with exact disparity.

Geometry (one crop window, zoom and squeeze for both views) and colour follow the augmentation layers of the released
DispNet training definition. Images are interpolated bilinearly, and so is disparity within a surface; at edges, as for
gradients, the nearest pixel's value is taken.

What tells two real cameras apart can be added (`training.data.view_differences`). Disparity stays that of the ideal
rig.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from datagen.ground_truth.labels import forward_differences
from stereoforge_kit.camera_effects import blurred
from training.data.view_differences import compressed, erased, one_view_blurred, vertical_shifts

Float32 = NDArray[np.float32]


@dataclass(frozen=True)
class StereoPair:
    """One decoded frame: its images and the ground truth that training uses."""

    left: NDArray[np.uint8]
    """(H, W, 3) sRGB."""
    right: NDArray[np.uint8]
    """(H, W, 3) sRGB."""
    disparity_left: Float32
    """(H, W) px, NaN invalid."""
    disparity_right: Float32 | None
    """(H, W) px, NaN invalid; None if the data set has none. Such a pair cannot be mirrored."""

    @property
    def nbytes(self) -> int:
        """Memory of all arrays, in bytes."""
        right = 0 if self.disparity_right is None else self.disparity_right.nbytes
        return self.left.nbytes + self.right.nbytes + self.disparity_left.nbytes + right


@dataclass(frozen=True)
class TrainingSample:
    """One crop: what the networks see, and its ground truth."""

    left: Float32
    """(H, W, 3) in 0..1."""
    right: Float32
    """(H, W, 3) in 0..1."""
    disparity: Float32
    """(H, W) of the left view, in pixels of this crop, NaN invalid."""
    gradient: Float32
    """(H, W, 2) forward differences [dx, dy] in px per pixel of this crop, NaN invalid."""


@dataclass(frozen=True)
class AugmentationConfig:
    """Ranges of the random changes; the defaults are those of the released training definition.

    Where a field's name begins with `log_`, the factor is the exponential of the number drawn. U(a, b) is the uniform
    distribution.
    """

    translation: float = 0.4
    """Distance of the window's centre from the image's, U(-this, this) times the crop's width and height."""
    log_zoom: tuple[float, float] = (-0.2, 0.6)
    """Zoom of both axes; above 0 the crop is magnified."""
    log_squeeze: tuple[float, float] = (-0.3, 0.3)
    """Factor q by which the horizontal zoom is multiplied and the vertical zoom divided."""
    horizontal_flip: float = 0.0
    """Probability of mirroring left-right, which swaps the views and takes the right view's ground truth. Pairs without
    it stay as they are (ours)."""
    vertical_flip: float = 0.0
    """Probability of mirroring top-bottom (ours)."""
    shear: float = 0.0
    """A quarter of the pairs are sheared: the rows of the right view are moved, row by row further, so that
    U(-this, this) pixels of disparity are added per row, as if everything were slanted (ours). A network that trains on
    flying things sees slants like a road's this way."""
    log_brightness: float = 0.4
    """Factor exp U(-this, this) of all colour channels together."""
    log_gamma: float = 0.4
    """Exponent exp U(-this, this) of the colours."""
    log_contrast: float = 0.4
    """Factor exp U(-this, this) of the colours' distance from middle grey."""
    log_color: float = 0.2
    """Factor exp U(-this, this) of each colour channel by itself."""
    noise: float = 0.06
    """Standard deviation of the Gaussian noise, U(0, this) of the range 0..1, the same for both views."""
    right_only: float = 0.01
    """Standard deviation of the small additional brightness, contrast, gamma and colour changes of the right view."""
    antialias: bool = False
    """Blur what a zoom below 1 makes smaller, so that it does not alias; for wide ranges of `log_zoom` (ours)."""
    vertical_misalignment: float = 0.0
    """The right view lies U(-this, this) pixels of the crop too low (ours)."""
    roll_deg: float = 0.0
    """The right view is also moved along y as if its camera were turned about its axis by U(-this, this) degrees. The
    turn's small moves along x are left out, so that the disparity holds (ours)."""
    log_view_brightness: float = 0.0
    """Factor exp U(-this, this) of all colour channels, drawn for each view by itself (ours)."""
    log_view_color: float = 0.0
    """Factor exp U(-this, this) of each colour channel, drawn for each view by itself (ours)."""
    one_sided_blur: float = 0.0
    """A quarter of the pairs have one view, either, blurred with a Gaussian of U(0, this) pixels (ours)."""
    erasing: float = 0.0
    """Probability of one or two rectangles of the right view in its mean colour, as in RAFT-Stereo's training."""
    erased_size: tuple[float, float] = (50.0, 100.0)
    """Shortest and longest side of these rectangles in pixels of the crop."""
    jpeg: float = 0.0
    """Probability of JPEG compression, of both views with one quality (ours)."""
    jpeg_quality: tuple[int, int] = (30, 95)
    """Lowest and highest quality, 1..100."""


SHEARED = 0.25
"""Share of the pairs that `AugmentationConfig.shear` applies to."""
BLURRED = 0.25
"""Share of the pairs that `AugmentationConfig.one_sided_blur` applies to."""
SAME_SURFACE_PX = 1.0
"""Neighbouring pixels whose disparities differ by no more are taken to see one surface."""
WINDOW_TRIALS = 50
"""Windows drawn before the centre crop is taken."""
RIGHT_ONLY_GROWTH_STEPS = 50_000
"""Steps after which `right_only_growth` is 0.75 (the released training definition)."""


@dataclass(frozen=True)
class Window:
    """A crop's place in its source image.

    The crop's point (u, v) is the source's point (left_px + u / zoom_x, top_px + v / zoom_y).
    """

    left_px: float
    """Left edge in pixels of the source."""
    top_px: float
    """Top edge in pixels of the source."""
    zoom_x: float
    """Pixels of the crop per pixel of the source, horizontally."""
    zoom_y: float
    """Pixels of the crop per pixel of the source, vertically."""


def augment(
    rng: np.random.Generator,
    pair: StereoPair,
    size: tuple[int, int],
    config: AugmentationConfig,
    step: int = 0,
) -> TrainingSample:
    """Draw one training sample from a pair.

    Args:
        rng: Source of all randomness.
        pair: The frame.
        size: (height, width) of the sample.
        config: Ranges of the changes.
        step: Training step; the right view's own changes grow with it.

    Raises:
        ValueError: the pair is smaller than `size`.
    """
    if rng.random() < config.horizontal_flip and pair.disparity_right is not None:
        pair = mirror(pair)
    if rng.random() < config.vertical_flip:
        pair = turn_over(pair)
    window = draw_window(rng, pair.left.shape[:2], size, config)
    tone_curves = draw_tone_curves(rng, config, step)
    shear = draw_shear(rng, config)
    shifts = draw_vertical_shifts(rng, size, config)
    if config.antialias:
        pair = smooth_for(pair, window)
    sample = cut(pair, window, size, tone_curves, shear, shifts)
    if config.one_sided_blur > 0 and rng.random() < BLURRED:
        sample = replace_views(
            sample, one_view_blurred(rng, sample.left, sample.right, config.one_sided_blur)
        )
    noise = np.float32(rng.uniform(0, config.noise))
    if noise > 0:
        left = sample.left + noise * draw_normal(rng, sample.left.shape)
        right = sample.right + noise * draw_normal(rng, sample.right.shape)
        sample = replace(sample, left=left, right=right)
    # In the order of a camera: light, sensor, file. The flat patches come last, so that they stay flat.
    if config.jpeg > 0 and rng.random() < config.jpeg:
        sample = replace_views(sample, compressed(rng, sample.left, sample.right, config.jpeg_quality))
    if config.erasing > 0 and rng.random() < config.erasing:
        sample = replace(sample, right=erased(rng, sample.right, config.erased_size))
    return sample


def replace_views(sample: TrainingSample, views: tuple[Float32, Float32]) -> TrainingSample:
    """The sample with other images, (left, right)."""
    return replace(sample, left=views[0], right=views[1])


def draw_normal(rng: np.random.Generator, shape: tuple[int, ...]) -> Float32:
    """Standard normal numbers of a shape, read from a random place in a long table.

    To draw them anew would be half the cost of a crop.
    """
    table = _normal_table()
    return np.resize(table[rng.integers(len(table) // 2) :], shape)


@cache
def _normal_table() -> Float32:
    return np.random.default_rng(0).standard_normal(1 << 22, np.float32)


def mirror(pair: StereoPair) -> StereoPair:
    """Mirror left-right and swap the views, so that disparity is positive again.

    Raises:
        ValueError: the pair has no ground truth of the right view.
    """
    if pair.disparity_right is None:
        raise ValueError("a pair without the right view's disparity cannot be mirrored")
    return StereoPair(
        left=pair.right[:, ::-1],
        right=pair.left[:, ::-1],
        disparity_left=pair.disparity_right[:, ::-1],
        disparity_right=pair.disparity_left[:, ::-1],
    )


def turn_over(pair: StereoPair) -> StereoPair:
    """Mirror top-bottom."""
    right = None if pair.disparity_right is None else pair.disparity_right[::-1]
    return StereoPair(pair.left[::-1], pair.right[::-1], pair.disparity_left[::-1], right)


def draw_window(
    rng: np.random.Generator, source: tuple[int, ...], size: tuple[int, int], config: AugmentationConfig
) -> Window:
    """Draw a window inside the source, by rejection; the centre crop without zoom if no trial fits.

    Args:
        rng: Source of all randomness.
        source: (height, width, ...) of the source image.
        size: (height, width) of the crop.
        config: Ranges of the changes.

    Raises:
        ValueError: the source is smaller than `size`.
    """
    (source_height, source_width), (height, width) = source[:2], size
    if source_height < height or source_width < width:
        raise ValueError(f"a {width}x{height} crop does not fit into a {source_width}x{source_height} image")
    zoom = np.exp(rng.uniform(*config.log_zoom, WINDOW_TRIALS))
    squeeze = np.exp(rng.uniform(*config.log_squeeze, WINDOW_TRIALS))
    shift = rng.uniform(-config.translation, config.translation, (2, WINDOW_TRIALS))
    zoom_x, zoom_y = zoom * squeeze, zoom / squeeze
    left = source_width / 2 + (shift[0] - 0.5) * width / zoom_x
    top = source_height / 2 + (shift[1] - 0.5) * height / zoom_y
    fits = (left >= 0) & (left + width / zoom_x <= source_width)
    fits &= (top >= 0) & (top + height / zoom_y <= source_height)
    if not fits.any():
        return Window((source_width - width) // 2, (source_height - height) // 2, 1.0, 1.0)
    trial = int(np.argmax(fits))
    return Window(float(left[trial]), float(top[trial]), float(zoom_x[trial]), float(zoom_y[trial]))


def draw_shear(rng: np.random.Generator, config: AugmentationConfig) -> float:
    """Draw the disparity to add per row of the source, in pixels. Nothing is drawn if the range is empty."""
    if config.shear == 0:
        return 0.0
    slope = rng.uniform(-config.shear, config.shear)
    return float(slope) if rng.random() < SHEARED else 0.0


def draw_vertical_shifts(
    rng: np.random.Generator, size: tuple[int, int], config: AugmentationConfig
) -> NDArray[np.float64] | None:
    """Draw how far the right view's columns are moved along y, (W,) px of a crop of size (H, W); None for nowhere."""
    if config.vertical_misalignment == 0 and config.roll_deg == 0:
        return None
    shift, roll = rng.uniform(-1, 1, 2) * (config.vertical_misalignment, config.roll_deg)
    return vertical_shifts(size[1], shift, roll)


def smooth_for(pair: StereoPair, window: Window) -> StereoPair:
    """The pair with images that a window's zoom, where it is below 1, samples without aliasing.

    The blur adds to that of a pixel of the source, whose deviation is about half a pixel, what one of the crop has.
    """
    sigma = tuple(0.5 * np.sqrt(max(zoom**-2 - 1.0, 0.0)) for zoom in (window.zoom_x, window.zoom_y))
    if not any(sigma):
        return pair
    left, right = (
        np.rint(blurred(image.astype(np.float32), (sigma[0], sigma[1]))).astype(np.uint8)
        for image in (pair.left, pair.right)
    )
    return replace(pair, left=left, right=right)


def cut(
    pair: StereoPair,
    window: Window,
    size: tuple[int, int],
    tone_curves: tuple[Float32, Float32],
    shear: float = 0.0,
    shifts: NDArray[np.float64] | None = None,
) -> TrainingSample:
    """Crop, recolour and resample both views and the left view's ground truth.

    A surface d(x, y) seen with zooms (zx, zy) has disparity zx d, slope dx along x and zx / zy dy along y. The
    gradients are differences of the source's ground truth, since a zoomed map of nearest pixels would have steps.

    Args:
        pair: The source.
        window: The crop's place in it.
        size: (height, width) of the crop.
        tone_curves: (256, 3) colours in 0..1 of the levels 0..255, for the left and the right view.
        shear: Disparity added per row, in pixels of the source. It is 0 in the window's first row or, if negative, in
            its last, so disparities stay positive. Occlusions in a row stay as they were.
        shifts: (W,) how many pixels of the crop lower than it should be each column of the right view lies; None for
            an aligned pair. Disparity does not change.
    """
    rows = window.top_px + (np.arange(size[0]) + 0.5) / window.zoom_y
    columns = window.left_px + (np.arange(size[1]) + 0.5) / window.zoom_x
    nearest_rows = _nearest(rows, pair.left.shape[0])
    nearest_columns = _nearest(columns, pair.left.shape[1])
    gradient = missing_at_borders(forward_differences(pair.disparity_left))
    gradient = gradient[np.ix_(nearest_rows, nearest_columns)]
    disparity = sample_disparity(pair.disparity_left, rows, columns)
    moves = shear * (rows - (rows[0] if shear > 0 else rows[-1]))
    gradient = gradient + np.array([0.0, shear], np.float32)
    columns_right = columns if shear == 0 else columns + moves[:, None]
    rows_right = rows if shifts is None else rows[:, None] - shifts / window.zoom_y
    return TrainingSample(
        left=sample_bilinear(pair.left, rows, columns, tone_curves[0]),
        right=sample_bilinear(pair.right, rows_right, columns_right, tone_curves[1]),
        disparity=(disparity + moves[:, None].astype(np.float32)) * np.float32(window.zoom_x),
        gradient=gradient * np.array([1.0, window.zoom_x / window.zoom_y], np.float32),
    )


def sample_disparity(disparity: Float32, rows: NDArray[np.float64], columns: NDArray[np.float64]) -> Float32:
    """Interpolate a disparity bilinearly within surfaces; where the four pixels around a point belong to several, or
    one of them has none, take the nearest pixel's.

    Args:
        disparity: (h, w) px, NaN where there is none.
        rows: (H,) positions in pixels; pixel centres lie at + 0.5.
        columns: (W,) positions.

    Returns:
        (H, W) px.

    Examples:
        >>> slope = np.array([[1.0, 1.5, 9.0]], np.float32)
        >>> sample_disparity(slope, np.array([0.5]), np.array([0.75, 1.75, 2.25])).tolist()
        [[1.125, 1.5, 9.0]]
    """
    row, row_weight = _neighbours(rows, disparity.shape[0])
    column, column_weight = _neighbours(columns, disparity.shape[1])
    below = np.minimum(row + 1, disparity.shape[0] - 1)
    right = np.minimum(column + 1, disparity.shape[1] - 1)
    corners = [
        disparity[np.ix_(at_row, at_column)] for at_row in (row, below) for at_column in (column, right)
    ]
    above, under = (first + (second - first) * column_weight for first, second in (corners[:2], corners[2:]))
    interpolated = above + (under - above) * row_weight[:, None]
    nearest = disparity[np.ix_(_nearest(rows, disparity.shape[0]), _nearest(columns, disparity.shape[1]))]
    spread = np.max(corners, axis=0) - np.min(corners, axis=0)
    values: Float32 = np.where(spread <= SAME_SURFACE_PX, interpolated, nearest)
    return values


def missing_at_borders(gradient: Float32) -> Float32:
    """Forward differences (H, W, 2) with NaN in the last row and column, which have none; in place."""
    gradient[:, -1] = np.nan
    gradient[-1, :] = np.nan
    return gradient


def sample_bilinear(
    image: NDArray[np.uint8], rows: NDArray[np.float64], columns: NDArray[np.float64], tone_curve: Float32
) -> Float32:
    """Recolour an image and interpolate it bilinearly at a grid of points.

    OpenCV's warp is not used, since it rounds positions to 1/32 px, which would be an error in disparity.

    Args:
        image: (h, w, 3) uint8.
        rows: (H,) positions in pixels, or (H, W) if each column has its own; pixel centres lie at + 0.5.
        columns: (W,) positions, or (H, W) if each row has its own.
        tone_curve: (256, 3) colours in 0..1 of the levels 0..255.

    Returns:
        (H, W, 3) in 0..1.
    """
    row, row_weight = _neighbours(rows, image.shape[0])
    column, column_weight = _neighbours(columns, image.shape[1])
    first_row, first_column = int(row.min()), int(column.min())
    part = image[first_row : int(row.max()) + 2, first_column : int(column.max()) + 2]
    colors = cv2.LUT(np.ascontiguousarray(part), tone_curve[None])
    row, column = row - first_row, column - first_column
    below = np.minimum(row + 1, colors.shape[0] - 1)
    right = np.minimum(column + 1, colors.shape[1] - 1)
    if row.ndim == 2:
        before, after = (
            colors[row, at] + (colors[below, at] - colors[row, at]) * row_weight[..., None]
            for at in (column, right)
        )
        return before + (after - before) * column_weight[..., None]
    lines = np.take(colors, row, axis=0)
    lines += (np.take(colors, below, axis=0) - lines) * row_weight[:, None, None]
    values: Float32 = _at_columns(lines, column)
    values += (_at_columns(lines, right) - values) * column_weight[..., None]
    return values


def _at_columns(lines: Float32, columns: NDArray[np.int64]) -> Float32:
    if columns.ndim == 1:
        return np.take(lines, columns, axis=1)
    return np.take_along_axis(lines, columns[..., None], axis=1)


IDENTITY_CURVE: Float32 = np.repeat(np.linspace(0, 1, 256, dtype=np.float32)[:, None], 3, axis=1)
"""(256, 3) tone curve that changes no colour."""


def draw_tone_curves(
    rng: np.random.Generator, config: AugmentationConfig, step: int
) -> tuple[Float32, Float32]:
    """Draw brightness, colour, contrast and gamma as (256, 3) tone curves of the left and the right view.

    Both views get the same changes, the right view small ones of its own, and each view those that the config asks for.

    Args:
        rng: Source of all randomness.
        config: Ranges of the changes.
        step: Training step; the right view's own changes grow with it.
    """
    brightness, contrast, gamma = np.exp(
        rng.uniform(-1, 1, 3) * (config.log_brightness, config.log_contrast, config.log_gamma)
    )
    color = brightness * np.exp(rng.uniform(-1, 1, 3) * config.log_color)
    offset, *extra = rng.standard_normal(6) * config.right_only * right_only_growth(step)
    extra_contrast, extra_gamma, *extra_color = np.exp(extra)
    left_color, right_color = draw_view_colors(rng, config)
    return (
        tone_curve(color * left_color, 0.0, contrast, gamma),
        tone_curve(color * extra_color * right_color, offset, contrast * extra_contrast, gamma * extra_gamma),
    )


def draw_view_colors(rng: np.random.Generator, config: AugmentationConfig) -> NDArray[np.float64]:
    """Draw (2, 3) factors of the colour channels of the left and the right view, each by itself; 1 if nothing asks."""
    if config.log_view_brightness == 0 and config.log_view_color == 0:
        return np.ones((2, 3))
    drawn = rng.uniform(-1, 1, (2, 4)) * (config.log_view_brightness, *[config.log_view_color] * 3)
    return np.exp(drawn[:, :1] + drawn[:, 1:])


def tone_curve(color: NDArray[np.float64], offset: float, contrast: float, gamma: float) -> Float32:
    """Colours clip((level * color + offset - 1/2) * contrast + 1/2, 0, 1) ** gamma of the levels 0..255, (256, 3).

    Args:
        color: (3,) factors.
        offset, contrast, gamma: Numbers for all channels.
    """
    curve = np.clip((IDENTITY_CURVE * color + offset - 0.5) * contrast + 0.5, 0, 1) ** gamma
    return curve.astype(np.float32)


def right_only_growth(step: int) -> float:
    """Factor of the right view's own changes: it grows from 0.5 to 1, with 0.75 after 50,000 steps.

    This is the schedule of the released training definition.
    """
    return float(1 / (1 + np.exp(-np.log(3) * step / RIGHT_ONLY_GROWTH_STEPS)))


def _nearest(positions: NDArray[np.float64], length: int) -> NDArray[np.int64]:
    return np.clip(np.floor(positions).astype(np.int64), 0, length - 1)


def _neighbours(positions: NDArray[np.float64], length: int) -> tuple[NDArray[np.int64], Float32]:
    """Index of the pixel before each position, and the weight of the pixel after it; borders are repeated."""
    centred = np.clip(positions - 0.5, 0, length - 1)
    before = np.minimum(np.floor(centred).astype(np.int64), max(length - 2, 0))
    return before, (centred - before).astype(np.float32)
