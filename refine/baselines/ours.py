"""The paper's method: the continuous MRF over initial disparity, confidence and gradients."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from refine.methods import EvaluationFrame, Method, MethodOutput
from refine.mrf import DEFAULT_TOLERANCE, SolverName, refine_disparity
from refine.parameters import MRFParameters
from refine.system import Form


@dataclass(frozen=True)
class Ours(Method):
    """The MRF with ConfNet's confidence and GradNet's gradient."""

    name: ClassVar[str] = "ours"
    label: ClassVar[str] = "Ours"
    needs: ClassVar[frozenset[str]] = frozenset({"confidence", "gradient"})

    parameters: MRFParameters = field(default_factory=MRFParameters)
    form: Form = "exact"
    solver: SolverName = "auto"
    tolerance: float = DEFAULT_TOLERANCE

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        if frame.confidence is None or frame.gradient is None:
            raise ValueError(
                f"{self.label} needs {', '.join(self.missing(frame))}; frame {frame.name} has none"
            )
        refined = refine_disparity(
            frame.disparity,
            frame.confidence,
            frame.gradient,
            frame.image,
            self.parameters,
            self.form,
            self.solver,
            self.tolerance,
        )
        return MethodOutput(disparity=refined)
