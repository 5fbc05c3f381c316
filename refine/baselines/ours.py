"""The paper's method: the continuous MRF over initial disparity, confidence and gradients."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from refine.confidence_shape import ConfidenceShape
from refine.methods import EvaluationFrame, Method, MethodOutput
from refine.mrf import DEFAULT_TOLERANCE, MRFSolution, SolverName, solve_mrf
from refine.parameters import MRFParameters
from refine.system import Form


@dataclass(frozen=True)
class Ours(Method):
    """The MRF with ConfNet's confidence and GradNet's gradient."""

    name: ClassVar[str] = "ours"
    label: ClassVar[str] = "Ours"
    needs: ClassVar[frozenset[str]] = frozenset({"confidence", "gradient"})
    search: ClassVar = {
        "parameters.sigma_r": (1.0, 1.7, 2.55, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0, 25.0, 40.0),
        "shape.power": (0.5, 1.0, 2.0, 3.0, 4.0),
        "parameters.alpha": (3.0, 10.0, 30.0, 50.0, 100.0, 300.0),
        "parameters.beta": (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0),
        "shape.temperature": (0.5, 0.7, 1.0, 1.5),
        "parameters.confidence_floor": (1e-5, 1e-4, 1e-3, 3e-3, 1e-2),
    }

    parameters: MRFParameters = field(default_factory=MRFParameters)
    shape: ConfidenceShape = field(default_factory=ConfidenceShape)
    form: Form = "exact"
    solver: SolverName = "auto"
    tolerance: float = DEFAULT_TOLERANCE

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        solution = self.solve(*mrf_inputs(self, frame))
        return MethodOutput(disparity=solution.disparity.astype(np.float32))

    def deviation(self, frame: EvaluationFrame, samples: int) -> NDArray[np.float32]:
        """The posterior's standard deviation in pixels, of the exact form; sampling takes a solve each."""
        return self.sample(*mrf_inputs(self, frame), samples)

    def sample(
        self,
        disparity: NDArray[np.float32],
        confidence: NDArray[np.float32],
        gradient: NDArray[np.float32],
        image: NDArray[np.uint8],
        samples: int,
    ) -> NDArray[np.float32]:
        """`refine.posterior.posterior_deviation` with this method's parameters, the confidence shaped."""
        from refine.posterior import posterior_deviation  # brings numba along

        shaped = self.shape.apply(confidence)
        return posterior_deviation(disparity, shaped, gradient, image, self.parameters, samples)

    def solve(
        self,
        disparity: NDArray[np.float32],
        confidence: NDArray[np.float32],
        gradient: NDArray[np.float32],
        image: NDArray[np.uint8],
    ) -> MRFSolution:
        """`refine.solve_mrf` with this method's parameters, the confidence shaped."""
        return solve_mrf(
            disparity,
            self.shape.apply(confidence),
            gradient,
            image,
            self.parameters,
            self.form,
            self.solver,
            self.tolerance,
        )


def mrf_inputs(
    method: Method, frame: EvaluationFrame
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.uint8]]:
    """What a method with the MRF's inputs takes of a frame; ValueError if it lacks one of them."""
    if frame.confidence is None or frame.gradient is None:
        raise ValueError(
            f"{method.label} needs {method.lacks(frame)}, which frame {frame.name} comes without"
        )
    return frame.disparity, frame.confidence, frame.gradient, frame.image
