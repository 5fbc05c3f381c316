"""Semi-global matching as OpenCV has it (H. Hirschmueller, "Stereo Processing by Semiglobal Matching and Mutual
Information", PAMI 2008; OpenCV's variant matches blocks by Birchfield and Tomasi's cost)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from stereoforge_kit.errors import InputError

SUBPIXELS = 16
"""OpenCV gives disparities as integers in units of 1/16 px."""
_MODES = {
    "5 paths": cv2.STEREO_SGBM_MODE_SGBM,
    "8 paths": cv2.STEREO_SGBM_MODE_HH,
    "3 paths": cv2.STEREO_SGBM_MODE_SGBM_3WAY,
}


@dataclass(frozen=True)
class SGBMParameters:
    """Parameters of OpenCV's matcher; the defaults are its documentation's for colour images."""

    max_disparity_px: int = 160
    """Disparities 0 to below this are searched; rounded up to a multiple of 16."""
    block_px: int = 5
    """Side of the blocks that are compared, odd."""
    small_penalty: float = 8.0
    """Cost of a change of one pixel in disparity between neighbours, per channel and pixel of the block."""
    large_penalty: float = 32.0
    """Cost of a larger change; above `small_penalty`."""
    uniqueness_percent: int = 10
    """By how much the best match must beat the second best, or there is none."""
    speckle_px: int = 100
    """Smaller connected pieces than this are removed; 0 keeps all."""
    paths: Literal["3 paths", "5 paths", "8 paths"] = "5 paths"
    """Directions along which costs are summed."""

    def __post_init__(self) -> None:
        if self.max_disparity_px < 1:
            raise InputError(f"SGBM's max_disparity_px must be at least 1, got {self.max_disparity_px}")
        if self.block_px < 1 or self.block_px % 2 == 0:
            raise InputError(f"SGBM's block_px must be odd, got {self.block_px}")
        if not 0 <= self.small_penalty < self.large_penalty:
            raise InputError(
                "SGBM's penalties must be at least 0, the large one larger than the small one, got "
                f"{self.small_penalty} and {self.large_penalty}"
            )
        if not 0 <= self.uniqueness_percent <= 100 or self.speckle_px < 0:
            raise InputError("SGBM's uniqueness_percent is 0 to 100 and its speckle_px at least 0")


def match_sgbm(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    parameters: SGBMParameters = SGBMParameters(),
) -> NDArray[np.float32]:
    """The left view's disparity.

    Args:
        left, right: (H, W, 3) uint8, rectified.

    Returns:
        (H, W) float32 pixels, multiples of 1/16; NaN where the matcher finds no unique match inside the right image.

    Raises:
        ValueError: If the images differ in shape or are not (H, W, 3) of uint8.
    """
    for image in (left, right):
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
            raise InputError(f"SGBM takes images (H, W, 3) of uint8, got {image.shape} of {image.dtype}")
    if left.shape != right.shape:
        raise InputError(f"the images differ in size: {left.shape[:2]} and {right.shape[:2]}")
    disparities = -(-parameters.max_disparity_px // 16) * 16
    area = 3 * parameters.block_px**2
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=disparities,
        blockSize=parameters.block_px,
        P1=round(parameters.small_penalty * area),
        P2=max(round(parameters.large_penalty * area), round(parameters.small_penalty * area) + 1),
        uniquenessRatio=parameters.uniqueness_percent,
        speckleWindowSize=parameters.speckle_px,
        speckleRange=1,
        mode=_MODES[parameters.paths],
    )
    # OpenCV matches no pixel whose largest disparity would leave the image; with so many columns put before the
    # images, every pixel of theirs is matched. Its block at the right border leaves the image, too.
    margin = parameters.block_px // 2
    padded = [
        cv2.copyMakeBorder(image, margin, margin, disparities, margin, cv2.BORDER_REPLICATE)
        for image in (left, right)
    ]
    steps = matcher.compute(*padded)[
        margin : margin + left.shape[0], disparities : disparities + left.shape[1]
    ]
    disparity = steps / np.float32(SUBPIXELS)
    # What is found among the columns put before the right image is no match.
    found = (steps >= 0) & (disparity < np.arange(1, left.shape[1] + 1))
    return np.where(found, disparity, np.nan).astype(np.float32)


def match_both(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    parameters: SGBMParameters = SGBMParameters(),
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Both views' disparities, the right one's by matching the mirrored, swapped pair; as `match_sgbm`."""
    mirrored = [np.ascontiguousarray(image[:, ::-1]) for image in (right, left)]
    disparity_right = match_sgbm(mirrored[0], mirrored[1], parameters)[:, ::-1]
    return match_sgbm(left, right, parameters), np.ascontiguousarray(disparity_right)
