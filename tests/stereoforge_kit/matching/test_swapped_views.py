"""Views in the wrong order are told by what can be matched."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from stereoforge_kit.matching import seem_swapped


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("size", [(96, 160), (240, 400)])
def test_order_is_told_from_a_textured_pair(seed: int, size: tuple[int, int]) -> None:
    """A slanted plane of smoothed noise: the right view shows each point further to the left."""
    height, width = size
    rng = np.random.default_rng(seed)
    left = gaussian_filter(rng.uniform(0, 255, (height, width, 3)), (1, 1, 0))
    left = ((left - left.min()) / np.ptp(left) * 255).astype(np.uint8)
    rows, columns = np.mgrid[:height, :width].astype(float)
    disparity = width / 40 + columns * 0.05  # of the right view
    right = np.stack(
        [
            map_coordinates(left[..., channel].astype(float), [rows, columns + disparity], order=1)
            for channel in range(3)
        ],
        axis=2,
    ).astype(np.uint8)
    assert not seem_swapped(left, right)
    assert seem_swapped(right, left)
    assert not seem_swapped(left, left)
