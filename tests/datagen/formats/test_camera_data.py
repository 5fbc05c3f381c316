"""camera_data.txt: the published text, exact numbers, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from datagen.errors import FormatError
from datagen.formats import read_camera_data, write_camera_data

matrices = hnp.arrays(np.float64, (4, 4), elements=st.floats(allow_nan=False, allow_infinity=False))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.dictionaries(st.integers(0, 10**6), st.tuples(matrices, matrices), max_size=4))
def test_round_trip_is_exact(tmp_path: Path, poses: dict[int, tuple[np.ndarray, np.ndarray]]) -> None:
    write_camera_data(tmp_path / "camera_data.txt", poses)
    again = read_camera_data(tmp_path / "camera_data.txt")
    assert again.keys() == poses.keys()
    for frame, (left, right) in poses.items():
        np.testing.assert_array_equal(again[frame][0], left)
        np.testing.assert_array_equal(again[frame][1], right)


def test_the_text_is_that_of_flying_things(tmp_path: Path) -> None:
    left, right = np.eye(4), np.arange(16.0).reshape(4, 4) / 4
    write_camera_data(tmp_path / "c.txt", {7: (left, right), 6: (left, left)})
    identity = "1.0 0.0 0.0 0.0 0.0 1.0 0.0 0.0 0.0 0.0 1.0 0.0 0.0 0.0 0.0 1.0"
    quarters = "0.0 0.25 0.5 0.75 1.0 1.25 1.5 1.75 2.0 2.25 2.5 2.75 3.0 3.25 3.5 3.75"
    assert (tmp_path / "c.txt").read_text() == (
        f"Frame 6\nL {identity}\nR {identity}\n\nFrame 7\nL {identity}\nR {quarters}\n\n"
    )


NUMBERS = " ".join(["1"] * 16)
DAMAGED = {
    "no text": b"\xff\xfe",
    "heading": f"Picture 6\nL {NUMBERS}\nR {NUMBERS}\n".encode(),
    "negative frame": f"Frame -6\nL {NUMBERS}\nR {NUMBERS}\n".encode(),
    "cut": f"Frame 6\nL {NUMBERS}\n".encode(),
    "fifteen numbers": f"Frame 6\nL {NUMBERS}\nR {NUMBERS[2:]}\n".encode(),
    "views swapped": f"Frame 6\nR {NUMBERS}\nL {NUMBERS}\n".encode(),
    "no number": f"Frame 6\nL {NUMBERS}\nR {NUMBERS[2:]} x\n".encode(),
    "not finite": f"Frame 6\nL {NUMBERS}\nR {NUMBERS[2:]} nan\n".encode(),
    "twice": f"Frame 6\nL {NUMBERS}\nR {NUMBERS}\nFrame 6\nL {NUMBERS}\nR {NUMBERS}\n".encode(),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damage_is_one_sentence_naming_the_file(tmp_path: Path, name: str) -> None:
    path = tmp_path / "c.txt"
    path.write_bytes(DAMAGED[name])
    with pytest.raises(FormatError) as caught:
        read_camera_data(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_poses_of_another_shape(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"c\.txt: the poses of frame 6 are \(3, 4\)"):
        write_camera_data(tmp_path / "c.txt", {6: (np.zeros((3, 4)), np.eye(4))})
