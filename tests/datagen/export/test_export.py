"""Exports, read back by readers that are not ours."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import webdataset

from datagen import DatasetError, StereoDataset
from datagen.dataset.layout import Layout
from datagen.dataset.manifest import file_entry, read_manifest, write_manifest
from datagen.export import EXPORTERS, ExportOptions
from datagen.export.kitti import encode_disparity, share_too_large, vehicle_numbers
from datagen.export.lidar import lidar_mask
from datagen.formats import read_camera_data, read_pfm, write_flow, write_pfm
from datagen.sources.registry import open_source
from datagen.verify.dataset_check import verify_dataset
from scenes import sample_scene
from scenes.spec import StereoCamera, Trajectory
from stereoforge.cli import main
from stereoforge_kit.files import open_tree


def export(data: Path, kind: str, out: Path, *flags: str) -> None:
    with pytest.raises(SystemExit) as end:
        main(["export", str(data), "--format", kind, "--out", str(out), *flags])
    assert end.value.code == 0


def read_kitti(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(disparity, valid), as every KITTI loader does it."""
    raw = cv2.imread(str(path), cv2.IMREAD_ANYDEPTH)
    assert raw.dtype == np.uint16
    return raw / 256.0, raw > 0


def test_kitti(analytic_dataset: Path, tmp_path: Path) -> None:
    export(analytic_dataset, "kitti", tmp_path)
    names = (tmp_path / "training/frames.txt").read_text().splitlines()
    assert names == [f"00000{k}_10 TRAIN/A/000{k // 2}/000{6 + k % 2}" for k in range(4)]
    for number, sample in enumerate(StereoDataset(analytic_dataset, "train")):
        file = f"{number:06d}_10.png"
        left = cv2.cvtColor(cv2.imread(str(tmp_path / "training/image_2" / file)), cv2.COLOR_BGR2RGB)
        right = cv2.cvtColor(cv2.imread(str(tmp_path / "training/image_3" / file)), cv2.COLOR_BGR2RGB)
        assert (left == sample.left).all()
        assert (right == sample.right).all()
        everywhere, valid = read_kitti(tmp_path / "training/disp_occ_0" / file)
        assert (valid == (sample.disparity_left > 0)).all()
        assert np.abs(everywhere - sample.disparity_left)[valid].max() <= 0.5 / 256 + 1e-6
        visible, seen = read_kitti(tmp_path / "training/disp_noc_0" / file)
        assert (seen == valid & (sample.occlusion_left == 0)).all()
        assert 0 < seen.sum() < valid.sum()
        assert (visible[seen] == everywhere[seen]).all()
        objects = cv2.imread(str(tmp_path / "training/obj_map" / file), cv2.IMREAD_UNCHANGED)
        assert objects.dtype == np.uint8
        assert (objects == 0).all()  # no vehicle
    lines = (tmp_path / "training/calib_cam_to_cam/000000.txt").read_text().splitlines()
    words = dict(line.split(": ") for line in lines)
    left, right = (np.array(words[f"P_rect_{k}"].split(), float).reshape(3, 4) for k in ("02", "03"))
    camera = StereoDataset(analytic_dataset, "train")[0].scene_record.camera
    point = np.array([0.3, -0.2, 4.0, 1.0])
    one, two = ((p @ point)[:2] / (p @ point)[2] for p in (left, right))
    assert one[0] - two[0] == pytest.approx(camera.focal_px * camera.baseline_m / 4.0)
    assert one[1] == two[1]
    assert len(list((tmp_path / "testing/image_2").iterdir())) == 2


def test_kitti_object_maps_number_vehicles() -> None:
    """The oracle reads the Scene as text: class names and the words before a part's."""
    scene = sample_scene(np.random.default_rng(3), "driving")
    numbers = vehicle_numbers(scene)
    assert numbers[0] == 0
    vehicles: dict[str, set[int]] = {}
    for thing, number in zip(scene.objects, numbers[1:], strict=True):
        part = re.fullmatch(
            r"((?:car|parked) [LR]?[0-9.]+) (body|box|glass|trim|head lamps|tail lamps|wheels?.*)", thing.name
        )
        assert (part is not None) == (number > 0), thing.name
        if part is not None:
            vehicles.setdefault(part[1], set()).add(int(number))
    assert len(vehicles) > 10
    assert all(len(own) == 1 for own in vehicles.values())
    assert len(set.union(*vehicles.values())) == len(vehicles)


def test_kitti_disparities_at_the_ends_of_what_it_can_store() -> None:
    disparity = np.array([[0.0, 1e-4, 255.99, 256.1, np.nan, np.inf, 3.0]], np.float32)
    keep = np.array([[True] * 6 + [False]])
    assert encode_disparity(disparity, keep).tolist() == [[0, 1, 65533, 0, 0, 0, 0]]


def test_a_laser_scanner_measures_few_pixels_in_even_lines(analytic_dataset: Path, tmp_path: Path) -> None:
    mask = lidar_mask(StereoCamera(1242, 375, 721.5 * 32 / 1242, 0.5, Trajectory.static()), 64)
    assert 0.03 < mask.mean() < 0.06
    assert not mask[:140].any()  # Nothing above the highest beam, 2 degrees over the horizon.
    middle = np.flatnonzero(mask.any(axis=0))
    column = np.flatnonzero(mask[:, middle[len(middle) // 2]])
    # The picture's lower edge is 14.6 degrees under the horizon, the highest beam 2 degrees over it.
    assert len(column) == pytest.approx((14.6 + 2.0) / (26.9 / 63), abs=1)
    # Beams are 26.9 / 63 degrees apart: 5.4 pixels at the horizon, more below it.
    assert np.diff(column)[:5].mean() == pytest.approx(5.4, abs=0.5)
    with pytest.raises(ValueError, match="at least one beam"):
        lidar_mask(StereoCamera(10, 10, 32.0, 0.5, Trajectory.static()), 0)
    export(analytic_dataset, "kitti", tmp_path, "--lidar-beams", "64")
    sparse = read_kitti(tmp_path / "training/disp_occ_0/000000_10.png")[1]
    sample = StereoDataset(analytic_dataset, "train")[0]
    beams = lidar_mask(sample.scene_record.camera, 64)
    assert (sparse == beams & (sample.disparity_left > 0)).all()


def test_webdataset_shards_stream_the_same_bytes(analytic_dataset: Path, tmp_path: Path) -> None:
    export(analytic_dataset, "webdataset", tmp_path / "a", "--frames-per-shard", "3")
    assert [path.name for path in sorted((tmp_path / "a").iterdir())] == [
        "export.json",
        "index.json",
        "recipe.yaml",
        "test-000000.tar",
        "train-000000.tar",
        "train-000001.tar",
    ]
    ours = open_source(f"webdataset:{tmp_path / 'a'}").frames("train")
    native = StereoDataset(analytic_dataset, "train")
    for one, other in zip(ours, native, strict=True):
        assert (one.disparity_right == other.disparity_right).all()
    shards = [str(tmp_path / "a" / f"train-00000{k}.tar") for k in range(2)]
    samples = list(webdataset.WebDataset(shards, shardshuffle=False))
    frames = StereoDataset(analytic_dataset, "train")
    assert [sample["__key__"] for sample in samples] == [
        f"train-000{k // 2}-000{6 + k % 2}" for k in range(4)
    ]
    layout = Layout(analytic_dataset)
    for sample, frame in zip(samples, frames, strict=True):
        members = {name for name in sample if not name.startswith("__")}
        assert members == {
            *(f"{view}.png" for view in ("left", "right")),
            *(f"disparity_{view}.pfm" for view in ("left", "right")),
            *(f"disparity_gradient_{view}.exr" for view in ("left", "right")),
            *(f"{kind}_{view}.png" for kind in ("occlusion", "object_index") for view in ("left", "right")),
            "meta.json",
        }
        disparity = layout.file("disparity", "train", frame.scene, "right", frame.frame)
        assert sample["disparity_right.pfm"] == disparity.read_bytes()
        decoded = cv2.imdecode(np.frombuffer(sample["left.png"], np.uint8), cv2.IMREAD_COLOR)
        assert (decoded[..., ::-1] == frame.left).all()
        meta = json.loads(sample["meta.json"])
        assert (meta["scene"], meta["frame"], meta["render_pass"]) == (frame.scene, frame.frame, "clean")
        assert meta["baseline_m"] == frame.scene_record.camera.baseline_m
        poses = read_camera_data(layout.file("camera_data", "train", frame.scene))[frame.frame]
        np.testing.assert_array_equal([meta["poses"][view] for view in ("left", "right")], poses)
        assert meta["cx_left"] == (meta["width"] - 1) / 2
        for view, pose in zip(("left", "right"), poses, strict=True):
            opencv = np.array(meta["cameras"][view]["camera_to_world"])
            np.testing.assert_allclose(opencv, pose @ np.diag((1, -1, -1, 1)), atol=1e-12)


@pytest.mark.parametrize("kind", EXPORTERS)
def test_a_damaged_data_set_is_not_exported(kind: str, own_dataset: Path, tmp_path: Path) -> None:
    if kind == "coco":
        pytest.importorskip("pycocotools")
    read = "object_index" if kind == "coco" else "disparity"
    damaged = Layout(own_dataset).file(read, "train", 0, "left", 6)
    content = bytearray(damaged.read_bytes())
    content[len(content) // 2] ^= 1
    damaged.write_bytes(content)
    sets = [StereoDataset(own_dataset, "train")]
    with pytest.raises(DatasetError, match=f"{damaged}: is damaged, its SHA-256 is not the manifest's"):
        EXPORTERS[kind](sets, open_tree(tmp_path / "out"), ExportOptions(), lambda *_: None)


def test_a_recipe_of_other_settings_is_not_exported(own_dataset: Path, tmp_path: Path) -> None:
    recipe = own_dataset / "recipe.yaml"
    recipe.write_text(recipe.read_text().replace("seed: 0", "seed: 1"))
    sets = [StereoDataset(own_dataset, "train")]
    with pytest.raises(DatasetError, match="is not the recipe that the scenes were rendered by"):
        EXPORTERS["webdataset"](sets, open_tree(tmp_path / "out"), ExportOptions(), lambda *_: None)


def test_a_damaged_member_of_a_shard_is_refused_when_it_is_read(
    analytic_dataset: Path, tmp_path: Path
) -> None:
    with pytest.raises(SystemExit):
        main(["export", str(analytic_dataset), "--format", "webdataset", "--out", str(tmp_path / "out")])
    shard = tmp_path / "out" / "train-000000.tar"
    whole = Layout(analytic_dataset).file("disparity", "train", 0, "left", 7).read_bytes()
    content = bytearray(shard.read_bytes())
    content[content.index(whole) + len(whole) - 100] ^= 1
    shard.write_bytes(content)
    frames = open_source(str(tmp_path / "out")).frames("train")
    assert frames[0].disparity_left is not None
    assert frames[1].left is not None
    with pytest.raises(DatasetError, match=r"train-0000-0007\.disparity_left\.pfm is damaged, its SHA-256"):
        frames[1].disparity_left  # noqa: B018


def test_damage_to_shards_is_found(analytic_dataset: Path, tmp_path: Path) -> None:
    export(analytic_dataset, "webdataset", tmp_path, "--frames-per-shard", "3")
    report = verify_dataset(tmp_path)
    assert report.ok
    assert (report.scenes, report.frames, report.files) == (3, 6, 3)
    assert report.bytes_read == sum(path.stat().st_size for path in tmp_path.glob("*.tar"))
    shard = tmp_path / "train-000001.tar"
    good = shard.read_bytes()
    for bad, said in (
        (
            good[:5000] + bytes([good[5000] ^ 8]) + good[5001:],
            "is damaged, its SHA-256 is not the manifest's",
        ),
        (good[:-1], f"has {len(good) - 1} bytes where the manifest has {len(good)}"),
    ):
        shard.write_bytes(bad)
        assert [str(problem) for problem in verify_dataset(tmp_path).problems] == [f"{shard.name}: {said}"]
    shard.rename(tmp_path / "train-000009.tar")
    assert [str(problem) for problem in verify_dataset(tmp_path).problems] == [
        "train-000001.tar: cannot be read: No such file or directory",
        "train-000009.tar: is not in index.json",
    ]
    index = tmp_path / "index.json"
    index.write_text(index.read_text().replace("train-0001-0007", "train-0001-0006"))
    with pytest.raises(
        DatasetError, match=r"index\.json: is not an index of shards \(is damaged, its SHA-256"
    ):
        verify_dataset(tmp_path)
    index.write_text('{"shards": {}}')
    with pytest.raises(DatasetError, match="has no sizes and SHA-256 of its shards"):
        verify_dataset(tmp_path)


def test_exporting_twice_gives_the_same_bytes(analytic_dataset: Path, tmp_path: Path) -> None:
    for kind in ("kitti", "webdataset"):
        digests = []
        for out in (tmp_path / kind / "a", tmp_path / kind / "b"):
            export(analytic_dataset, kind, out)
            files = sorted(path for path in out.rglob("*") if path.is_file())
            digests.append([hashlib.sha256(path.read_bytes()).hexdigest() for path in files])
        assert digests[0] == digests[1]
        assert len(digests[0]) > 1


def test_sceneflow_is_the_published_part_of_the_data_set(analytic_dataset: Path, tmp_path: Path) -> None:
    export(analytic_dataset, "sceneflow", tmp_path / "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "frames_cleanpass",
        "disparity",
        "camera_data",
        "export.json",
    }
    files = [path for path in (tmp_path / "out").glob("*/**/*") if path.is_file()]
    assert len(files) == 3 * (2 * 2 * 2 + 1)
    for path in files:
        original = analytic_dataset / path.relative_to(tmp_path / "out")
        assert path.read_bytes() == original.read_bytes()


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        (
            "kitti",
            "kitti has no place for: right disparity, disparity_gradient, objects that are no vehicles, poses",
        ),
        ("sceneflow", "sceneflow has no place for: disparity_gradient, occlusion, object_index"),
        ("webdataset", None),
    ],
)
def test_what_a_format_cannot_hold_is_said(
    analytic_dataset: Path, kind: str, says: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export(analytic_dataset, kind, tmp_path / "out")
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if "no place" in line] == ([says] if says else [])
    assert not any("256 px" in line for line in lines)


def test_flow_and_the_like_are_carried_where_they_were_rendered(own_dataset: Path, tmp_path: Path) -> None:
    """The scene of the fixture has none, so its manifest gets some."""
    layout = Layout(own_dataset)
    added = [
        layout.file("optical_flow", "test", 0, "left", 6, "into_future"),
        layout.file("normals", "test", 0, "right", 6),
    ]
    for path in added:
        path.parent.mkdir(parents=True)
        path.write_bytes(path.name.encode())
    manifest = read_manifest(layout.manifest("test", 0))
    files = (*manifest.files, *(file_entry(own_dataset, path) for path in added))
    write_manifest(layout.manifest("test", 0), replace(manifest, files=files))
    export(own_dataset, "webdataset", tmp_path / "wds")
    (sample, _) = webdataset.WebDataset(str(tmp_path / "wds/test-000000.tar"), shardshuffle=False)
    assert sample["optical_flow_into_future_left.pfm"] == added[0].name.encode()
    assert sample["normals_right.exr"] == added[1].name.encode()
    export(own_dataset, "sceneflow", tmp_path / "sceneflow")
    copied = tmp_path / "sceneflow" / layout.relative(added[0])
    assert copied.read_bytes() == added[0].name.encode()
    assert not (tmp_path / "sceneflow/normals").exists()


def add_motion(root: Path, split: str, scene: int) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Give a scene of two frames flow and disparity change, also of its last frame; both by the frame's number."""
    layout, motion = Layout(root), {}
    manifest = read_manifest(layout.manifest(split, scene))
    height, width = read_pfm(layout.file("disparity", split, scene, "left", 6)).shape
    added = []
    for frame in (6, 7):
        rng = np.random.default_rng(10 * scene + frame)
        flow = rng.uniform(-40, 40, (height, width, 2)).astype(np.float32)
        flow[0, :3] = ((np.nan, 0), (600, 0), (0, -512.5))
        change = rng.uniform(-0.5, 0.5, (height, width)).astype(np.float32)
        for kind, write, array in (
            ("optical_flow", write_flow, flow),
            ("disparity_change", write_pfm, change),
        ):
            path = layout.file(kind, split, scene, "left", frame, "into_future")
            path.parent.mkdir(parents=True, exist_ok=True)
            write(path, array)
            added.append(file_entry(root, path))
        motion[frame] = flow, change
    write_manifest(layout.manifest(split, scene), replace(manifest, files=(*manifest.files, *added)))
    return motion


def test_kitti_scene_flow(own_dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Read as KITTI's devkit and the loaders of optical flow do, which pair the sorted files of each folder."""
    motion = {scene: add_motion(own_dataset, "train", scene) for scene in (0, 1)}
    export(own_dataset, "kitti", tmp_path / "out")
    said = capsys.readouterr().out
    assert "no flow of 512 px and more" in said
    assert "2 of 6 frames are the last of their scenes" in said
    folder = tmp_path / "out/training"
    names = (folder / "frames.txt").read_text().splitlines()
    assert [line.split()[1] for line in names] == [
        f"TRAIN/A/000{scene}/000{f}" for f in (6, 7) for scene in (0, 1)
    ]
    samples = {sample.name: sample for sample in StereoDataset(own_dataset, "train")}
    now, then, flows = (
        sorted(folder.glob(pattern))
        for pattern in ("image_2/*_10.png", "image_2/*_11.png", "flow_occ/*_10.png")
    )
    assert (len(now), len(then), len(flows)) == (4, 2, 2)
    for scene, (first, second, flow_file) in enumerate(zip(now, then, flows, strict=False)):
        for path, frame in ((first, 6), (second, 7)):
            sample = samples[f"TRAIN/A/000{scene}/000{frame}"]
            assert (cv2.imread(str(path))[..., ::-1] == sample.left).all()
            right = folder / "image_3" / path.name
            assert (cv2.imread(str(right))[..., ::-1] == sample.right).all()
        raw = cv2.imread(str(flow_file), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR)[..., ::-1].astype(np.float64)
        flow, change = motion[scene][6]
        valid = np.ones(raw.shape[:2], bool)
        valid[0, :3] = False
        assert (raw[..., 2] == valid).all()
        assert (raw[~valid] == 0).all()
        assert np.abs((raw[..., :2] - 2**15) / 64 - flow)[valid].max() <= 1 / 128 + 1e-6
        disparity = samples[f"TRAIN/A/000{scene}/0006"].disparity_left
        moved, known = read_kitti(folder / "disp_occ_1" / flow_file.name)
        assert (known == (disparity > 0) & (disparity + change > 0)).all()
        assert np.abs(moved - disparity - change)[known].max() <= 0.5 / 256 + 1e-4
    assert not (tmp_path / "out/testing/flow_occ").exists()
    (frames,) = [open_source(f"kitti2015:{tmp_path / 'out'}").frames("train")]
    assert len(frames) == 4


def test_the_share_that_kitti_cannot_store() -> None:
    assert (
        share_too_large(np.array([[0.0, 255.99, 256.1, np.nan, np.inf, 3.0, 1, 1, 300, 1]], np.float32))
        == 0.2
    )


@pytest.mark.parametrize(
    ("flags", "code", "says"),
    [
        (["--format", "kitti", "--out", "{data}"], 2, "another place"),
        (["--format", "webdataset", "--frames-per-shard", "0", "--out", "{tmp}/x"], 2, "at least 1"),
        (["--format", "kitti", "--lidar-beams", "0", "--out", "{tmp}/x"], 2, "at least 1"),
    ],
)
def test_refusals(
    analytic_dataset: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    flags: list[str],
    code: int,
    says: str,
) -> None:
    words = [flag.format(data=analytic_dataset, tmp=tmp_path) for flag in flags]
    with pytest.raises(SystemExit) as end:
        main(["export", str(analytic_dataset), *words])
    assert end.value.code == code
    assert says in capsys.readouterr().err
    assert not (tmp_path / "x").exists()
