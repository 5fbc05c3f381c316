"""Random changes to a stereo pair that keep it a rectified pair with exact disparity.

Geometry (one window, zoom and squeeze for both views) and colour follow the augmentation layers of the released
DispNet training definition. Images are resampled bilinearly; disparity and gradients never are, they take the
nearest pixel's value.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from datagen.ground_truth.labels import forward_differences

Float32 = NDArray[np.float32]


@dataclass(frozen=True)
class StereoPair:
    """One decoded frame, as much of it as training uses."""

    left: NDArray[np.uint8]
    """(H, W, 3) sRGB."""
    right: NDArray[np.uint8]
    disparity_left: Float32
    """(H, W) px, NaN invalid."""
    disparity_right: Float32 | None
    """None where the data set has none; such a pair cannot be mirrored."""

    @property
    def nbytes(self) -> int:
        right = 0 if self.disparity_right is None else self.disparity_right.nbytes
        return self.left.nbytes + self.right.nbytes + self.disparity_left.nbytes + right


@dataclass(frozen=True)
class TrainingSample:
    """What the networks see and are told."""

    left: Float32
    """(H, W, 3) in 0..1."""
    right: Float32
    disparity: Float32
    """(H, W) of the left view, px of this crop, NaN invalid."""
    gradient: Float32
    """(H, W, 2) forward differences [dx, dy] in px per pixel of this crop, NaN invalid."""


@dataclass(frozen=True)
class AugmentationConfig:
    """Ranges of the random changes; the defaults are the released ones. `log_` ranges are exponentiated."""

    translation: float = 0.4
    """Window centre from the image's centre, U(-this, this) of the crop's sides."""
    log_zoom: tuple[float, float] = (-0.2, 0.6)
    log_squeeze: tuple[float, float] = (-0.3, 0.3)
    """q: horizontal zoom times q, vertical zoom divided by q."""
    horizontal_flip: float = 0.0
    """Probability of mirroring, which swaps the views and takes the right view's truth. Pairs without that truth
    stay as they are."""
    vertical_flip: float = 0.0
    """Probability of turning upside down."""
    shear: float = 0.0
    """A quarter of the pairs have the rows of their right view moved, further and further down or up the image, as if
    all that is seen leant: U(-this, this) pixels of disparity a pixel down are added (ours). So a network that was
    shown things in the air has seen the slant of a road, too."""
    log_brightness: float = 0.4
    """Factor exp U(-this, this), and so on for gamma, contrast and the factor of each colour channel."""
    log_gamma: float = 0.4
    log_contrast: float = 0.4
    log_color: float = 0.2
    noise: float = 0.06
    """Standard deviation of the Gaussian noise, U(0, this) of the range 0..1, drawn for each view alike."""
    right_only: float = 0.01
    """Spread of the small extra gamma, brightness, contrast and colour change of the right view."""


NO_AUGMENTATION = AugmentationConfig(0.0, (0.0, 0.0), (0.0, 0.0), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
SHEARED = 0.25
WINDOW_TRIALS = 50
RIGHT_ONLY_GROWTH_STEPS = 50_000


@dataclass(frozen=True)
class Window:
    """A crop's place in the source image: u of the crop lies at left_px + u / zoom_x of the source."""

    left_px: float
    top_px: float
    zoom_x: float
    zoom_y: float


def augment(
    rng: np.random.Generator,
    pair: StereoPair,
    size: tuple[int, int],
    config: AugmentationConfig,
    step: int = 0,
) -> TrainingSample:
    """Draw one training sample from a pair.

    Args:
        rng: decides everything.
        size: (height, width) of the sample.
        step: training step; the right view's own changes grow with it.

    Raises:
        ValueError: the pair is smaller than `size`.
    """
    if rng.random() < config.horizontal_flip and pair.disparity_right is not None:
        pair = mirror(pair)
    if rng.random() < config.vertical_flip:
        pair = turn_over(pair)
    window = draw_window(rng, pair.left.shape[:2], size, config)
    tone_curves = draw_tone_curves(rng, config, step)
    sample = cut(pair, window, size, tone_curves, draw_shear(rng, config))
    noise = np.float32(rng.uniform(0, config.noise))
    if noise > 0:
        left = sample.left + noise * draw_normal(rng, sample.left.shape)
        right = sample.right + noise * draw_normal(rng, sample.right.shape)
        sample = replace(sample, left=left, right=right)
    return sample


def draw_normal(rng: np.random.Generator, shape: tuple[int, ...]) -> Float32:
    """Standard normal numbers, read from a random place of a long table: drawing them afresh would be half the
    cost of a crop."""
    table = _normal_table()
    return np.resize(table[rng.integers(len(table) // 2) :], shape)


@cache
def _normal_table() -> Float32:
    return np.random.default_rng(0).standard_normal(1 << 22, np.float32)


def mirror(pair: StereoPair) -> StereoPair:
    """Mirror left-right: the mirrored right view is the left view of a pair with positive disparity again.

    Raises ValueError for a pair without the right view's truth.
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
    """A window inside the source, by rejection; the plain centre crop when no trial fits."""
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
    """Disparity to add per row of the source, px; nothing is drawn where the range is empty."""
    if config.shear == 0:
        return 0.0
    slope = rng.uniform(-config.shear, config.shear)
    return float(slope) if rng.random() < SHEARED else 0.0


def cut(
    pair: StereoPair,
    window: Window,
    size: tuple[int, int],
    tone_curves: tuple[Float32, Float32],
    shear: float = 0.0,
) -> TrainingSample:
    """Recolour and resample both views, and the left truth, through one window.

    A surface d(x, y) seen through zooms (zx, zy) has disparity zx d, slope dx along x and zx / zy dy along y.
    The gradients are differences of the source's truth: those of a zoomed, nearest-sampled map would be stairs.

    Args:
        tone_curves: (256, 3) colours in 0..1 of the levels 0..255, for the left and the right view.
        shear: Disparity added from row to row, px of the source; none in the window's first row, or, where it is
            negative, in its last: disparities stay positive. What hides what in a row stays as it was.
    """
    rows = window.top_px + (np.arange(size[0]) + 0.5) / window.zoom_y
    columns = window.left_px + (np.arange(size[1]) + 0.5) / window.zoom_x
    nearest_rows = _nearest(rows, pair.left.shape[0])
    nearest_columns = _nearest(columns, pair.left.shape[1])
    gradient = missing_at_borders(forward_differences(pair.disparity_left))
    nearest = np.ix_(nearest_rows, nearest_columns)
    disparity, gradient = pair.disparity_left[nearest], gradient[nearest]
    moves = shear * (rows - (rows[0] if shear > 0 else rows[-1]))
    gradient = gradient + np.array([0.0, shear], np.float32)
    columns_right = columns if shear == 0 else columns + moves[:, None]
    return TrainingSample(
        left=sample_bilinear(pair.left, rows, columns, tone_curves[0]),
        right=sample_bilinear(pair.right, rows, columns_right, tone_curves[1]),
        disparity=(disparity + moves[:, None].astype(np.float32)) * np.float32(window.zoom_x),
        gradient=gradient * np.array([1.0, window.zoom_x / window.zoom_y], np.float32),
    )


def missing_at_borders(gradient: Float32) -> Float32:
    """Forward differences (H, W, 2) with NaN in the last row and column, which have none; in place."""
    gradient[:, -1] = np.nan
    gradient[-1, :] = np.nan
    return gradient


def sample_bilinear(
    image: NDArray[np.uint8], rows: NDArray[np.float64], columns: NDArray[np.float64], tone_curve: Float32
) -> Float32:
    """A recoloured image at a grid of points, (len(rows), columns.shape[-1], 3).

    Pixel centres lie at + 0.5. Not OpenCV's warp, which rounds positions to 1/32 px: an error in disparity.

    Args:
        rows: (H,).
        columns: (W,), or (H, W) where each row has its own.
    """
    row, row_weight = _neighbours(rows, image.shape[0])
    column, column_weight = _neighbours(columns, image.shape[1])
    first_row, first_column = int(row[0]), int(column.min())
    part = image[first_row : row[-1] + 2, first_column : int(column.max()) + 2]
    colors = cv2.LUT(np.ascontiguousarray(part), tone_curve[None])
    row, column = row - first_row, column - first_column
    below = np.minimum(row + 1, colors.shape[0] - 1)
    right = np.minimum(column + 1, colors.shape[1] - 1)
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


def draw_tone_curves(
    rng: np.random.Generator, config: AugmentationConfig, step: int
) -> tuple[Float32, Float32]:
    """Brightness, colour, contrast and gamma as (256, 3) tables: alike for both views, a little more for the right."""
    brightness, contrast, gamma = np.exp(
        rng.uniform(-1, 1, 3) * (config.log_brightness, config.log_contrast, config.log_gamma)
    )
    color = brightness * np.exp(rng.uniform(-1, 1, 3) * config.log_color)
    offset, *extra = rng.standard_normal(6) * config.right_only * right_only_growth(step)
    extra_contrast, extra_gamma, *extra_color = np.exp(extra)
    return (
        tone_curve(color, 0.0, contrast, gamma),
        tone_curve(color * extra_color, offset, contrast * extra_contrast, gamma * extra_gamma),
    )


def tone_curve(color: NDArray[np.float64], offset: float, contrast: float, gamma: float) -> Float32:
    """clip((level * color + offset - 1/2) * contrast + 1/2, 0, 1) ** gamma for the levels 0..255, (256, 3)."""
    curve = np.clip((IDENTITY_CURVE * color + offset - 0.5) * contrast + 0.5, 0, 1) ** gamma
    return curve.astype(np.float32)


def right_only_growth(step: int) -> float:
    """0.5 at the start towards 1, 0.75 after 50,000 steps: the released training's schedule."""
    return float(1 / (1 + np.exp(-np.log(3) * step / RIGHT_ONLY_GROWTH_STEPS)))


def _nearest(positions: NDArray[np.float64], length: int) -> NDArray[np.int64]:
    return np.clip(np.floor(positions).astype(np.int64), 0, length - 1)


def _neighbours(positions: NDArray[np.float64], length: int) -> tuple[NDArray[np.int64], Float32]:
    """Index of the pixel before each position and the weight of the one after, borders repeated."""
    centred = np.clip(positions - 0.5, 0, length - 1)
    before = np.minimum(np.floor(centred).astype(np.int64), max(length - 2, 0))
    return before, (centred - before).astype(np.float32)
