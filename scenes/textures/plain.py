"""Pictures with no pattern."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from scenes.spec import Texture


@dataclass(frozen=True)
class SolidColor(Texture):
    """One colour everywhere."""

    srgb: tuple[int, int, int]
    """0..255."""

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        r, g, b = (int(value) for value in rng.integers(0, 256, 3))
        return cls(srgb=(r, g, b))

    def image(self) -> NDArray[np.uint8]:
        return np.full((4, 4, 3), self.srgb, np.uint8)
