"""The layout of KITTI 2015's stereo benchmark (Menze and Geiger, CVPR 2015; its devkit's readme and io code).

    training/image_2/000000_10.png       left image            training/image_3/...   right image
    training/disp_occ_0/000000_10.png    all pixels            training/disp_noc_0/... pixels visible in the right view
    training/obj_map/000000_10.png       0 background, else a vehicle's number (KITTI's foreground is its cars)
    training/calib_cam_to_cam/000000.txt projections of both cameras

The disparity is a 16-bit PNG file of 256 times the pixels. 0 is invalid, and so is the sky. Of data sets with optical
flow or disparity change the frames that have a next one have also, as KITTI's scene flow:

    training/image_2/000000_11.png       the next left image       training/image_3/...   the next right image
    training/flow_occ/000000_10.png      the left flow to it: 16 bits, 64 u + 2^15, 64 v + 2^15, and 1 where it is valid
    training/disp_occ_1/000000_10.png    the disparity that each pixel's point has there
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.samples import StereoDataset, StereoSample
from datagen.export.lidar import lidar_mask
from datagen.formats import write_png
from datagen.formats.disparity import PNG_UNITS_PER_PX, to_units
from datagen.sources.kitti import FRAME_LIST
from scenes.shapes.street.vehicles import VEHICLE_PARTS
from scenes.spec import Scene, StereoCamera
from scenes.streets.traffic import vehicle_of
from stereoforge_kit.files import Tree

FOLDERS = {"train": "training", "val": "validation", "test": "testing"}
"""The folder of each split. KITTI has no validation set and no ground truth of its testing set; here all have it."""
FLOW_UNITS_PER_PX, FLOW_ZERO = 64, 2**15
"""Of the 16-bit flow files."""
VEHICLE_NUMBERS = 255
"""Numbers in an object map, which has 8 bits. After so many vehicles they begin again at 1; 0 is background."""

Images = dict[str, NDArray[np.uint8] | NDArray[np.uint16]]
"""By the folder that they go to."""


def export_kitti(
    sets: Sequence[StereoDataset],
    out: Tree,
    lidar_beams: int | None,
    progress: Callable[[int, int], None],
) -> list[str]:
    """Write the frames of each split, numbered from 0, and `frames.txt` with their names.

    Of data sets with flow the last frames of the scenes come last, since they have no next one: readers pair the sorted
    files of each folder.

    Returns sentences about what is not as in the data set: values that are too large to store, frames without flow.

    Args:
        sets: One data set for each split.
        out: The folder or URL to write to.
        lidar_beams: Keep only what a laser scanner with so many beams would measure; None for all pixels.
        progress: Called with (frames done, frames in all).

    Raises:
        DatasetError: For damaged files.
    """
    total, done, losses = sum(map(len, sets)), 0, _Losses()
    for frames in sets:
        folder, names = FOLDERS[frames.split], []
        for number, (sample, following) in enumerate(_in_order(frames)):
            _write_frame(out, folder, number, sample, lidar_beams)
            if following is not None:
                _write_motion(out, folder, number, sample, following, lidar_beams, losses)
            losses.last_frames += following is None and _has_motion(sample)
            losses.disparity += share_too_large(sample.disparity_left)
            names.append(f"{number:06d}_10 {sample.name}\n")
            done += 1
            progress(done, total)
        out.write(f"{folder}/{FRAME_LIST}", "".join(names).encode())
    return losses.sentences(total)


@dataclass
class _Losses:
    """What became invalid in an export, or has no place in it."""

    disparity: float = 0.0
    """Sum over the frames of the share of pixels whose disparity is too large to store."""
    flow: float = 0.0
    """The same of the flow."""
    last_frames: int = 0
    """Frames whose flow leads to no picture."""

    def sentences(self, frames: int) -> list[str]:
        said = []
        if self.disparity:
            said.append(
                f"KITTI stores no disparity of 256 px and more: {self.disparity / frames:.2%} of the pixels became "
                "invalid"
            )
        if self.flow:
            said.append(
                f"KITTI stores no flow of 512 px and more: {self.flow / frames:.2%} of the pixels became invalid"
            )
        if self.last_frames:
            said.append(
                f"{self.last_frames} of {frames} frames are the last of their scenes: they have no next picture and so "
                "no flow, and are numbered last"
            )
        return said


def _in_order(frames: StereoDataset) -> list[tuple[StereoSample, StereoSample | None]]:
    """The frames of a split, each with the next one of its scene if it is to be written: those that have one first."""
    samples = list(frames)
    if not samples or not _has_motion(samples[0]):
        return [(sample, None) for sample in samples]
    following = {(sample.scene, sample.frame - 1): sample for sample in samples}
    pairs = [(sample, following.get((sample.scene, sample.frame))) for sample in samples]
    return sorted(pairs, key=lambda pair: pair[1] is None)


def _has_motion(sample: StereoSample) -> bool:
    return any(_has_future(sample, kind) for kind in ("optical_flow", "disparity_change"))


def _has_future(sample: StereoSample, kind: str) -> bool:
    path = sample.layout.file(kind, sample.split, sample.scene, "left", sample.frame, "into_future")
    return sample.has(path)


def share_too_large(disparity: NDArray[np.float32]) -> float:
    """The share (0..1) of the pixels of a disparity (H, W) in px that are finite and too large to store."""
    scaled = np.rint(disparity.astype(np.float64) * PNG_UNITS_PER_PX)
    return float((np.isfinite(scaled) & (scaled > np.iinfo(np.uint16).max)).mean())


def encode_disparity(disparity: NDArray[np.float32], keep: NDArray[np.bool_]) -> NDArray[np.uint16]:
    """(H, W) uint16 KITTI numbers of a disparity (H, W) in px.

    They are 0 where the mask `keep` (H, W) is False and where the disparity is not finite, not above 0 (infinitely far)
    or too large to store.
    """
    scaled = np.rint(np.nan_to_num(disparity).astype(np.float64) * PNG_UNITS_PER_PX)
    storable = keep & (disparity > 0) & (scaled <= np.iinfo(np.uint16).max)
    return to_units(np.where(storable, disparity, np.nan), PNG_UNITS_PER_PX)


def encode_flow(flow: NDArray[np.float32], keep: NDArray[np.bool_]) -> NDArray[np.uint16]:
    """(H, W, 3) uint16 KITTI numbers of a flow (H, W, 2) in px, to the right and down, and its validity.

    All three are 0 where the mask `keep` (H, W) is False and where the flow is not finite or too large to store.
    """
    finite = np.isfinite(flow).all(axis=2)
    scaled = np.rint(np.where(finite[..., None], flow, 0).astype(np.float64) * FLOW_UNITS_PER_PX) + FLOW_ZERO
    valid = keep & finite & ((scaled >= 0) & (scaled <= np.iinfo(np.uint16).max)).all(axis=2)
    return np.where(valid[..., None], np.concatenate([scaled, valid[..., None]], axis=2), 0).astype(np.uint16)


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
    measured = _measured(sample, lidar_beams)
    _write_images(
        out,
        folder,
        f"{number:06d}_10.png",
        {
            "image_2": sample.left,
            "image_3": sample.right,
            "disp_occ_0": encode_disparity(sample.disparity_left, measured),
            "disp_noc_0": encode_disparity(sample.disparity_left, measured & (sample.occlusion_left == 0)),
            "obj_map": vehicle_numbers(scene)[sample.object_index_left],
        },
    )
    out.write(f"{folder}/calib_cam_to_cam/{number:06d}.txt", _calibration(camera).encode())


def _write_motion(
    out: Tree,
    folder: str,
    number: int,
    sample: StereoSample,
    following: StereoSample,
    lidar_beams: int | None,
    losses: _Losses,
) -> None:
    """Write what leads from a frame to the next one of its scene, and that one's pictures."""
    measured = _measured(sample, lidar_beams)
    pictures: Images = {"image_2": following.left, "image_3": following.right}
    _write_images(out, folder, f"{number:06d}_11.png", pictures)
    targets: Images = {}
    if _has_future(sample, "optical_flow"):
        flow = sample.flow("left", "into_future")
        targets["flow_occ"] = encode_flow(flow, measured)
        everywhere = encode_flow(flow, np.ones(sample.size, bool))[..., 2]
        losses.flow += float((np.isfinite(flow).all(axis=2) & (everywhere == 0)).mean())
    if _has_future(sample, "disparity_change"):
        then = sample.disparity_left + sample.disparity_change("left", "into_future")
        targets["disp_occ_1"] = encode_disparity(then, measured & (sample.disparity_left > 0))
    _write_images(out, folder, f"{number:06d}_10.png", targets)


def _measured(sample: StereoSample, lidar_beams: int | None) -> NDArray[np.bool_]:
    """(H, W) True where there is to be ground truth."""
    if lidar_beams is None:
        return np.ones(sample.size, bool)
    return lidar_mask(sample.scene_record.camera, lidar_beams)


def _write_images(out: Tree, folder: str, name: str, images: Images) -> None:
    for kind, image in images.items():
        with out.writing(f"{folder}/{kind}/{name}") as path:
            write_png(path, image)


def _calibration(camera: StereoCamera) -> str:
    """The rectified projections. KITTI has pixel centres at whole numbers."""
    fx, fy, lines = camera.focal_px, camera.focal_y_px, []
    for view, number, offset in (("left", "02", 0.0), ("right", "03", -camera.disparity_metres)):
        x, y = (center - 0.5 for center in camera.principal_point(view))
        matrix = (fx, 0.0, x, offset, 0.0, fy, y, 0.0, 0.0, 0.0, 1.0, 0.0)
        lines.append(f"S_rect_{number}: {camera.width:e} {camera.height:e}\n")
        lines.append(f"P_rect_{number}: {' '.join(f'{value:.12e}' for value in matrix)}\n")
    return "".join(lines)
