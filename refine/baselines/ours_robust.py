"""The paper's MRF with a robust gradient term (`refine.robust`), which the paper does not have."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from refine.baselines.ours import mrf_inputs
from refine.confidence_shape import ConfidenceShape
from refine.methods import EvaluationFrame, Method, MethodOutput
from refine.mrf import DEFAULT_TOLERANCE, MRFSolution, SolverName
from refine.parameters import MRFParameters
from refine.robust import DEFAULT_REWEIGHTINGS, DEFAULT_SCALE, solve_robust

_PARAMETERS = MRFParameters(alpha=300.0, beta=0.003, sigma_r=8.0, confidence_floor=1e-5)
_SHAPE = ConfidenceShape(temperature=0.5, power=2.0)


@dataclass(frozen=True)
class OursRobust(Method):
    """`ours`, its gradient term linear for large deviations, so that disparities may step where the image does not."""

    name: ClassVar[str] = "ours_robust"
    label: ClassVar[str] = "Ours, robust gradients"
    needs: ClassVar[frozenset[str]] = frozenset({"confidence", "gradient"})
    search: ClassVar = {
        "parameters.sigma_r": (1.0, 1.7, 2.55, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0, 25.0, 40.0),
        "parameters.alpha": (10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0),
        "scale": (0.03, 0.1, 0.3, 1.0, 3.0),
        "shape.power": (0.5, 1.0, 2.0, 3.0, 4.0),
        "parameters.beta": (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0),
        "shape.temperature": (0.5, 0.7, 1.0, 1.5),
        "parameters.confidence_floor": (1e-5, 1e-4, 1e-3, 3e-3, 1e-2),
    }

    parameters: MRFParameters = field(default_factory=lambda: _PARAMETERS)
    """What `ours` is validated to on flying things, but for alpha, which that one cannot have so large."""
    shape: ConfidenceShape = field(default_factory=lambda: _SHAPE)
    scale: float = DEFAULT_SCALE
    """As `refine.robust.solve_robust`'s, like the reweightings."""
    reweightings: int = DEFAULT_REWEIGHTINGS
    solver: SolverName = "auto"
    tolerance: float = DEFAULT_TOLERANCE

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        solution = self.solve(*mrf_inputs(self, frame))
        return MethodOutput(disparity=solution.disparity.astype(np.float32))

    def solve(
        self,
        disparity: NDArray[np.float32],
        confidence: NDArray[np.float32],
        gradient: NDArray[np.float32],
        image: NDArray[np.uint8],
    ) -> MRFSolution:
        """`refine.robust.solve_robust` with this method's parameters, the confidence shaped."""
        return solve_robust(
            disparity,
            self.shape.apply(confidence),
            gradient,
            image,
            self.parameters,
            self.scale,
            self.reweightings,
            self.solver,
            self.tolerance,
        )
