"""numba's decorators for kernels whose machine code is cached, wherever a cache can be written.

numba keeps compiled code beside the source or in the user's cache folder, and refuses to compile where it can write to
neither, as in a container with a read-only image and another user. The decorators here then use the folder for
temporary files, or compile without a cache, and say so once.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba import prange

__all__ = ["njit", "prange", "vectorize"]

_CACHE_VARIABLE = "NUMBA_CACHE_DIR"


def njit(*signatures: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """`numba.njit(..., cache=True)` with the fallbacks of this module."""
    return _cached(numba.njit, signatures, options)


def vectorize(*signatures: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """`numba.vectorize(..., cache=True)` with the fallbacks of this module."""
    return _cached(numba.vectorize, signatures, options)


def _cached(
    decorator: Callable[..., Any], signatures: tuple[Any, ...], options: dict[str, Any]
) -> Callable[[Callable[..., Any]], Any]:
    def decorate(function: Callable[..., Any]) -> Any:
        try:
            return decorator(*signatures, cache=True, **options)(function)
        except RuntimeError as error:
            if "cannot cache function" not in str(error):
                raise
        return decorator(*signatures, cache=_use_temporary_cache(), **options)(function)

    return decorate


@cache
def _use_temporary_cache() -> bool:
    """Let numba, in child processes too, cache in the folder for temporary files; False if nothing can be written."""
    folder = Path()
    try:
        folder = Path(tempfile.gettempdir()) / f"stereoforge-numba-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        # Cached code is run as it is read, so a folder that another user may have made is not used.
        usable = folder.stat().st_uid == os.getuid() and not folder.is_symlink()
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        usable = False
    if usable:
        numba.config.CACHE_DIR = os.environ[_CACHE_VARIABLE] = str(folder)
    where = f"is kept in {folder}" if usable else "is not kept, so every start compiles anew"
    print(
        f"stereoforge: compiled code {where}: neither the program's folder nor the user's cache folder can be "
        f"written ({_CACHE_VARIABLE} names another one)",
        file=sys.stderr,
    )
    return usable
