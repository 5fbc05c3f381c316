"""`stereoforge rectify`: rigs with distortion whose points and pictures are worked out by hand."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from datagen.cameras.raw_calibration import RawCalibration, RawView
from datagen.cameras.rectification import plan_rectification
from datagen.cameras.registry import read_calibration
from datagen.formats import read_png, write_png
from stereoforge.cli import main
from tests.stereoforge.raw_rigs import SIZE, WALL, WALL_M, RawRig, brown_rig, fisheye_rig
from tests.stereoforge.test_refine_videos import write_video

RIGS = {"brown": brown_rig, "fisheye": fisheye_rig}


def stored(path: Path, rig: RawRig, **others: object) -> Path:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    values = {"K1": rig.k1, "D1": rig.d1, "K2": rig.k2, "D2": rig.d2, "R": rig.rotation, "T": rig.shift}
    values |= {"image_width": SIZE[0], "image_height": SIZE[1]}
    if rig.fisheye:
        values["distortion_model"] = "fisheye"
    for name, value in (values | others).items():
        if value is not None:
            storage.write(name, value)
    storage.release()
    return path


def said(capsys: pytest.CaptureFixture[str], code: int, *words: object) -> str:
    """All that a command says, on one line, where it ends with this code."""
    with pytest.raises(SystemExit) as end:
        main([str(word) for word in words])
    told = capsys.readouterr()
    assert int(end.value.code or 0) == code, told.out + told.err
    return " ".join((told.out + told.err).split())


@pytest.fixture(scope="module", params=RIGS)
def raw_pair(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RawRig]:
    rig = RIGS[request.param]()
    folder = tmp_path_factory.mktemp(request.param)
    for name, right in (("left", False), ("right", True)):
        write_png(folder / f"{name}.png", rig.picture(right))
    stored(folder / "rig.yml", rig)
    return folder, rig


@pytest.mark.parametrize("alpha", [None, 0.0, 1.0])
@pytest.mark.parametrize("kind", RIGS)
def test_points_lie_where_the_calibration_says(kind: str, alpha: float | None) -> None:
    """A point's raw pixel by the lens's formula is where the map of its rectified pixel points to."""
    rig = RIGS[kind]()
    model = "fisheye" if rig.fisheye else "brown"
    views = (RawView(rig.k1, rig.d1, model), RawView(rig.k2, rig.d2, model))
    planned = plan_rectification(RawCalibration(*views, rig.rotation, rig.shift, SIZE), alpha)
    calibration = planned.calibration
    assert calibration.baseline_m == pytest.approx(np.linalg.norm(rig.shift), rel=1e-9)
    assert calibration.doffs == pytest.approx(0, abs=1e-9)
    points = np.random.default_rng(1).uniform([-0.7, -0.5, 1.5], [0.7, 0.5, 4.0], (500, 3))
    turned = points @ planned.rotations[0].T
    # In the rectified frame the right camera is the baseline to the right of the left one.
    x = calibration.fx * turned[:, 0] / turned[:, 2] + calibration.cx_left
    y = calibration.fy * turned[:, 1] / turned[:, 2] + calibration.cy
    disparity = calibration.fx * calibration.baseline_m / turned[:, 2]
    for right in (False, True):
        column = x - disparity * right
        inside = (column > 0) & (column < SIZE[0] - 1) & (y > 0) & (y < SIZE[1] - 1)
        assert inside.sum() > 150
        mapped = [
            cv2.remap(
                one, column.astype(np.float32)[:, None], y.astype(np.float32)[:, None], cv2.INTER_LINEAR
            )[:, 0]
            for one in planned.maps[right]
        ]
        expected = rig.pixels(points, right)
        # cv2.remap reads the map at 1/32 of a pixel.
        np.testing.assert_allclose(np.stack(mapped, axis=1)[inside], expected[inside], atol=0.05)


@pytest.mark.parametrize("kind", RIGS)
def test_alpha_keeps_all_or_only_what_is_seen(kind: str) -> None:
    rig = RIGS[kind]()
    model = "fisheye" if rig.fisheye else "brown"
    raw = RawCalibration(
        RawView(rig.k1, rig.d1, model), RawView(rig.k2, rig.d2, model), rig.rotation, rig.shift, SIZE
    )
    cropped, whole = plan_rectification(raw, 0.0), plan_rectification(raw, 1.0)
    assert min(seen.mean() for seen in cropped.seen) > 0.99
    assert cropped.calibration.fx > whole.calibration.fx
    for (x, y), seen in zip(whole.maps, whole.seen, strict=True):
        assert 0.5 < seen.mean() < 0.99
        for values, side in ((x[seen], SIZE[0]), (y[seen], SIZE[1])):
            assert values.min() < 3
            assert values.max() > side - 4


def test_a_warped_picture_is_rectified_to_a_tenth_of_a_pixel(
    raw_pair: tuple[Path, RawRig], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, rig = raw_pair
    raw = folder / "left.png", folder / "right.png"
    out = tmp_path / "out"
    assert "not rectified" in said(capsys, 0, "check", *raw, "--json", tmp_path / "raw.json")
    assert json.loads((tmp_path / "raw.json").read_text())["vertical_offset"]["worst_part_px"] > 3
    told = said(capsys, 0, "rectify", *raw, "--calibration", folder / "rig.yml", "--out", out, "--alpha", 0)
    assert "rectified; focal length" in told
    figures = tmp_path / "figures.json"
    pair = out / "left.png", out / "right.png"
    calibration = out / "calibration.json"
    told = said(capsys, 0, "check", *pair, "--calibration", calibration, "--json", figures)
    assert ": rectified, the left view first" in told
    found = json.loads(figures.read_text())
    offset = found["vertical_offset"]
    assert found["consistent_matches"] > 300
    assert abs(offset["median_px"]) < 0.05
    assert offset["worst_part_px"] < 0.1
    assert max(abs(part["median_px"]) for part in offset["parts"]) < 0.15
    # The wall's nearest and farthest points that both cameras see are within these.
    near, far = found["depth_range_m"]
    again = read_calibration(calibration)
    corners = np.array([[x, y, 1.0] for x in (-1.3, 1.3) for y in (-1.0, 1.0)])
    depths = WALL_M / (corners @ WALL)
    assert depths.min() < near < far < depths.max()
    assert again.size == SIZE
    middle = (SIZE[0] // 2, SIZE[1] // 2)
    ray = np.array([(middle[0] - again.cx_left) / again.fx, (middle[1] - again.cy) / again.fy, 1.0])
    turned = ray @ plan_rectification(_raw(rig), 0.0).rotations[0]
    expected = again.fx * again.baseline_m / (WALL_M / (turned @ WALL))
    assert disparity_at(*map(read_png, pair), middle) == pytest.approx(expected, abs=0.3)


def _raw(rig: RawRig) -> RawCalibration:
    model = "fisheye" if rig.fisheye else "brown"
    views = (RawView(rig.k1, rig.d1, model), RawView(rig.k2, rig.d2, model))
    return RawCalibration(*views, rig.rotation, rig.shift, SIZE)


def disparity_at(left: np.ndarray, right: np.ndarray, pixel: tuple[int, int]) -> float:
    """By the correlation of a patch along its row, to a whole pixel and a parabola."""
    x, y = pixel
    patch = left[y - 10 : y + 11, x - 10 : x + 11]
    scores = cv2.matchTemplate(right[y - 10 : y + 11, : x + 11], patch, cv2.TM_CCOEFF_NORMED)[0]
    best = int(scores.argmax())
    before, at, after = scores[best - 1 : best + 2]
    return x - 10 - (best + 0.5 * (before - after) / (before - 2 * at + after))


def test_folders_go_on_and_are_not_mixed(
    raw_pair: tuple[Path, RawRig], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, rig = raw_pair
    for view in ("left", "right"):
        for name in ("a", "b"):
            write_png(tmp_path / view / f"{name}.png", read_png(folder / f"{view}.png"))
    out = tmp_path / "out"
    words = ("rectify", tmp_path / "left", tmp_path / "right", "--out", out, "--calibration")
    assert "2 pairs rectified, 0 were there" in said(capsys, 0, *words, folder / "rig.yml")
    before = {path: path.read_bytes() for path in out.rglob("*.*")}
    names = {str(path.relative_to(out)) for path in before}
    assert names == {
        "calibration.json", "settings.json", "left/a.png", "left/b.png", "right/a.png", "right/b.png",
    }  # fmt: skip
    (out / "right" / "b.png").unlink()
    assert "1 pairs rectified, 1 were there" in said(capsys, 0, *words, folder / "rig.yml")
    assert {path: path.read_bytes() for path in out.rglob("*.*")} == before
    other = stored(tmp_path / "other.yml", rig, K1=rig.k1 + np.diag([1.0, 1.0, 0.0]))
    assert "holds results of other settings (calibration" in said(capsys, 1, *words, other)
    assert "other settings (interpolation)" in said(
        capsys, 1, *words, folder / "rig.yml", "--interpolation", "linear"
    )
    assert {path: path.read_bytes() for path in out.rglob("*.*")} == before
    small = read_png(folder / "left.png")[:300]
    (out / "right" / "b.png").unlink()
    write_png(tmp_path / "left" / "b.png", small)
    assert "is of pictures of 480x360, but this is 480x300" in said(capsys, 1, *words, folder / "rig.yml")
    assert not (out / "right" / "b.png").exists()


def test_videos_frame_by_frame(
    raw_pair: tuple[Path, RawRig], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each frame becomes the picture that it would be on its own, but for the video's compression."""
    folder, _ = raw_pair
    views = {view: read_png(folder / f"{view}.png") for view in ("left", "right")}
    videos = [write_video(tmp_path / f"{view}.mp4", [picture] * 2) for view, picture in views.items()]
    out, alone = tmp_path / "out", tmp_path / "alone"
    rig = ("--calibration", folder / "rig.yml")
    assert "2 pairs rectified, 0 were there" in said(capsys, 0, "rectify", *videos, "--out", out, *rig)
    raw = (folder / "left.png", folder / "right.png")
    said(capsys, 0, "rectify", *raw, "--out", alone, *rig)
    for view in views:
        frames = sorted((out / view).iterdir())
        assert [frame.name for frame in frames] == ["frame_000000.png", "frame_000001.png"]
        expected = read_png(alone / f"{view}.png").astype(int)
        for frame in frames:
            assert np.abs(read_png(frame) - expected).mean() < 8
    assert "0 pairs rectified, 2 were there" in said(capsys, 0, "rectify", *videos, "--out", out, *rig)


WRONG = [
    ({"K2": None}, "it has no K2"),
    ({"R": None}, "it has no R"),
    ({"R": 2 * np.eye(3)}, "its R is no rotation"),
    ({"R": np.diag([1.0, 1.0, -1.0])}, "its R is no rotation"),
    ({"T": np.zeros(3)}, "its baseline is 0"),
    ({"T": np.array([-120.0, 0, 0])}, "is it in millimetres"),
    ({"T": np.array([0.12, 0, 0])}, "are the views swapped"),
    ({"T": np.array([0.0, 0.12, 0])}, "above one another"),
    ({"K1": np.array([[np.nan, 0, 240], [0, 300, 180], [0, 0, 1]])}, "not finite"),
    ({"D1": np.zeros(3)}, "coefficients, not 3"),
    ({"D1": np.array([-0.3, np.inf, 0, 0])}, "not finite"),
    ({"image_width": 960, "image_height": 720}, "is of pictures of 960x720, but these are 480x360"),
    ({"K1": np.array([[800.0, 0, 1280], [0, 800, 720], [0, 0, 1]])}, "is it of another size"),
    ({"distortion_model": "omni"}, "its lens model omni is none of"),
]  # fmt: skip


@pytest.mark.parametrize(("others", "message"), WRONG)
def test_wrong_calibrations_are_a_sentence_and_leave_nothing(
    others: dict[str, object], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    for view in ("left", "right"):
        write_png(tmp_path / f"{view}.png", picture)
    calibration = stored(tmp_path / "rig.yml", brown_rig(), **others)
    views = tmp_path / "left.png", tmp_path / "right.png"
    told = said(capsys, 1, "rectify", *views, "--calibration", calibration, "--out", tmp_path / "out")
    assert message in told
    assert len(told) <= 300
    assert not (tmp_path / "out").exists()


def test_wrong_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for view, height in (("left", SIZE[1]), ("right", 300)):
        write_png(tmp_path / f"{view}.png", np.zeros((height, SIZE[0], 3), np.uint8))
    views = tmp_path / "left.png", tmp_path / "right.png"
    words = ("rectify", *views, "--calibration", stored(tmp_path / "rig.yml", brown_rig()))
    out = ("--out", tmp_path / "out")
    assert "--alpha is from 0 to 1, not 2" in said(capsys, 2, *words, *out, "--alpha", 2)
    assert "which is only read" in said(capsys, 2, *words, "--out", tmp_path)
    folders = tmp_path / "in" / "left", tmp_path / "in" / "right"
    for folder, name in zip(folders, ("left", "right"), strict=True):
        write_png(folder / "a.png", read_png(tmp_path / f"{name}.png"))
    into = said(capsys, 2, "rectify", *folders, *words[3:], "--out", tmp_path / "in")
    assert "which is only read" in into
    assert "differ in size: left 480x360, right 480x300" in said(capsys, 1, *words, *out)
    assert not (tmp_path / "out").exists()
