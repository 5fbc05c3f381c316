"""list:FILE: the lists that trainers of stereo networks have."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from datagen import DatasetError
from datagen.sources.own_data.listing import parse_list
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

NAMES = ("image_2/{:06}_10.png", "image_3/{:06}_10.png", "disp_occ_0/{:06}_10.png")
LINES = [" ".join(name.format(i) for name in NAMES) for i in range(3)]


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return folder(tmp_path / "set", *NAMES, 3)


def written(root: Path, text: str, name: str = "list.txt") -> str:
    (root / name).write_text(text)
    return f"list:{root / name}"


@pytest.mark.parametrize(
    "text",
    [
        "\n".join(LINES),
        "\n".join(LINES) + "\n\n",
        "# left right disparity\n\n" + "\r\n".join(LINES),
        "\n".join(line.replace(" ", ",") for line in LINES),
        "\n".join(line.replace(" ", ", ") for line in LINES),
        "\n".join(line.replace(" ", "\t") for line in LINES),
        "\n".join(line.replace(" ", "   ") for line in LINES),
        "left,right,disparity\n" + "\n".join(line.replace(" ", ",") for line in LINES),
        "imgL imgR dispL\n" + "\n".join(LINES),
        "\ufeffleft_path,right_path,gt\n" + "\n".join(line.replace(" ", ",") for line in LINES),
        "id;disp;left;right\n" + "\n".join("7;{2};{0};{1}".format(*line.split()) for line in LINES),
        "\n".join(line.replace("/", "\\") for line in LINES),
        '"' + '"\n"'.join(line.replace(" ", '","') for line in LINES) + '"',
    ],
)
def test_lists_as_others_write_them(root: Path, text: str) -> None:
    source = open_source(written(root, text))
    frames = source.frames("test")
    assert [frame.name for frame in frames] == [f"image_2/{i:06}_10" for i in range(3)]
    for i, frame in enumerate(frames):
        assert (frame.left[0, 0, 0], frame.right[0, 0, 0]) == (10 * i + 1, 10 * i + 2)
        np.testing.assert_array_equal(frame.disparity_left, truth(i + 1))
    assert [frame.scene_name for frame in frames] == [f"{i:06}_10" for i in range(3)]
    assert [frame.name for frame in source.validation_frames()] == ["image_2/000002_10"]
    assert len(source.frames("train")) == 2
    assert str(source.note).startswith("3 pairs, columns of ")


def test_the_note_says_what_was_taken_for_what(root: Path) -> None:
    assert open_source(written(root, "\n".join(LINES))).note == (
        "3 pairs, columns of spaces: left image_2/000000_10.png, right image_3/000000_10.png, "
        "disparity disp_occ_0/000000_10.png"
    )


def test_a_stated_root_and_a_scale(root: Path, tmp_path: Path) -> None:
    lists = tmp_path / "lists"
    lists.mkdir()
    source = written(
        lists,
        "\n".join(f"set/{cell}" for line in LINES for cell in line.split())
        .replace("\nset/image_3", " set/image_3")
        .replace("\nset/disp", " set/disp"),
    )
    with pytest.raises(
        DatasetError, match=r"line 1: there is no file .*; if paths begin elsewhere, state where"
    ):
        open_source(source).frames("test")
    (frame, *_) = open_source(f"{source},root={tmp_path},scale=512#0-1").frames("test")
    assert frame.name == "set/image_2/000000_10"
    np.testing.assert_array_equal(frame.disparity_left, truth(0.5))
    absolute = written(
        lists, "\n".join(" ".join(f"{root}/{cell}" for cell in line.split()) for line in LINES)
    )
    with pytest.raises(DatasetError, match=r"line 1 leaves .*lists with .*state the folder of all files"):
        open_source(absolute).frames("test")
    assert open_source(f"{absolute},root={root}").frames("test")[0].name == "image_2/000000_10"
    with pytest.raises(DatasetError, match="root=nowhere is no folder"):
        open_source(f"{absolute},root=nowhere").frames("test")


def test_a_fourth_column_is_what_its_name_says(root: Path) -> None:
    values = np.zeros((HEIGHT, WIDTH), np.uint8)
    values[2, 5] = 255
    mask(root / "m" / "valid.png", values)
    mask(root / "m" / "occ.png", values)
    disparity(root / "m" / "disp_right.pfm", 4)
    for header in ("", "left right disp {}\n"):
        for fourth, name in (
            ("m/valid.png", "mask"),
            ("m/occ.png", "occlusion"),
            ("m/disp_right.pfm", "disp_R"),
        ):
            source = written(root, f"{header.format(name)}{LINES[0]} {fourth}")
            (frame,) = open_source(source).frames("test")
            if name == "mask":
                np.testing.assert_array_equal(np.isfinite(frame.disparity_left), values > 0)
            elif name == "occlusion":
                assert frame.occlusion_left is not None
                np.testing.assert_array_equal(frame.occlusion_left == 1, values > 0)
            else:
                np.testing.assert_array_equal(frame.disparity_right, truth(4))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "names no pair; each line needs left, right and disparity"),
        ("# nothing\n\n", "names no pair"),
        ("left,right,disp\n", "names no pair below its header"),
        ("left,right\na.png,b.png", "line 1 names no column of disparities"),
        ("left,right,disp,gt\na.png,b.png,c.pfm,d.pfm", "line 1 names two columns that could be disparity"),
        ("# two\nimage_2/000000_10.png image_3/000000_10.png", r"line 2 has 2 columns \(image_2"),
        ("a.png", r"line 1 has 1 column \(a\.png\)"),
        ("a.png b.png c.pfm d.png e.png", "line 1 has 5 columns"),
        (f"{LINES[0]}\n\n{LINES[1]} x.png", "line 3 has 4 columns where there should be 3"),
        (f"{LINES[0]}\n{LINES[1].replace('_3', '_4')}", r"line 2: there is no file .*image_4/000001_10\.png"),
        (f"{LINES[0]}\n../set/{LINES[1]}x", r"line 2"),
        (f"{LINES[0]}\n../../{LINES[1]}", r"line 2 leaves .*set with \.\./\.\./image_2"),
        (f"{LINES[0]}\n{LINES[1]}\n{LINES[0]}", "line 3 names the left picture of line 1 again"),
        ("left,right,disp\nimage_2/000000_10.png,,x.pfm", "line 2 has no right"),
        ('"a.png b.png c.pfm', "line 1 cannot be split into columns"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(root: Path, text: str, reason: str) -> None:
    with pytest.raises(DatasetError, match=rf"list\.txt: {reason}") as refusal:
        open_source(written(root, text)).frames("test")
    assert "\n" not in str(refusal.value)


def test_files_that_are_no_lists(root: Path) -> None:
    (root / "list.txt").write_bytes(b"\xff\xfe\0")
    with pytest.raises(DatasetError, match=r"list\.txt: is no list, which is text in UTF-8"):
        open_source(f"list:{root / 'list.txt'}").frames("test")
    with pytest.raises(DatasetError, match=f"is a folder, not a list; folder:{root} takes it"):
        open_source(f"list:{root}").frames("test")
    with pytest.raises(DatasetError, match=r"gone\.txt: there is no such (folder|file)"):
        open_source(f"list:{root / 'gone.txt'}")


def test_damaged_and_odd_files_are_named_with_their_line(root: Path) -> None:
    frames = open_source(written(root, "\n".join(LINES))).frames("test")
    picture(root / NAMES[1].format(0), 3, (HEIGHT, WIDTH + 1))
    (root / NAMES[0].format(1)).write_bytes(b"no picture")
    with pytest.raises(
        DatasetError, match=r"10x6, its left image 9x6 \(.*000000_10\.png, list\.txt, line 1\)"
    ):
        _ = frames[0].right
    with pytest.raises(DatasetError, match=r"image_2/000001_10\.png: .* \(list\.txt, line 2\)"):
        _ = frames[1].left


PATHS = st.text("abzAZ019 ._-,;'()é漢#", min_size=1, max_size=12).map(lambda text: f"d/{text}.png")


@settings(suppress_health_check=[HealthCheck.too_slow])
@given(
    rows=st.lists(st.tuples(PATHS, PATHS, PATHS), min_size=1, max_size=5),
    separator=st.sampled_from([" ", ",", "\t", ";"]),
    header=st.booleans(),
    comments=st.booleans(),
)
def test_every_list_that_csv_writes_is_read(
    rows: list[tuple[str, str, str]], separator: str, header: bool, comments: bool
) -> None:
    stream = io.StringIO()
    writer = csv.writer(stream, delimiter=separator, quoting=csv.QUOTE_ALL)
    if header:
        writer.writerow(("left", "right", "disparity"))
    for row in rows:
        if comments:
            stream.write("# a comment, with separators\n\n")
        writer.writerow(row)
    # The first line decides what separates, so names must not hold what comes before it.
    first = stream.getvalue().replace("# a comment, with separators\n\n", "").partition("\n")[0]
    before = {" ": "\t,;", ";": "\t,", ",": "\t", "\t": ""}[separator]
    if any(each in first for each in before):
        return
    parsed = parse_list(stream.getvalue(), "a.txt")
    assert [tuple(line.files.values()) for line in parsed.lines] == rows
    lines = stream.getvalue().split("\n")
    assert all(row[0] in lines[line.number - 1] for line, row in zip(parsed.lines, rows, strict=True))


@given(st.text(max_size=200))
def test_any_text_is_read_or_refused_in_one_sentence(text: str) -> None:
    try:
        parse_list(text, "a.txt")
    except DatasetError as error:
        said = str(error)
    else:
        said = "a.txt: "
    assert said.startswith("a.txt: ")
