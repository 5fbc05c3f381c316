"""folder:PATH: pairs and disparities found by the names that people give them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from datagen import DatasetError
from datagen.sources.registry import open_source
from tests.datagen.sources.own_data.pairs_on_disk import (
    HEIGHT,
    WIDTH,
    disparity,
    folder,
    mask,
    picture,
    truth,
)

LAYOUTS = {
    "folders": ("left/{:04}.png", "right/{:04}.png", "disparity/{:04}.pfm"),
    "kitti": ("image_2/{:06}_10.png", "image_3/{:06}_10.png", "disp_occ_0/{:06}_10.png"),
    "kitti 2012": ("colored_0/{:06}_10.png", "colored_1/{:06}_10.png", "disp_occ/{:06}_10.png"),
    "middlebury": ("scene{}/im0.png", "scene{}/im1.png", "scene{}/disp0.pfm"),
    "middlebury test names": ("s{}/im0.png", "s{}/im1.png", "s{}/disp0GT.pfm"),
    "middlebury 2006": ("scene{}/view1.png", "scene{}/view5.png", "scene{}/disp1.pfm"),
    "long names": ("left_images/{}.png", "right_images/{}.png", "gt/{}.npy"),
    "nested": ("rgb/left/{}.png", "rgb/right/{}.png", "disparity/left/{}.tiff"),
    "nested the other way": ("left/rgb/{}.jpg", "right/rgb/{}.jpg", "left/disparity/{}.pfm"),
    "scenes": ("a{}/left.png", "a{}/right.png", "a{}/disp.pfm"),
    "one scene's folders": ("town/left/{}.png", "town/right/{}.png", "town/disparity/{}.pfm"),
    "cameras": ("mav0/cam0/data/{}.png", "mav0/cam1/data/{}.png", "mav0/disp0/data/{}.pfm"),
    "suffixes": ("{:03}_left.png", "{:03}_right.png", "{:03}_disp.pfm"),
    "letters": ("img_{:03}_L.png", "img_{:03}_R.png", "disp_{:03}.pfm"),
    "prefixes": ("left{:02}.jpg", "right{:02}.jpg", "disp{:02}.pfm"),
    "small letters": ("imgl/{}.png", "imgr/{}.png", "displ/{}.pfm"),
    "crestereo": ("tree/{}_left.jpg", "tree/{}_right.jpg", "tree/{}_left.disp.png"),
    "driving stereo": ("left-image-half-size/{}.jpg", "right-image-half-size/{}.jpg", "disparity-map-half-size/{}.png"),
    "cityscapes": ("leftImg8bit/{}.png", "rightImg8bit/{}.png", "disparity/{}.png"),
    "floats beside the left": ("left/{}.png", "right/{}.png", "left/{}.pfm"),
}  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
def test_names_that_people_use(layout: str, tmp_path: Path) -> None:
    left, right, disparities = LAYOUTS[layout]
    folder(tmp_path / "set", left, right, disparities)
    picture(tmp_path / "set" / "preview.png", 99)
    (tmp_path / "set" / "readme_left.txt").write_text("no picture")
    source = open_source(f"folder:{tmp_path / 'set'}")
    frames = source.frames("test")
    assert len(frames) == 2
    for i, frame in enumerate(frames):
        assert abs(int(frame.left.max()) - (10 * i + 1)) <= 1
        assert abs(int(frame.right.max()) - (10 * i + 2)) <= 1
        np.testing.assert_array_equal(frame.disparity_left, truth(i + 1))
        assert frame.disparity_right is None
    assert len({frame.name for frame in frames}) == 2
    assert len({frame.scene_name for frame in frames}) == 2
    assert source.note == (
        f"2 pairs, matched as left {left.format(0)}, right {right.format(0)}, disparities {disparities.format(0)}"
    )


@pytest.mark.parametrize(
    "names",
    [
        ("left/{}.png", "right/{}.png", "disparity/left/{}.pfm", "disparity/right/{}.pfm"),
        ("left/{}.png", "right/{}.png", "disp0/{}.pfm", "disp1/{}.pfm"),
        ("s{}/im0.png", "s{}/im1.png", "s{}/disp0.pfm", "s{}/disp1.pfm"),
        ("s{}/view1.png", "s{}/view5.png", "s{}/disp1.pfm", "s{}/disp5.pfm"),
        ("{}_L.png", "{}_R.png", "{}_disp_L.pfm", "{}_disp_R.pfm"),
    ],
)
def test_right_disparities(names: tuple[str, str, str, str], tmp_path: Path) -> None:
    left, right, disparities, right_disparities = names
    folder(tmp_path, left, right, disparities, right_truth=right_disparities)
    frame = open_source(f"folder:{tmp_path}").frames("test")[1]
    np.testing.assert_array_equal(frame.disparity_left, truth(2))
    np.testing.assert_array_equal(frame.disparity_right, truth(3))


def test_what_kitti_measured_a_frame_later_or_where_both_see_is_not_taken(tmp_path: Path) -> None:
    folder(tmp_path, *LAYOUTS["kitti"], right_truth="disp_occ_1/{:06}_10.png")
    folder(tmp_path, *LAYOUTS["kitti"][:2], "disp_noc_0/{:06}_10.png", right_truth="disp_noc_1/{:06}_10.png")
    disparity(tmp_path / "disp_occ_0" / "000000_10.png", 7)
    frame = open_source(f"folder:{tmp_path}").frames("test")[0]
    assert frame.disparity_right is None
    np.testing.assert_array_equal(frame.disparity_left, truth(7))


def test_masks(tmp_path: Path) -> None:
    values = np.zeros((HEIGHT, WIDTH), np.uint8)
    values[3, 5] = 255
    expected = np.zeros((HEIGHT, WIDTH), np.uint8)
    expected[:, 0] = 2  # a pixel farther left is out of the right view's frame
    expected[0, 0] = 0  # has no disparity
    expected[3, 5] = 1
    for name, made in (("occlusion/0.png", values), ("mask0nocc/0.png", 255 - values)):
        root = folder(tmp_path / name[:4], "left/{}.png", "right/{}.png", "disp/{}.pfm", 1)
        mask(root / name, made)
        (frame,) = open_source(f"folder:{root}").frames("test")
        np.testing.assert_array_equal(frame.occlusion_left, expected)
    root = folder(tmp_path / "valid", "left/{}.png", "right/{}.png", "disp/{}.pfm", 1)
    mask(root / "valid/0.png", values)
    (frame,) = open_source(f"folder:{root}").frames("test")
    np.testing.assert_array_equal(np.isfinite(frame.disparity_left), values > 0)
    mask(root / "valid/0.png", np.ones((3, 3), np.uint8))
    with pytest.raises(DatasetError, match=r"valid/0\.png: this mask is 3x3, its disparity 9x6"):
        _ = open_source(f"folder:{root}").frames("test")[0].disparity_left


def test_a_scale_and_opencvs_fixed_point_are_told(tmp_path: Path) -> None:
    root = folder(tmp_path / "set", "left/{}.png", "right/{}.png", None, 1)
    (root / "disp").mkdir()
    np.save(root / "disp" / "0.npy", np.full((HEIGHT, WIDTH), 40, np.int16))
    source = open_source(f"folder:{root}")
    assert (source.frames("test")[0].disparity_left == 2.5).all()
    assert source.note is not None
    assert source.note.endswith("; 0.npy: int16 is taken for OpenCV's fixed point, 16 units a pixel")
    source = open_source(f"folder:{root},scale=8")
    assert (source.frames("test")[0].disparity_left == 5).all()
    assert "fixed point" not in str(source.note)
    for option, reason in (
        ("scale=0", "scale= takes a positive number"),
        ("scale=x", "scale= takes a positive number"),
        ("root=x", "has no option root=; there is scale="),
    ):
        with pytest.raises(DatasetError, match=reason):
            open_source(f"folder:{root},{option}").frames("test")


def test_split_folders(tmp_path: Path) -> None:
    for split, count in (("training", 3), ("val", 2), ("testing", 1)):
        folder(tmp_path / split, *LAYOUTS["folders"], count)
    source = open_source(f"folder:{tmp_path}")
    assert [len(source.frames(split)) for split in ("train", "val", "test")] == [3, 2, 1]
    assert [frame.name for frame in source.validation_frames()] == ["val/0000", "val/0001"]
    assert "6 pairs (3 train, 2 val, 1 test), matched as" in str(source.note)
    inside = folder(tmp_path / "inside", "left/train/{}.png", "right/train/{}.png", "disp/train/{}.pfm")
    source = open_source(f"folder:{inside}")
    assert [frame.name for frame in source.frames("train")] == ["train/0"]
    assert [frame.name for frame in source.validation_frames()] == ["train/1"]
    assert [frame.name for frame in source.held_out_frames()] == ["train/1"]
    with pytest.raises(DatasetError, match="a folder of pairs has no split 'test'; there is train"):
        source.frames("test")


def test_the_last_tenth_validates_where_nothing_else_does(tmp_path: Path) -> None:
    root = folder(tmp_path / "a", *LAYOUTS["folders"], 30)
    source = open_source(f"folder:{root}")
    names = [f"{i:04}" for i in range(30)]
    assert [frame.name for frame in source.frames("test")] == names
    assert [frame.name for frame in source.frames("train")] == names[:27]
    assert [frame.name for frame in source.frames("val")] == names[27:]
    assert [frame.name for frame in source.validation_frames()] == names[27:]
    assert [frame.name for frame in source.held_out_frames()] == names
    # Of a stated part the user decides.
    part = open_source(f"folder:{root}#0-9")
    assert [frame.name for frame in part.frames("train")] == names[:10]
    assert list(part.validation_frames()) == []
    # Whole scenes, so that none is trained on and validates.
    for scene in "abcd":
        folder(tmp_path / "b" / scene, *LAYOUTS["folders"], 5)
    source = open_source(f"folder:{tmp_path / 'b'}")
    assert {frame.scene_name for frame in source.frames("train")} == {"a", "b", "c"}
    assert {frame.scene_name for frame in source.validation_frames()} == {"d"}
    one = folder(tmp_path / "one", *LAYOUTS["folders"], 1)
    assert len(open_source(f"folder:{one}").frames("train")) == 1
    assert len(open_source(f"folder:{one}").validation_frames()) == 0


def test_pairs_without_ground_truth(tmp_path: Path) -> None:
    folder(tmp_path, "left/{}.png", "right/{}.png", None)
    source = open_source(f"folder:{tmp_path}")
    assert source.note == "2 pairs, matched as left left/0.png, right right/0.png"
    with pytest.raises(
        DatasetError, match="has no frame with ground truth in the layout of a folder of pairs"
    ):
        source.frames("test")


def test_what_cannot_be_told_is_refused(tmp_path: Path) -> None:
    def refuses(name: str, reason: str) -> None:
        with pytest.raises(DatasetError, match=reason) as refusal:
            open_source(f"folder:{tmp_path / name}").frames("test")
        assert len(str(refusal.value)) - len(str(tmp_path)) < 300

    root = folder(tmp_path / "count", *LAYOUTS["folders"], 4)
    picture(root / "right" / "0004.png", 3)
    refuses("count", r"4 left and 5 right pictures; right/0004\.png has no partner")
    root = folder(tmp_path / "truths", *LAYOUTS["folders"], 4)
    (root / "disparity" / "0002.pfm").unlink()
    refuses("truths", r"3 disparities for 4 pairs; left/0002\.png has none")
    root = folder(tmp_path / "stray", *LAYOUTS["folders"], 2)
    disparity(root / "disparity" / "other.pfm", 1)
    refuses("stray", r"3 disparities for 2 pairs; disparity/other\.pfm is of none of them")
    root = folder(tmp_path / "twice", *LAYOUTS["folders"], 1)
    disparity(root / "gt" / "0000.png", 1)
    refuses("twice", r"disparity/0000\.pfm and gt/0000\.png could both be the disparity of one pair")
    root = folder(tmp_path / "numbers", *LAYOUTS["kitti"], 1)
    folder(root, *LAYOUTS["kitti 2012"][:2], None, 1)
    refuses("numbers", "the views could be colored0 and colored1 or image2 and image3")
    root = folder(tmp_path / "mixed" / "train", *LAYOUTS["folders"], 1)
    folder(tmp_path / "mixed", "left/x{}.png", "right/x{}.png", None, 1)
    refuses("mixed", r"some pairs are in folders of splits \(train\), others are not")
    picture(tmp_path / "plain" / "a.png", 1)
    refuses("plain", "has no left and no right pictures by names such as left and right, image_2")
    (tmp_path / "empty").mkdir()
    refuses("empty", "has no left and no right pictures")
    picture(tmp_path / "half" / "left" / "a.png", 1)
    refuses("half", "has 1 left and no right pictures")
    refuses("gone", "there is no such folder")
    refuses("plain/a.png", "is no folder")


def test_damaged_and_odd_files_are_named(tmp_path: Path) -> None:
    root = folder(tmp_path / "set", *LAYOUTS["folders"], 4)
    picture(root / "right" / "0000.png", 3, (HEIGHT, WIDTH + 1))
    disparity(root / "disparity" / "0001.pfm", 3, (HEIGHT - 1, WIDTH))
    (root / "left" / "0002.png").write_bytes(b"no picture")
    frames = open_source(f"folder:{root}").frames("test")
    with pytest.raises(DatasetError, match=r"right image is 10x6, its left image 9x6 \(.*right/0000\.png\)"):
        _ = frames[0].right
    with pytest.raises(DatasetError, match=r"left disparity is 9x5, .* \(.*disparity/0001\.pfm\)"):
        _ = frames[1].disparity_left
    with pytest.raises(DatasetError, match=r"left/0002\.png: "):
        _ = frames[2].left


def test_a_folder_is_offered_where_no_layout_is_known(tmp_path: Path) -> None:
    folder(tmp_path, *LAYOUTS["long names"])
    with pytest.raises(DatasetError, match="name the format in front, such as folder:PATH"):
        open_source(tmp_path)
