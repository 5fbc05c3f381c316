"""Palettes of named stuffs: foliage, bark, rock, sand, snow, skin, cloth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenes.appearance.painting import Palette, oklch_to_srgb
from scenes.random_draws import Range


@dataclass(frozen=True)
class Tones:
    """Ranges of OKLCH that a stuff's colours lie in."""

    hue_deg: Range
    chroma: Range
    lightness: Range
    """Spread evenly between darkest and lightest, so that a pattern has contrast."""


FOLIAGE = Tones((100.0, 150.0), (0.07, 0.16), (0.32, 0.78))
HEATH = Tones((95.0, 135.0), (0.035, 0.095), (0.3, 0.7))
DRY_GRASS = Tones((75.0, 110.0), (0.05, 0.12), (0.5, 0.85))
BARK = Tones((40.0, 80.0), (0.015, 0.06), (0.25, 0.6))
EARTH = Tones((45.0, 85.0), (0.03, 0.08), (0.3, 0.62))
ROCK = Tones((30.0, 110.0), (0.005, 0.035), (0.35, 0.75))
RED_ROCK = Tones((35.0, 60.0), (0.06, 0.12), (0.4, 0.75))
SAND = Tones((60.0, 85.0), (0.05, 0.1), (0.62, 0.86))
SNOW = Tones((220.0, 270.0), (0.004, 0.02), (0.84, 0.97))
MOSS = Tones((105.0, 135.0), (0.045, 0.105), (0.35, 0.65))
PLASTER = Tones((50.0, 100.0), (0.01, 0.06), (0.6, 0.92))
TILES = Tones((25.0, 60.0), (0.05, 0.13), (0.4, 0.68))
SKIN = Tones((45.0, 70.0), (0.03, 0.08), (0.4, 0.82))
HAIR = Tones((40.0, 80.0), (0.01, 0.08), (0.18, 0.6))
CLOTH = Tones((0.0, 360.0), (0.02, 0.14), (0.25, 0.75))
VIVID = Tones((0.0, 360.0), (0.08, 0.2), (0.4, 0.9))


def sample_tones(rng: np.random.Generator, tones: Tones, count: int, hue_spread_deg: float = 14.0) -> Palette:
    """`count` colours of one stuff from dark to light, of neighbouring hues."""
    hue = rng.uniform(*tones.hue_deg) + rng.uniform(-hue_spread_deg, hue_spread_deg, count)
    chroma = rng.uniform(*tones.chroma) * rng.uniform(0.75, 1.2, count)
    low, high = tones.lightness
    middle = rng.uniform(low, high)
    low, high = (low + middle) / 2, (high + middle) / 2
    lightness = np.linspace(low, high, count) + rng.normal(0.0, 0.02, count)
    colors = oklch_to_srgb(np.clip(lightness, 0.05, 0.98), chroma, np.radians(hue))
    return tuple((int(r), int(g), int(b)) for r, g, b in colors)
