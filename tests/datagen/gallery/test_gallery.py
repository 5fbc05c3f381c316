"""The gallery: what must be in the file, that it needs nothing else, and that its pictures are the data's."""

from __future__ import annotations

import base64
import io
import re
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest

from datagen.dataset.layout import Layout
from datagen.dataset.samples import StereoDataset
from datagen.errors import DatasetError
from datagen.gallery.page import evenly_spaced, write_gallery
from stereoforge_kit.viewing import index_picture
from tests.datagen.analytic_world import make_scene, render, write_dataset


@pytest.fixture(scope="module")
def page(analytic_dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    out = tmp_path_factory.mktemp("gallery") / "new folder" / "gallery.html"
    write_gallery(analytic_dataset, out)
    return out.read_text(encoding="utf-8")


def pictures(page: str, alt: str) -> list[np.ndarray]:
    sources = re.findall(rf'<img[^>]*src="data:image/\w+;base64,([^"]+)"[^>]*alt="{alt}"', page)
    return [imageio.imread(io.BytesIO(base64.b64decode(source))) for source in sources]


def test_every_scene_is_there_with_all_its_pictures(page: str) -> None:
    names = re.findall(r"<h3>(.*?)</h3>", page)
    assert names == ["TRAIN/A/0000/0006", "TRAIN/A/0001/0006", "TEST/A/0000/0006"]
    shown_views = [(make_scene(scene), view) for scene in (0, 1, 0) for view in ("left", "right")]
    expected = [render(scene, view, instant=0) for scene, view in shown_views]
    for alt, which in (("Left view", expected[::2]), ("Right view", expected[1::2])):
        shown = pictures(page, alt)
        assert len(shown) == 3
        for picture, view in zip(shown, which, strict=True):
            assert np.abs(picture.astype(int) - view.image).mean() < 12  # JPEG of a lively picture
    for picture, view in zip(pictures(page, "Objects"), expected[::2], strict=True):
        np.testing.assert_array_equal(picture, index_picture(view.object_index))
    for alt in ("Disparity", "Not visible in the right view", "Disparity gradient"):
        assert [picture.shape for picture in pictures(page, alt)] == [(64, 96, 3)] * 3


def test_numbers_are_the_data_s(page: str, analytic_dataset: Path) -> None:
    assert "flying_things at 96 × 64: 4 train, 2 test stereo pairs." in page
    sample = StereoDataset(analytic_dataset, "train")[0]
    not_visible = (sample.occlusion_left > 0).mean()
    assert f"{not_visible:.1%} of the left view is not visible" in page
    assert f"3 objects in view, disparity 0.0 to {np.percentile(sample.disparity_left, 99):.1f} px" in page
    assert page.count("<svg") == 1 + 4  # the colour filters, and the plots
    assert "All 3 finished scenes." in page


def test_the_file_needs_nothing_beside_it(page: str) -> None:
    addresses = re.findall(r'(?:src|href|url)\s*[=(]\s*["\']?([^"\')\s>]+)', page)
    assert addresses
    for address in addresses:
        assert address.startswith(("data:", "#", "chosen.")), address
    assert "http" not in page


def test_few_scenes_of_many_evenly_spaced(tmp_path: Path) -> None:
    write_dataset(tmp_path / "set", {"train": 5})
    calls: list[tuple[int, int]] = []
    write_gallery(tmp_path / "set", tmp_path / "g.html", scenes=3, progress=lambda *done: calls.append(done))
    text = (tmp_path / "g.html").read_text(encoding="utf-8")
    assert re.findall(r"<h3>(.*?)</h3>", text) == [f"TRAIN/A/{scene:04d}/0006" for scene in (0, 2, 4)]
    assert "3 of 5 finished scenes, evenly spaced." in text
    assert calls == [(done, 13) for done in range(1, 14)]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["g.html", "set"]


@pytest.mark.parametrize(
    ("items", "count", "expected"),
    [(5, 9, [0, 1, 2, 3, 4]), (5, 5, [0, 1, 2, 3, 4]), (10, 2, [0, 9]), (9, 3, [0, 4, 8]), (7, 1, [0])],
)
def test_evenly_spaced(items: int, count: int, expected: list[int]) -> None:
    assert evenly_spaced(range(items), count) == expected


def test_names_are_escaped(tmp_path: Path) -> None:
    root = tmp_path / "<b>set & co"
    write_dataset(root, {"train": 1})
    write_gallery(root, tmp_path / "g.html")
    assert "<title>&lt;b&gt;set &amp; co</title>" in (tmp_path / "g.html").read_text(encoding="utf-8")


def test_what_cannot_be_shown_is_said(own_dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "g.html"
    with pytest.raises(DatasetError, match="there is no such folder"):
        write_gallery(tmp_path / "nowhere", out)
    with pytest.raises(DatasetError, match="lists no image of the final pass"):
        write_gallery(own_dataset, out, render_pass="final")
    layout = Layout(own_dataset)
    picture = layout.file("frames_cleanpass", "train", 0, "right", 6)
    picture.write_bytes(picture.read_bytes()[:-100])
    with pytest.raises(DatasetError, match=r"right/0006\.png: has \d+ bytes where the manifest has \d+"):
        write_gallery(own_dataset, out)
    for split, scene in (("train", 0), ("train", 1), ("test", 0)):
        layout.manifest(split, scene).unlink()
    with pytest.raises(DatasetError, match="has no finished scene to show"):
        write_gallery(own_dataset, out)
    assert not out.exists()


@pytest.mark.slow
def test_of_a_rendered_data_set(rendered_dataset: Path, tmp_path: Path) -> None:
    write_gallery(rendered_dataset, tmp_path / "g.html")
    text = (tmp_path / "g.html").read_text(encoding="utf-8")
    assert len(text) < 2 * 400_000
    lefts, sample = pictures(text, "Left view"), StereoDataset(rendered_dataset, "train")[0]
    assert np.abs(lefts[0].astype(int) - sample.left).mean() < 12
    assert lefts[0].std() > 10
