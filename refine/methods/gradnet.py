"""GradNet's gradients by themselves (the paper's Table 1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from refine.method import EvaluationFrame, Method, MethodOutput


@dataclass(frozen=True)
class GradNet(Method):
    """GradNet's gradient; it has a gradient error only."""

    name: ClassVar[str] = "gradnet"
    label: ClassVar[str] = "GradNet"
    needs: ClassVar[frozenset[str]] = frozenset({"gradient"})

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        """Hand on the predicted gradient, (H, W, 2) in pixels per pixel."""
        return MethodOutput(gradient=frame.gradient, seconds=frame.seconds.get("gradient", 0.0))
