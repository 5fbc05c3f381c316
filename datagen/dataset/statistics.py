"""Statistics of a data set's frames: disparity, occlusion, objects and texture."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from datagen.dataset.samples import StereoSample
from datagen.formats.occlusion import OCCLUDED, OUT_OF_FRAME

TEXTURE_WINDOW_PX = 9
"""Width of the window in which a pixel's texture is judged, about what block matching compares."""
TEXTURE_DEVIATION = 3.0
"""Standard deviation of grey, on a scale of 0 to 255, above which a window counts as textured."""
PIXEL_STEP = 4
"""Every fourth pixel along each axis goes into the distribution of the disparity."""


@dataclass(frozen=True)
class SetStatistics:
    """Distributions over the left views of F frames."""

    disparity: NDArray[np.float32]
    """(P,) px, of a regular subset of all frames' pixels."""
    occluded: NDArray[np.float64]
    """(F,) share of each frame's pixels that are occluded in the right view."""
    out_of_frame: NDArray[np.float64]
    """(F,) share of each frame's pixels that lie out of the right view's frame."""
    visible_objects: NDArray[np.int64]
    """(F,) number of objects with at least one pixel."""
    textured: NDArray[np.float64]
    """(F,) share of each frame's pixels whose window is textured."""

    def __len__(self) -> int:
        return len(self.occluded)


def measure(samples: Iterable[StereoSample]) -> SetStatistics:
    """Measure the left views of at least one sample. Raises DatasetError for damaged files."""
    rows = [
        (
            sample.disparity_left[::PIXEL_STEP, ::PIXEL_STEP].ravel(),
            (sample.occlusion_left == OCCLUDED).mean(),
            (sample.occlusion_left == OUT_OF_FRAME).mean(),
            np.count_nonzero(np.unique(sample.object_index_left)),
            textured_share(sample.left),
        )
        for sample in samples
    ]
    disparity, occluded, out_of_frame, objects, textured = zip(*rows, strict=True)
    return SetStatistics(
        disparity=np.concatenate(disparity),
        occluded=np.array(occluded),
        out_of_frame=np.array(out_of_frame),
        visible_objects=np.array(objects, np.int64),
        textured=np.array(textured),
    )


def textured_share(image: NDArray[np.uint8]) -> float:
    """Share of the pixels of an (H, W, 3) sRGB image whose window has enough contrast to be matched."""
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float64)
    window = (TEXTURE_WINDOW_PX, TEXTURE_WINDOW_PX)
    variance = cv2.blur(grey * grey, window) - cv2.blur(grey, window) ** 2
    return float((variance > TEXTURE_DEVIATION**2).mean())
