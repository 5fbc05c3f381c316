"""How a scene's characters are framed: one in the middle, near, far, a group, nobody."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenes.landscapes.terrain import LandscapeConfig
from scenes.random_draws import Count, Range, choose, integer, uniform

FRAMINGS = ("middle", "near", "far", "several", "none")
"""Kinds of framings; a scene notes the index of its own."""


@dataclass(frozen=True)
class Framing:
    """Where a scene's characters are. Depths are in units of the depth at which the baseline is set."""

    kind: str
    height_share: float
    """Height that the main character would have at the unit of depth, as a share of the image height."""
    characters: int
    other_depths: Range
    first_depth: float = 1.0
    """Depth of the main character."""
    spread: float = 0.9
    """Largest distance of the others from the image's middle, relative to half its width."""
    aim: float = 0.5
    """Height at which the camera looks, relative to the character's."""
    above: Range = (-0.1, 0.25)
    """How far the camera looks above that, relative to half the vertical field of view."""
    camera_height: Range = (0.35, 1.2)
    """Height of the camera, relative to the character's height."""

    @property
    def note(self) -> float:
        """The index of its kind."""
        return float(FRAMINGS.index(self.kind))


def sample_framing(rng: np.random.Generator, config: LandscapeConfig, characters: Count) -> Framing:
    """Draw a framing and, from a range, how many characters there are."""
    named = (config.near_share, config.far_share, config.several_share, config.empty_share)
    kind = choose(rng, FRAMINGS, (max(0.0, 1.0 - sum(named)), *named))
    count, high = integer(rng, *characters), uniform(rng, *config.focus_height_share)
    if kind == "near":
        # From the height of its chest, or it would stand before nothing but sky.
        close, aim = uniform(rng, 1.0, 1.6), uniform(rng, 0.6, 0.74)
        return Framing(
            kind, close, count, (1.3, 4.5), aim=aim, above=(-0.25, 0.12), camera_height=(0.5, 0.95)
        )
    if kind == "far":
        first = uniform(rng, 1.9, 4.5)
        return Framing(kind, high, count, (first, 1.8 * first), first, spread=0.8)
    if kind == "several":
        count = max(count, min(3, characters[1])) + integer(rng, 0, min(2, characters[1]))
        return Framing(kind, 0.85 * high, count, (0.9, 1.9), spread=0.75)
    if kind == "none":
        return Framing(kind, high, 0, (1.0, 2.0), aim=0.4)
    return Framing(kind, high, count, (0.9, 3.5))
