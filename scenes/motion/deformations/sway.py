"""Swaying of what is rooted at one end: grass, saplings, vines."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.spec import Deformation


@dataclass(frozen=True)
class Sway(Deformation):
    """A periodic bend that grows with the square of the distance from the root along z."""

    amplitude: float
    """Sideways displacement of the tip, in mesh coordinates."""
    direction_deg: float
    """Heading of the sway in the xy plane."""
    period_frames: float
    phase: float = 0.0
    """Where in its period the motion is at frame 0, 0..1."""
    root: float = -1.0
    """z of the root, in mesh coordinates. What is beyond the root stands still."""
    tip: float = 1.0
    """z of the tip, in mesh coordinates; below the root for what hangs."""

    def deformed(self, vertices: NDArray[np.float64], time_frames: float) -> NDArray[np.float64]:
        heading = math.radians(self.direction_deg)
        swing = self.amplitude * math.sin(2 * math.pi * (time_frames / self.period_frames + self.phase))
        share = np.maximum((vertices[:, 2] - self.root) / (self.tip - self.root), 0.0) ** 2
        moved = vertices.copy()
        moved[:, 0] += swing * math.cos(heading) * share
        moved[:, 1] += swing * math.sin(heading) * share
        return moved
