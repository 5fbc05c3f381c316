"""The initial disparity as it is: what every other row starts from."""

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
        return MethodOutput(disparity=frame.disparity, seconds=frame.seconds.get("disparity", 0.0))
