"""Disparities as other programs write them, and as other programs read ours."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image

from datagen.errors import FormatError
from datagen.formats import write_pfm, write_png
from datagen.formats.disparity import disparity_formats, read_disparity, write_disparity

DISPARITY = np.array([[1.5, 2.25, 200.0], [0.25, 7.0, np.nan]], np.float32)
NAN = np.nan


def saved_by_others(folder: Path) -> list[Path]:
    """The same disparity in every format, as numpy, OpenCV, Pillow and OpenEXR write it."""
    units = np.nan_to_num(DISPARITY * 256).astype(np.uint16)
    cv2.imwrite(str(folder / "cv2.pfm"), DISPARITY)
    cv2.imwrite(str(folder / "cv2.png"), units)
    Image.fromarray(units).save(folder / "pillow.png")
    np.save(folder / "a.npy", DISPARITY)
    np.save(folder / "double.npy", DISPARITY.astype(np.float64)[None, :, :, None])
    np.save(folder / "fortran.npy", np.asfortranarray(DISPARITY))
    np.save(folder / "opencv.npy", np.where(np.isnan(DISPARITY), -1.0, DISPARITY * 16).astype(np.int16))
    np.savez(folder / "a.npz", disparity=DISPARITY)
    np.savez_compressed(folder / "packed.npz", DISPARITY)
    Image.fromarray(DISPARITY).save(folder / "pillow.tif")
    Image.fromarray(DISPARITY).save(folder / "deflated.tif", compression="tiff_adobe_deflate")
    cv2.imwrite(str(folder / "cv2.tiff"), DISPARITY)
    cv2.imwrite(str(folder / "units.tiff"), units)
    for name, channels in (
        ("grey", {"Y": DISPARITY}),
        ("half", {"disparity": DISPARITY.astype(np.float16)}),
        ("color", {"RGB": np.repeat(DISPARITY[..., None], 3, axis=2)}),
    ):
        for compression in (OpenEXR.PIZ_COMPRESSION, OpenEXR.NO_COMPRESSION):
            header = {"compression": compression, "type": OpenEXR.scanlineimage, "comments": "by a program"}
            OpenEXR.File(header, channels).write(str(folder / f"{name}{int(compression)}.exr"))
    return sorted(folder.iterdir())


def test_every_format_says_the_same(tmp_path: Path) -> None:
    paths = saved_by_others(tmp_path)
    assert {path.suffix for path in paths} == disparity_formats().keys()
    for path in paths:
        read = read_disparity(path).disparity
        assert read.dtype == np.float32
        np.testing.assert_array_equal(read, DISPARITY, err_msg=path.name)


def read_by_others(path: Path) -> np.ndarray:
    if path.suffix == ".npy":
        return np.load(path)
    if path.suffix == ".npz":
        return np.load(path)["disparity"]
    if path.suffix == ".exr":
        return OpenEXR.File(str(path)).channels()["Y"].pixels
    if path.suffix == ".pfm":
        return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return np.asarray(Image.open(path))


@pytest.mark.parametrize("ending", sorted(disparity_formats()))
@pytest.mark.parametrize("scale", [None, 100.0])
def test_others_read_what_is_written(ending: str, scale: float | None, tmp_path: Path) -> None:
    path, again = tmp_path / f"a{ending}", tmp_path / f"b{ending}"
    for each in (path, again):
        write_disparity(each, DISPARITY, scale)
    assert path.read_bytes() == again.read_bytes()
    stored = read_by_others(path)
    whole = ending == ".png" or (scale is not None and ending in (".tif", ".tiff"))
    units = DISPARITY * np.float32(scale or (256 if whole else 1))
    if whole:
        assert stored.dtype == np.uint16
        units = np.nan_to_num(units)
    np.testing.assert_array_equal(stored, units)
    np.testing.assert_array_equal(read_disparity(path, scale).disparity, DISPARITY)


def test_what_16_bits_do_not_hold_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    with pytest.raises(
        FormatError, match=r"a\.png: 300\.0 px are more than 16 bits hold at 256 units a pixel"
    ):
        write_disparity(tmp_path / "a.png", np.full((2, 2), 300, np.float32))
    with pytest.raises(FormatError, match=r"a disparity is an \.exr, a \.npy"):
        write_disparity(tmp_path / "a.jpg", DISPARITY)
    assert not list(tmp_path.iterdir())


def matched(minimum: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """OpenCV's left and right disparities of noise that is shifted by 5 px."""
    rng = np.random.default_rng(0)
    left = cv2.resize(rng.integers(0, 256, (12, 40), np.uint8), (160, 48), interpolation=cv2.INTER_CUBIC)
    right = np.roll(left, -5, 1)
    matcher = cv2.StereoSGBM.create(minimum, 16, 5)
    return matcher.compute(left, right), cv2.ximgproc.createRightMatcher(matcher).compute(right, left)


def save_fixed_point(folder: Path, disparity: np.ndarray) -> dict[str, Path]:
    """As people save what OpenCV's matchers return."""
    paths = {name: folder / f"{name}.npy" for name in ("as_it_is", "as_floats", "divided")}
    np.save(paths["as_it_is"], disparity)
    np.save(paths["as_floats"], disparity.astype(np.float32))
    np.save(paths["divided"], disparity.astype(np.float32) / 16)
    paths["as_unsigned"] = folder / "as_unsigned.png"
    cv2.imwrite(str(paths["as_unsigned"]), disparity.astype(np.uint16))
    return paths


def test_opencvs_answer_is_recognised_however_it_was_saved(tmp_path: Path) -> None:
    disparity, _ = matched()
    expected = np.where(disparity < 0, np.nan, disparity / np.float32(16))
    assert np.isnan(expected[:, 0]).all()
    assert np.nanmedian(expected) == pytest.approx(5, abs=0.2)
    for name, path in save_fixed_point(tmp_path, disparity).items():
        reading = read_disparity(path)
        np.testing.assert_array_equal(reading.disparity, expected, err_msg=name)
        (remark,) = reading.remarks
        assert ("-1 is taken for no disparity" if name == "divided" else "fixed point, 16 units") in remark


def test_the_right_views_answer_of_opencv_is_negative_and_turned(tmp_path: Path) -> None:
    _, right = matched()
    np.save(tmp_path / "a.npy", right)
    reading = read_disparity(tmp_path / "a.npy")
    assert reading.remarks[-1] == "its disparities are negative, so the sign is turned"
    assert np.nanmedian(reading.disparity) == pytest.approx(5, abs=0.2)
    found = right != right.min()
    np.testing.assert_array_equal(reading.disparity, np.where(found, -right / np.float32(16), NAN))


def test_a_map_of_the_other_sign_is_turned_and_a_marker_is_not(tmp_path: Path) -> None:
    for values, expected, remarks in (
        ([[-2.5, -3.5, 2.0, NAN]], [[2.5, 3.5, -2, NAN]], 1),
        ([[-999, -999, -999, 2.5]], [[-999, -999, -999, 2.5]], 0),
        ([[-1, -1, -1, 2.5]], [[NAN, NAN, NAN, 2.5]], 1),
    ):
        np.save(tmp_path / "a.npy", np.array(values))
        reading = read_disparity(tmp_path / "a.npy")
        np.testing.assert_array_equal(reading.disparity, np.array(expected, np.float32))
        assert len(reading.remarks) == remarks


def test_a_stated_scale_divides_every_kind_of_number(tmp_path: Path) -> None:
    for kind in (np.uint8, np.uint16, np.int16, np.int32, np.float32, np.float64):
        np.save(tmp_path / "a.npy", np.array([[8, 20], [0, 100]], kind))
        read = read_disparity(tmp_path / "a.npy", 8).disparity
        none = NAN if np.dtype(kind).kind == "u" else 0
        np.testing.assert_array_equal(read, np.array([[1, 2.5], [none, 12.5]], np.float32))
    write_png(tmp_path / "old.png", np.array([[8, 0]], np.uint8))
    np.testing.assert_array_equal(read_disparity(tmp_path / "old.png", 8).disparity, [[1, NAN]])


def test_what_is_no_disparity_is_a_sentence(tmp_path: Path) -> None:
    cases: dict[str, tuple[object, str]] = {
        "colors": (np.zeros((2, 3, 3), np.float32), r"is \(H, W\), not \(2, 3, 3\)"),
        "row": (np.zeros(5, np.float32), r"is \(H, W\), not \(5,\)"),
        "counts": (np.zeros((2, 3), np.int32), "int32 in unknown units; say with --disparity-scale"),
        "bytes": (np.zeros((2, 3), np.uint16), "uint16 in unknown units"),
        "text": (np.array([["a"]]), "not numbers"),
        "objects": (np.array([[{}]], dtype=object), "not numbers"),
        "empty": (np.zeros((0, 3), np.float32), "an image of 3 x 0 pixels"),
    }
    for name, (array, reason) in cases.items():
        np.save(tmp_path / f"{name}.npy", array, allow_pickle=True)
        with pytest.raises(FormatError, match=rf"{name}\.npy: .*{reason}"):
            read_disparity(tmp_path / f"{name}.npy")
    np.savez(tmp_path / "two.npz", a=DISPARITY, b=DISPARITY)
    (tmp_path / "no.npz").write_bytes(b"PK nothing")
    write_png(tmp_path / "old.png", np.ones((2, 3), np.uint8))
    Image.fromarray(np.zeros((2, 3, 3), np.uint8)).save(tmp_path / "color.tif")
    frames = [Image.fromarray(DISPARITY)] * 2
    frames[0].save(tmp_path / "pages.tif", save_all=True, append_images=frames[1:])
    (tmp_path / "no.tif").write_bytes(b"II nothing")
    header = {"type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"Z": DISPARITY}).write(str(tmp_path / "depth.exr"))
    OpenEXR.File(header, {"dx": DISPARITY, "dy": -DISPARITY}).write(str(tmp_path / "slopes.exr"))
    (tmp_path / "no.exr").write_bytes(b"nothing")
    for name, reason in (
        ("two.npz", "holds 2 arrays"),
        ("no.npz", r"is no \.npz file"),
        ("old.png", "uint8 in unknown units"),
        ("color.tif", "has 3 channels, a disparity has one"),
        ("pages.tif", "several pictures"),
        ("no.tif", "not a TIFF file"),
        ("depth.exr", r"holds a depth \(channel Z\)"),
        ("slopes.exr", "the channels dx, dy, a disparity has one"),
        ("no.exr", "not an EXR file"),
        ("gone.exr", "cannot be read"),
        ("a.jpg", r"a disparity is an \.exr, .* or a \.tiff file"),
    ):
        with pytest.raises(FormatError, match=f"{name}: .*{reason}"):
            read_disparity(tmp_path / name)


def test_a_header_that_promises_more_than_follows_is_refused_before_memory_is_allocated(
    tmp_path: Path,
) -> None:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        stream, {"descr": "<f4", "fortran_order": False, "shape": (2**20, 2**20)}
    )
    (tmp_path / "a.npy").write_bytes(stream.getvalue() + b"1234")
    with pytest.raises(FormatError, match=r"a\.npy: its header promises 4398046511104 bytes, 4 follow"):
        read_disparity(tmp_path / "a.npy")
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", stream.getvalue())
    with pytest.raises(FormatError, match="0 follow"):
        read_disparity(tmp_path / "a.npz")
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Y": DISPARITY}).write(str(tmp_path / "a.exr"))
    size = np.array([0, 0, 2**20 - 1, 2**20 - 1], "<i4").tobytes()
    content = (tmp_path / "a.exr").read_bytes().replace(np.array([0, 0, 2, 1], "<i4").tobytes(), size)
    (tmp_path / "a.exr").write_bytes(content)
    with pytest.raises(FormatError, match=r"declares 1048576 x 1048576 pixels"):
        read_disparity(tmp_path / "a.exr")
    Image.fromarray(DISPARITY).save(tmp_path / "a.tif")
    content = (tmp_path / "a.tif").read_bytes()
    for tag in (256, 257):
        entry = content.index(np.array([tag], "<u2").tobytes() + b"\x04\0\x01\0\0\0")
        content = content[: entry + 8] + np.array([2**20], "<u4").tobytes() + content[entry + 12 :]
    (tmp_path / "a.tif").write_bytes(content)
    with pytest.raises(FormatError, match=r"declares 1048576 x 1048576 pixels"):
        read_disparity(tmp_path / "a.tif")


@given(
    array=arrays.arrays(np.float32, st.tuples(st.integers(1, 4), st.integers(1, 4))),
    at=st.integers(0, 2**16),
    byte=st.integers(0, 255),
    ending=st.sampled_from(sorted(disparity_formats())),
)
def test_a_damaged_file_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, array: np.ndarray, at: int, byte: int, ending: str
) -> None:
    path = tmp_path_factory.mktemp("damaged") / f"a{ending}"
    if ending == ".png":
        array = np.clip(np.nan_to_num(array), 0, 255)
    write_disparity(path, array)
    content = bytearray(path.read_bytes())
    content[at % len(content)] = byte
    path.write_bytes(content)
    try:
        read = read_disparity(path).disparity
    except FormatError as error:
        said = str(error)
    else:
        assert read.ndim == 2
        said = str(path)
    assert str(path) in said


def test_a_pfm_file_of_ours_reads_the_same(tmp_path: Path) -> None:
    write_pfm(tmp_path / "a.pfm", DISPARITY)
    write_disparity(tmp_path / "b.pfm", DISPARITY)
    assert (tmp_path / "a.pfm").read_bytes() == (tmp_path / "b.pfm").read_bytes()
