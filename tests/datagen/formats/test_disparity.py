"""Disparities as other programs write them."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from datagen.errors import FormatError
from datagen.formats import write_pfm, write_png
from datagen.formats.disparity import DISPARITY_READERS, read_disparity_npy, read_disparity_npz

DISPARITY = np.array([[1.5, 2.25, 300.0], [0.25, 7.0, np.nan]], np.float32)


def saved(folder: Path) -> list[Path]:
    """The same disparity in every format."""
    write_pfm(folder / "a.pfm", DISPARITY)
    write_png(folder / "a.png", np.nan_to_num(DISPARITY * 256).clip(0, 65535).astype(np.uint16))
    np.save(folder / "a.npy", DISPARITY)
    np.save(folder / "double.npy", DISPARITY.astype(np.float64)[None, :, :, None])
    np.save(folder / "fortran.npy", np.asfortranarray(DISPARITY))
    np.save(folder / "opencv.npy", np.where(np.isnan(DISPARITY), -1.0, DISPARITY * 16).astype(np.int16))
    np.savez(folder / "a.npz", disparity=DISPARITY)
    np.savez_compressed(folder / "packed.npz", DISPARITY)
    return sorted(folder.iterdir())


def test_every_format_says_the_same(tmp_path: Path) -> None:
    paths = saved(tmp_path)
    assert {path.suffix for path in paths} == DISPARITY_READERS.keys()
    for path in paths:
        read = DISPARITY_READERS[path.suffix](path)
        assert read.dtype == np.float32
        expected = DISPARITY.copy()
        if path.suffix == ".png":
            expected[0, 2] = 65535 / 256  # the most that 16 bits hold
        np.testing.assert_array_equal(read, expected, err_msg=path.name)


def test_opencvs_own_answer_is_read_as_it_is(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    right = cv2.resize(rng.integers(0, 256, (12, 40), np.uint8), (160, 48), interpolation=cv2.INTER_CUBIC)
    fixed_point = cv2.StereoSGBM.create(0, 16, 5).compute(np.roll(right, 5, 1), right)
    np.save(tmp_path / "a.npy", fixed_point)
    read = read_disparity_npy(tmp_path / "a.npy")
    assert np.isnan(read[:, 0]).all()
    assert np.nanmedian(read) == pytest.approx(5, abs=0.2)


def test_what_is_no_disparity_is_a_sentence(tmp_path: Path) -> None:
    cases: dict[str, tuple[object, str]] = {
        "colors": (np.zeros((2, 3, 3), np.float32), r"is \(H, W\), not \(2, 3, 3\)"),
        "row": (np.zeros(5, np.float32), r"is \(H, W\), not \(5,\)"),
        "counts": (np.zeros((2, 3), np.int32), "int32, of unknown units"),
        "text": (np.array([["a"]]), "not numbers"),
        "objects": (np.array([[{}]], dtype=object), "not numbers"),
        "empty": (np.zeros((0, 3), np.float32), "an image of 3 x 0 pixels"),
    }
    for name, (array, reason) in cases.items():
        np.save(tmp_path / f"{name}.npy", array, allow_pickle=True)
        with pytest.raises(FormatError, match=rf"{name}\.npy: .*{reason}"):
            read_disparity_npy(tmp_path / f"{name}.npy")
    np.savez(tmp_path / "two.npz", a=DISPARITY, b=DISPARITY)
    with pytest.raises(FormatError, match="holds 2 arrays"):
        read_disparity_npz(tmp_path / "two.npz")
    (tmp_path / "no.npz").write_bytes(b"PK nothing")
    with pytest.raises(FormatError, match=r"is no \.npz file"):
        read_disparity_npz(tmp_path / "no.npz")


def test_a_header_that_promises_more_than_follows_is_refused_before_memory_is_allocated(
    tmp_path: Path,
) -> None:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        stream, {"descr": "<f4", "fortran_order": False, "shape": (2**20, 2**20)}
    )
    (tmp_path / "a.npy").write_bytes(stream.getvalue() + b"1234")
    with pytest.raises(FormatError, match=r"a\.npy: its header promises 4398046511104 bytes, 4 follow"):
        read_disparity_npy(tmp_path / "a.npy")
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", stream.getvalue())
    with pytest.raises(FormatError, match="0 follow"):
        read_disparity_npz(tmp_path / "a.npz")


@given(
    array=arrays.arrays(np.float32, st.tuples(st.integers(1, 4), st.integers(1, 4))),
    at=st.integers(0, 2**16),
    byte=st.integers(0, 255),
    ending=st.sampled_from([".npy", ".npz"]),
)
def test_a_damaged_file_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, array: np.ndarray, at: int, byte: int, ending: str
) -> None:
    path = tmp_path_factory.mktemp("damaged") / f"a{ending}"
    (np.save if ending == ".npy" else np.savez)(path, array)
    content = bytearray(path.read_bytes())
    content[at % len(content)] = byte
    path.write_bytes(content)
    try:
        read = DISPARITY_READERS[ending](path)
    except FormatError as error:
        said = str(error)
    else:
        assert read.ndim == 2
        said = str(path)
    assert str(path) in said
