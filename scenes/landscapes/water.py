"""Ponds: a basin in the land before the camera, and the water in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenes.appearance.materials import Finish
from scenes.appearance.palettes import PaletteRange, sample_palette_in
from scenes.landscapes.terrain import Land
from scenes.placement.ground import GroundPlacement
from scenes.random_draws import log_uniform, new_seed, uniform
from scenes.shapes.nature.landforms import Basin
from scenes.shapes.nature.water import WaterSurface
from scenes.spec import Texture
from scenes.textures.noise import FractalNoise

_WATER = Finish(1.0, roughness=(0.015, 0.09), specular=(0.5, 0.5))
_DEEP = PaletteRange((130.0, 250.0), (0.015, 0.05), (0.16, 0.38))
_FREEBOARD = 0.03
"""How far the water is below the level of the land, in units of depth."""


def with_pond(rng: np.random.Generator, land: Land, unit_m: float, first_m: float) -> Land:
    """The land with a pond before the camera or beyond the main character, at depth `first_m`, who stands dry.

    Depths are in units of `unit_m`. Where no pond fits, the land stays as it is.
    """
    across = np.linspace(-0.7, 0.7, 9)
    dry = np.array([(0.0, 0.0), *((x * first_m * 0.6, first_m) for x in across)]) / land.half_m
    for _ in range(12):
        wide_m = uniform(rng, 0.45, 1.1) * unit_m
        long_m = wide_m * uniform(rng, 1.2, 3.2)
        y_m = uniform(rng, 0.75, 2.6) * unit_m
        x_m = uniform(rng, -0.9, 0.9) * unit_m
        basin = Basin(
            x_m / land.half_m, y_m / land.half_m, long_m / land.half_m, wide_m / land.half_m,
            uniform(rng, -0.5, 0.5), uniform(rng, 0.2, 0.4) * unit_m / land.half_m,
        )  # fmt: skip
        if basin.rim_shares(dry).min() > 1.12:
            return Land(replace(land.shape, basin=basin), land.half_m, -_FREEBOARD * unit_m)
    return land


def add_water(rng: np.random.Generator, placement: GroundPlacement, land: Land, unit_m: float) -> None:
    """The water of the land's pond, if it has one: dark and reflecting, still or in waves."""
    basin = land.shape.basin
    if basin is None:
        return
    long_m, wide_m = water_size_m(land)
    shape = WaterSurface(
        width=wide_m / long_m,
        wavelength=log_uniform(rng, 0.12, 0.5) * unit_m / long_m,
        steepness=log_uniform(rng, 0.0015, 0.014),
        cells=150,
        seed=new_seed(rng),
    )
    material = placement.new_material(rng, _murk, 0.5 * long_m, unit_m, size=128, finish=_WATER)
    plan = np.array((basin.x, basin.y)) * land.half_m
    spot = placement.spot_at(plan, basin.heading_rad)
    above_m = land.water_m - float(spot.ground_m[2])
    placement.stand("water", shape, material, spot, long_m, sunk_m=-above_m, checked=False)


def water_size_m(land: Land) -> tuple[float, float]:
    """Half the length and half the width of a pond's block of water.

    It reaches under the shore everywhere: where the land's cells are coarse, the basin's mesh is wider than the basin.
    """
    basin = land.shape.basin
    assert basin is not None
    margin = 1.5 * land.shape.cell(max(abs(basin.x), abs(basin.y)) + basin.long)
    return (1.04 * basin.long + margin) * land.half_m, (1.04 * basin.wide + margin) * land.half_m


def _murk(rng: np.random.Generator, size: int) -> Texture:
    palette = sample_palette_in(rng, _DEEP, 3)
    return replace(FractalNoise.sample(rng, size), palette=palette, slope=1.5, ridges=False, grain=0.02)
