"""One array, as `numpy.save` writes it. No code in the file is run."""

from __future__ import annotations

import io
import math
import tokenize
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.disparity.meaning import in_floats
from datagen.formats.disparity.record import DisparityFormat
from datagen.formats.limits import read_bounded
from stereoforge_kit.files import write_bytes

_NO_NPY = (ValueError, TypeError, EOFError, SyntaxError, KeyError, RecursionError, tokenize.TokenError)
"""What numpy raises for damaged headers, which are Python literals."""
_HEADERS: Mapping[tuple[int, int], Callable[[io.BytesIO], Any]] = {
    (1, 0): npy.read_array_header_1_0,
    (2, 0): npy.read_array_header_2_0,
}


def decode_npy(path: Path, content: bytes) -> NDArray[Any]:
    """The array of a .npy file, whose header is compared with what follows before memory is allocated.

    Raises FormatError, naming `path`, for what is none.
    """
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


def encode_npy(values: NDArray[np.float32]) -> bytes:
    """The content of a .npy file."""
    stream = io.BytesIO()
    np.save(stream, values)
    return stream.getvalue()


def _read(path: Path) -> NDArray[Any]:
    return decode_npy(path, read_bounded(path))


def _write(path: Path, disparity: NDArray[np.float32], units_per_px: float | None) -> None:
    write_bytes(path, encode_npy(in_floats(disparity, units_per_px)))


FORMAT = DisparityFormat("a .npy", (".npy",), _read, _write)
