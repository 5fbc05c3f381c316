"""A video of the left views beside their refined disparities."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from imageio.v3 import imopen
from numpy.typing import NDArray

from datagen.formats import read_pfm
from stereoforge.inputs.stereo_pairs import StereoPairs
from stereoforge.pipelines.refined_names import DISPARITY
from stereoforge_kit.files import replacing
from stereoforge_kit.viewing import disparity_picture

CODEC = "libx264"
TALLEST_PX = 1080
"""Taller views are shown smaller."""


def write_video(
    path: Path, pairs: StereoPairs, results: Path, frames_per_second: float, advance: Callable[[], None]
) -> None:
    """Write the left views of pairs beside their refined disparities, all of these in one scale.

    Args:
        path: The video, `.mp4`.
        pairs: The pairs, each of which has been refined.
        results: The folder with a folder of results for each.
        frames_per_second: Of the video.
        advance: Called after each frame.
    """
    scale = _scale(results)
    with replacing(path) as temporary, imopen(temporary, "w", plugin="pyav", container="mp4") as video:
        video.init_video_stream(CODEC, fps=frames_per_second)
        for pair in pairs:
            left, _, _ = pair.read()
            disparity = read_pfm(results / pair.name / DISPARITY)
            video.write_frame(_even(np.hstack([left, disparity_picture(disparity, scale)])))
            advance()


def _scale(results: Path) -> float:
    """The disparity that is shown brightest: what 99.5 % of the pixels of the frames are below, in the median."""
    found = [float(np.nanpercentile(read_pfm(path), 99.5)) for path in sorted(results.glob(f"*/{DISPARITY}"))]
    return max(float(np.median(found)), 1.0)


def _even(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A picture of an even size, which the codec wants, and at most `TALLEST_PX` tall."""
    shrink = min(TALLEST_PX / picture.shape[0], 1.0)
    height, width = (max(round(length * shrink) // 2 * 2, 2) for length in picture.shape[:2])
    smaller = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(smaller, dtype=np.uint8)
