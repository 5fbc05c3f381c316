"""Sun, sky and the time of day."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from scenes.appearance.painting import shade
from scenes.random_draws import chance, log_uniform, uniform
from scenes.spec import SunLight, World
from scenes.streets.config import DrivingConfig
from scenes.textures.sky import Sky


@dataclass(frozen=True)
class Daylight:
    """The lighting of a street, apart from lamps."""

    suns: tuple[SunLight, ...]
    world: World
    dusk: bool
    windows_lit: float
    """Share of the windows with light behind them."""


def sample_daylight(rng: np.random.Generator, config: DrivingConfig) -> Daylight:
    """Draw the time of day and the weather: dusk, overcast or a clear sky."""
    if chance(rng, config.dusk_share):
        return _dusk(rng)
    return _day(rng, overcast=chance(rng, config.overcast_share))


def _sun(azimuth: float, elevation: float, irradiance: float, angle_deg: float, warmth: float) -> SunLight:
    """azimuth and elevation of where the light comes from, radians."""
    level = math.cos(elevation)
    direction = (-level * math.cos(azimuth), -level * math.sin(azimuth), -math.sin(elevation))
    return SunLight(direction, (1.0 + 0.25 * warmth, 1.0, 1.0 - 0.4 * warmth), irradiance, angle_deg)


def _sky(rng: np.random.Generator, azimuth: float, elevation: float) -> Sky:
    """Blender's equirectangular pictures have world -x in their middle, and azimuths that run backwards."""
    column = (math.atan2(math.sin(azimuth), -math.cos(azimuth)) / (2 * math.pi) + 0.5) % 1.0
    return replace(Sky.sample(rng, 1024), sun_azimuth=column, sun_elevation_deg=math.degrees(elevation))


def _day(rng: np.random.Generator, overcast: bool) -> Daylight:
    azimuth, elevation = uniform(rng, -math.pi, math.pi), math.radians(uniform(rng, 14.0, 65.0))
    sky = _sky(rng, azimuth, elevation)
    warmth = max(0.0, 1.0 - math.degrees(elevation) / 45.0)
    if overcast:
        grey = [shade(light, 0.015, 250.0) for light in (uniform(rng, 0.62, 0.8), uniform(rng, 0.8, 0.92))]
        cloud = shade(uniform(rng, 0.86, 0.95), 0.008, 250.0)
        sky = replace(
            sky, zenith=grey[0], horizon=grey[1], cloud=cloud, cloud_cover=uniform(rng, 0.75, 1.0), glow=0.1
        )
        sun = _sun(azimuth, elevation, uniform(rng, 0.9, 2.2), 50.0, 0.0)
        return Daylight((sun,), World(sky, uniform(rng, 0.7, 1.0)), False, 0.0)
    blue = shade(uniform(rng, 0.5, 0.68), uniform(rng, 0.07, 0.13), uniform(rng, 240.0, 262.0))
    pale = shade(
        uniform(rng, 0.84, 0.93),
        uniform(rng, 0.015, 0.05),
        uniform(rng, 60.0, 80.0) if chance(rng, 0.3) else 235.0,
    )
    sky = replace(sky, zenith=blue, horizon=pale, cloud=(248, 248, 248), cloud_cover=uniform(rng, 0.0, 0.7))
    sun = _sun(azimuth, elevation, log_uniform(rng, 2.5, 5.0), log_uniform(rng, 0.5, 3.0), warmth)
    return Daylight((sun,), World(sky, uniform(rng, 0.5, 0.85)), False, 0.0)


def _dusk(rng: np.random.Generator) -> Daylight:
    azimuth, elevation = uniform(rng, -math.pi, math.pi), math.radians(uniform(rng, 2.0, 7.0))
    sky = _sky(rng, azimuth, elevation)
    warm = uniform(rng, 30.0, 75.0)
    sky = replace(
        sky,
        zenith=shade(uniform(rng, 0.3, 0.45), 0.08, uniform(rng, 250.0, 285.0)),
        horizon=shade(uniform(rng, 0.65, 0.8), uniform(rng, 0.05, 0.13), warm),
        cloud=shade(uniform(rng, 0.5, 0.7), 0.05, uniform(rng, -70.0, 60.0)),
        cloud_cover=uniform(rng, 0.1, 0.8),
        glow=uniform(rng, 0.0, 0.5),
    )
    suns = (_sun(azimuth, elevation + 0.1, uniform(rng, 0.3, 1.0), 4.0, 1.5),) if chance(rng, 0.4) else ()
    return Daylight(suns, World(sky, uniform(rng, 0.35, 0.8)), True, uniform(rng, 0.25, 0.6))
