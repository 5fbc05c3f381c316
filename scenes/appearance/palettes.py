"""Palettes of named substances: foliage, bark, rock, sand, snow, skin, cloth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenes.appearance.painting import Palette, oklch_to_srgb
from scenes.random_draws import Range


@dataclass(frozen=True)
class PaletteRange:
    """The OKLCH colours that a substance may have."""

    hue_deg: Range
    """As in `scenes.appearance.painting.shade`: 30 red, 100 yellow, 140 green."""
    chroma: Range
    """0 grey .. 0.3 vivid."""
    lightness: Range
    """Perceptual, 0..1."""


FOLIAGE = PaletteRange((100.0, 150.0), (0.07, 0.16), (0.32, 0.78))
HEATH = PaletteRange((95.0, 135.0), (0.035, 0.095), (0.3, 0.7))
DRY_GRASS = PaletteRange((75.0, 110.0), (0.05, 0.12), (0.5, 0.85))
BARK = PaletteRange((40.0, 80.0), (0.015, 0.06), (0.25, 0.6))
EARTH = PaletteRange((45.0, 85.0), (0.03, 0.08), (0.3, 0.62))
ROCK = PaletteRange((30.0, 110.0), (0.005, 0.035), (0.35, 0.75))
RED_ROCK = PaletteRange((35.0, 60.0), (0.06, 0.12), (0.4, 0.75))
SAND = PaletteRange((60.0, 85.0), (0.05, 0.1), (0.62, 0.86))
SNOW = PaletteRange((220.0, 270.0), (0.004, 0.02), (0.84, 0.97))
MOSS = PaletteRange((105.0, 135.0), (0.045, 0.105), (0.35, 0.65))
PLASTER = PaletteRange((50.0, 100.0), (0.01, 0.06), (0.6, 0.92))
TILES = PaletteRange((25.0, 60.0), (0.05, 0.13), (0.4, 0.68))
SKIN = PaletteRange((45.0, 70.0), (0.03, 0.08), (0.4, 0.82))
HAIR = PaletteRange((40.0, 80.0), (0.01, 0.08), (0.18, 0.6))
CLOTH = PaletteRange((0.0, 360.0), (0.02, 0.14), (0.25, 0.75))
VIVID = PaletteRange((0.0, 360.0), (0.08, 0.2), (0.4, 0.9))


def sample_palette_in(
    rng: np.random.Generator, within: PaletteRange, count: int, hue_spread_deg: float = 14.0
) -> Palette:
    """`count` colours of one substance from dark to light, their hues within `hue_spread_deg` of a common one.

    Lightness is spread evenly about a random level, so that a pattern in these colours has contrast.
    """
    hue = rng.uniform(*within.hue_deg) + rng.uniform(-hue_spread_deg, hue_spread_deg, count)
    chroma = rng.uniform(*within.chroma) * rng.uniform(0.75, 1.2, count)
    low, high = within.lightness
    middle = rng.uniform(low, high)
    low, high = (low + middle) / 2, (high + middle) / 2
    lightness = np.linspace(low, high, count) + rng.normal(0.0, 0.02, count)
    colors = oklch_to_srgb(np.clip(lightness, 0.05, 0.98), chroma, np.radians(hue))
    return tuple((int(r), int(g), int(b)) for r, g, b in colors)
