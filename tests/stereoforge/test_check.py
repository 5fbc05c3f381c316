"""`stereoforge check`: planted offsets, turns, exposures and swaps, in pictures made from formulas."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from datagen.formats import read_png, write_png
from stereoforge.cli import main
from tests.stereoforge.raw_rigs import SIZE, RawRig

FOCAL_PX = 400.0
BASELINE_M = 0.12


def rectified_rig(**changes: Any) -> RawRig:
    """Two equal cameras side by side without distortion, the right one with these changes."""
    k = np.array([[FOCAL_PX, 0, 240], [0, FOCAL_PX, 180], [0, 0, 1]])
    parts = {"k2": k, "rotation": np.eye(3)} | changes
    straight = np.zeros(5)
    return RawRig(k, straight, parts["k2"], straight, parts["rotation"], np.array([-BASELINE_M, 0, 0]))


@pytest.fixture(scope="module")
def pair() -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    return rectified_rig().picture(right=False), rectified_rig().picture(right=True)


def ran(
    folder: Path, left: NDArray[np.uint8], right: NDArray[np.uint8], *words: object, code: int = 0
) -> Any:
    """The figures of a pair, or None where the command fails."""
    write_png(folder / "l.png", left)
    write_png(folder / "r.png", right)
    figures = folder / "figures.json"
    figures.unlink(missing_ok=True)
    with pytest.raises(SystemExit) as end:
        main(["check", *map(str, (folder / "l.png", folder / "r.png", "--json", figures, *words))])
    assert int(end.value.code or 0) == code
    return json.loads(figures.read_text()) if figures.exists() else None


def test_a_rectified_pair(
    pair: tuple[NDArray[np.uint8], NDArray[np.uint8]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    calibration = tmp_path / "rig.json"
    calibration.write_text(
        json.dumps(
            {"width": 480, "height": 360, "fx": 400, "fy": 400, "cx_left": 240, "cx_right": 240, "cy": 180}
            | {"baseline_m": BASELINE_M}
        )
    )
    picture = tmp_path / "matches.png"
    found = ran(tmp_path, *pair, "--calibration", calibration, "--out", picture)
    assert (found["verdict"], found["order"], found["positive_share"]) == ("rectified", "left first", 1)
    offset = found["vertical_offset"]
    assert abs(offset["median_px"]) < 0.05
    assert offset["worst_part_px"] < 0.1
    assert abs(offset["roll_deg"]) < 0.02
    assert abs(offset["scale_percent"]) < 0.05
    assert max(map(abs, found["exposure"]["color_percent"])) < 1
    assert abs(found["exposure"]["pixel_values_percent"]) < 1
    # The wall is 2 / (1 - 0.25 x + 0.1 y) m away along the ray (x, y, 1): 1.7 to 2.5 m.
    low, high = found["disparity_range_px"]
    assert FOCAL_PX * BASELINE_M / 2.6 < low < FOCAL_PX * BASELINE_M / 2.2
    assert FOCAL_PX * BASELINE_M / 1.9 < high < FOCAL_PX * BASELINE_M / 1.7
    assert found["max_disparity"] == 48
    near, far = found["depth_range_m"]
    assert near * high == pytest.approx(FOCAL_PX * BASELINE_M)
    assert far * low == pytest.approx(FOCAL_PX * BASELINE_M)
    said = capsys.readouterr().out
    assert "rectified, the left view first" in said.replace("\n", "")
    assert "For refine: --max-disparity 48" in said
    assert "To correct" not in said
    drawn = read_png(picture)
    assert drawn.std() > 20
    assert drawn.shape[1] > 800


@pytest.mark.parametrize("planted", [0.5, -0.5])
def test_half_a_pixel(
    planted: float,
    pair: tuple[NDArray[np.uint8], NDArray[np.uint8]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    lower = np.array([[FOCAL_PX, 0, 240], [0, FOCAL_PX, 180 + planted], [0, 0, 1]])
    found = ran(tmp_path, pair[0], rectified_rig(k2=lower).picture(right=True))
    assert found["verdict"] == "nearly rectified"
    assert found["vertical_offset"]["median_px"] == pytest.approx(planted, abs=0.05)
    assert found["vertical_offset"]["shift_px"] == pytest.approx(planted, abs=0.05)
    said = capsys.readouterr().out
    assert f"move it {'up' if planted > 0 else 'down'} by 0." in said
    assert "turn it" not in said


def test_roll_and_scale(
    pair: tuple[NDArray[np.uint8], NDArray[np.uint8]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As OpenCV warps a picture: by a positive angle counter-clockwise."""
    warp = cv2.getRotationMatrix2D(((SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2), -1.0, 1.02)
    warped = cv2.warpAffine(pair[1], warp, SIZE, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    found = ran(tmp_path, pair[0], warped)
    assert found["verdict"] == "not rectified"
    assert found["vertical_offset"]["roll_deg"] == pytest.approx(1.0, abs=0.05)
    assert found["vertical_offset"]["scale_percent"] == pytest.approx(2.0, abs=0.15)
    assert found["vertical_offset"]["shift_px"] == pytest.approx(0.0, abs=0.15)
    said = capsys.readouterr().out
    assert "turn it counter-clockwise by " in said
    assert "scale it to 98." in said
    # What is said to correct it does.
    steps = found["vertical_offset"]
    back = cv2.getRotationMatrix2D(
        ((SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2), steps["roll_deg"], 1 / (1 + steps["scale_percent"] / 100)
    )
    back[1, 2] -= steps["shift_px"]
    corrected = cv2.warpAffine(warped, back, SIZE, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    assert ran(tmp_path, pair[0], corrected)["verdict"] == "rectified"


def test_a_bent_picture_needs_a_calibration(
    pair: tuple[NDArray[np.uint8], NDArray[np.uint8]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    k = rectified_rig().k2
    bent = RawRig(k, np.zeros(5), k, np.array([-0.1, 0, 0, 0, 0]), np.eye(3), np.array([-BASELINE_M, 0, 0]))
    assert ran(tmp_path, pair[0], bent.picture(right=True))["verdict"] == "not rectified"
    assert "which only a calibration (stereoforge rectify) corrects" in capsys.readouterr().out


def test_swapped_views(
    pair: tuple[NDArray[np.uint8], NDArray[np.uint8]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = ran(tmp_path, pair[1], pair[0])
    assert (found["verdict"], found["order"], found["max_disparity"]) == ("rectified", "swapped", None)
    assert "give the pictures the other way round" in capsys.readouterr().out


def test_a_calibration_says_where_infinity_is(
    pair: tuple[NDArray[np.uint8], NDArray[np.uint8]], tmp_path: Path
) -> None:
    """A right picture that begins 30 px to the left has disparities of -11 to -3 px, and is no left one."""
    moved = np.roll(pair[1], 30, axis=1)
    assert ran(tmp_path, pair[0], moved)["order"] == "swapped"
    calibration = tmp_path / "rig.json"
    calibration.write_text(
        json.dumps(
            {
                "width": 960,
                "height": 720,
                "fx": 800,
                "fy": 800,
                "cx_left": 480.5,
                "cx_right": 540.5,
                "cy": 360.5,
            }
            | {"baseline_m": BASELINE_M}
        )
    )
    found = ran(tmp_path, pair[0], moved, "--calibration", calibration)
    assert found["order"] == "left first"
    assert found["depth_range_m"] == [pytest.approx(1.8, abs=0.1), pytest.approx(2.4, abs=0.15)]
    calibration.write_text(calibration.read_text().replace("720", "800"))
    assert ran(tmp_path, *pair, "--calibration", calibration, code=1) is None


@pytest.mark.parametrize("exposure", [0.8, 1.2])
def test_exposure_and_color(
    exposure: float,
    pair: tuple[NDArray[np.uint8], NDArray[np.uint8]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    changed = np.clip(pair[1] * exposure, 0, 255).astype(np.uint8)
    found = ran(tmp_path, pair[0], changed)["exposure"]
    assert found["pixel_values_percent"] == pytest.approx(100 * (exposure - 1), abs=1.5)
    assert "differ in exposure" in capsys.readouterr().out
    # The same of light, by a power that is close to sRGB's curve.
    light = np.clip(255 * ((pair[1] / 255.0) ** 2.2 * exposure) ** (1 / 2.2), 0, 255).astype(np.uint8)
    found = ran(tmp_path, pair[0], light)["exposure"]
    assert found["light_percent"] == pytest.approx(100 * (exposure - 1), abs=2)
    reddish = np.clip(pair[1] * [1.1, 1.0, 1.0], 0, 255).astype(np.uint8)
    red, green, blue = ran(tmp_path, pair[0], reddish)["exposure"]["color_percent"]
    assert red - green == pytest.approx(10, abs=1.5)
    assert green == pytest.approx(blue, abs=1)


def test_the_same_and_unrelated_pictures(
    pair: tuple[NDArray[np.uint8], NDArray[np.uint8]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ran(tmp_path, pair[0], pair[0])["verdict"] == "the same picture"
    noise = np.random.default_rng(0).integers(-2, 3, pair[0].shape)
    again = np.clip(pair[0] + noise, 0, 255).astype(np.uint8)
    assert ran(tmp_path, pair[0], again)["verdict"] == "the same picture"
    other = np.ascontiguousarray(pair[1][::-1, ::-1, ::-1])
    picture = tmp_path / "none.png"
    found = ran(tmp_path, pair[0], 255 - other, "--out", picture)
    assert found["verdict"] == "unrelated"
    assert (found["order"], found["vertical_offset"], found["exposure"]) == ("unclear", None, None)
    assert read_png(picture).shape[1] > 500
    assert "unrelated pictures" in capsys.readouterr().out


def test_nothing_to_say(
    pair: tuple[NDArray[np.uint8], NDArray[np.uint8]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plain = np.full_like(pair[0], 100)
    assert ran(tmp_path, pair[0], plain, code=1) is None
    assert "nothing can be said: the right picture has one colour only" in capsys.readouterr().err
    plain[100:102] = 101
    assert ran(tmp_path, pair[0], plain, code=1) is None
    assert "features and the right one 0, and 30 are needed" in capsys.readouterr().err
    assert ran(tmp_path, pair[0], pair[1][:300], code=1) is None
    assert "the pictures differ in size: left 480x360, right 480x300" in capsys.readouterr().err
    assert ran(tmp_path, *pair, "--out", tmp_path / "a.jpg", code=2) is None
    assert "its name ends in .png" in capsys.readouterr().err
    assert ran(tmp_path, *pair, "--out", tmp_path / "l.png", code=2) is None
    assert "which is only read" in capsys.readouterr().err
