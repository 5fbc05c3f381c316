"""KITTI 2012 and 2015 (Geiger et al., CVPR 2012; Menze and Geiger, CVPR 2015): the training part, sparse truth.

Disparity of the left view as 16-bit PNG, d = value / 256, 0 where there is none. `occ` holds all points, `noc` those
the right view shows. The truth that 2015 calls `disp_occ_1` is the left view's one frame later, not the right
view's, so there is no right disparity here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats import read_png
from datagen.formats.limits import MAX_JSON_BYTES, read_bounded
from datagen.formats.picture import read_picture
from datagen.ground_truth.from_disparity import occlusion_from_mask
from datagen.sources.registry import SourceFormat
from datagen.sources.stereo_frame import FileFrame, FileFrames, StereoFrame

UNITS_PER_PX = 256
FRAME_LIST = "frames.txt"
"""In sets that were exported to this layout: a line a frame, its name here and there (`datagen.export.kitti`)."""


@dataclass(frozen=True)
class _Edition:
    """The folders of one edition."""

    left: str
    right: str
    all_points: str
    visible_points: str
    objects: str | None = None


_KITTI_2012 = (
    _Edition("colored_0", "colored_1", "disp_occ", "disp_noc"),
    _Edition("image_0", "image_1", "disp_occ", "disp_noc"),
)
"""With the colour images, or with the grey ones only."""
_KITTI_2015 = (_Edition("image_2", "image_3", "disp_occ_0", "disp_noc_0", "obj_map"),)


def read_disparity(path: Path) -> NDArray[np.float32]:
    """Read a KITTI disparity, NaN where there is none. Raises FormatError."""
    values = read_png(path)
    if values.dtype != np.uint16 or values.ndim != 2:
        raise FormatError(
            f"{path}: a KITTI disparity is a 16-bit grey PNG, not {values.dtype} {values.shape}"
        )
    disparity = values.astype(np.float32) / UNITS_PER_PX
    disparity[values == 0] = np.nan
    return disparity


def read_labels(all_points: Path, visible_points: Path) -> NDArray[np.uint8]:
    """Points missing from the second file are hidden in the right view. Raises FormatError."""
    disparity = read_disparity(all_points)
    hidden = np.isnan(read_disparity(visible_points)) & ~np.isnan(disparity)
    return occlusion_from_mask(disparity, hidden)


def read_foreground(path: Path) -> NDArray[np.uint16]:
    """0 background, else a number a car. Raises FormatError."""
    return read_png(path).astype(np.uint16)


def _training(root: Path) -> Path:
    return root / "training" if (root / "training").is_dir() else root


def _edition(root: Path, editions: tuple[_Edition, ...]) -> _Edition | None:
    folder = _training(root)
    fitting = (e for e in editions if (folder / e.left).is_dir() and (folder / e.all_points).is_dir())
    return next(fitting, None)


def _find(root: str, split: str, editions: tuple[_Edition, ...]) -> Sequence[StereoFrame]:  # noqa: ARG001
    edition = _edition(Path(root), editions)
    return [] if edition is None else FileFrames(_frames(_training(Path(root)), edition))


def _scenes(frame_list: Path) -> dict[str, str]:
    """The scenes of exported frames by the frames' names; empty for KITTI itself, where every frame is one of its own.
    Raises FormatError."""
    if not frame_list.is_file():
        return {}
    lines = read_bounded(frame_list, MAX_JSON_BYTES).decode("utf-8", errors="replace").splitlines()
    pairs = (words for line in lines if len(words := line.split()) == 2)
    return {name: original.rpartition("/")[0] or original for name, original in pairs}


def _frames(folder: Path, edition: _Edition) -> Iterator[FileFrame]:
    scenes = _scenes(folder / FRAME_LIST)
    for truth in sorted((folder / edition.all_points).glob("*_10.png")):
        visible = folder / edition.visible_points / truth.name
        objects = None if edition.objects is None else folder / edition.objects / truth.name
        yield FileFrame(
            name=truth.stem,
            scene_name=scenes.get(truth.stem, truth.stem),
            read_left=partial(read_picture, folder / edition.left / truth.name),
            read_right=partial(read_picture, folder / edition.right / truth.name),
            read_disparity_left=partial(read_disparity, truth),
            read_occlusion_left=partial(read_labels, truth, visible) if visible.is_file() else None,
            read_foreground_left=partial(read_foreground, objects) if objects and objects.is_file() else None,
        )


FORMATS = tuple(
    SourceFormat(
        name,
        title,
        partial(lambda root, editions: _edition(root, editions) is not None, editions=editions),
        partial(_find, editions=editions),
    )
    for name, title, editions in (
        ("kitti2012", "KITTI 2012", _KITTI_2012),
        ("kitti2015", "KITTI 2015", _KITTI_2015),
    )
)
