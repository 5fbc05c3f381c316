"""What cameras do to a picture: blur and JPEG. Rendering and training's augmentation share it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def blurred(image: NDArray[np.float32], sigma: tuple[float, float]) -> NDArray[np.float32]:
    """Gaussian blur of an image (H, W, C) or (H, W), the border repeated.

    Args:
        image: Any float32 values.
        sigma: Standard deviations along x and y in px; an axis with 0 stays sharp.
    """
    along_x, along_y = (_kernel(deviation) for deviation in sigma)
    return cv2.sepFilter2D(image, cv2.CV_32F, along_x, along_y, borderType=cv2.BORDER_REPLICATE)


def _kernel(sigma: float) -> NDArray[np.float32]:
    # OpenCV reads a deviation of 0 as a wish that it choose one.
    if sigma == 0:
        return np.ones((1, 1), np.float32)
    return cv2.getGaussianKernel(2 * int(np.ceil(3 * sigma)) + 1, sigma, cv2.CV_32F)


def jpeg_compressed(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """An sRGB picture (H, W, 3) after it was stored as a JPEG file of a quality in 1..100."""
    _, code = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.ascontiguousarray(cv2.imdecode(code, cv2.IMREAD_COLOR)[..., ::-1])
