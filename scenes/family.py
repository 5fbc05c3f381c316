"""A family of scenes: a name, a typed config and a sampler."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, Self, get_type_hints

import numpy as np

from scenes.imperfections import ImperfectionRanges
from scenes.random_draws import Count, Range
from scenes.spec import OMIT_DEFAULT, Rig, Scene, StereoCamera, Trajectory
from scenes.user_assets.pool import AssetPool
from scenes.user_assets.replacement import Replaceable
from stereoforge_kit.errors import InputError

EMPTIEST = 0.1
"""What is left of a family's crowd at complexity 0."""


def crowd_share(complexity: float) -> float:
    """The share of a family's crowd that is left at a complexity from 0 (`EMPTIEST`) to 1 (all of it)."""
    return EMPTIEST + (1 - EMPTIEST) * complexity


@dataclass(frozen=True)
class FamilyConfig:
    """The settings that all families share; each family's own config adds its ranges.

    Raises ValueError for settings that no family can sample.
    """

    crowd: ClassVar[tuple[str, ...]] = ()
    """Names of the fields that hold numbers of things; a lower complexity lowers them."""
    sparsity: ClassVar[tuple[str, ...]] = ()
    """Names of the fields that hold distances between things; a lower complexity raises them."""

    depths_for_range: ClassVar[bool] = False
    """Whether a range of disparities is reached by choosing depths, so that the baseline need not change."""

    width: int = 960
    """Image width, pixels."""
    height: int = 540
    """Image height, pixels."""
    frames: int = 1
    """Frames per scene."""
    rig: Rig | None = field(default=None, metadata=OMIT_DEFAULT)
    """The stereo rig that all scenes are seen by; None to sample focal lengths and baselines."""
    imperfections: ImperfectionRanges = field(default_factory=ImperfectionRanges)
    """How the final pass's rigs differ from ideal ones."""

    def __post_init__(self) -> None:
        """The checks that all families share; a family adds its own after these."""
        for name, kind in _numbers(type(self)).items():
            given = getattr(self, name)
            values = given if isinstance(given, tuple) else (given,)
            if not np.isfinite(values).all():
                raise InputError(f"{name} must be finite, got {given}")
            if kind in (Range, Count) and values[0] > values[1]:
                raise InputError(f"{name} must be (low, high), got {given}")
            if kind == Count and values[0] < 0:
                raise InputError(f"{name} must not be negative, got {given}")
            if kind is float and name.endswith("_share") and not 0 <= given <= 1:
                raise InputError(f"{name} must be in 0..1, got {given}")
        if self.frames < 1:
            raise InputError(f"frames must be at least 1, got {self.frames}")
        if self.rig and (self.rig.width, self.rig.height) != (self.width, self.height):
            raise InputError(
                f"the rig's images are {self.rig.width}x{self.rig.height}, not {self.width}x{self.height}"
            )

    def lens_mm(self, focal_mm: float) -> float:
        """The rig's focal length on a sensor 32 mm wide, or the one that was drawn if there is no rig."""
        return self.rig.focal_mm if self.rig else focal_mm

    def camera(self, focal_mm: float, baseline_m: float, motion: Trajectory) -> StereoCamera:
        """The camera of a scene on a path: the rig, or one of the lens and baseline drawn if there is none."""
        if self.rig:
            return self.rig.camera(motion)
        return StereoCamera(self.width, self.height, focal_mm, baseline_m, motion)

    def with_assets(self, assets: AssetPool) -> Self:  # noqa: ARG002
        """This config with the user's files, for a family that draws them while it samples.

        Other families return the config unchanged: their scenes get user assets afterwards
        (`scenes.user_assets.replacement`).
        """
        return self

    def within_disparities(self, least_px: float, greatest_px: float) -> Self:  # noqa: ARG002
        """This config with its depths chosen for a range of disparities.

        Raises ValueError for a range that the family's worlds cannot have.
        """
        if least_px > 0:
            raise InputError(
                f"worlds of {type(self).__name__} reach to the horizon, so the least disparity can only be 0, "
                f"not {least_px:g}"
            )
        return self

    def at_complexity(self, complexity: float) -> Self:
        """This config made simpler, for curricula: a tenth of the things at 0, as it is at 1.

        Raises ValueError for a complexity outside 0..1, or for a family that names nothing to have fewer of.
        """
        if not 0 <= complexity <= 1:
            raise InputError(f"complexity must be from 0 to 1, got {complexity}")
        if complexity < 1 and not self.crowd and not self.sparsity:
            raise InputError(f"{type(self).__name__} names no crowd that a curriculum could make smaller")
        factor = crowd_share(complexity)
        changes: dict[str, Any] = {name: _scaled(getattr(self, name), factor) for name in self.crowd}
        changes |= {name: _scaled(getattr(self, name), 1 / factor) for name in self.sparsity}
        return replace(self, **changes)


def _numbers(config: type[FamilyConfig]) -> dict[str, Any]:
    """The types of the fields that hold numbers or tuples of them, by name."""
    kinds = (int, float, Range, Count, tuple[float, ...])
    hints = get_type_hints(config)
    return {one.name: hints[one.name] for one in fields(config) if hints[one.name] in kinds}


def _scaled(limits: tuple[float, float], factor: float) -> tuple[float, float]:
    """A range multiplied by a factor; in a range of counts, what was at least one stays at least one."""
    if isinstance(limits[0], int):
        low, high = (max(min(limit, 1), round(limit * factor)) for limit in limits)
        return low, high
    return limits[0] * factor, limits[1] * factor


@dataclass(frozen=True)
class Family:
    """A family of scenes, as the registry knows it."""

    name: str
    config: type[FamilyConfig]
    sample: Callable[[np.random.Generator, Any], Scene]
    """Draws one scene from a generator and an instance of `config`."""
    replaceable: Replaceable | None = None
    """What user assets may replace; None where the family draws them itself (`FamilyConfig.with_assets`)."""

    @property
    def takes_assets(self) -> bool:
        """Whether its scenes can show user assets."""
        return self.replaceable is not None or self.config.with_assets is not FamilyConfig.with_assets
