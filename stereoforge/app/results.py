"""What the page shows of a pair: pure functions from pictures and settings to maps, pictures, points and files."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.cameras.calibration import Calibration
from datagen.cameras.registry import read_calibration
from datagen.cameras.reprojection import points_of_depth
from datagen.formats.point_cloud import write_point_cloud
from stereoforge.errors import CommandError
from stereoforge.inputs.images import pair_doubts, read_color_images
from stereoforge.inputs.rig_flags import KnownRig, SimpleRig
from stereoforge.pipelines.doubts import result_doubts, view_doubts
from stereoforge.pipelines.prediction import Image
from stereoforge.pipelines.refined_files import points_kept, write_found
from stereoforge.pipelines.refiner import RefinedPair, StereoRefiner
from stereoforge_kit.errors import InputError, UserError
from stereoforge_kit.viewing import Picture, confidence_picture, disparity_picture
from training.prediction.predictor import Prediction

MOST_PIXELS = 4_000_000
"""Of a picture on the page: about a minute of two cores."""
BRIGHTEST = 99.5
"""Percentile of the refined disparity that has the brightest colour, so that a few wild pixels darken nothing."""
FILE_CONTENTS = {
    "disparity.pfm": "pixels, 32-bit",
    "disparity.png": "1/256 of a pixel, 16-bit, as KITTI has it",
    "disparity.npy": "pixels, float32",
    "confidence.pfm": "0 to 1, 32-bit",
    "points.ply": "metres, coloured",
}
"""What can be downloaded, by the names of the files."""


@dataclass(frozen=True)
class ReadPair:
    """Two views of one size, and what is to be said of them."""

    left: Image
    right: Image
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class Found:
    """What was found for a pair, and what it takes to refine it again."""

    pair: ReadPair
    prediction: Prediction
    refined: RefinedPair
    strength: float
    seconds: float
    """Of the networks and the refinement."""


def read_pair(left: Path | None, right: Path | None) -> ReadPair:
    """Read both pictures.

    Raises CommandError, with the names of the files and without their folders, for one that is missing, damaged, too
    large or of another size than its partner.
    """
    if left is None or right is None:
        raise CommandError(f"the {'right' if right is None and left else 'left'} picture is missing")
    try:
        views = read_color_images(left, right)
    except UserError as error:
        raise CommandError(_without_folders(error, left, right)) from error
    (height, width), (other_height, other_width) = (view.shape[:2] for view in views[:2])
    if (width, height) != (other_width, other_height):
        raise CommandError(
            f"the pictures differ in size: the left one has {width}x{height} pixels, the right one "
            f"{other_width}x{other_height}; a rectified pair has one size"
        )
    if width * height > MOST_PIXELS:
        raise CommandError(
            f"the pictures have {width}x{height} pixels, more than the {MOST_PIXELS / 1e6:g} million that this page "
            "takes; stereoforge refine takes them"
        )
    odd = pair_doubts(*views[:2])
    return ReadPair(views[0], views[1], (*views[2], *(odd or view_doubts(*views[:2]))))


def find(refiner: StereoRefiner, pair: ReadPair, strength: float) -> Found:
    """Predict and refine. Raises as `StereoRefiner.predict` and `refine` do."""
    start = time.perf_counter()
    prediction = refiner.predict(pair.left, pair.right)
    refined = refiner.refine(pair.left, prediction, strength=strength)
    return Found(pair, prediction, refined, strength, time.perf_counter() - start)


def find_again(refiner: StereoRefiner, found: Found, strength: float) -> Found:
    """The same with another strength; the networks are not asked again."""
    if strength == found.strength:
        return found
    start = time.perf_counter()
    refined = refiner.refine(found.pair.left, found.prediction, strength=strength)
    return Found(found.pair, found.prediction, refined, strength, time.perf_counter() - start)


def rig_of(
    file: Path | None, focal_px: float | None, baseline_m: float | None, doffs: float | None
) -> KnownRig | None:
    """The rig of a calibration file or, without one, of its numbers; None if nothing is said.

    Raises CommandError for a file that is no calibration, half of the numbers, or numbers that cannot be.
    """
    if file is not None:
        try:
            return KnownRig(read_calibration(file))
        except UserError as error:
            raise CommandError(_without_folders(error, file)) from error
    if focal_px is None and baseline_m is None:
        return None
    if focal_px is None or baseline_m is None:
        raise CommandError("depth needs both the focal length and the baseline, or a calibration file")
    if not (focal_px > 0 and baseline_m > 0):
        raise CommandError("the focal length and the baseline must be positive")
    return KnownRig(SimpleRig(focal_px, baseline_m, doffs or 0.0))


def calibration_of(rig: KnownRig | None, pair: ReadPair) -> tuple[Calibration | None, list[str]]:
    """The calibration of these pictures, None without a rig, and remarks about it.

    Raises CommandError for a calibration of pictures of another shape.
    """
    if rig is None:
        return None, []
    height, width = pair.left.shape[:2]
    return rig.calibration((width, height))


def pictures_of(refined: RefinedPair) -> tuple[Picture, Picture, Picture]:
    """Initial disparity, refined disparity and confidence as pictures; both disparities have one scale."""
    brightest = brightest_of(refined)
    return (
        disparity_picture(refined.initial, brightest),
        disparity_picture(refined.disparity, brightest),
        confidence_picture(refined.confidence),
    )


def brightest_of(refined: RefinedPair) -> float:
    """Disparity in px of the brightest colour."""
    return max(float(np.percentile(refined.disparity, BRIGHTEST)), 1.0)


def summary(found: Found) -> list[str]:
    """The result in a sentence, then what is odd about it."""
    disparity = found.refined.disparity
    height, width = disparity.shape
    return [
        f"{width}x{height} pixels, disparity {disparity.min():.1f} to {disparity.max():.1f} px, found in "
        f"{found.seconds:.1f} s",
        *found.pair.remarks,
        *result_doubts(found.refined),
    ]


def value_at(refined: RefinedPair, calibration: Calibration | None, x: int, y: int) -> str:
    """The values of the pixel in column x and row y, in a sentence; empty outside of the picture."""
    height, width = refined.disparity.shape
    if not (0 <= x < width and 0 <= y < height):
        return ""
    said = (
        f"x {x}, y {y}: disparity {refined.disparity[y, x]:.2f} px (before refining {refined.initial[y, x]:.2f}), "
        f"confidence {refined.confidence[y, x]:.2f}"
    )
    if calibration is None:
        return said
    depth = refined.depth(calibration)[y, x]
    return said + (f", depth {depth:.3f} m" if np.isfinite(depth) else ", infinitely far")


def point_cloud(
    found: Found, calibration: Calibration, min_confidence: float
) -> tuple[NDArray[np.float64], NDArray[np.uint8], str]:
    """Points (N, 3) in metres, their colours (N, 3), and a sentence on what was left out."""
    if not 0 <= min_confidence <= 1:
        raise InputError(f"the least confidence of a point lies between 0 and 1, not at {min_confidence}")
    depth = found.refined.depth(calibration)
    kept, said = points_kept(found.refined, depth.astype(np.float32), min_confidence)
    return points_of_depth(depth, calibration)[kept], found.pair.left[kept], said


def write_files(
    folder: Path, found: Found, points: tuple[NDArray[np.float64], NDArray[np.uint8]] | None
) -> tuple[list[Path], list[str]]:
    """Write what can be downloaded into a folder; the files in the order of `FILE_CONTENTS`, and remarks."""
    remarks: list[str] = []
    maps = (*[found.refined.disparity] * 3, found.refined.confidence)
    for name, values in zip(FILE_CONTENTS, maps, strict=False):
        remarks += write_found(folder / name, values)
    if points is not None and len(points[0]):
        write_point_cloud(folder / "points.ply", *points)
    return [folder / name for name in FILE_CONTENTS if (folder / name).exists()], remarks


def _without_folders(error: UserError, *paths: Path) -> str:
    message = error.whole
    for path in paths:
        message = message.replace(str(path), path.name)
    return message
