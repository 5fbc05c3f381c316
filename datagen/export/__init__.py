"""Exporting data sets to the layouts of others, one module for each format."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from datagen.dataset.layout import EXTRA_TARGETS
from datagen.dataset.samples import StereoDataset
from datagen.export.coco import export_coco
from datagen.export.depth import DepthFile, export_depth
from datagen.export.kitti import export_kitti
from datagen.export.sceneflow import export_sceneflow
from datagen.export.webdataset import export_webdataset
from datagen.recipe.recipe import read_recipe
from stereoforge_kit.files import Tree


@dataclass(frozen=True)
class ExportOptions:
    """What some formats let the user choose."""

    frames_per_shard: int = 256
    """webdataset: number of samples in one tar file."""
    lidar_beams: int | None = None
    """kitti: keep only the disparities that a laser scanner with so many beams would measure; None for all."""
    depth_as: DepthFile = "png"
    """depth: 16-bit PNG files of millimetres, or npy files of float32 metres."""


Progress = Callable[[int, int], None]
"""Called with (frames done, frames in all)."""
Exporter = Callable[[Sequence[StereoDataset], Tree, ExportOptions, Progress], list[str] | None]
"""Writes all frames of some splits of one data set into a folder or URL; may return sentences for the user."""

EXPORTERS: dict[str, Exporter] = {
    "coco": lambda sets, out, _, progress: export_coco(sets, out, progress),
    "depth": lambda sets, out, options, progress: export_depth(sets, out, options.depth_as, progress),
    "kitti": lambda sets, out, options, progress: export_kitti(sets, out, options.lidar_beams, progress),
    "sceneflow": lambda sets, out, _, progress: export_sceneflow(sets, out, progress),
    "webdataset": lambda sets, out, options, progress: export_webdataset(
        sets, out, options.frames_per_shard, progress
    ),
}
"""Every exporter by the name of its format on the command line."""

_CANNOT_HOLD = {
    "kitti": (
        "right disparity",
        "disparity_gradient",
        "objects that are no vehicles",
        "poses",
        "material_index",
        "reflective",
        "depth",
        "normals",
        "optical_flow into the past and of the right view",
        "disparity_change into the past and of the right view",
        "motion_boundaries",
    ),
    "sceneflow": (
        "disparity_gradient",
        "occlusion",
        "object_index",
        "depth",
        "normals",
        "material_index",
        "reflective",
    ),
    "webdataset": (),
    # These are one thing made of a data set, not a layout for all of it.
    "coco": (),
    "depth": (),
}
"""What the layout of a format has no place for; what begins with a target's name only where a set has the target."""


def left_out(name: str, dataset: StereoDataset) -> str | None:
    """A sentence: what of a data set the format of this name cannot hold; None if it holds all. Raises DatasetError."""
    there = set(read_recipe(dataset.layout.recipe).targets)
    absent = tuple(set(EXTRA_TARGETS) - there)
    lacking = [what for what in _CANNOT_HOLD[name] if not what.startswith(absent)]
    return f"{name} has no place for: {', '.join(lacking)}" if lacking else None


__all__ = ["EXPORTERS", "ExportOptions", "Exporter", "Progress", "left_out"]
