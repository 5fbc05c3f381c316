"""verify finds nothing in a right data set, and every kind of damage in a wrong one."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from datagen.dataset.layout import Layout
from datagen.dataset.manifest import file_entry, read_manifest
from datagen.dataset.samples import StereoDataset
from datagen.errors import DatasetError
from datagen.formats import (
    read_camera_data,
    read_gradient,
    read_occlusion,
    read_pfm,
    read_png,
    write_camera_data,
    write_gradient,
    write_occlusion,
    write_pfm,
    write_png,
)
from datagen.ground_truth.labels import forward_differences, gradient_validity
from datagen.recipe.recipe import read_recipe
from datagen.verify.dataset_check import FEW_SCENES, verify_dataset
from datagen.verify.report import VerifyReport
from tests.datagen.analytic_world import commit, write_dataset


def test_a_right_data_set_has_no_problem(analytic_dataset: Path) -> None:
    calls: list[tuple[int, int]] = []
    report = verify_dataset(analytic_dataset, progress=lambda done, total: calls.append((done, total)))
    assert [str(problem) for problem in report.problems] == []
    assert report.ok
    assert (report.scenes, report.frames, report.files) == (3, 6, 3 * (2 * 2 * 5 + 3))
    listed = [
        entry.size
        for split, scene in (("train", 0), ("train", 1), ("test", 0))
        for entry in read_manifest(Layout(analytic_dataset).manifest(split, scene)).files
    ]
    assert report.bytes_read == sum(listed)
    assert calls == [(1, 3), (2, 3), (3, 3)]
    assert "no problem in 3 scenes, 6 frames" in str(report)


def messages(report: VerifyReport) -> str:
    assert not report.ok
    for problem in report.problems:
        assert "\n" not in str(problem)
    return "\n".join(str(problem) for problem in report.problems)


def test_every_one_of_many_flipped_bits_is_found(own_dataset: Path) -> None:
    rng = np.random.default_rng(0)
    layout = Layout(own_dataset)
    files = [entry.path for entry in read_manifest(layout.manifest("train", 1)).files]
    for name in files:
        path = own_dataset / name
        good = path.read_bytes()
        damaged = bytearray(good)
        damaged[rng.integers(len(good))] ^= 1 << rng.integers(8)
        path.write_bytes(damaged)
        report = verify_dataset(own_dataset)
        assert messages(report) == f"{name}: is damaged, its SHA-256 is not the manifest's"
        assert (report.problems[0].split, report.problems[0].scene) == ("train", 1)
        path.write_bytes(good)
    assert verify_dataset(own_dataset).ok


def test_files_cut_lengthened_deleted_and_added(own_dataset: Path) -> None:
    layout = Layout(own_dataset)
    cut = layout.file("disparity_gradient", "train", 0, "left", 6)
    cut.write_bytes(cut.read_bytes()[:-10])
    longer = layout.file("frames_cleanpass", "train", 0, "right", 7)
    longer.write_bytes(longer.read_bytes() + b"x")
    layout.file("occlusion", "test", 0, "left", 6).unlink()
    layout.file("disparity", "train", 1, "left", 8).write_bytes(b"more")
    (layout.manifest("train", 0).parent / ".0007.json.1.1.tmp").write_bytes(b"{")
    found = messages(verify_dataset(own_dataset)).splitlines()
    assert len(found) == 5
    assert any("TRAIN/A/0000/left/0006.exr: has" in line and "bytes where" in line for line in found)
    assert any("TRAIN/A/0000/right/0007.png: has" in line and "bytes where" in line for line in found)
    assert any(line.startswith("occlusion/TEST/A/0000/left/0006.png: cannot be read") for line in found)
    assert "disparity/TRAIN/A/0001/left/0008.pfm: belongs to no finished scene" in found
    assert "manifest/TRAIN/A/.0007.json.1.1.tmp: belongs to no finished scene" in found


def test_what_desktops_leave_is_no_damage(own_dataset: Path) -> None:
    for folder in [own_dataset, *(path for path in own_dataset.rglob("*") if path.is_dir())]:
        for name in (".DS_Store", "._0006.png", "Thumbs.db", "desktop.ini"):
            (folder / name).write_bytes(b"Bud1")
    assert verify_dataset(own_dataset).ok


def test_a_scene_without_manifest_is_missing_and_its_files_belong_to_nothing(own_dataset: Path) -> None:
    Layout(own_dataset).manifest("train", 0).unlink()
    found = messages(verify_dataset(own_dataset)).splitlines()
    assert "recipe.yaml: 1 of the recipe's 2 train scenes are not finished (0)" in found
    orphans = [line for line in found if line.endswith("belongs to no finished scene")]
    assert len(orphans) == 2 * 2 * 5 + 3
    assert len(found) == len(orphans) + 1


def test_manifests_that_are_damaged_or_of_another_scene(own_dataset: Path) -> None:
    layout = Layout(own_dataset)
    layout.manifest("train", 1).write_bytes(layout.manifest("train", 0).read_bytes())
    layout.manifest("test", 0).write_text("{}")
    found = messages(verify_dataset(own_dataset))
    assert "manifest/TRAIN/A/0001.json: is the manifest of train scene 0" in found
    assert "scenes/TRAIN/A/0001.json: is part of the scene but not in its manifest" in found
    assert "manifest/TEST/A/0000.json: is not a scene's manifest" in found


def test_folders_that_are_no_data_set(tmp_path: Path, own_dataset: Path) -> None:
    with pytest.raises(DatasetError, match="there is no such folder"):
        verify_dataset(tmp_path / "nowhere")
    with pytest.raises(DatasetError, match="is not a data set"):
        verify_dataset(tmp_path)
    Layout(own_dataset).recipe.write_text("world: {")
    with pytest.raises(DatasetError, match=r"recipe\.yaml"):
        verify_dataset(own_dataset)


# Damage that the manifest does not show, because it was there before the manifest was written.

Arrays = dict[str, NDArray[np.float32]]


def change_disparities(root: Path, change: Callable[[Arrays], Arrays]) -> None:
    """Change the disparities of one frame, with gradients that fit them, and commit the scene again."""
    layout = Layout(root)
    paths = {view: layout.file("disparity", "train", 0, view, 6) for view in ("left", "right")}
    for view, disparity in change({view: read_pfm(path) for view, path in paths.items()}).items():
        write_pfm(paths[view], disparity)
        with np.errstate(invalid="ignore"):  # Infinity minus infinity, where that is the damage.
            gradient = forward_differences(disparity)
        valid = gradient_validity(gradient, read_recipe(layout.recipe).gradient_threshold_px)
        write_gradient(layout.file("disparity_gradient", "train", 0, view, 6), gradient, valid)
    commit_again(root)


def commit_again(root: Path) -> None:
    layout = Layout(root)
    names = [entry.path for entry in read_manifest(layout.manifest("train", 0)).files]
    files = [file_entry(root, root / name) for name in names if (root / name).exists()]
    commit(layout, "train", 0, files, read_recipe(layout.recipe))


def test_committing_unchanged_arrays_again_is_no_problem(own_dataset: Path) -> None:
    change_disparities(own_dataset, lambda arrays: arrays)
    assert verify_dataset(own_dataset).ok


def shift_half_a_pixel(disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """The map sampled half a pixel further right, as if pixel centres were at whole numbers."""
    return (disparity + np.roll(disparity, -1, axis=1)) / np.float32(2)


BOTH_VIEWS = ("left", "right")
WRONG: dict[str, tuple[Callable[[Arrays], Arrays], str]] = {
    "views swapped": (lambda a: {"left": a["right"], "right": a["left"]}, "from the scene's geometry"),
    "sign turned": (lambda a: {view: -a[view] for view in BOTH_VIEWS}, "disparities are negative"),
    "sampled half a pixel off": (
        lambda a: {view: shift_half_a_pixel(a[view]) for view in BOTH_VIEWS},
        "from the scene's geometry",
    ),
    "half a pixel too much": (
        lambda a: {view: a[view] + np.float32(0.5) for view in BOTH_VIEWS},
        "from the scene's geometry",
    ),
    "one view half a pixel too much": (
        lambda a: {"left": a["left"] + np.float32(0.5)},
        "visible pixels have another disparity than the other view",
    ),
    "baseline doubled": (lambda a: {view: 2 * a[view] for view in BOTH_VIEWS}, "from the scene's geometry"),
    "upside down": (
        lambda a: {view: a[view][::-1].copy() for view in BOTH_VIEWS},
        "from the scene's geometry",
    ),
    "not finite": (
        lambda a: {"left": np.where(a["left"] > 15, np.float32("nan"), a["left"])},
        "disparities are not finite",
    ),
    "infinite": (
        lambda a: {"right": np.where(a["right"] == 0, np.float32("inf"), a["right"])},
        "disparities are not finite",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_disparities_that_are_wrong(own_dataset: Path, name: str) -> None:
    change, says = WRONG[name]
    change_disparities(own_dataset, change)
    report = verify_dataset(own_dataset)
    assert says in messages(report)
    assert {(problem.split, problem.scene) for problem in report.problems} == {("train", 0)}


def test_disparity_of_another_size(own_dataset: Path) -> None:
    change_disparities(own_dataset, lambda arrays: {"left": arrays["left"][:-1]})
    found = messages(verify_dataset(own_dataset))
    assert found.startswith("disparity/TRAIN/A/0000/left/0006.pfm: holds (63, 96) of float32 where")


def test_all_images_of_another_size_than_the_camera(own_dataset: Path) -> None:
    layout = Layout(own_dataset)
    for view in BOTH_VIEWS:
        for kind in ("frames_cleanpass", "object_index"):
            path = layout.file(kind, "train", 0, view, 6)
            write_png(path, read_png(path)[:-1])
        path = layout.file("occlusion", "train", 0, view, 6)
        write_occlusion(path, read_occlusion(path)[:-1])
    change_disparities(own_dataset, lambda arrays: {view: array[:-1] for view, array in arrays.items()})
    assert "is (63, 96) where the scene's camera makes (64, 96)" in messages(verify_dataset(own_dataset))


def test_images_swapped(own_dataset: Path) -> None:
    layout = Layout(own_dataset)
    left, right = (layout.file("frames_cleanpass", "train", 0, view, 6) for view in BOTH_VIEWS)
    left_bytes, right_bytes = left.read_bytes(), right.read_bytes()
    left.write_bytes(right_bytes)
    right.write_bytes(left_bytes)
    commit_again(own_dataset)
    assert "the views are swapped" in messages(verify_dataset(own_dataset))


def test_gradients_that_do_not_follow_from_the_disparity(own_dataset: Path) -> None:
    path = Layout(own_dataset).file("disparity_gradient", "train", 0, "right", 7)
    gradient, valid = read_gradient(path)
    write_gradient(path, gradient[..., ::-1], valid)
    commit_again(own_dataset)
    found = messages(verify_dataset(own_dataset))
    assert "valid gradients are not the forward differences" in found
    assert "disparity/TRAIN/A/0000/right/0007.pfm" in found
    valid[5, 5] = not valid[5, 5]
    write_gradient(path, gradient, valid)
    commit_again(own_dataset)
    assert "1 pixels of the gradient's mask do not follow" in messages(verify_dataset(own_dataset))


def test_occlusion_against_disparity(own_dataset: Path) -> None:
    path = Layout(own_dataset).file("occlusion", "train", 0, "left", 6)
    labels = read_occlusion(path)
    for changed, says in (
        (np.where(labels == 1, 0, labels), "sampled occlusion labels are not those of the scene"),
        (np.where(labels == 1, 0, 1), "visible pixels have another disparity than the other view"),
        (np.where(labels == 2, 1, labels), "have a label that contradicts their place"),
        (np.where(labels == 0, 1, labels), "occluded pixels have nothing nearer in front of them"),
        (labels[:, ::-1].copy(), "have a label that contradicts their place"),
    ):
        write_occlusion(path, changed.astype(np.uint8))
        commit_again(own_dataset)
        assert says in messages(verify_dataset(own_dataset))


def test_object_index_against_the_scene(own_dataset: Path) -> None:
    path = Layout(own_dataset).file("object_index", "train", 0, "left", 6)
    index = read_png(path).astype(np.uint16)
    for changed, says in (
        (np.where(index == 3, 4, index), "object index 4 is beyond the scene's 3 objects"),
        (np.where(index == 0, 1, index), "pixels are sky in one of object index and disparity"),
        (np.choose(index, [0, 2, 1, 3]), "sampled object indices are not those"),
    ):
        write_png(path, changed.astype(np.uint16))
        commit_again(own_dataset)
        assert says in messages(verify_dataset(own_dataset))


def test_poses_against_the_scene(own_dataset: Path) -> None:
    path = Layout(own_dataset).file("camera_data", "train", 0)
    poses = read_camera_data(path)
    write_camera_data(path, {frame: (right, left) for frame, (left, right) in poses.items()})
    commit_again(own_dataset)
    assert "the poses of frame 7 are not those of the scene's camera" in messages(verify_dataset(own_dataset))
    write_camera_data(path, {6: poses[6]})
    commit_again(own_dataset)
    assert "has the frames [6] where the scene has [6, 7]" in messages(verify_dataset(own_dataset))
    path.write_text("Frame 6\n")
    commit_again(own_dataset)
    assert "camera data has three lines a frame" in messages(verify_dataset(own_dataset))


@pytest.mark.parametrize("at", ["fx", "baseline_m", "frames"])
def test_cameras_against_the_scene(at: str, own_dataset: Path) -> None:
    path = Layout(own_dataset).file("cameras", "train", 0)
    record = json.loads(path.read_text())
    if at == "frames":
        record["frames"]["7"]["right"]["world_to_camera"][0][3] += 1e-6
    else:
        record[at] *= 1.0001
    path.write_text(json.dumps(record))
    commit_again(own_dataset)
    assert "its numbers are not those of the scene's camera" in messages(verify_dataset(own_dataset))
    path.write_text("[")
    commit_again(own_dataset)
    assert "cameras.json: is no JSON" in messages(verify_dataset(own_dataset))


def test_a_file_the_manifest_forgot_and_a_scene_that_does_not_parse(own_dataset: Path) -> None:
    layout = Layout(own_dataset)
    layout.file("occlusion", "train", 0, "left", 7).unlink()
    commit_again(own_dataset)
    wanted = "occlusion/TRAIN/A/0000/left/0007.png: is part of the scene but not in its manifest"
    assert wanted in messages(verify_dataset(own_dataset))
    layout.scene_record("train", 0).write_text('{"family": 3}')
    commit_again(own_dataset)
    assert "scenes/TRAIN/A/0000.json: is not a scene" in messages(verify_dataset(own_dataset))
    layout.scene_record("train", 0).unlink()
    commit_again(own_dataset)
    wanted = "scenes/TRAIN/A/0000.json: is part of the scene but not in its manifest"
    assert wanted in messages(verify_dataset(own_dataset))


def test_the_scene_record_of_another_scene(own_dataset: Path) -> None:
    layout = Layout(own_dataset)
    layout.scene_record("train", 0).write_bytes(layout.scene_record("train", 1).read_bytes())
    commit_again(own_dataset)
    assert "geometry" in messages(verify_dataset(own_dataset))
    assert len(StereoDataset(own_dataset, "train")) == 4


@pytest.mark.slow
def test_a_rendered_data_set_has_no_problem_and_swapped_views_have(
    rendered_dataset: Path, tmp_path: Path
) -> None:
    assert [str(problem) for problem in verify_dataset(rendered_dataset, workers=2).problems] == []
    root = Path(shutil.copytree(rendered_dataset, tmp_path / "set"))
    change_disparities(root, lambda arrays: {"left": arrays["right"], "right": arrays["left"]})
    found = messages(verify_dataset(root))
    assert "sampled disparities are over 0.01 px from the scene's geometry" in found
    assert "visible pixels have another disparity than the other view has there" in found


@pytest.mark.slow
def test_processes_of_their_own_find_the_same(tmp_path: Path) -> None:
    write_dataset(tmp_path / "set", {"train": FEW_SCENES})
    damaged = Layout(tmp_path / "set").file("occlusion", "train", 3, "left", 7)
    damaged.write_bytes(damaged.read_bytes()[:-1])
    calls: list[tuple[int, int]] = []
    report = verify_dataset(tmp_path / "set", lambda *done: calls.append(done), workers=2)
    alone = verify_dataset(tmp_path / "set", workers=1)
    assert report.problems == alone.problems
    assert len(report.problems) == 1
    assert (report.frames, report.files, report.bytes_read) == (alone.frames, alone.files, alone.bytes_read)
    assert calls == [(done, FEW_SCENES) for done in range(1, FEW_SCENES + 1)]


def test_without_rays_the_geometry_is_left_out_and_nothing_else(own_dataset: Path) -> None:
    change_disparities(own_dataset, lambda arrays: {view: array * 0 for view, array in arrays.items()})
    assert "from the scene's geometry" in messages(verify_dataset(own_dataset))
    without = messages(verify_dataset(own_dataset, sampled_pixels=0))
    assert "geometry" not in without
    assert "pixels are sky in one of object index and disparity" in without
