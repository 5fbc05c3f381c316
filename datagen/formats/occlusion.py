"""Occlusion labels and their grey PNG files.

A pixel of one view is visible in the other view (0; grey 0 on disk), occluded there (1; 255), or out of that view's
frame (2; 128). To a reader that knows only two classes, as those of Sintel's masks, any grey above 0 means "not
visible in the other view".
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.png import read_png, write_png

VISIBLE, OCCLUDED, OUT_OF_FRAME = 0, 1, 2
"""The labels of an occlusion map."""
_NO_LABEL = 3
_GREYS = np.array([0, 255, 128], np.uint8)
_LABELS = np.full(256, _NO_LABEL, np.uint8)
_LABELS[_GREYS] = [VISIBLE, OCCLUDED, OUT_OF_FRAME]


def read_occlusion(path: Path | str) -> NDArray[np.uint8]:
    """Read occlusion labels: (H, W) uint8 of VISIBLE, OCCLUDED and OUT_OF_FRAME.

    Raises FormatError for a file that is missing, damaged, not 8-bit grey or of other greys. `write_occlusion` has
    an example.
    """
    return labels_of(read_png(path), str(path))


def labels_of(greys: NDArray[np.uint8] | NDArray[np.uint16], origin: str) -> NDArray[np.uint8]:
    """The (H, W) uint8 labels that the grey values (H, W) of a file stand for.

    `origin` names the file in errors. Raises FormatError for greys that stand for no label, or another type of
    image.

    >>> labels_of(np.array([[0, 255, 128]], np.uint8), "occlusion.png").tolist()
    [[0, 1, 2]]
    """
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
    """Write occlusion labels: (H, W) uint8 of VISIBLE, OCCLUDED and OUT_OF_FRAME.

    Raises FormatError for other values, types or shapes.

    >>> import tempfile
    >>> labels = np.array([[OUT_OF_FRAME, VISIBLE, OCCLUDED]], np.uint8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "occlusion.png"
    ...     write_occlusion(path, labels)
    ...     greys, again = read_png(path), read_occlusion(path)
    >>> greys.tolist(), again.tolist()
    ([[128, 0, 255]], [[2, 0, 1]])
    """
    if labels.dtype != np.uint8 or labels.ndim != 2 or (labels >= len(_GREYS)).any():
        raise FormatError(
            f"{path}: occlusion labels are (H, W) uint8 of 0, 1, 2, not {labels.shape} of {labels.dtype} "
            f"up to {labels.max(initial=0)}"
        )
    write_png(path, _GREYS[labels])
