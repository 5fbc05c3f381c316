"""The upper bound of the paper's Table 3: the MRF whose confidence is taken from the ground truth."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from refine.method import EvaluationFrame, Method, MethodOutput
from refine.methods.ours import Ours


@dataclass(frozen=True)
class OursConfGT(Method):
    """The MRF with confidence 1 where the initial disparity is right within `threshold`, else 0.

    Where the ground truth is unknown nothing counts, and confidence is 0.
    """

    name: ClassVar[str] = "ours_conf_gt"
    label: ClassVar[str] = "Ours, true confidence"
    upper_bound: ClassVar[bool] = True
    needs: ClassVar[frozenset[str]] = frozenset({"gradient"})
    follows: ClassVar = {"mrf": "ours"}

    mrf: Ours = field(default_factory=Ours)
    threshold: float = 1.0
    """In pixels; ConfNet's label."""

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        """Refine with the confidence that the ground truth gives."""
        right = np.abs(frame.disparity - frame.truth) <= self.threshold
        return self.mrf.run(replace(frame, confidence=right.astype(np.float32)))
