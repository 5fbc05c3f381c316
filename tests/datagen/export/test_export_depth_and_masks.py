"""Depths and instance masks, read back by OpenCV, NumPy and pycocotools."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from datagen import StereoDataset, StereoSample
from datagen.dataset.layout import VIEWS, View
from stereoforge.cli import main


def export(data: Path, kind: str, out: Path, *flags: str) -> None:
    with pytest.raises(SystemExit) as end:
        main(["export", str(data), "--format", kind, "--out", str(out), *flags])
    assert end.value.code == 0


def closed_form(sample: StereoSample, view: View) -> NDArray[np.float64]:
    """(H, W) metres by the rig's numbers: 96 px and 0.5 m."""
    disparity = sample.view(view).disparity.astype(np.float64)
    return np.where(disparity > 0, 96 * 0.5 / np.maximum(disparity, 1e-9), np.inf)


def test_depth_as_png(analytic_dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    export(analytic_dataset, "depth", tmp_path / "out")
    assert len(list((tmp_path / "out").glob("depth/*/A/*/*/*.png"))) == 3 * 2 * 2
    for sample in StereoDataset(analytic_dataset, "train"):
        for view in VIEWS:
            path = tmp_path / "out" / f"depth/TRAIN/A/{sample.scene:04d}/{view}/{sample.frame:04d}.png"
            stored = cv2.imread(str(path), cv2.IMREAD_ANYDEPTH)
            assert stored.dtype == np.uint16
            expected = closed_form(sample, view)
            near = expected < 65.535
            assert np.abs(stored[near] / 1000 - expected[near]).max() <= 0.5e-3 + 1e-5
            assert not stored[~near].any()
            assert near.any()
            assert np.isinf(expected).any()
    assert "no depth beyond" not in capsys.readouterr().out


def test_depth_as_npy(analytic_dataset: Path, tmp_path: Path) -> None:
    export(analytic_dataset, "depth", tmp_path / "out", "--depth-as", "npy")
    for sample in StereoDataset(analytic_dataset, "test"):
        stored = np.load(tmp_path / "out" / f"depth/TEST/A/{sample.scene:04d}/right/{sample.frame:04d}.npy")
        assert stored.dtype == np.float32
        np.testing.assert_allclose(stored, closed_form(sample, "right"), rtol=1e-6)


def test_the_two_kinds_do_not_mix(
    analytic_dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export(analytic_dataset, "depth", tmp_path / "out")
    with pytest.raises(SystemExit) as end:
        main(
            [
                "export",
                str(analytic_dataset),
                "--format",
                "depth",
                "--depth-as",
                "npy",
                "--out",
                str(tmp_path / "out"),
            ]
        )
    assert end.value.code == 1
    assert "has another export" in capsys.readouterr().err


def test_coco_masks_are_the_object_index(analytic_dataset: Path, tmp_path: Path) -> None:
    coco_tools = pytest.importorskip("pycocotools.coco")
    export(analytic_dataset, "coco", tmp_path / "out")
    for split in ("train", "test"):
        coco = coco_tools.COCO(str(tmp_path / f"out/annotations/instances_{split}.json"))
        frames = StereoDataset(analytic_dataset, split)
        assert len(coco.imgs) == 2 * len(frames)
        by_name = {image["file_name"]: image for image in coco.imgs.values()}
        for sample in frames:
            for view in VIEWS:
                image = by_name[
                    f"frames_cleanpass/{split.upper()}/A/{sample.scene:04d}/{view}/{sample.frame:04d}.png"
                ]
                assert (image["height"], image["width"]) == sample.size
                index = sample.view(view).object_index
                again = np.zeros_like(index)
                objects = [thing.name for thing in sample.scene_record.objects]
                for annotation in coco.loadAnns(coco.getAnnIds(imgIds=image["id"])):
                    mask = coco.annToMask(annotation).astype(bool)
                    assert mask.sum() == annotation["area"]
                    rows, columns = np.nonzero(mask)
                    assert annotation["bbox"] == [
                        columns.min(), rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1,
                    ]  # fmt: skip
                    again[mask] = 1 + objects.index(annotation["name"])
                    assert coco.cats[annotation["category_id"]]["name"] == "Plane"
                np.testing.assert_array_equal(again, index)


def test_coco_says_what_to_install(
    analytic_dataset: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, "pycocotools", None)
    with pytest.raises(SystemExit) as end:
        main(["export", str(analytic_dataset), "--format", "coco", "--out", str(tmp_path / "out")])
    assert end.value.code == 1
    assert "pip install 'stereoforge[coco]'" in " ".join(capsys.readouterr().err.split())


def test_a_set_without_an_object_in_view(analytic_dataset: Path, tmp_path: Path) -> None:
    """Its list of annotations is empty, and the file is JSON all the same."""
    from datagen.export.coco import export_coco
    from stereoforge_kit.files import open_tree

    pytest.importorskip("pycocotools")
    frames = StereoDataset(analytic_dataset, "train")
    frames._frames = []
    export_coco([frames], open_tree(tmp_path), lambda *_: None)
    assert json.loads((tmp_path / "annotations/instances_train.json").read_text()) == {
        "images": [], "categories": [], "annotations": [],
    }  # fmt: skip
