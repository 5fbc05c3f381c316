"""The weights of the refinement's energy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereoforge_kit.errors import InputError


@dataclass(frozen=True)
class MRFParameters:
    """Weights of the energy's terms (paper, Sec. 3.3; the values are the paper's unless said otherwise)."""

    alpha: float = 100.0
    """Weight of the gradient term."""
    beta: float = 0.1
    """Weight of the colour term; 0 leaves data and gradients alone (the paper's Table 5, row "Grad")."""
    sigma_r: float = 2.55
    """Colour difference between neighbours, in 8-bit units, at which a gradient's weight has fallen to
    exp(-1/2)."""
    confidence_floor: float = 1e-3
    """Confidences are raised to at least this. Our choice, the paper gives none: without a floor, areas of
    zero confidence are held by the weak colour term alone."""

    def __post_init__(self) -> None:
        for name in ("alpha", "beta", "confidence_floor"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise InputError(f"the MRF's {name} must be finite and at least 0, got {value}")
        if not (np.isfinite(self.sigma_r) and self.sigma_r > 0):
            raise InputError(f"the MRF's sigma_r must be positive, got {self.sigma_r}")
        if self.confidence_floor > 1:
            raise InputError(f"the MRF's confidence_floor must be at most 1, got {self.confidence_floor}")
