"""Disparities of a folder in place of a set's own ground truth."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from datagen.sources.registry import open_source
from tests.datagen.sources import published
from training.data.pipeline import Source
from training.data.pseudo_labels import with_pseudo_labels


def test_any_format_and_a_stated_scale(tmp_path: Path) -> None:
    published.kitti2015(tmp_path / "set")
    frames = open_source(tmp_path / "set").frames("train")
    labels = np.full(frames[0].size, 40, np.int16)
    labels[0] = -16
    folder = tmp_path / "labels"
    folder.mkdir()
    np.save(folder / f"{frames[0].name}.npy", labels)
    source = with_pseudo_labels([Source(frames)], folder)
    expected = np.where(labels < 0, np.nan, np.float32(2.5))
    np.testing.assert_array_equal(source.frames[0].disparity_left, expected)
    (remark,) = source.remarks
    assert f"{frames[0].name}.npy: int16 is taken for OpenCV's fixed point" in remark

    scaled = with_pseudo_labels([Source(frames)], folder, units_per_px=8)
    np.testing.assert_array_equal(
        scaled.frames[0].disparity_left, np.where(labels < 0, np.nan, np.float32(5))
    )
    assert scaled.remarks == ()

    (folder / f"{frames[0].name}.npy").unlink()
    cv2.imwrite(str(folder / f"{frames[0].name}.tiff"), expected)
    np.testing.assert_array_equal(
        with_pseudo_labels([Source(frames)], folder).frames[0].disparity_left, expected
    )
