"""Camera poses as text, in the format of FlyingThings3D's `camera_data.txt` (Mayer et al., CVPR 2016).

    Frame 6
    L T00 T01 ... T33
    R T00 T01 ... T33

An empty line follows each frame. T is the (4, 4) camera-to-world matrix of that view, row by row, in metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.limits import read_bounded
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import write_bytes

Matrix = NDArray[np.float64]


def write_camera_data(path: Path | str, poses: Mapping[int, tuple[Matrix, Matrix]]) -> None:
    """Write the (left, right) camera-to-world matrices of each frame, exact to the last bit.

    Args:
        path: The file to write.
        poses: For each frame number the two (4, 4) matrices, float64, translations in metres.

    Raises:
        FormatError: For a matrix of another shape.

    >>> import tempfile
    >>> left, right = np.eye(4), np.eye(4)
    >>> right[0, 3] = 0.25  # The right camera is 0.25 m to the right.
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "camera_data.txt"
    ...     write_camera_data(path, {6: (left, right)})
    ...     poses = read_camera_data(path)
    >>> list(poses), poses[6][1][:3, 3].tolist()
    ([6], [0.25, 0.0, 0.0])
    """
    path = Path(path)
    blocks = []
    for frame, (left, right) in sorted(poses.items()):
        if left.shape != (4, 4) or right.shape != (4, 4):
            raise FormatError(
                f"{path}: the poses of frame {frame} are {left.shape} and {right.shape}, not (4, 4)"
            )
        blocks.append(f"Frame {frame}\nL {_numbers(left)}\nR {_numbers(right)}\n\n")
    write_bytes(path, "".join(blocks).encode("ascii"))


def read_camera_data(path: Path | str) -> dict[int, tuple[Matrix, Matrix]]:
    """Read the (left, right) camera-to-world matrices, (4, 4) float64 in metres, by frame number.

    Raises FormatError for a file that is missing, cut off or not of this format. `write_camera_data` has an example.
    """
    path = Path(path)
    try:
        text = read_bounded(path).decode("ascii")
    except UnicodeDecodeError as error:
        raise FormatError(f"{path}: camera data is text, but byte {error.start} is not") from error
    lines = [line for line in text.splitlines() if line.strip()]
    if len(lines) % 3:
        raise FormatError(f"{path}: camera data has three lines a frame, but there are {len(lines)}")
    poses: dict[int, tuple[Matrix, Matrix]] = {}
    for start in range(0, len(lines), 3):
        heading = lines[start].split()
        if len(heading) != 2 or heading[0] != "Frame" or not heading[1].isdigit():
            raise FormatError(f"{path}: expected 'Frame <number>', got {lines[start][:40]!r}")
        frame = int(heading[1])
        if frame in poses:
            raise FormatError(f"{path}: frame {frame} occurs twice")
        poses[frame] = (
            _matrix(path, frame, "L", lines[start + 1]),
            _matrix(path, frame, "R", lines[start + 2]),
        )
    return poses


def _numbers(matrix: Matrix) -> str:
    return " ".join(repr(float(value)) for value in matrix.flat)


def _matrix(path: Path, frame: int, view: str, line: str) -> Matrix:
    words = line.split()
    try:
        if words[0] != view:
            raise InputError(f"it begins with {words[0][:20]!r}")
        matrix = np.array([float(word) for word in words[1:]]).reshape(4, 4)
        if not np.isfinite(matrix).all():
            raise InputError("it is not finite")
    except ValueError as error:
        raise FormatError(f"{path}: frame {frame} has no valid {view!r} matrix: {error}") from error
    return matrix
