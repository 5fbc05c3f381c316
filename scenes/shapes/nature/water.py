"""Water: ponds and pools with waves on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from scenes.geometry.building import Part, block_under
from scenes.random_draws import log_uniform, new_seed, uniform
from scenes.shapes.anchored import PartedShape
from scenes.shapes.solids.organic import wave_noise


@dataclass(frozen=True)
class WaterSurface(PartedShape):
    """A block of water with waves on it, its middle at the level of the water; half as long as 1 along x."""

    width: float
    """Along y, relative to the length along x."""
    wavelength: float
    """Of the longest waves, relative to half the length."""
    steepness: float
    """Standard deviation of the height relative to the wavelength."""
    cells: int
    """Along x."""
    seed: int

    popularity: ClassVar[float] = 0.0
    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 0.3, 1.0),
            log_uniform(rng, 0.06, 0.3),
            uniform(rng, 0.002, 0.015),
            96,
            new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        rows = max(8, round(self.cells * self.width))
        x, y = np.meshgrid(np.linspace(-1, 1, self.cells + 1), np.linspace(-self.width, self.width, rows + 1))
        flat = np.stack([x, y], -1).reshape(-1, 2)
        waves = wave_noise(rng, flat, 2 * np.pi / self.wavelength, 1.3, 20).reshape(x.shape)
        # Still water mirrors, where the wind does not reach it.
        calm = 0.35 + 0.65 / (1 + np.exp(-2.5 * wave_noise(rng, flat, 2.5, 1.0, 12).reshape(x.shape)))
        height = self.steepness * self.wavelength * waves * calm
        return {"water": block_under(np.stack([x, y, height], -1), -0.2)}
