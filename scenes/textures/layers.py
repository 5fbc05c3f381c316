"""Pictures composed of other pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.appearance.painting import mix, smooth_step, spectral_noise, to_bytes
from scenes.random_draws import chance, choose, log_uniform, new_seed, uniform
from scenes.spec import Texture
from scenes.textures import cells, collages, noise, plain, tiles

_GROUNDS: list[type[Texture]] = [
    noise.FractalNoise,
    noise.NaturalSpectrum,
    noise.Marble,
    noise.WoodPlanks,
    cells.VoronoiCells,
    cells.Cobblestones,
    tiles.Bricks,
    tiles.Checkers,
    tiles.Weave,
    collages.DeadLeaves,
    collages.Facade,
    plain.Gradient,
]
_COVERS: list[type[Texture]] = [
    noise.FractalNoise,
    noise.NaturalSpectrum,
    noise.Labyrinth,
    cells.VoronoiCells,
    tiles.Stripes,
    tiles.Dots,
    collages.DeadLeaves,
    collages.BlurredShapes,
    collages.GlyphRows,
    plain.NearTextureless,
]


@dataclass(frozen=True)
class Layered(Texture):
    """One picture showing through holes in another: peeling paint, posters, moss on stone, rust."""

    size: int
    seed: int
    below: Texture
    above: Texture
    cover: float
    """Share of the picture covered, about."""
    low_cycles: float
    """Patches per picture."""
    softness: float
    """Width of the transition, in standard deviations of the mask's noise."""

    popularity: ClassVar[float] = 2.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            below=choose(rng, _GROUNDS).sample(rng, size),
            above=choose(rng, _COVERS).sample(rng, size),
            cover=uniform(rng, 0.25, 0.7),
            low_cycles=log_uniform(rng, 1.5, 8.0),
            softness=0.05 if chance(rng, 0.6) else uniform(rng, 0.2, 0.8),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        patches = spectral_noise(rng, self.size, 1.4, self.low_cycles)
        mask = smooth_step(patches, float(np.quantile(patches, 1 - self.cover)), self.softness)
        # The layer on top throws a thin shadow on the one below.
        shadow = 1 - np.float32(0.45) * np.roll(mask, (2, 2), (0, 1)) * (1 - mask)
        below, above = (
            layer.image().transpose(2, 0, 1).astype(np.float32, order="C")
            for layer in (self.below, self.above)
        )
        return to_bytes(mix(below * shadow, above, mask))
