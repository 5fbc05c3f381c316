"""Semi-global block matching, the rival without learning."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from refine.method import EvaluationFrame, Method, MethodOutput
from stereoforge_kit.matching import SGBMParameters, fill_background, match_sgbm


@dataclass(frozen=True)
class SGBM(Method):
    """OpenCV's semi-global matcher on the pair, its holes filled as the KITTI benchmark fills them.

    Not among the paper's rows for its own data; its Table 6 lists semi-global methods on KITTI. It does not look at
    the initial disparity.
    """

    name: ClassVar[str] = "sgbm"
    label: ClassVar[str] = "SGBM"
    needs: ClassVar[frozenset[str]] = frozenset({"right"})
    search: ClassVar = {
        "parameters.block_px": (1, 3, 5, 7, 9),
        "parameters.small_penalty": (1.0, 2.0, 4.0, 8.0, 16.0),
        "parameters.large_penalty": (24.0, 32.0, 64.0, 96.0, 128.0),
        "parameters.uniqueness_percent": (0, 5, 10, 15),
        "parameters.paths": ("3 paths", "5 paths", "8 paths"),
    }

    parameters: SGBMParameters = field(default_factory=SGBMParameters)

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        """Match the pair, (H, W) in pixels."""
        assert frame.right is not None
        return MethodOutput(fill_background(match_sgbm(frame.image, frame.right, self.parameters)))
