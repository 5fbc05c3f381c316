"""`stereoforge refine` of two videos, and videos of its results."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from imageio.v3 import imopen, imread

from datagen.formats import read_pfm, write_png
from tests.stereoforge.test_refine_many import SHIFT_PX, picture_pair, told

FRAMES = 3


def write_video(path: Path, frames: list[np.ndarray]) -> Path:
    with imopen(path, "w", plugin="pyav") as video:
        video.init_video_stream("libx264", fps=12)
        for frame in frames:
            video.write_frame(frame)
    return path


@pytest.fixture
def videos(tmp_path: Path) -> tuple[Path, Path]:
    left, right = zip(*(picture_pair(number) for number in range(FRAMES)), strict=True)
    return write_video(tmp_path / "left.mp4", list(left)), write_video(tmp_path / "right.mp4", list(right))


def test_videos_frame_by_frame(
    videos: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert "3 pairs refined, 0 were there already" in told(capsys, 0, *videos, "--out", out)
    names = [f"frame_{number:06d}" for number in range(FRAMES)]
    assert sorted(path.name for path in out.iterdir()) == [*names, "settings.json"]
    disparity = read_pfm(out / names[1] / "disparity.pfm")
    assert np.median(np.abs(disparity[:, 2 * SHIFT_PX :] - SHIFT_PX)) < 0.5

    (out / names[1] / "overview.png").unlink()
    told(capsys, 0, *videos, "--out", out, "--video")
    made = imread(out / "side_by_side.mp4", plugin="pyav")
    assert made.shape == (FRAMES, 64, 256, 3)
    left = imread(videos[0], plugin="pyav")
    assert np.abs(made[:, :, :128].astype(int) - left).mean() < 8
    assert sorted(path.name for path in out.iterdir()) == [*names, "settings.json", "side_by_side.mp4"]


def test_a_video_that_ends_early(
    videos: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What both have is refined and stays."""
    short = write_video(tmp_path / "short.mp4", [picture_pair(number)[1] for number in range(FRAMES - 1)])
    out = tmp_path / "out"
    said = told(capsys, 1, videos[0], short, "--out", out)
    assert f"short.mp4: ends after 2 frames, and {videos[0]} goes on" in said
    assert (out / "frame_000001" / "overview.png").is_file()


def test_videos_that_cannot_be(
    videos: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    picture = tmp_path / "right.png"
    write_png(picture, picture_pair(0)[1])
    assert "left.mp4 is a video and" in told(capsys, 2, videos[0], picture, "--out", out)
    wide = write_video(tmp_path / "wide.mp4", [np.zeros((64, 160, 3), np.uint8)])
    assert "the videos differ in size" in told(capsys, 1, videos[0], wide, "--out", out)
    damaged = tmp_path / "damaged.mp4"
    damaged.write_bytes(b"no video at all" * 50)
    assert "damaged.mp4: cannot be read as a video" in told(capsys, 1, videos[0], damaged, "--out", out)
    missing = tmp_path / "missing.mp4"
    assert "missing.mp4: there is no such file" in told(capsys, 1, missing, missing, "--out", out)
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(videos[0].read_bytes()[:-200])
    assert "cut.mp4: " in told(capsys, 1, cut, videos[1], "--out", out)
    assert not out.exists()
