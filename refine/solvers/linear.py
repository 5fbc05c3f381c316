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
    """The linear system could not be solved: its matrix is singular, or the iterations stopped short."""


@dataclass(frozen=True)
class Problem:
    """The checked inputs of one refinement, shaped as for `refine.refine_disparity`."""

    disparity: Floats
    """(H, W) initial disparity in pixels, without NaN."""
    confidence: Floats
    """(H, W) in [0, 1], without NaN."""
    gradient: Floats
    """(H, W, 2) predicted gradient [dx, dy] in pixels a pixel; NaN where there is none."""
    image: NDArray[np.uint8]
    """(H, W, 3)."""
    parameters: MRFParameters
    form: Form
    start: Floats
    """(H, W) initial guess of the iterations, in pixels."""
    gradient_factor: Floats | None = None
    """(H, W, 2) factors of the gradient terms' weights alpha phi, not negative; 1 if None."""

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W)."""
        height, width = self.disparity.shape
        return height, width

    def system(self) -> MRFSystem:
        """A and b as sparse matrices in float64."""
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
    """(H, W), in pixels."""
    iterations: int
    """Of the Krylov method; 0 for a direct solver."""
    relative_residual: float
    """|b - A x| / |b|, or |A x| where b is 0."""
    converged: bool
    """Whether the relative residual is within the tolerance."""
