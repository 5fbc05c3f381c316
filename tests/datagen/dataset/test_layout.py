"""Paths of the FlyingThings3D tree, and which scenes count as finished."""

from __future__ import annotations

from pathlib import Path

import pytest

from datagen.dataset.layout import FIRST_FRAME, KINDS, Layout
from datagen.errors import DatasetError

LAYOUT = Layout(Path("/data"))


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        (LAYOUT.scene_folder("disparity", "train", 3), "disparity/TRAIN/A/0003"),
        (
            LAYOUT.file("frames_cleanpass", "test", 0, "left", 6),
            "frames_cleanpass/TEST/A/0000/left/0006.png",
        ),
        (LAYOUT.file("disparity", "val", 12, "right", 15), "disparity/VAL/A/0012/right/0015.pfm"),
        (
            LAYOUT.file("disparity_gradient", "train", 9999, "left", 10000),
            "disparity_gradient/TRAIN/A/9999/left/10000.exr",
        ),
        (LAYOUT.file("occlusion", "train", 10000, "left", 6), "occlusion/TRAIN/A/10000/left/0006.png"),
        (LAYOUT.file("object_index", "train", 1, "left", 6), "object_index/TRAIN/A/0001/left/0006.png"),
        (LAYOUT.file("camera_data", "train", 1), "camera_data/TRAIN/A/0001/camera_data.txt"),
        (LAYOUT.file("cameras", "train", 1), "camera_data/TRAIN/A/0001/cameras.json"),
        (LAYOUT.file("depth", "val", 2, "left", 7), "depth/VAL/A/0002/left/0007.exr"),
        (
            LAYOUT.file("optical_flow", "train", 2, "left", 6, "into_future"),
            "optical_flow/TRAIN/A/0002/into_future/left/OpticalFlowIntoFuture_0006_L.pfm",
        ),
        (
            LAYOUT.file("optical_flow", "test", 2, "right", 15, "into_past"),
            "optical_flow/TEST/A/0002/into_past/right/OpticalFlowIntoPast_0015_R.pfm",
        ),
        (
            LAYOUT.file("disparity_change", "train", 2, "right", 7, "into_past"),
            "disparity_change/TRAIN/A/0002/into_past/right/0007.pfm",
        ),
        (
            LAYOUT.file("motion_boundaries", "train", 2, "left", 7, "into_future"),
            "motion_boundaries/TRAIN/A/0002/into_future/left/0007.pgm",
        ),
        (LAYOUT.file("material_index", "val", 2, "left", 7), "material_index/VAL/A/0002/left/0007.png"),
        (LAYOUT.file("normals", "val", 2, "left", 7), "normals/VAL/A/0002/left/0007.exr"),
        (LAYOUT.scene_record("train", 123456), "scenes/TRAIN/A/123456.json"),
        (LAYOUT.manifest("val", 7), "manifest/VAL/A/0007.json"),
        (LAYOUT.recipe, "recipe.yaml"),
    ],
)
def test_paths(path: Path, expected: str) -> None:
    assert path == Path("/data") / expected
    assert LAYOUT.relative(path) == expected


def test_no_two_files_share_a_path() -> None:
    paths = [LAYOUT.recipe]
    for split in ("train", "val", "test"):
        for scene in (0, 1, 11, 10001):
            paths += [LAYOUT.manifest(split, scene), LAYOUT.scene_record(split, scene)]
            for name, kind in KINDS.items():
                if kind.per_view:
                    views_and_frames = [(view, frame) for view in ("left", "right") for frame in (6, 7)]
                    paths += [
                        LAYOUT.file(name, split, scene, *one, direction)
                        for one in views_and_frames
                        for direction in kind.directions
                    ]
                else:
                    paths.append(LAYOUT.file(name, split, scene))
    assert len(set(paths)) == len(paths)


@pytest.mark.parametrize(
    ("view", "frame"), [(None, 6), ("centre", 6), ("left", None), ("left", FIRST_FRAME - 1)]
)
def test_a_file_of_a_view_needs_view_and_frame(view: str | None, frame: int | None) -> None:
    with pytest.raises(ValueError, match="needs a view"):
        LAYOUT.file("disparity", "train", 0, view, frame)


def test_impossible_numbers_and_splits() -> None:
    with pytest.raises(ValueError, match="numbered from 0, got -1"):
        LAYOUT.manifest("train", -1)
    with pytest.raises(DatasetError, match="no split 'TRAIN'; there are train, val, test"):
        LAYOUT.manifest("TRAIN", 0)


def test_committed_scenes_are_those_with_a_manifest(tmp_path: Path) -> None:
    layout = Layout(tmp_path)
    assert layout.committed_scenes("train") == []
    for scene in (10, 2, 12345):
        layout.manifest("train", scene).parent.mkdir(parents=True, exist_ok=True)
        layout.manifest("train", scene).touch()
    folder = layout.manifest("train", 0).parent
    for name in (".0003.json.1.2.tmp", "3.json", "00004.json", "0005.yaml", "0006.json.bak"):
        (folder / name).touch()
    layout.scene_folder("disparity", "train", 4).mkdir(parents=True)
    assert layout.committed_scenes("train") == [2, 10, 12345]
    assert layout.committed_scenes("test") == []


def test_only_kinds_over_time_have_a_direction() -> None:
    with pytest.raises(ValueError, match="no direction None"):
        LAYOUT.file("optical_flow", "train", 0, "left", 6)
    with pytest.raises(ValueError, match="no direction 'into_past'"):
        LAYOUT.file("disparity", "train", 0, "left", 6, "into_past")
