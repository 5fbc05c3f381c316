"""StereoDataset against the closed forms it was written from, and everything a user can get wrong."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from datagen import DatasetError, StereoDataset
from datagen.dataset.layout import Layout
from datagen.formats import write_pfm, write_png
from tests.datagen.analytic_world import HEIGHT, WIDTH, make_scene, render, vouch


def test_samples_in_order_with_their_names(analytic_dataset: Path) -> None:
    train = StereoDataset(analytic_dataset, "train")
    names = [f"TRAIN/A/{scene:04d}/{frame:04d}" for scene in (0, 1) for frame in (6, 7)]
    assert [sample.name for sample in train] == names
    assert train[-1].name == names[-1]
    assert [sample.name for sample in train[1:3]] == names[1:3]
    assert len(StereoDataset(str(analytic_dataset), "test")) == 2
    with pytest.raises(IndexError):
        train[4]


@pytest.mark.parametrize("view", ["left", "right"])
def test_arrays_are_what_was_written(analytic_dataset: Path, view: str) -> None:
    sample = StereoDataset(analytic_dataset, "train")[3]
    expected = render(make_scene(1), view, instant=1)
    named = {
        view: expected.image,
        f"disparity_{view}": expected.disparity,
        f"gradient_{view}": expected.gradient,
        f"gradient_valid_{view}": expected.gradient_valid,
        f"occlusion_{view}": expected.occlusion,
        f"object_index_{view}": expected.object_index,
    }
    for name, array in named.items():
        read = getattr(sample, name)
        assert read.dtype == array.dtype, name
        np.testing.assert_array_equal(read, array, err_msg=name)
    arrays = sample.view(view)
    assert arrays.disparity is getattr(sample, f"disparity_{view}")
    assert arrays.image is getattr(sample, view)
    assert sample.size == (HEIGHT, WIDTH)
    assert sample.scene_record == make_scene(1)


def test_arrays_are_read_once_and_only_when_asked_for(own_dataset: Path) -> None:
    sample = StereoDataset(own_dataset, "train")[0]
    first = sample.disparity_left
    Layout(own_dataset).file("disparity", "train", 0, "left", 6).unlink()
    assert sample.disparity_left is first
    fresh = StereoDataset(own_dataset, "train")[0]
    assert fresh.disparity_right.shape == (HEIGHT, WIDTH)
    with pytest.raises(DatasetError, match=r"disparity/TRAIN/A/0000/left/0006\.pfm: cannot be read"):
        _ = fresh.disparity_left


def test_data_sets_travel_to_worker_processes(analytic_dataset: Path) -> None:
    again = pickle.loads(pickle.dumps(StereoDataset(analytic_dataset, "train")))
    np.testing.assert_array_equal(again[0].left, StereoDataset(analytic_dataset, "train")[0].left)


def test_a_scene_without_its_manifest_is_not_there(own_dataset: Path) -> None:
    Layout(own_dataset).manifest("train", 0).unlink()
    assert [sample.scene for sample in StereoDataset(own_dataset, "train")] == [1, 1]


def test_folders_that_are_no_data_set(tmp_path: Path, own_dataset: Path) -> None:
    with pytest.raises(DatasetError, match=r"nowhere: there is no such folder"):
        StereoDataset(tmp_path / "nowhere", "train")
    (tmp_path / "photos").mkdir()
    with pytest.raises(DatasetError, match=r"photos: is not a data set, it has no recipe\.yaml"):
        StereoDataset(tmp_path / "photos", "train")
    with pytest.raises(DatasetError, match=r"has no finished val scene; there are 2 train and 1 test"):
        StereoDataset(own_dataset, "val")
    with pytest.raises(DatasetError, match=r"no split 'training'; there are train, val, test"):
        StereoDataset(own_dataset, "training")
    with pytest.raises(DatasetError, match=r"no render pass 'dirty'; there are clean, final"):
        StereoDataset(own_dataset, "train", render_pass="dirty")
    with pytest.raises(DatasetError, match=r"0000\.json: lists no image of the final pass"):
        StereoDataset(own_dataset, "train", render_pass="final")
    for split in ("train", "test"):
        for scene in (0, 1):
            Layout(own_dataset).manifest(split, scene).unlink(missing_ok=True)
    with pytest.raises(DatasetError, match=r"has no finished train scene and none of another split"):
        StereoDataset(own_dataset, "train")


def test_a_damaged_manifest_is_named(own_dataset: Path) -> None:
    Layout(own_dataset).manifest("train", 1).write_text("{}")
    with pytest.raises(DatasetError, match=r"manifest/TRAIN/A/0001\.json: is not a scene's manifest"):
        StereoDataset(own_dataset, "train")


def test_arrays_of_another_size_or_type_than_the_left_image(own_dataset: Path) -> None:
    layout = Layout(own_dataset)
    write_pfm(layout.file("disparity", "train", 0, "left", 6), np.zeros((HEIGHT, WIDTH + 1)))
    write_png(layout.file("frames_cleanpass", "train", 0, "right", 6), np.zeros((HEIGHT, WIDTH), np.uint8))
    write_png(layout.file("object_index", "train", 0, "left", 6), np.zeros((HEIGHT, WIDTH), np.uint8))
    vouch(own_dataset, "train", 0)
    sample = StereoDataset(own_dataset, "train")[0]
    with pytest.raises(DatasetError, match=r"0006\.pfm: holds \(64, 97\) of float32 where .* \(64, 96\)"):
        _ = sample.disparity_left
    with pytest.raises(DatasetError, match=r"right/0006\.png: holds \(64, 96\) of uint8 .* \(64, 96, 3\)"):
        _ = sample.right
    with pytest.raises(DatasetError, match=r"object_index.*holds \(64, 96\) of uint8 .* of uint16"):
        _ = sample.object_index_left


def test_a_file_that_is_not_the_manifest_s_is_refused_when_it_is_read(own_dataset: Path) -> None:
    sample = StereoDataset(own_dataset, "train")[0]
    path = Layout(own_dataset).file("disparity", "train", 0, "right", 6)
    content = bytearray(path.read_bytes())
    content[-3] ^= 1  # another number, which a PFM itself cannot tell
    path.write_bytes(content)
    assert sample.disparity_left is not None
    with pytest.raises(
        DatasetError, match=f"{path}: is damaged, its SHA-256 is not the manifest's; verify --repair"
    ):
        sample.disparity_right  # noqa: B018


def test_a_damaged_scene_record_is_named(own_dataset: Path) -> None:
    record = Layout(own_dataset).scene_record("train", 0)
    for content in ("{", '{"family": "x"}', "[]"):
        record.write_text(content)
        vouch(own_dataset, "train", 0)
        with pytest.raises(DatasetError, match=r"scenes/TRAIN/A/0000\.json: is not a scene"):
            _ = StereoDataset(own_dataset, "train")[0].scene_record
    record.write_bytes(b"\xff\xfe")
    vouch(own_dataset, "train", 0)
    with pytest.raises(DatasetError, match=r"scenes/TRAIN/A/0000\.json: is not a scene"):
        _ = StereoDataset(own_dataset, "train")[0].scene_record


def test_reading_needs_neither_blender_nor_torch() -> None:
    modules = "datagen, datagen.verify.dataset_check, datagen.gallery.page"
    code = f"import sys, {modules}; assert not {{'bpy', 'torch'}} & set(sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_torchvision_style_reader_finds_the_same_files(analytic_dataset: Path) -> None:
    """The globs and the PFM reading of torchvision's SceneFlowStereo (variant FlyingThings3D), transcribed."""
    lefts = sorted(analytic_dataset.glob("frames_cleanpass/TRAIN/*/*/left/*.png"))
    rights = sorted(analytic_dataset.glob("frames_cleanpass/TRAIN/*/*/right/*.png"))
    disparities = sorted(analytic_dataset.glob("disparity/TRAIN/*/*/left/*.pfm"))
    assert len(lefts) == len(rights) == len(disparities) == 4
    with disparities[2].open("rb") as file:
        assert file.readline().rstrip() == b"Pf"
        width, height = map(int, file.readline().split())
        assert float(file.readline()) < 0
        values = np.flipud(np.fromfile(file, "<f4").reshape(height, width))
    np.testing.assert_array_equal(values, StereoDataset(analytic_dataset, "train")[2].disparity_left)
