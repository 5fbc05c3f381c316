"""Materials of vehicles: paint under a clear coat, glass, wheels, lettering, what is inside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenes.appearance.materials import Shares, plain, tiled
from scenes.appearance.painting import Srgb, shade
from scenes.random_draws import chance, choose, integer, new_seed, uniform
from scenes.spec import Material
from scenes.textures.collages import GlyphRows
from scenes.textures.plain import NearTextureless
from scenes.textures.streets import WheelFace

_VIVID: tuple[tuple[float, float, float, float], ...] = (
    (0.42, 0.56, 0.17, 27.0),  # red
    (0.25, 0.42, 0.1, 20.0),  # dark red
    (0.25, 0.5, 0.13, 258.0),  # blue
    (0.5, 0.7, 0.07, 245.0),  # light blue
    (0.25, 0.4, 0.06, 150.0),  # dark green
    (0.45, 0.65, 0.06, 120.0),  # olive
    (0.65, 0.85, 0.15, 90.0),  # yellow
    (0.55, 0.72, 0.15, 55.0),  # orange
    (0.35, 0.55, 0.04, 65.0),  # brown, beige
)
"""Lowest and highest lightness, largest chroma, hue."""


def car_color(rng: np.random.Generator) -> Srgb:
    """A colour that cars have: two in three white, silver, grey or black."""
    if chance(rng, 0.65):
        return shade(
            choose(rng, [0.2, 0.3, 0.45, 0.65, 0.78, 0.94]) + uniform(rng, -0.04, 0.04), 0.006, 255.0
        )
    low, high, chroma, hue = choose(rng, _VIVID)
    return shade(uniform(rng, low, high), uniform(rng, 0.6, 1.0) * chroma, hue + uniform(rng, -8.0, 8.0))


def car_paint(rng: np.random.Generator, shares: Shares) -> Material:
    """The paint of a vehicle: coloured, metallic or not, mostly under a clear coat; else dull or dirty."""
    color = car_color(rng)
    metallic = uniform(rng, 0.3, 0.8) if chance(rng, shares.metallic) else 0.0
    if chance(rng, shares.glossy):
        return replace(
            plain(color, roughness=uniform(rng, 0.35, 0.6), specular=0.3, metallic=metallic),
            coat=uniform(rng, 0.7, 1.0),
        )
    dust = NearTextureless(64, new_seed(rng), color, uniform(rng, 0.04, 0.14), 0.03)
    return replace(tiled(dust, 2.0), roughness=uniform(rng, 0.45, 0.7), specular=0.3)


def dark_glass(rng: np.random.Generator) -> Material:
    """Windows of vehicles into which one does not see."""
    tint = shade(uniform(rng, 0.12, 0.24), 0.02, uniform(rng, 160.0, 260.0))
    return plain(tint, roughness=0.03, specular=0.6)


def clear_glass(rng: np.random.Generator) -> Material:
    """Panes that one sees through: windscreens, shop windows, shelters."""
    tint = shade(uniform(rng, 0.1, 0.3), 0.02, uniform(rng, 140.0, 240.0))
    pane = plain(tint, roughness=uniform(rng, 0.0, 0.03), specular=0.5)
    return replace(pane, transmission=uniform(rng, 0.72, 0.95), thin=True)


def upholstery(rng: np.random.Generator) -> Material:
    """Seats and dashboards."""
    color = shade(uniform(rng, 0.16, 0.45), uniform(rng, 0.0, 0.03), uniform(rng, 30.0, 270.0))
    return tiled(NearTextureless(64, new_seed(rng), color, 0.08, 0.05), 0.4)


def wheel(rng: np.random.Generator, radius_m: float, width_m: float) -> Material:
    """The side of a wheel of a radius and a width in metres, unrolled onto its tread."""
    face = WheelFace.sample(rng, 128)
    # The picture is as wide as the wheel with its tread unrolled.
    side_m = 2.02 * (radius_m + 0.5 * width_m)
    return tiled(replace(face, rim=0.97 * 0.66 * 2 * radius_m / side_m), side_m)


def lettering(rng: np.random.Generator, shares: Shares) -> Material:
    """The sides of lorries' boxes and the signs on vans: a colour, mostly with large words on it."""
    color = shade(uniform(rng, 0.45, 0.95), uniform(rng, 0.0, 0.13), uniform(rng, 0.0, 360.0))
    if chance(rng, shares.plain):
        return tiled(NearTextureless(64, new_seed(rng), color, 0.05, 0.02), 2.5)
    glyphs = replace(GlyphRows.sample(rng, 256), lines=4, letters=integer(rng, 7, 9), grain=0.015)
    ink = shade(0.3, 0.12, uniform(rng, 0.0, 360.0)) if sum(color) > 380 else shade(0.92, 0.02, 90.0)
    return replace(
        tiled(replace(glyphs, palette=(color, ink)), uniform(rng, 2.6, 3.4)), specular=0.4, roughness=0.4
    )


def number_plate(rng: np.random.Generator) -> Material:
    """White or yellow with dark letters: a line of them is 11 cm high."""
    ground = shade(0.95, 0.01, 90.0) if chance(rng, 0.7) else shade(0.85, 0.15, 92.0)
    glyphs = replace(GlyphRows.sample(rng, 128), lines=4, letters=6, grain=0.01)
    return tiled(replace(glyphs, palette=(ground, shade(0.15, 0.02, 260.0))), 0.46)
