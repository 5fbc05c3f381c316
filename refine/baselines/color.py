"""Row "Color" of the paper's Table 5: neighbours of like colour have like disparity.

A. Levin, D. Lischinski, Y. Weiss, "Colorization using optimization", SIGGRAPH 2004, with confidence for the user's
strokes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from refine.energy.confidence_shape import ConfidenceShape
from refine.energy.parameters import MRFParameters
from refine.energy.system import Form
from refine.method import EvaluationFrame, Method, MethodOutput, mrf_inputs
from refine.mrf.solve import SolverName, solve_mrf

_DIRECT_UP_TO_PIXELS = 200_000


@dataclass(frozen=True)
class Color(Method):
    """sum tau_p (S_p - D_p)^2 + beta sum phibar_p (S_p - sum_q w_pq S_q)^2: the MRF with alpha = 0.

    Levin et al. weigh all pixels of the prior alike, which here is the limit of a small sigma_r (phibar = 2 wherever
    the image is not constant), and know some pixels exactly and the others not at all, which is a confidence of 1 or
    0. The form "paper" leaves the prior unsquared, as a published code for filling in depth maps does and the
    paper's eq. 8.
    """

    name: ClassVar[str] = "color"
    label: ClassVar[str] = "Colour term only"
    needs: ClassVar[frozenset[str]] = frozenset({"confidence"})
    search: ClassVar = {
        "beta": (0.01, 0.1, 1.0, 10.0, 100.0),
        "form": ("exact", "paper"),
        "sigma_r": (0.1, 1.0, 2.55, 6.0),
        "shape.power": (0.5, 1.0, 2.0, 3.0, 4.0),
        "confidence_floor": (1e-5, 1e-4, 1e-3, 3e-3, 1e-2),
    }

    beta: float = 1.0
    """Weight of the colour term (ours; a published code for depth maps has 1)."""
    sigma_r: float = 2.55
    """As `MRFParameters.sigma_r`."""
    confidence_floor: float = 1e-3
    """As `MRFParameters.confidence_floor`."""
    shape: ConfidenceShape = field(default_factory=ConfidenceShape)
    form: Form = "exact"
    tolerance: float = 1e-4
    """Relative residual at which the iterative solver stops, on images of more than 200,000 pixels. Without the
    gradient term large flat areas hang on little, and the MRF's own tolerance takes hundreds of iterations for digits
    that no measure shows."""

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        """Refine with the data and colour terms alone."""
        parameters = MRFParameters(0.0, self.beta, self.sigma_r, self.confidence_floor)
        # With alpha = 0 the gradient counts for nothing, whatever it is.
        level = np.zeros((*frame.disparity.shape, 2), np.float32)
        # The multigrid cycle is made for the gradient term's couplings; without them it takes hundreds of iterations,
        # and a factorisation of a smaller image less than half of their time.
        solver: SolverName = "direct" if frame.disparity.size <= _DIRECT_UP_TO_PIXELS else "auto"
        disparity, confidence, _, image = mrf_inputs(self, replace(frame, gradient=level))
        shaped = self.shape.apply(confidence)
        solution = solve_mrf(disparity, shaped, level, image, parameters, self.form, solver, self.tolerance)
        return MethodOutput(disparity=solution.disparity.astype(np.float32))
