"""From a network's confidence to the weight of the MRF's data term."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stereoforge_kit.errors import InputError


@dataclass(frozen=True)
class ConfidenceShape:
    """The data weight of a confidence c: tau = sigmoid(logit(c) / temperature) ^ power.

    The shape is ours; with the default values tau = c, as in the paper.

    A network's probabilities are calibrated for counting mistakes, not for weighing squared errors against slopes:
    a pixel that is right with probability 1/2 may be wrong by 20 px and deserves less than half of the weight.
    """

    temperature: float = 1.0
    """Above 1 brings confidences nearer to 1/2, below 1 nearer to 0 and 1."""
    power: float = 1.0
    """Above 1 lowers all confidences, the lower ones more."""

    def __post_init__(self) -> None:
        for name in ("temperature", "power"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"the confidence's {name} must be positive, got {value}")

    def apply(self, confidence: NDArray[np.float32]) -> NDArray[np.float32]:
        """Data weights (H, W) of confidences (H, W) in [0, 1]; 0 stays 0 and 1 stays 1."""
        # sigmoid(logit(c) / T) = c^(1/T) / (c^(1/T) + (1 - c)^(1/T))
        sure = np.power(confidence, 1 / self.temperature, dtype=np.float64)
        unsure = np.power(1 - confidence, 1 / self.temperature, dtype=np.float64)
        shaped: NDArray[np.float32] = np.power(sure / (sure + unsure), self.power).astype(np.float32)
        return shaped
