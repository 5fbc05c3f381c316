"""Disparities that cannot be: one rule for every reader."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from datagen.formats.impossible_disparity import ImpossibleShare, drop_impossible
from datagen.sources.registry import open_source
from tests.datagen.sources import published
from tests.datagen.sources.published import WIDTH
from training.data.pseudo_labels import PseudoLabelFrames

NAN = np.nan


def test_what_cannot_be_is_missing_and_its_share_is_known() -> None:
    row = np.array([[NAN, np.inf, -np.inf, 1e30, 13.5, 0, -0.4, -0.6, -3, 10, 10, 10, 13]], np.float32)
    kept, share = drop_impossible(row)
    np.testing.assert_array_equal(kept, [[NAN, NAN, NAN, NAN, NAN, 0, 0, NAN, NAN, 10, 10, 10, 13]])
    assert kept.dtype == np.float32
    assert share == ImpossibleShare(negative=0.2, too_large=0.2)
    assert np.isinf(row[0, 1])  # What was read is not changed.
    kept, share = drop_impossible(row, noise_px=1.0)
    np.testing.assert_array_equal(kept[0, 6:9], [0, 0, NAN])
    assert str(share) == (
        "30.00% of the disparities cannot be and are left out "
        "(20.00% larger than the picture is wide, 10.00% negative)"
    )


def test_what_can_be_is_unchanged() -> None:
    disparity = np.random.default_rng(0).uniform(0, 40, (5, 40)).astype(np.float32)
    kept, share = drop_impossible(disparity)
    np.testing.assert_array_equal(kept, disparity)
    assert not share
    assert not drop_impossible(np.full((2, 3), NAN, np.float32))[1]


@pytest.mark.parametrize("sentinel", [65535.0, 1e30, -1e30, -999.0])
@pytest.mark.parametrize("name", ["middlebury", "eth3d", "webdataset", "flyingthings3d", "driving", "monkaa"])
def test_sentinels_in_ground_truth(
    name: str, sentinel: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = published.pfm_bytes

    def with_sentinels(array: np.ndarray, scale: float = -1.0) -> bytes:
        array = array.copy()
        array[:, -3:] = sentinel
        return write(array, scale)

    monkeypatch.setattr(published, "pfm_bytes", with_sentinels)
    w = getattr(published, name)(tmp_path / "set")
    frame = open_source(tmp_path / "set").frames("train")[0]
    assert np.isnan(frame.disparity_left[:, -3:]).all()
    np.testing.assert_array_equal(frame.disparity_left[1:, :-3], w.disparity_left[1:, :-3])
    assert frame.impossible_left.share == pytest.approx(3 / WIDTH, abs=0.01)
    assert not frame.gradient_valid_left[:, -4:].any()
    if name in ("webdataset", "flyingthings3d", "driving", "monkaa"):
        assert frame.disparity_right is not None
        assert np.isnan(frame.disparity_right[:, -3:]).all()


@pytest.mark.parametrize(
    ("name", "files", "units"),
    [("kitti2015", "training/disp_occ_0/*.png", 256), ("crestereo", "tree/*_left.disp.png", 32)],
)
def test_sixteen_bits_hold_more_than_a_narrow_picture(
    name: str, files: str, units: int, tmp_path: Path
) -> None:
    getattr(published, name)(tmp_path)
    values = np.full((published.HEIGHT, WIDTH), units * 5, np.uint16)
    values[:, 0] = 65535
    (path,) = tmp_path.glob(files)
    published.png(path, values)
    frame = open_source(tmp_path).frames("train")[0]
    assert np.isnan(frame.disparity_left[:, 0]).all()
    assert (frame.disparity_left[:, 1:] == 5).all()
    assert frame.impossible_left.too_large == pytest.approx(1 / WIDTH)


def test_pseudo_labels(tmp_path: Path) -> None:
    w = published.middlebury(tmp_path / "set")
    labels = w.disparity_left.copy()
    labels[:, -3:], labels[:, 0], labels[:, 1] = 1e30, -0.8, -1.2
    published.pfm(tmp_path / "labels/trainingQ/Adirondack.pfm", labels)
    (frame,) = PseudoLabelFrames(open_source(tmp_path / "set").frames("train"), tmp_path / "labels")
    assert np.isnan(frame.disparity_left[:, [1, -1, -2, -3]]).all()
    assert (frame.disparity_left[:, 0] == 0).all()
    assert frame.impossible_left == ImpossibleShare(1 / WIDTH, 3 / WIDTH)
