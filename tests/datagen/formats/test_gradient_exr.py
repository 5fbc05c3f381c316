"""Gradient EXR: round trips, files of other layouts refused, and OpenEXR's reader kept from damage."""

from __future__ import annotations

import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from datagen.errors import FormatError
from datagen.formats import read_gradient, write_gradient

one_folder = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
sizes = st.tuples(st.integers(1, 40), st.integers(1, 12))
gradients = sizes.flatmap(
    lambda size: st.tuples(
        hnp.arrays(np.float32, (*size, 2), elements=st.floats(width=32)), hnp.arrays(bool, size)
    )
)


def example(height: int = 37, width: int = 23) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:height, :width]
    smooth = np.stack([np.sin(x / 9), np.cos(y / 7)], axis=-1).astype(np.float32)
    return smooth, rng.random((height, width)) > 0.1


@one_folder
@given(gradients)
def test_round_trip_keeps_every_bit(tmp_path: Path, pair: tuple[np.ndarray, np.ndarray]) -> None:
    gradient, valid = pair
    write_gradient(tmp_path / "g.exr", gradient, valid)
    gradient_again, valid_again = read_gradient(tmp_path / "g.exr")
    assert gradient_again.dtype == np.float32
    assert gradient_again.tobytes() == gradient.tobytes()
    np.testing.assert_array_equal(valid_again, valid)
    assert valid_again.dtype == bool


def test_another_reader_sees_the_named_channels(tmp_path: Path) -> None:
    gradient, valid = example()
    write_gradient(tmp_path / "g.exr", gradient, valid)
    with OpenEXR.File(str(tmp_path / "g.exr"), separate_channels=True) as file:
        assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    assert channels.keys() == {"dx", "dy", "valid"}
    np.testing.assert_array_equal(channels["dx"], gradient[..., 0])
    np.testing.assert_array_equal(channels["dy"], gradient[..., 1])
    np.testing.assert_array_equal(channels["valid"], valid.astype(np.float32))


def test_same_gradient_same_bytes_and_no_other_file(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_gradient(tmp_path / f"{name}.exr", *example())
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.exr", "b.exr"]


def test_shapes_that_do_not_fit(tmp_path: Path) -> None:
    for gradient, valid in (
        (np.zeros((3, 4, 3)), np.zeros((3, 4), bool)),
        (np.zeros((3, 4, 2)), np.zeros((4, 3), bool)),
        (np.zeros((3, 4)), np.zeros((3, 4), bool)),
        (np.zeros((0, 4, 2)), np.zeros((0, 4), bool)),
    ):
        with pytest.raises(FormatError, match=r"g\.exr: a gradient is"):
            write_gradient(tmp_path / "g.exr", gradient, valid)
    assert list(tmp_path.iterdir()) == []


def write_other(path: Path, channels: dict[str, np.ndarray], **header: object) -> None:
    defaults = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(defaults | header, channels).write(str(path))


PLANE = np.zeros((20, 10), np.float32)
OTHERS = {
    "other names": ({"R": PLANE, "G": PLANE, "B": PLANE}, {}),
    "one missing": ({"dx": PLANE, "dy": PLANE}, {}),
    "one more": ({"dx": PLANE, "dy": PLANE, "valid": PLANE, "z": PLANE}, {}),
    "half floats": ({name: PLANE.astype(np.float16) for name in ("dx", "dy", "valid")}, {}),
    "no compression": (
        {"dx": PLANE, "dy": PLANE, "valid": PLANE},
        {"compression": OpenEXR.NO_COMPRESSION},
    ),
    "tiles": (
        {"dx": PLANE, "dy": PLANE, "valid": PLANE},
        {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()},
    ),
    "valid is no mask": ({"dx": PLANE, "dy": PLANE, "valid": PLANE + 0.5}, {}),
    "valid is nan": ({"dx": PLANE, "dy": PLANE, "valid": PLANE + np.float32("nan")}, {}),
}


@pytest.mark.parametrize("name", OTHERS)
def test_exr_files_that_are_no_gradient(tmp_path: Path, name: str) -> None:
    channels, header = OTHERS[name]
    path = tmp_path / "other.exr"
    write_other(path, channels, **header)
    with pytest.raises(FormatError, match=r"other\.exr: "):
        read_gradient(path)


@pytest.mark.parametrize(
    ("window", "says"),
    [
        ((0, 0, 2**31 - 1, 2**31 - 1), "more than"),
        ((0, 0, -2, 36), "-1 x 37 pixels"),
        ((-(2**31), 0, 2**31 - 1, 36), "more than"),
        ((0, 0, 22, 37), "does not decompress"),
        ((0, 0, 22, 15), "not where"),
    ],
)
def test_a_data_window_that_lies(tmp_path: Path, window: tuple[int, ...], says: str) -> None:
    path = tmp_path / "lie.exr"
    write_gradient(path, *example(37, 23))
    data = path.read_bytes()
    true_window = struct.pack("<4i", 0, 0, 22, 36)
    assert data.count(true_window) == 2  # data window first, display window second
    path.write_bytes(data.replace(true_window, struct.pack("<4i", *window), 1))
    with pytest.raises(FormatError, match=says):
        read_gradient(path)


FUZZ = """
import resource, sys
import numpy as np
from pathlib import Path
from datagen.errors import FormatError
from datagen.formats import read_gradient
resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))
good, path = Path(sys.argv[1]).read_bytes(), Path(sys.argv[2])
expected = read_gradient(Path(sys.argv[1]))
rng = np.random.default_rng(int(sys.argv[3]))
header = good.index(b"scanlineimage") + 14
refused = unchanged = changed = 0
for trial in range(int(sys.argv[4])):
    damaged = bytearray(good)
    kind = trial % 4
    if kind == 0:
        del damaged[rng.integers(len(good)):]
    elif kind == 1:
        damaged[rng.integers(header)] = rng.integers(256)
    elif kind == 2:
        damaged[rng.integers(len(good))] ^= 1 << rng.integers(8)
    else:
        start = rng.integers(len(good))
        damaged[start:start + 8] = rng.bytes(8)
    path.write_bytes(damaged)
    try:
        gradient, valid = read_gradient(path)
    except FormatError as error:
        assert str(error).startswith(f"{path}: ") and "\\n" not in str(error), error
        refused += 1
    else:
        same = gradient.tobytes() == expected[0].tobytes() and (valid == expected[1]).all()
        unchanged, changed = unchanged + same, changed + (not same)
print(refused, unchanged, changed)
"""


def test_random_damage_never_crashes_the_interpreter(tmp_path: Path) -> None:
    """In a process of its own with 2 GiB to spend; compressed pixels carry a checksum, so damage shows."""
    write_gradient(tmp_path / "good.exr", *example(100, 60))
    command = [sys.executable, "-c", FUZZ, str(tmp_path / "good.exr"), str(tmp_path / "bad.exr"), "7", "1200"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    refused, unchanged, changed = map(int, done.stdout.split())
    assert refused + unchanged + changed == 1200
    assert changed == 0
    assert refused > 1000
