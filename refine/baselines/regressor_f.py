"""The paper's rival DispNetCorr1D_F: a regressor fine-tuned on gradients in place of refinement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from refine.method import EvaluationFrame, Method, MethodOutput


@dataclass(frozen=True)
class RegressorF(Method):
    """The disparity of the regressor fine-tuned with the paper's eq. 9.

    The loss is mean |l| + lambda mean(|dx l| + |dy l|) of the error l, lambda = 5; `stereoforge train regressor_f`
    makes the network, whose length of training the paper does not tell.
    """

    name: ClassVar[str] = "regressor_f"
    label: ClassVar[str] = "Regressor, fine-tuned"
    needs: ClassVar[frozenset[str]] = frozenset({"fine_tuned"})

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        """Hand on the fine-tuned regressor's disparity, (H, W) in pixels."""
        return MethodOutput(disparity=frame.fine_tuned, seconds=frame.seconds.get("fine_tuned", 0.0))
