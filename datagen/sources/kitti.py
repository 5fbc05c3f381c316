"""KITTI 2012 and 2015 (Geiger et al., CVPR 2012; Menze and Geiger, CVPR 2015): sparse ground truth.

The frames with ground truth are those of the training part. The disparity of the left view is a 16-bit PNG file with
d = value / 256, 0 where there is none. `occ` has all points, `noc` those that are visible in the right view. What 2015
calls `disp_occ_1` is the left view's disparity one frame later, not the right view's, so there is no right disparity.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.formats import read_png
from datagen.formats.disparity import read_disparity_png
from datagen.formats.impossible_disparity import drop_impossible
from datagen.formats.limits import MAX_JSON_BYTES, read_bounded
from datagen.formats.picture import read_picture
from datagen.ground_truth.from_disparity import occlusion_from_mask
from datagen.sources.registry import DataSource, SourceFormat
from datagen.sources.stereo_frame import FileFrame, FileFrames, StereoFrame
from stereoforge_kit.files import matching

FRAME_LIST = "frames.txt"
"""In sets that were exported to this layout: a line for each frame with its names here and in the set it comes from
(`datagen.export.kitti`)."""


@dataclass(frozen=True)
class _Edition:
    """The folders of one edition; `objects` is None if it has no object maps."""

    left: str
    right: str
    all_points: str
    visible_points: str
    objects: str | None = None


_EDITIONS = {
    "kitti2012": (
        _Edition("colored_0", "colored_1", "disp_occ", "disp_noc"),
        _Edition("image_0", "image_1", "disp_occ", "disp_noc"),
    ),
    "kitti2015": (_Edition("image_2", "image_3", "disp_occ_0", "disp_noc_0", "obj_map"),),
}
"""By the name of the format. KITTI 2012 comes with colour images, or with the grey ones only."""
_REFERENCE_FRAMES = "*_10.png"
"""Of the frames 00 to 20 of a sequence, number 10 has ground truth and is the one that the server judges."""


def read_labels(all_points: Path, visible_points: Path) -> NDArray[np.uint8]:
    """(H, W) occlusion labels: points that only the first file has are not visible in the right view.

    Raises FormatError.
    """
    disparity, _ = drop_impossible(read_disparity_png(all_points))
    not_visible = np.isnan(read_disparity_png(visible_points)) & ~np.isnan(disparity)
    return occlusion_from_mask(disparity, not_visible)


def read_foreground(path: Path) -> NDArray[np.uint16]:
    """Read an object map: (H, W) uint16, 0 background, else the number of a car. Raises FormatError."""
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
    """The scenes of exported frames by the frames' names.

    Empty for KITTI itself, where every frame is a scene of its own. Raises FormatError.
    """
    if not frame_list.is_file():
        return {}
    lines = read_bounded(frame_list, MAX_JSON_BYTES).decode("utf-8", errors="replace").splitlines()
    pairs = (words for line in lines if len(words := line.split()) == 2)
    return {name: original.rpartition("/")[0] or original for name, original in pairs}


def _frames(folder: Path, edition: _Edition) -> Iterator[FileFrame]:
    scenes = _scenes(folder / FRAME_LIST)
    for truth in matching(folder / edition.all_points, _REFERENCE_FRAMES):
        visible = folder / edition.visible_points / truth.name
        objects = None if edition.objects is None else folder / edition.objects / truth.name
        yield FileFrame(
            name=truth.stem,
            scene_name=scenes.get(truth.stem, truth.stem),
            read_left=partial(read_picture, folder / edition.left / truth.name),
            read_right=partial(read_picture, folder / edition.right / truth.name),
            read_disparity_left=partial(read_disparity_png, truth),
            read_occlusion_left=partial(read_labels, truth, visible) if visible.is_file() else None,
            read_foreground_left=partial(read_foreground, objects) if objects and objects.is_file() else None,
        )


def testing_frames(source: DataSource) -> Sequence[StereoFrame]:
    """The frames of a KITTI source's testing part, empty where it is not there.

    Only KITTI's server has their ground truth, so their disparity is NaN everywhere.
    """
    folder = Path(source.location) / "testing"
    for edition in _EDITIONS[source.format.name]:
        images = matching(folder / edition.left, _REFERENCE_FRAMES)
        if images:
            return FileFrames(_testing_frame(left, folder / edition.right / left.name) for left in images)
    return []


def _testing_frame(left: Path, right: Path) -> FileFrame:
    return FileFrame(
        name=left.stem,
        scene_name=left.stem,
        read_left=partial(read_picture, left),
        read_right=partial(read_picture, right),
        read_disparity_left=partial(_unknown_disparity, left),
    )


def _unknown_disparity(image: Path) -> NDArray[np.float32]:
    """(H, W) NaN, of the size of an image."""
    return np.full(read_picture(image).shape[:2], np.nan, np.float32)


FORMATS = tuple(
    SourceFormat(
        name,
        title,
        partial(lambda root, editions: _edition(root, editions) is not None, editions=_EDITIONS[name]),
        partial(_find, editions=_EDITIONS[name]),
    )
    for name, title in (("kitti2012", "KITTI 2012"), ("kitti2015", "KITTI 2015"))
)
