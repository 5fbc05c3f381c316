"""FlyingThings3D as it was published (Mayer et al., CVPR 2016): images, disparities and poses; where they were rendered
also optical flow, disparity change and motion boundaries. Nothing else.

A data set of StereoForge already has this layout. The export copies that part of it, for tools that stumble over the
rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path

from datagen.dataset.layout import RENDER_PASSES
from datagen.dataset.manifest import read_manifest
from datagen.dataset.samples import StereoDataset
from stereoforge_kit.files import Tree

CAMERAS = "cameras.json"
"""A file of ours in a folder that was published."""
PUBLISHED_KINDS = (
    *RENDER_PASSES.values(),
    "disparity",
    "camera_data",
    "optical_flow",
    "disparity_change",
    "motion_boundaries",
)
"""The kinds of files that are copied: those that have the published encoding here."""


def export_sceneflow(sets: Sequence[StereoDataset], out: Tree, progress: Callable[[int, int], None]) -> None:
    """Copy the files of each scene with their bytes unchanged. Raises DatasetError for damaged files.

    progress: Called with (frames done, frames in all).
    """
    total, done = sum(map(len, sets)), 0
    for frames in sets:
        layout = frames.layout
        for scene, group in groupby(frames, lambda sample: sample.scene):
            samples = list(group)
            manifest = read_manifest(layout.local(layout.manifest(frames.split, scene)))
            for entry in manifest.files:
                path = Path(entry.path)
                if path.parts[0] in PUBLISHED_KINDS and path.name != CAMERAS:
                    out.write(entry.path, samples[0].intact(layout.root / entry.path).read_bytes())
            done += len(samples)
            progress(done, total)
