"""Checks of one frame's arrays against one another. Each yields one sentence for each problem.

The limits on shares of pixels leave room for silhouettes, where the rounding of rays decides, and for things thinner
than a pixel, which the neighbouring pixels of the other view miss. On flying_things from 96 x 54 to 480 x 270 the
largest shares measured are a tenth to a third of the limits. An error of convention (sign, half a pixel, swapped views)
moves nearly all pixels.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from datagen.dataset.layout import View
from datagen.formats.occlusion import OCCLUDED, OUT_OF_FRAME, VISIBLE
from datagen.ground_truth.labels import forward_differences, gradient_validity
from datagen.ground_truth.raycast import Hits
from scenes.spec import StereoCamera

CONSISTENCY_TOLERANCE_PX = 0.25
"""How far a visible pixel's disparity may lie outside those of the two pixels it falls between."""
NEARER_PX = 1e-2
"""A surface that occludes a point has a disparity greater than the point's by more than this."""
MAX_INCONSISTENT = 0.1
"""Share of pixels in which the two views may disagree."""
FRAME_TIE_PX = 1e-3
"""A point this close to the edge of the other view's frame may have either label."""
GEOMETRY_TOLERANCE_PX = 1e-2
"""How far a sampled disparity may be from the scene's geometry."""
DEPTH_TOLERANCE_PX = 1e-4
"""How far the disparity of a stored depth may be from the stored disparity."""
MAX_OFF_GEOMETRY = 0.01
"""Share of sampled pixels that may differ from the scene's geometry by more than the tolerance."""
MAX_OFF_LABELS = 0.03
"""Share of sampled pixels whose occlusion label may differ: boundaries of occlusion are longer than silhouettes."""
MIN_COUNTED = 50
"""Shares of fewer pixels than this are not judged."""


def check_disparity(disparity: NDArray[np.float32], at_infinity: float) -> Iterator[str]:
    """A disparity (H, W) is finite and no less than at infinity: a rendered world has no pixel without ground truth."""
    wrong = int((~np.isfinite(disparity)).sum())
    if wrong:
        yield f"{wrong} disparities are not finite"
    less = int((disparity < np.float32(at_infinity)).sum())
    if less:
        beyond = "negative" if at_infinity == 0 else f"below {at_infinity:.3f} px, that of infinity"
        yield f"{less} disparities are {beyond}, the least {np.nanmin(disparity):.3f} px"


def check_gradient(
    disparity: NDArray[np.float32],
    gradient: NDArray[np.float32],
    valid: NDArray[np.bool_],
    threshold_px: float,
) -> Iterator[str]:
    """Valid gradients (H, W, 2) are the disparity's forward differences.

    The mask valid (H, W) is True where neither difference exceeds the threshold.
    """
    expected = forward_differences(disparity)
    wrong = int(((gradient != expected).any(axis=-1) & valid).sum())
    if wrong:
        yield f"{wrong} valid gradients are not the forward differences of the disparity"
    wrong = int((gradient_validity(expected, threshold_px) != valid).sum())
    if wrong:
        yield f"{wrong} pixels of the gradient's mask do not follow from the threshold of {threshold_px} px"


def check_object_index(
    index: NDArray[np.uint16], disparity: NDArray[np.float32], objects: int, at_infinity: float
) -> Iterator[str]:
    """Object indices (H, W) name objects that exist, and exactly the sky (index 0) is infinitely far."""
    if index.max() > objects:
        yield f"object index {index.max()} is beyond the scene's {objects} objects"
    wrong = int(((index == 0) != (disparity == np.float32(at_infinity))).sum())
    if wrong:
        yield f"{wrong} pixels are sky in one of object index and disparity but not in the other"


def check_views(
    view: View,
    disparity: NDArray[np.float32],
    other_disparity: NDArray[np.float32],
    occlusion: NDArray[np.uint8],
) -> Iterator[str]:
    """The occlusion labels (H, W) of one view agree with both views' disparities (H, W).

    A visible point falls between two pixels of the other view and has a disparity between theirs. An occluded point
    falls on or beside something nearer. A point is out of frame exactly if its x coordinate is.
    """
    x, low, high = _in_other_view(view, disparity, other_disparity)
    width = disparity.shape[1]
    outside = (x < 0) | (x > width)
    tie = np.minimum(np.abs(x), np.abs(x - width)) < FRAME_TIE_PX
    wrong = int((((occlusion == OUT_OF_FRAME) != outside) & ~tie).sum())
    if wrong:
        yield f"{wrong} pixels have a label that contradicts their place in the other view"
    tolerance = CONSISTENCY_TOLERANCE_PX
    unmet = (disparity < low - tolerance) | (disparity > high + tolerance)
    yield from _too_many(
        unmet[occlusion == VISIBLE],
        MAX_INCONSISTENT,
        "visible pixels have another disparity than the other view has there",
    )
    # What occludes a point may be thinner than a pixel and miss the centres next to it: look one pixel further.
    _, _, nearest = _in_other_view(view, disparity, maximum_filter(other_disparity, size=3))
    yield from _too_many(
        (nearest <= disparity + NEARER_PX)[occlusion == OCCLUDED],
        MAX_INCONSISTENT,
        "occluded pixels have nothing nearer in front of them in the other view",
    )


def check_images(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    disparity_left: NDArray[np.float32],
    occlusion_left: NDArray[np.uint8],
) -> Iterator[str]:
    """The right image, warped by the left disparity, is more like the left image than if warped the wrong way."""
    visible = (occlusion_left == VISIBLE) & (disparity_left > 1)
    if visible.sum() < MIN_COUNTED:
        return
    right_way = _warp_error(left, right, disparity_left, visible)
    wrong_way = _warp_error(left, right, -disparity_left, visible)
    # Textureless pairs fit either way about equally well; only a clear preference for the wrong way counts.
    if right_way > 1.2 * wrong_way + 1:
        yield (
            f"the images fit the negated disparity (mean difference {wrong_way:.1f} grey levels) better than the "
            f"disparity ({right_way:.1f}): the views are swapped"
        )


def check_geometry(
    disparity: NDArray[np.float32],
    object_index: NDArray[np.uint16],
    occlusion: NDArray[np.uint8],
    expected: Hits,
) -> Iterator[str]:
    """The arrays of N sampled pixels agree with the rays cast at the scene's meshes."""
    error = np.abs(disparity - expected.disparity)
    tolerance = GEOMETRY_TOLERANCE_PX
    sentence = f"sampled disparities are over {tolerance} px from the scene's geometry"
    yield from _too_many(
        ~(error <= tolerance), MAX_OFF_GEOMETRY, f"{sentence} (median {np.median(error):.3g} px)"
    )
    yield from _too_many(
        object_index != expected.object_index,
        MAX_OFF_GEOMETRY,
        "sampled object indices are not those of the scene's geometry",
    )
    yield from _too_many(
        occlusion != expected.occlusion,
        MAX_OFF_LABELS,
        "sampled occlusion labels are not those of the scene's geometry",
    )


def check_vectors(
    values: NDArray[np.float32], expected: NDArray[np.float32], tolerance: float
) -> Iterator[str]:
    """Sampled values (N,) or (N, C) of a target agree with the scene's geometry, and are NaN where that is.

    tolerance: Of the difference, and relative for values above 1.
    """
    with np.errstate(invalid="ignore"):
        same = np.abs(values - expected) <= tolerance * np.maximum(1, np.abs(expected))
    same |= np.isnan(values) & np.isnan(expected)
    yield from _too_many(
        ~same.reshape(len(same), -1).all(axis=1),
        MAX_OFF_GEOMETRY,
        f"sampled values are over {tolerance} from the scene's geometry",
    )


def check_depth(
    depth: NDArray[np.float32], disparity: NDArray[np.float32], camera: StereoCamera
) -> Iterator[str]:
    """A depth (H, W) in metres has the stored disparity (H, W), and the sky has none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        expected = camera.disparity_metres / depth.astype(np.float64) + camera.disparity_at_infinity
        # Both are rounded to 32 bits.
        same = np.abs(expected - disparity) <= DEPTH_TOLERANCE_PX + 1e-6 * np.abs(disparity)
    wrong = int((~same | ~(depth > 0)).sum())
    if wrong:
        yield f"{wrong} depths are not those of the disparity"


def check_derived(values: NDArray[Any], expected: NDArray[Any], origin: str) -> Iterator[str]:
    """A target (H, W) is what follows from other targets; `origin` names those."""
    wrong = int((values != expected).sum())
    if wrong:
        yield f"{wrong} pixels do not follow from {origin}"


def check_materials(values: NDArray[Any], expected: NDArray[Any]) -> Iterator[str]:
    """Sampled values (N,) of a target that follows from the materials are those of the scene's geometry."""
    yield from _too_many(
        values != expected, MAX_OFF_GEOMETRY, "sampled materials are not those of the scene's geometry"
    )


def check_boundaries(marked: NDArray[np.bool_], expected: NDArray[np.bool_]) -> Iterator[str]:
    """Motion boundaries (H, W) agree with those of the scene's geometry at the pixels that either marks."""
    either = marked | expected
    yield from _too_many(
        (marked != expected)[either],
        MAX_OFF_LABELS,
        "pixels of motion boundaries differ from the scene's geometry",
    )


def _in_other_view(
    view: View, disparity: NDArray[np.float32], other_disparity: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.float32]]:
    """Where each pixel's point is in the other view: its x there, and the least and greatest disparity of the two
    pixels whose centres it falls between; all (H, W)."""
    width = disparity.shape[1]
    sign = -1.0 if view == "left" else 1.0
    x = np.arange(width) + 0.5 + sign * disparity.astype(np.float64)
    first = np.floor(np.clip(x - 0.5, -1, width)).astype(np.int64)
    rows = np.arange(len(disparity))[:, None]
    one = other_disparity[rows, np.clip(first, 0, width - 1)]
    two = other_disparity[rows, np.clip(first + 1, 0, width - 1)]
    return x, np.minimum(one, two), np.maximum(one, two)


def _warp_error(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    disparity: NDArray[np.float32],
    mask: NDArray[np.bool_],
) -> float:
    """Mean absolute difference, in grey levels, of the left image and the right one sampled at x - d."""
    rows, columns = np.nonzero(mask)
    source = np.rint(columns - disparity[mask]).astype(np.int64)
    fetched = right[rows, np.clip(source, 0, right.shape[1] - 1)]
    return float(np.abs(left[mask].astype(np.int16) - fetched.astype(np.int16)).mean())


def _too_many(wrong: NDArray[Any], limit: float, what: str) -> Iterator[str]:
    share = float(wrong.mean()) if wrong.size >= MIN_COUNTED else 0.0
    if share > limit:
        yield f"{share:.1%} of the {wrong.size} {what}"
