"""Depth along the optical axis, as 16-bit PNG of millimetres or as NumPy arrays of metres.

    depth/TRAIN/A/0003/left/0006.png     uint16 millimetres, as depth cameras give them; 0 for none
    depth/TRAIN/A/0003/left/0006.npy     float32 metres, infinite for the sky

Names are those of the data set's own pictures. The set need not have been rendered with `--targets depth`: depth
follows from the disparity and the camera.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import VIEWS, View
from datagen.dataset.samples import StereoDataset, StereoSample
from datagen.formats.depth_png import FARTHEST_M, write_depth_png
from stereoforge_kit.files import Tree

DepthFile = Literal["png", "npy"]


def export_depth(
    sets: Sequence[StereoDataset], out: Tree, kind: DepthFile, progress: Callable[[int, int], None]
) -> list[str]:
    """Write the depths of both views of every frame.

    Returns a sentence if some were too far to store.

    Args:
        sets: One data set for each split.
        out: The folder or URL to write to.
        kind: The kind of file.
        progress: Called with (frames done, frames in all).

    Raises:
        DatasetError: For damaged files.
    """
    total, done, too_far = sum(map(len, sets)), 0, 0.0
    for frames in sets:
        for sample in frames:
            for view in VIEWS:
                depth = depth_of(sample, view)
                path = sample.layout.file("depth", sample.split, sample.scene, view, sample.frame)
                name = sample.layout.relative(path.with_suffix(f".{kind}"))
                with out.writing(name) as target:
                    if kind == "png":
                        too_far += write_depth_png(target, depth) / 2
                    else:
                        with target.open("wb") as file:
                            np.save(file, depth)
            done += 1
            progress(done, total)
    if kind == "npy" or not too_far:
        return []
    return [
        f"16 bits hold no depth beyond {FARTHEST_M:g} m: {too_far / total:.2%} of the pixels became 0, as "
        "the sky"
    ]


def depth_of(sample: StereoSample, view: View) -> NDArray[np.float32]:
    """(H, W) metres along the optical axis of a view, infinite for the sky; the stored target if there is one."""
    if sample.has(sample.layout.file("depth", sample.split, sample.scene, view, sample.frame)):
        return sample.depth(view)
    disparity: NDArray[np.float32] = getattr(sample, f"disparity_{view}")
    return sample.scene_record.camera.depth(disparity).astype(np.float32)
