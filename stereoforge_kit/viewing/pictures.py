"""Arrays of the stereo pipeline as pictures: pure functions, array in, (H, W, 3) uint8 sRGB out.

Each quantity has one colour code, the same in the gallery, in the report and in training's image panels, so a
reader learns it once. A pixel without a value (NaN) is `INVALID_COLOR`, which no colour code uses.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import hsv_to_rgb
from numpy.typing import ArrayLike, NDArray

from stereoforge_kit.errors import InputError

Picture = NDArray[np.uint8]
"""(H, W, 3), 8-bit sRGB, row 0 at the top."""

INVALID_COLOR = (112, 118, 128)
OCCLUDED_COLOR = (230, 85, 13)
OUT_OF_FRAME_COLOR = (49, 130, 189)

LUMA = np.array([0.299, 0.587, 0.114])
"""Rec. 601 weights of red, green and blue in the perceived brightness of an sRGB value."""

_GOOD_COLORS = np.array([[255.0, 255.0, 255.0], [205.0, 205.0, 205.0]])
_BAD_COLORS = np.array([[244.0, 109.0, 92.0], [140.0, 0.0, 26.0]])
_WORST_ERROR = 10.0
"""Errors above this multiple of the threshold all have the darkest red."""


def disparity_picture(disparity: ArrayLike, maximum: float | None = None) -> Picture:
    """Disparity, black (0, infinitely far) over violet and orange to pale yellow (`maximum`, near).

    Args:
        disparity: (H, W) in pixels, NaN where invalid.
        maximum: Disparity of the brightest colour; the largest finite one if None. Give the same number to
            pictures that are compared.

    Raises:
        ValueError: If the array is not two-dimensional or `maximum` is not positive.
    """
    values = _plane(disparity, "disparity")
    if maximum is None:
        maximum = max(float(np.max(values, initial=0.0, where=np.isfinite(values))), 1.0)
    if not maximum > 0:
        raise InputError(f"the maximum disparity of a picture must be positive, got {maximum}")
    return _mapped(values / maximum, "magma")


def confidence_picture(confidence: ArrayLike) -> Picture:
    """Confidence (H, W) from dark blue (0) to yellow (1)."""
    return _mapped(_plane(confidence, "confidence"), "viridis")


def error_picture(error: ArrayLike, threshold: float) -> Picture:
    """Absolute error, bad pixels red as in the paper's Fig. 6.

    Up to `threshold` white to light grey; above it red, darker with the error up to ten thresholds.

    Args:
        error: (H, W) in pixels, its sign ignored, NaN where there is no ground truth.
        threshold: Errors strictly above it are bad, in pixels.
    """
    if not threshold > 0:
        raise InputError(f"the error threshold of a picture must be positive, got {threshold}")
    size = np.abs(_plane(error, "error")) / threshold
    share = np.nan_to_num(size, nan=0.0)
    good = _blend(_GOOD_COLORS, np.clip(share, 0, 1))
    bad = _blend(_BAD_COLORS, np.log(np.clip(share, 1, _WORST_ERROR)) / np.log(_WORST_ERROR))
    return _with_invalid(np.where((share > 1)[..., None], bad, good), np.isnan(size))


def occlusion_picture(labels: ArrayLike, image: ArrayLike) -> Picture:
    """The image in grey, occluded pixels (1) tinted orange, pixels out of the other frame (2) blue.

    Args:
        labels: (H, W) integers 0 visible, 1 occluded, 2 out of the other frame.
        image: (H, W, 3) uint8, the same view.
    """
    classes = _plane(labels, "occlusion")
    picture = np.repeat((_image(image, "image") @ LUMA)[..., None], 3, axis=2)
    if classes.shape != picture.shape[:2]:
        raise InputError(f"occlusion {classes.shape} and image {picture.shape[:2]} differ in size")
    for label, color in ((1, OCCLUDED_COLOR), (2, OUT_OF_FRAME_COLOR)):
        chosen = classes == label
        picture[chosen] = 0.3 * picture[chosen] + 0.7 * np.array(color)
    return _rounded(picture)


def gradient_picture(gradient: ArrayLike, maximum: float = 0.5) -> Picture:
    """Disparity gradient: hue is its direction, white a fronto-parallel surface, full colour `maximum`.

    Red points to the right (disparity grows along x), green-yellow down, cyan left, violet up. The same wheel
    shows optical flow, which is a field of (right, down) too.

    Args:
        gradient: (H, W, 2) as [dx, dy], in pixels of disparity a pixel, NaN where invalid.
        maximum: Gradient of the full colour.
    """
    values = np.asarray(gradient, dtype=np.float64)
    if values.ndim != 3 or values.shape[2] != 2:
        raise InputError(f"a gradient is (H, W, 2), got shape {values.shape}")
    if not maximum > 0:
        raise InputError(f"the maximum gradient of a picture must be positive, got {maximum}")
    invalid = np.isnan(values).any(axis=2)
    dx, dy = np.moveaxis(np.nan_to_num(values), 2, 0)
    hue = (np.arctan2(dy, dx) / (2 * np.pi)) % 1.0
    saturation = np.clip(np.hypot(dx, dy) / maximum, 0, 1)
    return _with_invalid(_hsv_colors(hue, saturation, 1 - 0.15 * saturation), invalid)


def normals_picture(normals: ArrayLike) -> Picture:
    """Surface normals (H, W, 3), x right, y up, z towards the camera: -1..1 as red, green, blue; the sky dark."""
    values = _image(normals, "normals")
    nothing = ~values.any(axis=2, keepdims=True)
    return _rounded(np.where(nothing, 38.0, 127.5 * (values + 1)))


def index_picture(index: ArrayLike) -> Picture:
    """Object indices (H, W): 0 (sky) dark, every other number a colour of its own, neighbours far apart."""
    values = _plane(index, "object index").astype(np.int64)
    golden_ratio = (np.sqrt(5) - 1) / 2
    hue = (values * golden_ratio) % 1.0
    value = np.where(values == 0, 0.15, 0.7 + 0.3 * ((values * 7) % 4) / 3)
    saturation = np.where(values == 0, 0.0, 0.45 + 0.4 * ((values * 5) % 3) / 2)
    return _rounded(_hsv_colors(hue, saturation, value))


def anaglyph(left: ArrayLike, right: ArrayLike) -> Picture:
    """The pair for red-cyan glasses: the left view's brightness in red, the right view's green and blue.

    (A half-colour anaglyph: a full-colour one makes red things flicker between the eyes.)
    """
    first, second = _image(left, "left image"), _image(right, "right image")
    if first.shape != second.shape:
        raise InputError(f"left {first.shape[:2]} and right {second.shape[:2]} differ in size")
    return _rounded(np.concatenate([(first @ LUMA)[..., None], second[..., 1:]], axis=2))


def side_by_side(pictures: Sequence[ArrayLike], gap: int = 4, color: int = 255) -> Picture:
    """Pictures of one height in a row, `gap` pixels of grey level `color` between them."""
    return _joined(pictures, gap, color, axis=1)


def stacked(pictures: Sequence[ArrayLike], gap: int = 4, color: int = 255) -> Picture:
    """Pictures of one width in a column, `gap` pixels of grey level `color` between them."""
    return _joined(pictures, gap, color, axis=0)


def shrunk(picture: ArrayLike, longest: int) -> Picture:
    """The picture by whole-number area averaging, so that no side is longer than `longest` pixels."""
    values = _image(picture, "picture")
    height, width = values.shape[:2]
    factor = -(-max(height, width) // longest)
    if factor == 1:
        return _rounded(values)
    rows, columns = max(height // factor, 1), max(width // factor, 1)
    factor_y, factor_x = min(factor, height), min(factor, width)
    cropped = values[: rows * factor_y, : columns * factor_x]
    return _rounded(cropped.reshape(rows, factor_y, columns, factor_x, 3).mean(axis=(1, 3)))


def enlarged(picture: ArrayLike, factor: int) -> Picture:
    """The picture with every pixel repeated `factor` times both ways, so that single pixels can be seen."""
    return _rounded(np.repeat(np.repeat(_image(picture, "picture"), factor, axis=0), factor, axis=1))


def _joined(pictures: Sequence[ArrayLike], gap: int, color: int, axis: int) -> Picture:
    images = [_rounded(_image(picture, "picture")) for picture in pictures]
    if len({image.shape[1 - axis] for image in images}) != 1:
        across = "width" if axis == 0 else "height"
        sizes = [image.shape[:2] for image in images]
        raise InputError(f"pictures to join must be at least one and share their {across}, got sizes {sizes}")
    spacer_shape = list(images[0].shape)
    spacer_shape[axis] = gap
    spacer = np.full(spacer_shape, color, np.uint8)
    parts = [images[0]]
    for image in images[1:]:
        parts += [spacer, image]
    return np.concatenate(parts, axis=axis)


def _mapped(share: NDArray[np.float64], colormap: str) -> Picture:
    """Colours of values 0..1 (clipped) in one of matplotlib's perceptually uniform maps."""
    invalid = np.isnan(share)
    colors = np.asarray(colormaps[colormap](np.clip(np.where(invalid, 0, share), 0, 1)), dtype=np.float64)
    return _with_invalid(colors[..., :3] * 255, invalid)


def _hsv_colors(
    hue: NDArray[np.float64], saturation: NDArray[np.float64], value: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.asarray(hsv_to_rgb(np.stack([hue, saturation, value], axis=2)), dtype=np.float64) * 255


def _with_invalid(colors: NDArray[np.float64], invalid: NDArray[np.bool_]) -> Picture:
    return _rounded(np.where(invalid[..., None], np.array(INVALID_COLOR), colors))


def _blend(ends: NDArray[np.float64], share: NDArray[np.float64]) -> NDArray[np.float64]:
    blended: NDArray[np.float64] = ends[0] + share[..., None] * (ends[1] - ends[0])
    return blended


def _rounded(values: NDArray[np.float64]) -> Picture:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def _plane(array: ArrayLike, name: str) -> NDArray[np.float64]:
    values = np.asarray(array, dtype=np.float64)
    if values.ndim != 2:
        raise InputError(f"{name} must be (H, W), got shape {values.shape}")
    return values


def _image(array: ArrayLike, name: str) -> NDArray[np.float64]:
    values = np.asarray(array, dtype=np.float64)
    if values.ndim != 3 or values.shape[2] != 3:
        raise InputError(f"the {name} must be (H, W, 3), got shape {values.shape}")
    return values
