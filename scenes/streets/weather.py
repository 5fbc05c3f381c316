"""Rain and what it leaves: drops and haze in the final pass, a wet street, puddles."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenes.appearance.painting import Srgb
from scenes.random_draws import chance, log_uniform, uniform
from scenes.spec import FinalPass, Fog, Material, Rain, Texture
from scenes.streets.config import DrivingConfig
from scenes.textures.houses import Plaster
from scenes.textures.streets import Asphalt, Paving, RoadMarkingPaint


@dataclass(frozen=True)
class Weather:
    """How wet a street is."""

    raining: bool
    wetness: float
    """How much of the ground's roughness is filled with water, 0 dry .. 1."""

    def wetted(self, material: Material) -> Material:
        """A material of the ground as it is in this weather: darker and shining where it is wet."""
        if not self.wetness:
            return material
        return replace(
            material,
            color=_darker(material.color, 1.0 - 0.4 * self.wetness),
            roughness=0.42 - 0.28 * self.wetness,
            specular=0.5,
        )

    def standing_water(self, ground: Material) -> Material:
        """A film of still water over a material of the ground: a mirror at grazing angles."""
        return replace(ground, color=_darker(ground.color, 0.5), roughness=0.02, specular=0.5)


def _darker(texture: Texture, share: float) -> Texture:
    """A texture of the ground whose colours are darkened to a share of their levels."""

    def darker(color: Srgb) -> Srgb:
        red, green, blue = (round(level * share) for level in color)
        return (red, green, blue)

    if isinstance(texture, Paving):
        return replace(texture, palette=tuple(darker(color) for color in texture.palette))
    assert isinstance(texture, Asphalt | Plaster | RoadMarkingPaint)
    return replace(texture, color=darker(texture.color))


def sample_weather(rng: np.random.Generator, config: DrivingConfig) -> Weather:
    """Draw whether it rains, or has rained."""
    if chance(rng, config.rain_share):
        return Weather(True, uniform(rng, 0.5, 1.0))
    return Weather(False, uniform(rng, 0.25, 0.9) if chance(rng, config.wet_share) else 0.0)


def sample_final_pass(
    rng: np.random.Generator, config: DrivingConfig, weather: Weather, lamps_on: bool
) -> FinalPass:
    """Draw the final pass: motion blur; rain and its haze; noise in the dark, where sensors amplify."""
    shutter = uniform(rng, *config.shutter_frames)
    noise = uniform(rng, 0.008, 0.03) if lamps_on else 0.0
    if not weather.raining:
        return FinalPass(shutter, noise=noise)
    grey = uniform(rng, 0.05, 0.12) if lamps_on else uniform(rng, 0.4, 0.65)
    haze = Fog((0.96 * grey, grey, 1.03 * grey), log_uniform(rng, 150.0, 900.0))
    length_m = uniform(rng, 0.05, 0.35)
    rain = Rain(
        drops_per_m3=log_uniform(rng, 0.4, 4.0),
        streak_m=(uniform(rng, -0.25, 0.25) * length_m, uniform(rng, -0.25, 0.25) * length_m, -length_m),
        diameter_m=uniform(rng, 0.0015, 0.003),
        opacity=uniform(rng, 0.15, 0.5),
    )
    return FinalPass(shutter, fog=haze, noise=noise, rain=rain)
