"""The files that hold what `StereoRefiner` found for a pair."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.cameras.calibration import Calibration
from datagen.cameras.reprojection import points_of_depth
from datagen.formats import write_gradient, write_pfm, write_png
from datagen.formats.depth_exr import write_depth
from datagen.formats.depth_png import FARTHEST_M, write_depth_png
from datagen.formats.disparity import PNG_UNITS_PER_PX, write_disparity
from datagen.formats.point_cloud import write_point_cloud
from datagen.ground_truth.labels import gradient_validity
from refine.report.overview import overview_picture
from stereoforge.pipelines.prediction import Image
from stereoforge.pipelines.refined_names import DISPARITY, OVERVIEW
from stereoforge.pipelines.refiner import RefinedPair
from stereoforge_kit.files import replacing

LARGEST_PNG_PX = np.iinfo(np.uint16).max / PNG_UNITS_PER_PX
"""The largest disparity that a 16-bit PNG file holds."""
STEP_PX = 1.0
"""A pixel whose disparity differs by more from a neighbour's lies at the edge of a surface, and its point may hang in
the air between that surface and the next."""


def write_refined(
    out: Path,
    left: Image,
    refined: RefinedPair,
    calibration: Calibration | None,
    min_confidence: float,
    also_as: tuple[str, ...] = (),
) -> list[str]:
    """Write what was found for one pair, and return remarks about it.

    Args:
        out: The pair's folder.
        left: (H, W, 3) uint8, the left view.
        refined: What was found.
        calibration: Of the pair; None writes neither depth nor points.
        min_confidence: Pixels of lower confidence are no points.
        also_as: Endings of the formats that the disparity is written in besides PFM.
    """
    remarks: list[str] = []
    # A slope is predicted everywhere; only the differences inside the image exist.
    inside = gradient_validity(refined.gradient, float("inf"))
    write_pfm(out / DISPARITY, refined.disparity)
    write_pfm(out / "disparity_initial.pfm", refined.initial)
    write_pfm(out / "confidence.pfm", refined.confidence)
    if refined.deviation is not None:
        write_pfm(out / "deviation.pfm", refined.deviation)
    write_gradient(out / "gradient.exr", refined.gradient, inside)
    for ending in also_as:
        remarks += write_found(out / f"disparity{ending}", refined.disparity)
    if calibration is not None:
        remarks += _write_depth(out, left, refined, calibration, min_confidence)
    picture = overview_picture(
        left, refined.initial, refined.confidence, refined.disparity, refined.deviation
    )
    write_png(out / OVERVIEW, picture)
    return remarks


def write_found(path: Path, disparity: NDArray[np.float32]) -> list[str]:
    """Write a disparity (H, W) px in the format of the file's ending, and return a remark if that does not hold all."""
    if path.suffix != ".png":
        write_disparity(path, disparity)
        return []
    held = disparity <= LARGEST_PNG_PX
    write_disparity(path, np.where(held, disparity, np.float32(np.nan)))
    if held.all():
        return []
    return [
        f"{path.name} holds no disparity above {LARGEST_PNG_PX:.0f} px: {1 - held.mean():.1%} of the pixels are 0"
    ]


def _write_depth(
    out: Path, left: Image, refined: RefinedPair, calibration: Calibration, min_confidence: float
) -> list[str]:
    """Depth in three formats, and the coloured points."""
    remarks = []
    depth = refined.depth(calibration).astype(np.float32)
    write_depth(out / "depth.exr", depth)
    with replacing(out / "depth.npy") as temporary, temporary.open("wb") as file:
        np.save(file, depth)
    if too_far := write_depth_png(out / "depth.png", depth):
        remarks.append(f"depth.png holds no depth beyond {FARTHEST_M:g} m: {too_far:.1%} of the pixels are 0")
    kept, said = points_kept(refined, depth, min_confidence)
    if kept.any():
        write_point_cloud(out / "points.ply", points_of_depth(depth, calibration)[kept], left[kept])
    return [*remarks, said]


def points_kept(
    refined: RefinedPair, depth: NDArray[np.float32], min_confidence: float
) -> tuple[NDArray[np.bool_], str]:
    """Which pixels become points, (H, W), and a sentence that says why the others do not."""
    reasons = {
        "at infinity": ~np.isfinite(depth),
        f"of a confidence below {min_confidence:g}": refined.confidence < min_confidence,
        f"at edges (more than {STEP_PX:g} px from a neighbour)": _beside_steps(refined.disparity),
    }
    kept = np.ones(depth.shape, dtype=bool)
    left_out = []
    for reason, pixels in reasons.items():
        if (share := float((kept & pixels).mean())) > 0:
            left_out.append(f"{share:.1%} {reason}")
        kept &= ~pixels
    said = f"points.ply: {kept.mean():.1%} of the pixels" if kept.any() else "no pixel became a point"
    return kept, said + (f"; left out: {', '.join(left_out)}" if left_out else "")


def _beside_steps(disparity: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(H, W): pixels on either side of a step."""
    beside = np.zeros(disparity.shape, dtype=bool)
    across, down = (np.abs(np.diff(disparity, axis=axis)) > STEP_PX for axis in (1, 0))
    beside[:, :-1] |= across
    beside[:, 1:] |= across
    beside[:-1] |= down
    beside[1:] |= down
    return beside
