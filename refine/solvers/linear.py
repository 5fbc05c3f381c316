"""What a solver is given and what it returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from refine.energy.affinity import Floats
from refine.energy.parameters import MRFParameters
from refine.energy.system import Form, MRFSystem, build_system
from stereoforge_kit.errors import UserError


class SolverError(UserError):
    """The linear system could not be solved."""


@dataclass(frozen=True)
class Problem:
    """One refinement, checked; shapes as for `refine.refine_disparity`, disparity and confidence without
    NaN."""

    disparity: Floats
    confidence: Floats
    gradient: Floats
    image: NDArray[np.uint8]
    parameters: MRFParameters
    form: Form
    start: Floats
    """(H, W) where the iterations begin."""
    gradient_factor: Floats | None = None
    """(H, W, 2) factors of the gradient terms' weights alpha phi, not negative; 1 if None."""

    @property
    def shape(self) -> tuple[int, int]:
        height, width = self.disparity.shape
        return height, width

    def system(self) -> MRFSystem:
        """The problem as sparse matrices in float64."""
        return build_system(
            self.disparity,
            self.confidence,
            self.gradient,
            self.image,
            self.parameters,
            self.form,
            self.gradient_factor,
        )


@dataclass(frozen=True)
class LinearSolution:
    """An approximate solution of A x = b in float64, and how it was reached."""

    x: Floats
    """(H, W)."""
    iterations: int
    """Of the Krylov method; 0 for a direct solver."""
    relative_residual: float
    """|b - A x| / |b|, or |A x| where b is 0."""
    converged: bool
