"""Numbers in half precision, for a preconditioner's coefficients: the upper half of a float32 (bfloat16).

numba has no such type, so they are kept as the integers of their bits.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

Halves = NDArray[np.uint16]


@njit(cache=True)
def narrowed(single):
    """bfloat16 of float32, rounded."""
    return (np.float32(single).view(np.uint32) + np.uint32(0x8000)) >> np.uint32(16)


@njit(cache=True)
def widened(half):
    """float32 of bfloat16."""
    return np.uint32(np.uint32(half) << np.uint32(16)).view(np.float32)


def halves(values: NDArray[np.float32]) -> Halves:
    """An array rounded."""
    rounded = np.empty(values.shape, np.uint16)
    _narrow(values.reshape(-1), rounded.reshape(-1))
    return rounded


@njit(cache=True, parallel=True)
def _narrow(values, rounded):
    for i in prange(values.size):
        rounded[i] = narrowed(values[i])
