"""Disparity maps of one view in whatever format a program wrote them: one reader for each ending."""

from __future__ import annotations

import io
import lzma
import math
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.limits import MAX_FILE_BYTES, check_image_size, read_bounded
from datagen.formats.pfm import read_pfm_disparity
from datagen.formats.png import read_png

Float32 = NDArray[np.float32]

PNG_UNITS_PER_PX = 256
"""Of KITTI's 16-bit PNG files; 0 stands for no disparity."""
FIXED_POINT_UNITS_PER_PX = 16
"""Of what OpenCV's matchers return, int16; negative values stand for no disparity."""


def read_disparity_png(path: Path) -> Float32:
    """Read a disparity as KITTI has it: (H, W) float32 px, NaN where there is none.

    Raises:
        FormatError: a file that is none.
    """
    values = read_png(path)
    if values.dtype != np.uint16 or values.ndim != 2:
        raise FormatError(f"{path}: a disparity is a 16-bit grey PNG, not {values.dtype} {values.shape}")
    disparity = values.astype(np.float32) / PNG_UNITS_PER_PX
    disparity[values == 0] = np.nan
    return disparity


def read_disparity_npy(path: Path) -> Float32:
    """Read a disparity that numpy saved: (H, W) float32 px, as it is but for OpenCV's fixed point.

    int16 is taken for what OpenCV's matchers return: 16 times the disparity, negative where there is none. Axes of
    length 1 are dropped. No code in the file is run.

    Raises:
        FormatError: a file that is none, or an array of another shape or type.
    """
    return _disparity_of(path, _decode_npy(path, read_bounded(path)))


def read_disparity_npz(path: Path) -> Float32:
    """As `read_disparity_npy`, of a .npz file with one array.

    Raises:
        FormatError: a file that is none, or one with several arrays.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(read_bounded(path))) as archive:
            members = archive.infolist()
            if len(members) != 1:
                raise FormatError(f"{path}: holds {len(members)} arrays; a disparity is one")
            if members[0].file_size > MAX_FILE_BYTES:
                raise FormatError(f"{path}: {members[0].file_size} bytes are more than any disparity has")
            content = archive.read(members[0])
    except FormatError:
        raise
    except _NO_NPZ as error:
        raise FormatError(f"{path}: is no .npz file ({error})") from error
    return _disparity_of(path, _decode_npy(path, content))


DISPARITY_READERS: Mapping[str, Callable[[Path], Float32]] = {
    ".pfm": read_pfm_disparity,
    ".png": read_disparity_png,
    ".npy": read_disparity_npy,
    ".npz": read_disparity_npz,
}
"""By the file's ending in small letters."""
DISPARITY_KINDS = "a .pfm, a 16-bit .png, a .npy or a .npz file"
"""What they are, for messages."""


_NO_NPY = (ValueError, TypeError, EOFError, SyntaxError, KeyError, RecursionError, tokenize.TokenError)
"""What numpy raises for damaged headers, which are Python literals."""
_NO_NPZ = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    ValueError,
    RuntimeError,
    EOFError,
    OSError,
    lzma.LZMAError,
)
"""What zipfile raises for damaged archives."""
_HEADERS: Mapping[tuple[int, int], Callable[[io.BytesIO], Any]] = {
    (1, 0): npy.read_array_header_1_0,
    (2, 0): npy.read_array_header_2_0,
}


def _decode_npy(path: Path, content: bytes) -> NDArray[Any]:
    """The array of a .npy file, whose header is compared with what follows before memory is allocated."""
    stream = io.BytesIO(content)
    try:
        read_header = _HEADERS.get(npy.read_magic(stream))  # type: ignore[no-untyped-call]
        if read_header is None:
            raise FormatError(f"{path}: is a .npy file of a version that is not read")
        shape, _, kind = read_header(stream)
        if kind.hasobject or kind.kind not in "fiu":
            raise FormatError(f"{path}: holds {kind}, not numbers")
        wanted, found = kind.itemsize * math.prod(shape), len(content) - stream.tell()
        if wanted != found:
            raise FormatError(f"{path}: its header promises {wanted} bytes, {found} follow")
        return np.asarray(np.load(io.BytesIO(content), allow_pickle=False))
    except FormatError:
        raise
    except _NO_NPY as error:
        raise FormatError(f"{path}: is no .npy file ({' '.join(str(error).split())})") from error


def _disparity_of(path: Path, values: NDArray[Any]) -> Float32:
    shape = tuple(length for length in values.shape if length != 1) if values.ndim > 2 else values.shape
    if len(shape) != 2:
        raise FormatError(f"{path}: a disparity is (H, W), not {values.shape}")
    check_image_size(path, shape[1], shape[0], 1)
    if values.dtype.kind in "iu" and values.dtype != np.int16:
        raise FormatError(
            f"{path}: holds {values.dtype}, of unknown units; save pixels as float32, or OpenCV's int16 as it is"
        )
    disparity = values.reshape(shape).astype(np.float32)
    if values.dtype == np.int16:
        disparity = np.where(disparity < 0, np.float32(np.nan), disparity / FIXED_POINT_UNITS_PER_PX)
    return disparity
