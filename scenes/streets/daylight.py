"""Sun, sky and the time of day: day, low sun, overcast, dusk, night."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from scenes.appearance.painting import shade
from scenes.random_draws import chance, log_uniform, uniform
from scenes.spec import SunLight, World
from scenes.streets.config import DrivingConfig
from scenes.textures.sky import Sky

HOURS = ("day", "low sun", "overcast", "dusk", "night")
"""The kinds of light there are, by the numbers that a scene's notes have for them."""


@dataclass(frozen=True)
class Daylight:
    """The lighting of a street, apart from lamps."""

    hour: str
    """One of `HOURS`."""
    suns: tuple[SunLight, ...]
    world: World
    exposure_key: float
    """Mean level of the picture: a camera keeps evenings and nights darker than days."""
    windows_lit: float = 0.0
    """Share of the windows with light behind them."""

    @property
    def lamps_on(self) -> bool:
        """Whether street lamps, head lamps and shops are lit."""
        return self.hour in ("dusk", "night")


def sample_daylight(rng: np.random.Generator, config: DrivingConfig, raining: bool) -> Daylight:
    """Draw the time of day, and the sky; where it rains by day it is overcast."""
    drawn = rng.random()
    if drawn < config.night_share:
        return _night(rng)
    if drawn < config.night_share + config.dusk_share:
        return _dusk(rng, raining)
    if chance(rng, config.overcast_share) or raining:
        return _overcast(rng, raining)
    return _clear(rng, low=chance(rng, config.low_sun_share))


def _sun(azimuth: float, elevation: float, irradiance: float, angle_deg: float, warmth: float) -> SunLight:
    """azimuth and elevation of where the light comes from, radians."""
    level = math.cos(elevation)
    direction = (-level * math.cos(azimuth), -level * math.sin(azimuth), -math.sin(elevation))
    return SunLight(direction, (1.0 + 0.25 * warmth, 1.0, 1.0 - 0.4 * warmth), irradiance, angle_deg)


def _sky(rng: np.random.Generator, azimuth: float, elevation: float) -> Sky:
    """Blender's equirectangular pictures have world -x in their middle, and azimuths that run backwards."""
    column = (math.atan2(math.sin(azimuth), -math.cos(azimuth)) / (2 * math.pi) + 0.5) % 1.0
    return replace(Sky.sample(rng, 1024), sun_azimuth=column, sun_elevation_deg=math.degrees(elevation))


def _overcast(rng: np.random.Generator, raining: bool) -> Daylight:
    azimuth, elevation = uniform(rng, -math.pi, math.pi), math.radians(uniform(rng, 14.0, 65.0))
    darker = 0.08 if raining else 0.0
    grey = [
        shade(light - darker, 0.015, 250.0) for light in (uniform(rng, 0.62, 0.8), uniform(rng, 0.8, 0.92))
    ]
    sky = replace(
        _sky(rng, azimuth, elevation),
        zenith=grey[0],
        horizon=grey[1],
        cloud=shade(uniform(rng, 0.86, 0.95) - darker, 0.008, 250.0),
        cloud_cover=uniform(rng, 0.75, 1.0),
        glow=0.1,
    )
    sun = _sun(azimuth, elevation, uniform(rng, 0.1, 0.5) if raining else uniform(rng, 0.9, 2.2), 50.0, 0.0)
    return Daylight("overcast", (sun,), World(sky, uniform(rng, 0.7, 1.0)), uniform(rng, 0.17, 0.26))


def _clear(rng: np.random.Generator, low: bool) -> Daylight:
    """A blue sky with some clouds; a low sun is warm, and its shadows are long."""
    azimuth = uniform(rng, -math.pi, math.pi)
    elevation = math.radians(uniform(rng, 3.0, 13.0) if low else uniform(rng, 16.0, 65.0))
    warmth = max(0.0, 1.0 - math.degrees(elevation) / 45.0) + 0.7 * low
    blue = shade(uniform(rng, 0.5, 0.68), uniform(rng, 0.07, 0.13), uniform(rng, 240.0, 262.0))
    warm = low or chance(rng, 0.3)
    pale = shade(
        uniform(rng, 0.84, 0.93),
        uniform(rng, 0.02, 0.08) if low else uniform(rng, 0.015, 0.05),
        uniform(rng, 60.0, 80.0) if warm else 235.0,
    )
    sky = replace(
        _sky(rng, azimuth, elevation),
        zenith=blue,
        horizon=pale,
        cloud=shade(0.93, 0.03, 70.0) if low else (248, 248, 248),
        cloud_cover=uniform(rng, 0.0, 0.7),
    )
    irradiance = log_uniform(rng, 2.0, 4.0) if low else log_uniform(rng, 2.5, 5.0)
    sun = _sun(azimuth, elevation, irradiance, log_uniform(rng, 0.5, 3.0), warmth)
    strength = uniform(rng, 0.35, 0.6) if low else uniform(rng, 0.5, 0.85)
    return Daylight(
        "low sun" if low else "day", (sun,), World(sky, strength), uniform(rng, 0.16, 0.26 if low else 0.3)
    )


def _dusk(rng: np.random.Generator, raining: bool) -> Daylight:
    azimuth, elevation = uniform(rng, -math.pi, math.pi), math.radians(uniform(rng, 2.0, 7.0))
    sky = _sky(rng, azimuth, elevation)
    warm = uniform(rng, 30.0, 75.0)
    sky = replace(
        sky,
        zenith=shade(uniform(rng, 0.3, 0.45), 0.08, uniform(rng, 250.0, 285.0)),
        horizon=shade(uniform(rng, 0.65, 0.8), uniform(rng, 0.05, 0.13), warm),
        cloud=shade(uniform(rng, 0.5, 0.7), 0.05, uniform(rng, -70.0, 60.0)),
        cloud_cover=uniform(rng, 0.75, 1.0) if raining else uniform(rng, 0.1, 0.8),
        glow=uniform(rng, 0.0, 0.5),
    )
    sunny = chance(rng, 0.4) and not raining
    suns = (_sun(azimuth, elevation + 0.1, uniform(rng, 0.3, 1.0), 4.0, 1.5),) if sunny else ()
    world = World(sky, uniform(rng, 0.25, 0.6))
    return Daylight("dusk", suns, world, uniform(rng, 0.12, 0.2), uniform(rng, 0.25, 0.6))


def _night(rng: np.random.Generator) -> Daylight:
    """A dark sky that reflects some of the city's light, and perhaps a moon."""
    azimuth, elevation = uniform(rng, -math.pi, math.pi), math.radians(uniform(rng, 20.0, 60.0))
    city = uniform(rng, 40.0, 75.0) if chance(rng, 0.6) else uniform(rng, 240.0, 290.0)
    sky = replace(
        _sky(rng, azimuth, elevation),
        zenith=shade(uniform(rng, 0.1, 0.22), 0.03, 270.0),
        horizon=shade(uniform(rng, 0.25, 0.4), uniform(rng, 0.01, 0.05), city),
        cloud=shade(uniform(rng, 0.2, 0.35), 0.02, city),
        ground=shade(0.15, 0.01, city),
        cloud_cover=uniform(rng, 0.0, 0.9),
        glow=0.0,
    )
    moon = (_sun(azimuth, elevation, uniform(rng, 0.004, 0.02), 1.0, -0.5),) if chance(rng, 0.4) else ()
    world = World(sky, log_uniform(rng, 0.1, 0.4))
    return Daylight("night", moon, world, uniform(rng, 0.06, 0.11), uniform(rng, 0.12, 0.45))
