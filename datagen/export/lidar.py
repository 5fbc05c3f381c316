"""The pixels that a spinning laser scanner at the left camera would measure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.spec import StereoCamera
from stereoforge_kit.errors import InputError

ELEVATION_DEG = (-24.9, 2.0)
"""Lowest and highest beam of KITTI's scanner, a Velodyne HDL-64E."""
AZIMUTH_STEP_DEG = 0.18
"""Angle between two measurements of one beam at 10 turns per second."""


def lidar_mask(camera: StereoCamera, beams: int) -> NDArray[np.bool_]:
    """(H, W) True in the pixels of the left view that a beam hits.

    The beams are spread evenly in elevation, and each measures in even steps of azimuth. The scanner is at the camera,
    upright and with the same direction.

    Args:
        camera: The camera that the image is of.
        beams: Number of beams.

    Raises:
        ValueError: For fewer than one beam.
    """
    if beams < 1:
        raise InputError(f"a laser scanner has at least one beam, got {beams}")
    height, width = camera.height, camera.width
    center_x, center_y = camera.principal_point("left")
    first, last = np.degrees(np.arctan2((-center_x, width - center_x), camera.focal_px))
    azimuth = np.radians(np.arange(first, last, AZIMUTH_STEP_DEG))
    elevation = np.radians(np.linspace(*ELEVATION_DEG, beams))
    x = center_x + camera.focal_px * np.tan(azimuth)
    # A beam sweeps a cone, which the image plane cuts in a hyperbola.
    y = center_y - camera.focal_y_px * np.tan(elevation)[:, None] / np.cos(azimuth)
    columns = np.broadcast_to(np.floor(x).astype(np.int64), y.shape)
    rows = np.floor(y).astype(np.int64)
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    mask = np.zeros((height, width), bool)
    mask[rows[inside], columns[inside]] = True
    return mask
