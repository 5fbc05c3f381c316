"""What a family of worlds is: a name, a typed config and a sampler."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from scenes.assets import AssetPool
from scenes.own_content import Replaceable
from scenes.spec import Scene

EMPTIEST = 0.1
"""What is left of a family's crowd at complexity 0."""


@dataclass(frozen=True)
class FamilyConfig:
    """What every family lets the user choose; each family's own config adds its ranges."""

    crowd: ClassVar[tuple[str, ...]] = ()
    """Ranges of how many things there are, which a lower complexity lowers."""
    sparsity: ClassVar[tuple[str, ...]] = ()
    """Ranges of how far apart things are, which a lower complexity raises."""

    depths_for_range: ClassVar[bool] = False
    """Whether a range of disparities is met by where things are put, so that the baseline needs no choosing."""

    width: int = 960
    """Image width, pixels."""
    height: int = 540
    """Image height, pixels."""
    frames: int = 1
    """Frames per scene."""

    def with_assets(self, assets: AssetPool) -> Self:  # noqa: ARG002
        """This config for a family that draws the user's files while it samples; others have theirs replaced."""
        return self

    def within_disparities(self, least_px: float, greatest_px: float) -> Self:  # noqa: ARG002
        """This config with its depths chosen for a range of disparities.

        Raises ValueError for a range that the family's worlds cannot have.
        """
        if least_px > 0:
            raise ValueError(
                f"worlds of {type(self).__name__} reach to the horizon, so the least disparity can only be 0, "
                f"not {least_px:g}"
            )
        return self

    def at_complexity(self, complexity: float) -> Self:
        """This config made simpler, for curricula: a tenth of the things at 0, as it is at 1.

        Raises ValueError for a complexity outside 0..1.
        """
        if not 0 <= complexity <= 1:
            raise ValueError(f"complexity must be from 0 to 1, got {complexity}")
        factor = EMPTIEST + (1 - EMPTIEST) * complexity
        changes: dict[str, Any] = {name: _scaled(getattr(self, name), factor) for name in self.crowd}
        changes |= {name: _scaled(getattr(self, name), 1 / factor) for name in self.sparsity}
        return replace(self, **changes)


def _scaled(limits: tuple[float, float], factor: float) -> tuple[float, float]:
    """A range made smaller or larger; of whole numbers, one of anything there was is left."""
    if isinstance(limits[0], int):
        low, high = (max(min(limit, 1), round(limit * factor)) for limit in limits)
        return low, high
    return limits[0] * factor, limits[1] * factor


@dataclass(frozen=True)
class Family:
    """One kind of world."""

    name: str
    config: type[FamilyConfig]
    sample: Callable[[np.random.Generator, Any], Scene]
    """Draws one scene from a generator and an instance of `config`."""
    replaceable: Replaceable | None = None
    """What may be the user's own; None where the family draws it itself (`with_assets`)."""
