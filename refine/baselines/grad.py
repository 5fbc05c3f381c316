"""Row "Grad" of the paper's Table 5: the MRF without its colour term."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from refine.energy.confidence_shape import ConfidenceShape
from refine.energy.parameters import MRFParameters
from refine.method import EvaluationFrame, Method, MethodOutput, mrf_inputs
from refine.mrf.solve import solve_mrf


@dataclass(frozen=True)
class Grad(Method):
    """`ours` with beta = 0: data and gradients alone, a five-point system."""

    name: ClassVar[str] = "grad"
    label: ClassVar[str] = "Gradient term only"
    needs: ClassVar[frozenset[str]] = frozenset({"confidence", "gradient"})
    search: ClassVar = {
        "sigma_r": (1.0, 1.7, 2.55, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0, 25.0, 40.0),
        "shape.power": (0.5, 1.0, 2.0, 3.0, 4.0),
        "alpha": (3.0, 10.0, 30.0, 50.0, 100.0, 300.0),
        "confidence_floor": (1e-5, 1e-4, 1e-3, 3e-3, 1e-2),
    }

    alpha: float = 100.0
    """Weight of the gradient term."""
    sigma_r: float = 2.55
    """As `MRFParameters.sigma_r`."""
    confidence_floor: float = 1e-3
    """As `MRFParameters.confidence_floor`."""
    shape: ConfidenceShape = field(default_factory=ConfidenceShape)

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        """Refine with the data and gradient terms alone."""
        parameters = MRFParameters(self.alpha, 0.0, self.sigma_r, self.confidence_floor)
        disparity, confidence, gradient, image = mrf_inputs(self, frame)
        solution = solve_mrf(disparity, self.shape.apply(confidence), gradient, image, parameters)
        return MethodOutput(disparity=solution.disparity.astype(np.float32))
