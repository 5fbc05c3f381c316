"""An archive with one array, as `numpy.savez` writes it; it is called `disparity` in those written here."""

from __future__ import annotations

import io
import lzma
import struct
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.disparity.codecs.npy import decode_npy, encode_npy
from datagen.formats.disparity.meaning import in_floats
from datagen.formats.disparity.record import DisparityFormat
from datagen.formats.limits import MAX_FILE_BYTES, read_bounded
from stereoforge_kit.files import write_bytes

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
_NAME = "disparity.npy"


def _read(path: Path) -> NDArray[Any]:
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
    return decode_npy(path, content)


def _write(path: Path, disparity: NDArray[np.float32], units_per_px: float | None) -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        member = zipfile.ZipInfo(
            _NAME
        )  # Without the time of day, so that the same array gives the same bytes.
        member.compress_type = zipfile.ZIP_DEFLATED
        archive.writestr(member, encode_npy(in_floats(disparity, units_per_px)))
    write_bytes(path, stream.getvalue())


FORMAT = DisparityFormat("a .npz", (".npz",), _read, _write)
