"""Two sets side by side: the numbers are theirs, and equal sets are at distance 0."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from datagen import DatasetError, StereoDataset
from datagen.dataset.layout import Layout
from datagen.formats import write_pfm
from datagen.gallery.comparison import write_comparison
from tests.datagen.analytic_world import vouch


def distances(page: str) -> list[float]:
    return [float(text) for text in re.findall(r"<td>([0-9.]+)</td></tr>", page)]


def test_a_set_and_its_copy_are_at_distance_0(
    analytic_dataset: Path, own_dataset: Path, tmp_path: Path
) -> None:
    out = tmp_path / "page.html"
    write_comparison(analytic_dataset, own_dataset, out)
    page = out.read_text()
    assert distances(page) == [0.0] * 5
    # Both folders are called the same; the page tells them apart.
    names = re.findall(r"<h3>(.*?)</h3>", page)
    assert len(set(names)) == 2
    assert all(name.endswith("/set") for name in names)
    assert page.count("<svg") == 4
    assert page.count("Left view of") == 12
    assert not re.search(r"(src|href)=\"(?!data:|#)", page)


def test_numbers_are_each_set_s_own(analytic_dataset: Path, own_dataset: Path, tmp_path: Path) -> None:
    layout = Layout(own_dataset)
    for split in ("train", "test"):
        disparities = [(sample, sample.disparity_left) for sample in StereoDataset(own_dataset, split)]
        for sample, there in disparities:
            write_pfm(layout.file("disparity", split, sample.scene, "left", sample.frame), there + 100)
            vouch(own_dataset, split, sample.scene)
    progress: list[tuple[int, int]] = []
    write_comparison(
        analytic_dataset, own_dataset, tmp_path / "page.html", progress=lambda *done: progress.append(done)
    )
    page = (tmp_path / "page.html").read_text()
    assert distances(page) == [1.0, 0.0, 0.0, 0.0, 0.0]
    disparity = np.concatenate(
        [
            s.disparity_left[::4, ::4].ravel()
            for split in ("train", "test")
            for s in StereoDataset(analytic_dataset, split)
        ]
    )
    assert f"<td>{np.median(disparity):.1f} (" in page
    assert f"<td>{np.median(disparity) + 100:.1f} (" in page
    assert progress[-1] == (12, 12)


def test_what_is_no_data_set_is_refused(analytic_dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no such folder"):
        write_comparison(analytic_dataset, tmp_path / "nowhere", tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()
