"""bfloat16, the upper half of a float32, for the coefficients of a preconditioner.

numba has no such type, so the numbers are kept as the integers of their bits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from refine.solvers.arrays import Float32Array
from stereoforge_kit.kernels import njit, prange

BFloat16Array = NDArray[np.uint16]
"""The bits of bfloat16 numbers."""


@njit()
def to_bfloat16(value):
    """Round a float32 to the nearest bfloat16, ties away from zero; kernel."""
    return (np.float32(value).view(np.uint32) + np.uint32(0x8000)) >> np.uint32(16)


@njit()
def to_float32(bits):
    """The float32 of a bfloat16, exactly; kernel."""
    return np.uint32(np.uint32(bits) << np.uint32(16)).view(np.float32)


def round_to_bfloat16(values: Float32Array) -> BFloat16Array:
    """Round an array of any shape to bfloat16."""
    rounded = np.empty(values.shape, np.uint16)
    _round(values.reshape(-1), rounded.reshape(-1))
    return rounded


@njit(parallel=True)
def _round(values, rounded):
    for i in prange(values.size):
        rounded[i] = to_bfloat16(values[i])
