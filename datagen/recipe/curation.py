"""Rejecting scenes that are of no use for training, by casting rays before anything is rendered.

A rejected scene is sampled again from another random stream, that of its next attempt. So a data set with rejections
is as reproducible as one without.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.statistics import textured_share
from datagen.errors import DatasetError
from datagen.formats.occlusion import VISIBLE
from datagen.ground_truth.raycast import SceneRayCaster

TEXTURELESS = "textureless"
"""Why `is_textureless` rejects a scene."""
RAYS_ACROSS = 48
"""Columns of the coarse grid of pixels through which rays are cast; rows in proportion."""


@dataclass(frozen=True)
class Curation:
    """When a frame is degenerate. Shares are of the left view's pixels, 0 to 1.

    Raises DatasetError for wrong values.
    """

    enabled: bool = True
    """Whether scenes are rejected at all."""
    attempts: int = 20
    """How often a scene is sampled before it fails."""
    max_inside: float = 0.3
    """Share that may show the back of one object; if it is more, the camera is inside the object."""
    max_one_object: float = 0.9
    """Share that one object, or the sky, may fill."""
    max_occluded: float = 0.7
    """Share that may be invisible in the right view: occluded or out of frame."""
    min_textured: float = 0.05
    """Share of the rendered picture that must have texture."""
    disparity_px: tuple[float, float] | None = None
    """Least and greatest disparity that surfaces shall have, met by choosing depths and baseline; None for whatever
    the family gives."""
    max_outside: float = 0.02
    """Share of the surfaces whose disparity may be outside that range."""

    def __post_init__(self) -> None:
        if self.attempts < 1:
            raise DatasetError(f"curation attempts must be at least 1, got {self.attempts}")
        for name in ("max_inside", "max_one_object", "max_occluded", "min_textured", "max_outside"):
            if not 0 <= getattr(self, name) <= 1:
                raise DatasetError(f"curation {name} must be in 0..1, got {getattr(self, name):g}")
        if self.disparity_px and not 0 <= self.disparity_px[0] < self.disparity_px[1]:
            raise DatasetError(
                f"curation disparity_px must be (least, greatest), got {tuple(self.disparity_px)}"
            )


def fault_before_rendering(caster: SceneRayCaster, curation: Curation) -> str | None:
    """What is wrong with the scene's first or last frame, in a few words; None if nothing is."""
    if not curation.enabled:
        return None
    # The first frame last: it is the one that the caster will be asked for next.
    for frame in sorted({0, caster.geometry.scene.frames - 1}, reverse=True):
        for fault in _faults(caster, curation, frame):
            return fault
    return None


def share_outside(surfaces: NDArray[np.floating[Any]], curation: Curation) -> float:
    """Share of the surfaces' disparities (P,) in px that are outside the range asked for.

    It is 0 without surfaces or without a range.
    """
    if not curation.disparity_px or not len(surfaces):
        return 0.0
    low, high = curation.disparity_px
    return float(((surfaces < low) | (surfaces > high)).mean())


def is_textureless(image: NDArray[np.uint8], curation: Curation) -> bool:
    """Whether a rendered (H, W, 3) sRGB picture has too little texture to be matched."""
    return curation.enabled and textured_share(image) < curation.min_textured


def _faults(caster: SceneRayCaster, curation: Curation, frame: int) -> Iterator[str]:
    scene = caster.geometry.scene
    rows, columns = caster.coarse_pixels(RAYS_ACROSS)
    hits = caster.cast("left", frame, rows, columns)
    counts = np.bincount(hits.object_index, minlength=len(scene.objects) + 1) / len(rows)
    from_behind = caster.shows_back(frame, rows, columns)
    inner = np.bincount(hits.object_index[from_behind], minlength=len(counts)) / len(rows)
    if inner.max() > curation.max_inside:
        yield "camera inside an object"
    if counts.max() > curation.max_one_object:
        yield "one surface fills the view"
    if (hits.occlusion != VISIBLE).mean() > curation.max_occluded:
        yield "mostly occluded or out of frame"
    if share_outside(hits.disparity[hits.object_index > 0], curation) > curation.max_outside:
        yield "disparity out of range"
