"""How the C library hands out memory to this process."""

from __future__ import annotations

import ctypes
import sys

_M_TRIM_THRESHOLD = -1
_M_MMAP_MAX = -4
"""Of <malloc.h>."""
_NEVER = 2**31 - 1
_USUAL_TRIM_BYTES, _USUAL_MMAPS = 2**27, 2**16


def keep_freed_memory(keep: bool = True) -> bool:
    """Keep what is freed for the process's next arrays, instead of giving large blocks back to the system.

    A network's maps and a solver's planes have tens of megabytes each and live for milliseconds. Taken from the system
    every time, each page of them is cleared first, which is a fifth of a prediction's time. But kept blocks do not
    always fit what is asked for next, which takes half as much memory again.

    Args:
        keep: False for the library's usual way again.

    Returns:
        Whether the C library is one that can be told so (glibc).
    """
    tell = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    mmaps, trim = (0, _NEVER) if keep else (_USUAL_MMAPS, _USUAL_TRIM_BYTES)
    return tell is not None and bool(tell(_M_MMAP_MAX, mmaps)) and bool(tell(_M_TRIM_THRESHOLD, trim))


def give_back_freed_memory() -> None:
    """Give back to the system what is freed and kept, where the C library can.

    Blocks that live longer than what lay around them leave holes, and what fits no hole is taken anew, so kept memory
    grows slowly. The next arrays take new pages: 1 GB of them costs about a tenth of a second.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)
