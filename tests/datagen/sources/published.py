"""Data sets in their published encodings, written byte by byte and without the project's own writers."""

from __future__ import annotations

import io
import json
import struct
import tarfile
from dataclasses import dataclass
from pathlib import Path

import imageio.v3 as iio
import numpy as np
from numpy.typing import NDArray

HEIGHT, WIDTH = 12, 40


@dataclass(frozen=True)
class World:
    """A background at 2.25 px and a square at 10.5 px before it, both views, no two rows or images alike."""

    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    disparity_left: NDArray[np.float32]
    disparity_right: NDArray[np.float32]
    occlusion_left: NDArray[np.uint8]
    silhouette: NDArray[np.bool_]
    """Where labels derived from two disparity maps may err: within half a pixel of the square's edges."""


def world(seed: int = 0, units_per_px: int = 4) -> World:
    """The disparities are multiples of 1 / `units_per_px`, quarters for all but one of the encodings."""
    rng = np.random.default_rng(seed)
    left, right = (rng.integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8) for _ in range(2))
    rows = np.arange(HEIGHT, dtype=np.float32)[:, None] / 4
    disparity_left = np.broadcast_to(2.25 + rows, (HEIGHT, WIDTH)).astype(np.float32)
    disparity_left = np.rint(disparity_left * units_per_px) / np.float32(units_per_px)
    disparity_right = disparity_left.copy()
    nearest = np.float32(np.rint(10.5 * units_per_px)) / np.float32(units_per_px)
    first, last = 20 - nearest, 30 - nearest  # Where the square begins and ends in the right view.
    centers = np.arange(WIDTH) + 0.5
    disparity_left[4:8, 20:30] = nearest
    disparity_right[4:8, (centers > first) & (centers < last)] = nearest
    # Hidden: what of the background falls on the square in the right view.
    x_right = centers - disparity_left
    occlusion = np.zeros((HEIGHT, WIDTH), np.uint8)
    background = disparity_left < 10
    occlusion[4:8] = np.where(background & (x_right > first) & (x_right < last), 1, 0)[4:8]
    occlusion[x_right < 0] = 2
    edges = np.minimum(np.abs(x_right - first - 0.5), np.abs(x_right - last + 0.5))
    return World(left, right, disparity_left, disparity_right, occlusion, background & (edges <= 0.5))


def png(path: Path, array: NDArray[np.generic]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    iio.imwrite(path, array, extension=".png")


def jpeg(path: Path, array: NDArray[np.uint8]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    iio.imwrite(path, array, extension=".jpg", quality=95)


def pfm_bytes(array: NDArray[np.floating], scale: float = -1.0) -> bytes:
    """Rows from the bottom up; the scale's sign is the byte order."""
    height, width = array.shape
    code = "<" if scale < 0 else ">"
    rows = [struct.pack(f"{code}{width}f", *row) for row in array[::-1].tolist()]
    return f"Pf\n{width} {height}\n{scale}\n".encode() + b"".join(rows)


def pfm(path: Path, array: NDArray[np.floating], scale: float = -1.0) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(pfm_bytes(array, scale))


def pgm(path: Path, array: NDArray[np.uint8]) -> None:
    """P5 for grey, P6 for colour, with the comment that some programs leave there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    kind = "P5" if array.ndim == 2 else "P6"
    path.write_bytes(
        f"{kind}\n# made by a program\n{array.shape[1]} {array.shape[0]}\n255\n".encode() + array.tobytes()
    )


def flyingthings3d(root: Path) -> World:
    w = world()
    for part in ("TRAIN", "TEST"):
        base = f"{part}/B/0017"
        for folder in ("frames_cleanpass", "frames_finalpass"):
            png(root / folder / base / "left/0009.png", w.left)
            png(root / folder / base / "right/0009.png", w.right if folder == "frames_cleanpass" else w.left)
        pfm(root / "disparity" / base / "left/0009.pfm", w.disparity_left)
        pfm(root / "disparity" / base / "right/0009.pfm", w.disparity_right)
    return w


def flyingthings3d_subset(root: Path) -> World:
    """Flat folders, negative disparities."""
    w = world()
    for part in ("train", "val"):
        for view, image, truth in (("left", w.left, w.disparity_left), ("right", w.right, w.disparity_right)):
            png(root / part / "image_clean" / view / "0000017.png", image)
            pfm(root / part / "disparity" / view / "0000017.pfm", -truth)
    return w


def driving(root: Path) -> World:
    """The right view's disparities are negative there."""
    w = world()
    base = "15mm_focallength/scene_forwards/fast"
    png(root / "frames_cleanpass" / base / "left/0001.png", w.left)
    png(root / "frames_cleanpass" / base / "right/0001.png", w.right)
    pfm(root / "disparity" / base / "left/0001.pfm", w.disparity_left)
    pfm(root / "disparity" / base / "right/0001.pfm", -w.disparity_right)
    return w


def monkaa(root: Path) -> World:
    w = world()
    for view, image, truth in (("left", w.left, w.disparity_left), ("right", w.right, w.disparity_right)):
        png(root / "frames_cleanpass/eating_x2" / view / "0000.png", image)
        pfm(root / "disparity/eating_x2" / view / "0000.pfm", truth)
    return w


def sintel(root: Path) -> World:
    w = world()
    training = root / "training"
    for render_pass in ("clean", "final"):
        png(training / f"{render_pass}_left/alley_1/frame_0001.png", w.left)
        png(training / f"{render_pass}_right/alley_1/frame_0001.png", w.right)
    code = np.rint(w.disparity_left.astype(np.float64) * 2**14).astype(np.int64)
    colors = np.stack([code >> 16, (code >> 8) & 255, code & 255], axis=-1).astype(np.uint8)
    png(training / "disparities/alley_1/frame_0001.png", colors)
    png(
        training / "occlusions/alley_1/frame_0001.png",
        np.where(w.occlusion_left > 0, 255, 0).astype(np.uint8),
    )
    png(
        training / "outofframe/alley_1/frame_0001.png",
        np.where(w.occlusion_left == 2, 255, 0).astype(np.uint8),
    )
    return w


def _kitti_truths(folder: Path, w: World, names: tuple[str, str]) -> None:
    code = np.rint(w.disparity_left * 256).astype(np.uint16)
    code[::2] = 0  # sparse
    png(folder / names[0] / "000003_10.png", code)
    png(folder / names[1] / "000003_10.png", np.where(w.occlusion_left > 0, 0, code).astype(np.uint16))


def kitti2015(root: Path) -> World:
    w = world()
    folder = root / "training"
    for name, image in (("image_2", w.left), ("image_3", w.right)):
        png(folder / name / "000003_10.png", image)
        png(folder / name / "000003_11.png", image[::-1])
    _kitti_truths(folder, w, ("disp_occ_0", "disp_noc_0"))
    # The second frame's truth, which is not the right view's.
    png(folder / "disp_occ_1/000003_10.png", np.full((HEIGHT, WIDTH), 777, np.uint16))
    png(folder / "obj_map/000003_10.png", (w.disparity_left > 10).astype(np.uint8) * 3)
    return w


def kitti2012(root: Path) -> World:
    w = world()
    folder = root / "training"
    for name, image in (("colored_0", w.left), ("colored_1", w.right), ("image_0", w.left[..., 0])):
        png(folder / name / "000003_10.png", image)
    _kitti_truths(folder, w, ("disp_occ", "disp_noc"))
    return w


def middlebury(root: Path) -> World:
    """The version 3 benchmark: big endian is not used there, but the scale 1/255 is, and infinity."""
    w = world()
    scene = root / "trainingQ/Adirondack"
    png(scene / "im0.png", w.left)
    png(scene / "im1.png", w.right)
    truth = w.disparity_left.copy()
    truth[0] = np.inf
    pfm(scene / "disp0GT.pfm", truth, scale=-0.003922)
    pfm(scene / "disp1GT.pfm", w.disparity_right, scale=0.003922)
    mask = np.where(w.occlusion_left > 0, 128, 255).astype(np.uint8)
    mask[0] = 0
    png(scene / "mask0nocc.png", mask)
    return w


def eth3d(root: Path) -> World:
    """Grey images; truth of the left view only, in a folder of its own."""
    w = world()
    png(root / "two_view_training/delivery_area_1l/im0.png", w.left[..., 0])
    png(root / "two_view_training/delivery_area_1l/im1.png", w.right[..., 0])
    truth = w.disparity_left.copy()
    truth[0] = np.inf
    pfm(root / "two_view_training_gt/delivery_area_1l/disp0GT.pfm", truth)
    mask = np.where(w.occlusion_left > 0, 0, 255).astype(np.uint8)
    mask[0] = 0
    png(root / "two_view_training_gt/delivery_area_1l/mask0nocc.png", mask)
    return w


def middlebury2003(root: Path) -> World:
    """Quarter size: grey values are four times the disparity, 0 is unknown."""
    w = world()
    pgm(root / "cones/im2.ppm", w.left)
    pgm(root / "cones/im6.ppm", w.right)
    for name, truth in (("disp2", w.disparity_left), ("disp6", w.disparity_right)):
        code = np.rint(truth * 4).astype(np.uint8)
        code[0] = 0
        pgm(root / f"cones/{name}.pgm", code)
    return w


def middlebury2006(root: Path) -> World:
    """Third size: grey values are three times the disparity, 0 is unknown."""
    w = world(units_per_px=3)
    scene = root / "ThirdSize/Aloe"
    png(scene / "view1.png", w.left)
    png(scene / "view5.png", w.right)
    for name, truth in (("disp1", w.disparity_left), ("disp5", w.disparity_right)):
        code = np.rint(truth * 3).astype(np.uint8)
        code[0] = 0
        png(scene / f"{name}.png", code)
    return w


def crestereo(root: Path) -> World:
    w = world()
    for view, image, truth in (("left", w.left, w.disparity_left), ("right", w.right, w.disparity_right)):
        jpeg(root / f"tree/0a1b_{view}.jpg", image)
        png(root / f"tree/0a1b_{view}.disp.png", np.rint(truth * 32).astype(np.uint16))
    return w


def shard_members(w: World) -> dict[str, bytes]:
    """A sample's members as docs/conventions.md names them."""

    def image(array: NDArray[np.generic]) -> bytes:
        buffer = io.BytesIO()
        iio.imwrite(buffer, array, extension=".png")
        return buffer.getvalue()

    greys = np.array([0, 255, 128], np.uint8)
    return {
        "left.png": image(w.left),
        "right.png": image(w.right),
        "disparity_left.pfm": pfm_bytes(w.disparity_left),
        "disparity_right.pfm": pfm_bytes(w.disparity_right),
        "occlusion_left.png": image(greys[w.occlusion_left]),
        "object_index_left.png": image((w.disparity_left > 10).astype(np.uint16)),
        "meta.json": json.dumps({"frame": 6}).encode(),
    }


def shard(samples: dict[str, dict[str, bytes]]) -> bytes:
    """A tar file of samples."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w") as archive:
        for key, members in samples.items():
            for name, data in members.items():
                entry = tarfile.TarInfo(f"{key}.{name}")
                entry.size = len(data)
                archive.addfile(entry, io.BytesIO(data))
    return buffer.getvalue()


def webdataset(root: Path) -> World:
    w = world()
    root.mkdir(parents=True, exist_ok=True)
    (root / "train-000000.tar").write_bytes(shard({"train-0000-0006": shard_members(w)}))
    return w
