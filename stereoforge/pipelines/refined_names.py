"""Names of the files that hold what `StereoRefiner` found for a pair; nothing else is imported to know them."""

from __future__ import annotations

DISPARITY = "disparity.pfm"
"""The refined disparity."""
OVERVIEW = "overview.png"
"""Written last: where it is, all the others are."""
FILES = (
    DISPARITY,
    "disparity_initial.pfm",
    "confidence.pfm",
    "deviation.pfm",
    "gradient.exr",
    "depth.exr",
    "depth.npy",
    "depth.png",
    "points.ply",
    OVERVIEW,
)
"""All that a pair can have."""
