"""Array types that the solvers share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]
FloatArray = NDArray[np.floating[Any]]
"""float32 or float64."""
IndexArray = NDArray[np.int32]
