"""Random suns and lamps."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.motion.trajectories import vector
from scenes.random_draws import chance, log_uniform, uniform
from scenes.spec import AreaLight, Color, SunLight


def sample_light_color(rng: np.random.Generator, saturation: float) -> Color:
    """A light's colour, linear RGB of luminance 1: from candlelight to sky blue, a quarter of them of any hue.

    `saturation` scales how far it is from white.
    """
    warmth = rng.normal(0.0, 0.5)
    color = np.exp(saturation * np.array([warmth, 0.0, -1.3 * warmth]))
    if chance(rng, 0.25):
        color = np.exp(saturation * rng.normal(0.0, 0.8, 3))
    return vector(color / (color @ (0.2126, 0.7152, 0.0722)))


def sample_sun(rng: np.random.Generator, view: NDArray[np.float64]) -> SunLight:
    """A sun 15 to 70 degrees above the horizon, for a camera with the camera-to-world matrix `view` (4, 4).

    Three suns in four come from behind the camera rather than from in front of it.
    """
    elevation = math.radians(uniform(rng, 15.0, 70.0))
    spread = 100.0 if chance(rng, 0.75) else 180.0
    forward = -view[:2, 2] / np.linalg.norm(view[:2, 2])
    heading = Rotation.from_euler("Z", uniform(rng, -spread, spread), degrees=True)
    across = heading.apply((forward[0], forward[1], 0.0)) * math.cos(elevation)
    return SunLight(
        direction=vector(across - (0.0, 0.0, math.sin(elevation))),
        color=sample_light_color(rng, 0.4),
        irradiance=log_uniform(rng, 1.5, 8.0),
        angle_deg=log_uniform(rng, 0.5, 12.0),
    )


def sample_area_light(
    rng: np.random.Generator, view: NDArray[np.float64], target_m: NDArray[np.float64], distance_m: float
) -> AreaLight:
    """A lamp above and behind the camera `view`, or beside it, pointing at a target in front of it.

    `view` (4, 4) is camera to world, `target_m` (3,) in the world. `distance_m` sets the scale of the lamp's
    distance from the camera. The power gives the target an
    irradiance of about 0.5 to 4 W/m^2 (a small Lambertian lamp gives power / (pi * distance^2)).
    """
    side, up, back = uniform(rng, -1.5, 1.5), uniform(rng, 0.3, 1.8), uniform(rng, 0.1, 1.0)
    position = view[:3, 3] + distance_m * (side * view[:3, 0] + np.array([0.0, 0.0, up]) + back * view[:3, 2])
    squared = float(((target_m - position) ** 2).sum())
    return AreaLight(
        position_m=vector(position),
        target_m=vector(target_m),
        color=sample_light_color(rng, 0.8),
        power_w=log_uniform(rng, 0.5, 4.0) * math.pi * squared,
        size_m=distance_m * log_uniform(rng, 0.1, 1.0),
    )
