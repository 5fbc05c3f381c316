"""The layout of KITTI 2015's stereo benchmark (Menze and Geiger, CVPR 2015; its devkit's readme and io code).

    training/image_2/000000_10.png       left image            training/image_3/...   right image
    training/disp_occ_0/000000_10.png    all pixels            training/disp_noc_0/... pixels visible in the right view
    training/obj_map/000000_10.png       0 background, else a vehicle's number (KITTI's foreground is its cars)
    training/calib_cam_to_cam/000000.txt projections of both cameras

The disparity is a 16-bit PNG file of 256 times the pixels. 0 is invalid, and so is the sky.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.samples import StereoDataset, StereoSample
from datagen.export.lidar import lidar_mask
from datagen.formats import write_png
from datagen.sources.kitti import FRAME_LIST, UNITS_PER_PX
from scenes.shapes.street.vehicles import VEHICLE_PARTS
from scenes.spec import Scene, StereoCamera
from scenes.streets.traffic import vehicle_of
from stereoforge_kit.files import Tree

FOLDERS = {"train": "training", "val": "validation", "test": "testing"}
"""The folder of each split. KITTI has no validation set and no ground truth of its testing set; here all have it."""
VEHICLE_NUMBERS = 255
"""Numbers in an object map, which has 8 bits. After so many vehicles they begin again at 1; 0 is background."""


def export_kitti(
    sets: Sequence[StereoDataset],
    out: Tree,
    lidar_beams: int | None,
    progress: Callable[[int, int], None],
) -> list[str]:
    """Write the frames of each split, numbered from 0, and `frames.txt` with their names.

    Returns a sentence if disparities became invalid because they are too large to store.

    Args:
        sets: One data set for each split.
        out: The folder or URL to write to.
        lidar_beams: Keep only what a laser scanner with so many beams would measure; None for all pixels.
        progress: Called with (frames done, frames in all).

    Raises:
        DatasetError: For damaged files.
    """
    total, done, too_large = sum(map(len, sets)), 0, 0.0
    for frames in sets:
        folder, names = FOLDERS[frames.split], []
        for number, sample in enumerate(frames):
            _write_frame(out, folder, number, sample, lidar_beams)
            too_large += share_too_large(sample.disparity_left)
            names.append(f"{number:06d}_10 {sample.name}\n")
            done += 1
            progress(done, total)
        out.write(f"{folder}/{FRAME_LIST}", "".join(names).encode())
    if not too_large:
        return []
    return [
        f"KITTI stores no disparity of 256 px and more: {too_large / total:.2%} of the pixels became invalid"
    ]


def share_too_large(disparity: NDArray[np.float32]) -> float:
    """The share (0..1) of the pixels of a disparity (H, W) in px that are finite and too large to store."""
    scaled = np.rint(disparity.astype(np.float64) * UNITS_PER_PX)
    return float((np.isfinite(scaled) & (scaled > np.iinfo(np.uint16).max)).mean())


def encode_disparity(disparity: NDArray[np.float32], keep: NDArray[np.bool_]) -> NDArray[np.uint16]:
    """(H, W) uint16 KITTI numbers of a disparity (H, W) in px.

    They are 0 where the mask `keep` (H, W) is False and where the disparity is not finite, not above 0 (infinitely far)
    or too large to store.
    """
    scaled = np.rint(np.nan_to_num(disparity).astype(np.float64) * UNITS_PER_PX)
    storable = keep & (disparity > 0) & (scaled <= np.iinfo(np.uint16).max)
    # A valid disparity must not become invalid by rounding; KITTI's own writer raises it to 1 too.
    return np.where(storable, np.maximum(scaled, 1), 0).astype(np.uint16)


def vehicle_numbers(scene: Scene) -> NDArray[np.uint8]:
    """(objects + 1,) the number in KITTI's object map for every object index.

    It is 0 for what is no part of a vehicle. Body, glass, lamps and wheels of one vehicle share a number.
    """
    numbers = np.zeros(len(scene.objects) + 1, np.uint8)
    seen: dict[str, int] = {}
    for index, thing in enumerate(scene.objects, start=1):
        if isinstance(thing.shape, VEHICLE_PARTS):
            vehicle = seen.setdefault(vehicle_of(thing.name), len(seen))
            numbers[index] = vehicle % VEHICLE_NUMBERS + 1
    return numbers


def _write_frame(out: Tree, folder: str, number: int, sample: StereoSample, lidar_beams: int | None) -> None:
    scene = sample.scene_record
    camera = scene.camera
    measured = np.ones(sample.size, bool)
    if lidar_beams is not None:
        measured = lidar_mask(camera, lidar_beams)
    images: dict[str, NDArray[np.uint8] | NDArray[np.uint16]] = {
        "image_2": sample.left,
        "image_3": sample.right,
        "disp_occ_0": encode_disparity(sample.disparity_left, measured),
        "disp_noc_0": encode_disparity(sample.disparity_left, measured & (sample.occlusion_left == 0)),
        "obj_map": vehicle_numbers(scene)[sample.object_index_left],
    }
    for kind, image in images.items():
        with out.writing(f"{folder}/{kind}/{number:06d}_10.png") as path:
            write_png(path, image)
    out.write(f"{folder}/calib_cam_to_cam/{number:06d}.txt", _calibration(camera).encode())


def _calibration(camera: StereoCamera) -> str:
    """The rectified projections. KITTI has pixel centres at whole numbers."""
    fx, fy, lines = camera.focal_px, camera.focal_y_px, []
    for view, number, offset in (("left", "02", 0.0), ("right", "03", -camera.disparity_metres)):
        x, y = (center - 0.5 for center in camera.principal_point(view))
        matrix = (fx, 0.0, x, offset, 0.0, fy, y, 0.0, 0.0, 0.0, 1.0, 0.0)
        lines.append(f"S_rect_{number}: {camera.width:e} {camera.height:e}\n")
        lines.append(f"P_rect_{number}: {' '.join(f'{value:.12e}' for value in matrix)}\n")
    return "".join(lines)
