"""`stereoforge export`: a data set in another layout."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from datagen import StereoDataset
from datagen.dataset.layout import SPLITS
from datagen.dataset.samples import open_layout
from datagen.export import EXPORTERS, ExportOptions, left_out
from datagen.export.folder import export_folder, export_record
from stereoforge.errors import CommandError, UsageError
from stereoforge.inputs.flag_values import shown
from stereoforge.places import check_writable, keep_apart
from stereoforge.progress import console, progress_bar, remark
from stereoforge_kit.files import LocalTree, is_within, open_tree


@dataclass(frozen=True)
class Export:
    """Write a data set in a layout that other tools read; the data set itself stays as it is."""

    data: Annotated[tyro.conf.Positional[str], shown("DIR")]
    """Folder of the data set, or its URL."""
    format: Annotated[
        Literal["kitti", "sceneflow", "webdataset", "depth", "coco"],
        shown("kitti|sceneflow|webdataset|depth|coco"),
    ]
    """kitti: 16-bit PNG disparities; sceneflow: what FlyingThings3D has; webdataset: tar files; depth: depths alone;
    coco: instance masks alone, as COCO's JSON."""
    out: Annotated[str, shown("DIR2")]
    """Folder or URL to write to: new, empty, or with the same export, which continues."""
    render_pass: Annotated[Literal["clean", "final"], shown("clean|final")] = "clean"
    """Which images to take."""
    frames_per_shard: Annotated[int, shown("N")] = 256
    """webdataset: frames in one tar file."""
    lidar_beams: Annotated[int | None, shown("N", "every pixel")] = None
    """kitti: keep only the disparities that a laser scanner with so many beams would measure (KITTI's has 64)."""
    depth_as: Annotated[Literal["png", "npy"], shown("png|npy")] = "png"
    """depth: 16-bit PNG files of millimetres (up to 65.535 m), or NumPy arrays of float32 metres."""
    overwrite: bool = False
    """Replace another export that is in --out, once this one is whole (behind a URL, before it is)."""

    def run(self) -> None:
        """Write the data set in the other layout, showing progress."""
        if self.frames_per_shard < 1:
            raise UsageError(f"--frames-per-shard must be at least 1, got {self.frames_per_shard}")
        if self.lidar_beams is not None and self.lidar_beams < 1:
            raise UsageError(f"--lidar-beams must be at least 1, got {self.lidar_beams}")
        layout, out = open_layout(self.data), open_tree(self.out)
        keep_apart("--out", self.out, "the data set", self.data)
        if is_within(self.data, self.out):
            raise UsageError("--out holds the data set that is exported: write to a folder beside it")
        if isinstance(out, LocalTree):
            check_writable("--out", out.root)
        sets = [
            StereoDataset(self.data, split, self.render_pass)
            for split in SPLITS
            if layout.committed_scenes(split)
        ]
        if not sets:
            raise CommandError(f"{self.data}: has no finished scene")
        options: dict[str, dict[str, int | str | None]] = {
            "depth": {"depth_as": self.depth_as},
            "webdataset": {"frames_per_shard": self.frames_per_shard},
            "kitti": {"lidar_beams": self.lidar_beams},
        }
        record = export_record(self.format, sets, options.get(self.format, {}))
        with export_folder(out, record, overwrite=self.overwrite) as target, progress_bar() as progress:
            task = progress.add_task("exporting", total=None)
            remarks = EXPORTERS[self.format](
                sets,
                target,
                ExportOptions(self.frames_per_shard, self.lidar_beams, self.depth_as),
                lambda done, total: progress.update(task, completed=done, total=total),
            )
        console.print(f"{self.out}: {sum(map(len, sets))} frames as {self.format}")
        for sentence in (left_out(self.format, sets[0]), *(remarks or ())):
            if sentence:
                remark(sentence)
