"""Ours: the continuous MRF over initial disparity, confidence and gradients."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from refine.energy.confidence_shape import ConfidenceShape
from refine.energy.parameters import MRFParameters
from refine.energy.system import Form
from refine.method import EvaluationFrame, Method, MethodOutput, mrf_inputs
from refine.mrf.robust import check_scale, curvature_factor, solve_robust
from refine.mrf.solve import DEFAULT_TOLERANCE, MRFSolution, SolverName, solve_mrf
from stereoforge_kit.errors import InputError


@dataclass(frozen=True)
class Ours(Method):
    """The MRF with ConfNet's confidence and GradNet's gradient; the defaults are the paper's.

    Validation also chooses the penalty of the gradient term: quadratic as in the paper (`ours_quadratic` is that row),
    or robust (`refine.mrf.robust`), so that disparities may step where the image does not.
    """

    name: ClassVar[str] = "ours"
    label: ClassVar[str] = "Ours"
    needs: ClassVar[frozenset[str]] = frozenset({"confidence", "gradient"})
    search: ClassVar = {
        "parameters.sigma_r": (1.0, 1.7, 2.55, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0, 25.0, 40.0),
        "shape.power": (0.5, 1.0, 2.0, 3.0, 4.0),
        "parameters.alpha": (3.0, 10.0, 30.0, 50.0, 100.0, 300.0, 1000.0, 3000.0),
        "gradient_scale": (None, 3.0, 1.0, 0.3, 0.1, 0.03, 0.01),
        "parameters.beta": (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0),
        "shape.temperature": (0.5, 0.7, 1.0, 1.5),
        "parameters.confidence_floor": (1e-5, 1e-4, 1e-3, 3e-3, 1e-2),
    }
    tied: ClassVar[tuple[tuple[str, str], ...]] = (
        ("parameters.alpha", "gradient_scale"),
        ("shape.power", "shape.temperature"),
    )
    """Far from the predicted gradients only alpha times the scale matters; where the confidence is low, only power over
    temperature."""

    parameters: MRFParameters = field(default_factory=MRFParameters)
    shape: ConfidenceShape = field(default_factory=ConfidenceShape)
    form: Form = "exact"
    solver: SolverName = "auto"
    tolerance: float = DEFAULT_TOLERANCE
    gradient_scale: float | None = None
    """As `refine.mrf.robust.solve_robust`'s scale, in pixels a pixel; None for the paper's quadratic gradient term."""

    def __post_init__(self) -> None:
        if self.gradient_scale is None:
            return
        check_scale(self.gradient_scale)
        if self.form != "exact":
            raise InputError(
                "the paper's form of the MRF has a quadratic gradient term, so no gradient_scale"
            )

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        """Refine the frame's initial disparity. Raises InputError for a frame without confidence or gradient."""
        solution = self.solve(*mrf_inputs(self, frame))
        return MethodOutput(disparity=solution.disparity.astype(np.float32))

    def deviation(self, frame: EvaluationFrame, samples: int) -> NDArray[np.float32]:
        """Standard deviation (H, W) of the posterior of the exact form, in pixels. Each sample takes one solve."""
        return self.sample(*mrf_inputs(self, frame), samples)

    def sample(
        self,
        disparity: NDArray[np.float32],
        confidence: NDArray[np.float32],
        gradient: NDArray[np.float32],
        image: NDArray[np.uint8],
        samples: int,
    ) -> NDArray[np.float32]:
        """`refine.mrf.posterior.posterior_deviation` with this method's parameters, the confidence shaped.

        With a robust gradient term that of the Gaussian whose energy is curved as this one is at its minimum
        (Laplace's approximation).
        """
        from refine.mrf.posterior import posterior_deviation  # brings numba along

        factor = None
        if self.gradient_scale is not None:
            refined = self.solve(disparity, confidence, gradient, image).disparity
            factor = curvature_factor(refined, gradient, self.gradient_scale)
        shaped = self.shape.apply(confidence)
        return posterior_deviation(
            disparity, shaped, gradient, image, self.parameters, samples, gradient_factor=factor
        )

    def solve(
        self,
        disparity: NDArray[np.float32],
        confidence: NDArray[np.float32],
        gradient: NDArray[np.float32],
        image: NDArray[np.uint8],
    ) -> MRFSolution:
        """`refine.solve_mrf` or `refine.mrf.robust.solve_robust` with these parameters, the confidence shaped."""
        inputs = disparity, self.shape.apply(confidence), gradient, image, self.parameters
        if self.gradient_scale is None:
            return solve_mrf(*inputs, self.form, self.solver, self.tolerance)
        return solve_robust(*inputs, self.gradient_scale, solver=self.solver, tolerance=self.tolerance)
