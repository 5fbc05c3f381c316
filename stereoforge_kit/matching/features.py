"""Points that two views share, wherever they lie: SIFT features (D. Lowe, IJCV 2004) and their mutual best matches."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

MOST_FEATURES = 5000
"""Of each view; the strongest are kept."""
LONGEST_PX = 2400
"""Larger views are reduced to this before features are looked for; positions stay those of the views."""
RATIO = 0.8
"""Lowe's: the best match must be so much nearer than the second best."""


@dataclass(frozen=True)
class Matches:
    """Positions (x, y) of the same points in both views, in px; the centre of the first pixel is (0, 0)."""

    left: NDArray[np.float64]
    """(N, 2)."""
    right: NDArray[np.float64]
    """(N, 2)."""
    features: tuple[int, int]
    """How many features the left and the right view have."""

    def __len__(self) -> int:
        return len(self.left)

    def __getitem__(self, chosen: NDArray[np.bool_]) -> Matches:
        return Matches(self.left[chosen], self.right[chosen], self.features)


def match_features(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> Matches:
    """Match the features of two views, (H, W, 3) uint8 each, which need not be rectified or of one size."""
    (points_left, described_left), (points_right, described_right) = _features(left), _features(right)
    counts = len(points_left), len(points_right)
    if min(counts) < 2:
        nothing = np.zeros((0, 2))
        return Matches(nothing, nothing, counts)
    similarity = described_left @ described_right.T
    best = similarity.argmax(axis=1)
    rows = np.arange(len(best))
    mutual = similarity.argmax(axis=0)[best] == rows
    nearest = similarity[rows, best]
    similarity[rows, best] = -1
    # Of unit vectors the squared distance is 2 - 2 * similarity.
    closer = (1 - nearest).clip(min=0) < RATIO**2 * (1 - similarity.max(axis=1))
    chosen = mutual & closer
    return Matches(points_left[chosen], points_right[best[chosen]], counts)


def _features(view: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Positions (N, 2) and descriptors (N, 128) of length 1, compared as Arandjelovic and Zisserman do (CVPR 2012)."""
    grey = cv2.cvtColor(view, cv2.COLOR_RGB2GRAY)
    scale = min(1.0, LONGEST_PX / max(grey.shape))
    if scale < 1:
        height, width = (max(1, round(side * scale)) for side in grey.shape)
        grey = cv2.resize(grey, (width, height), interpolation=cv2.INTER_AREA)
    found, descriptors = cv2.SIFT.create(nfeatures=MOST_FEATURES).detectAndCompute(grey, None)
    if not found:
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32)
    back = np.array([view.shape[1] / grey.shape[1], view.shape[0] / grey.shape[0]])
    points = (np.array([point.pt for point in found], np.float64) + 0.5) * back - 0.5
    shares = descriptors / np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-6)
    return points, np.sqrt(shares)
