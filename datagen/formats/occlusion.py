"""Occlusion labels as grey PNG: 0 visible, 1 occluded, 2 out of the other frame; on disk 0, 255, 128.

Any value above 0 therefore means "not visible in the other view" to a reader that knows only two classes, as
Sintel's and FlyingThings3D's masks do.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.png import read_png, write_png

_NO_LABEL = 3
_GREYS = np.array([0, 255, 128], np.uint8)
_LABELS = np.full(256, _NO_LABEL, np.uint8)
_LABELS[_GREYS] = [0, 1, 2]


def read_occlusion(path: Path | str) -> NDArray[np.uint8]:
    """Read occlusion labels, (H, W) uint8 of 0, 1, 2. Raises FormatError."""
    return labels_of(read_png(path), str(path))


def labels_of(greys: NDArray[np.uint8] | NDArray[np.uint16], origin: str) -> NDArray[np.uint8]:
    """Labels of the grey values that stand for them; `origin` names the file in errors. Raises FormatError."""
    if greys.ndim != 2 or greys.dtype != np.uint8:
        raise FormatError(f"{origin}: occlusion is 8-bit grey, not {greys.dtype} of shape {greys.shape}")
    labels = _LABELS[greys]
    if (labels == _NO_LABEL).any():
        value = greys[labels == _NO_LABEL][0]
        raise FormatError(
            f"{origin}: grey {value} is no occlusion label (0 visible, 255 occluded, 128 out of frame)"
        )
    return labels


def write_occlusion(path: Path | str, labels: NDArray[np.uint8]) -> None:
    """Write occlusion labels, (H, W) uint8 of 0, 1, 2. Raises FormatError for other values."""
    if labels.dtype != np.uint8 or labels.ndim != 2 or (labels >= len(_GREYS)).any():
        raise FormatError(
            f"{path}: occlusion labels are (H, W) uint8 of 0, 1, 2, not {labels.shape} of {labels.dtype} "
            f"up to {labels.max(initial=0)}"
        )
    write_png(path, _GREYS[labels])
