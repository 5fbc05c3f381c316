"""The initial disparity, which every other method starts from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from refine.method import EvaluationFrame, Method, MethodOutput


@dataclass(frozen=True)
class Regressor(Method):
    """The regressor's disparity, untouched."""

    name: ClassVar[str] = "regressor"
    label: ClassVar[str] = "Regressor"

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        """Hand on the initial disparity, (H, W) in pixels."""
        return MethodOutput(disparity=frame.disparity, seconds=frame.seconds.get("disparity", 0.0))
