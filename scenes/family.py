"""What a family of worlds is: a name, a typed config and a sampler."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from scenes.assets import AssetPool
from scenes.spec import Scene


@dataclass(frozen=True)
class FamilyConfig:
    """What every family lets the user choose; each family's own config adds its ranges."""

    width: int = 960
    """Image width, pixels."""
    height: int = 540
    """Image height, pixels."""
    frames: int = 1
    """Frames per scene."""

    def with_assets(self, assets: AssetPool) -> Self:
        """This config drawing from the user's files too. Raises ValueError for a family that does not."""
        if not assets:
            return self
        raise ValueError(f"{type(self).__name__} makes no use of own meshes, textures and environments")

    def at_complexity(self, complexity: float) -> Self:
        """This config made simpler: fewer and plainer things at 0, as it is at 1 (for curricula).

        Raises ValueError for a family that cannot.
        """
        if complexity == 1:
            return self
        raise ValueError(f"{type(self).__name__} has no simpler worlds, so there is no curriculum for it")


@dataclass(frozen=True)
class Family:
    """One kind of world."""

    name: str
    config: type[FamilyConfig]
    sample: Callable[[np.random.Generator, Any], Scene]
    """Draws one scene from a generator and an instance of `config`."""
