"""Skies: equirectangular pictures that surround and light a scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.drawing import choose, new_seed, uniform
from scenes.painting import Field, Srgb, mix, oklch_to_srgb, smooth_step, spectral_noise
from scenes.spec import Texture


@dataclass(frozen=True)
class Sky(Texture):
    """A gradient from zenith to horizon, clouds, the sun's glow, and the land's colour below.

    Equirectangular: (size / 2, size, 3), the zenith in row 0; periodic along the horizon only.
    """

    size: int
    seed: int
    zenith: Srgb
    horizon: Srgb
    ground: Srgb
    cloud: Srgb
    cloud_cover: float
    """0 clear .. 1 overcast."""
    glow: float
    """Strength of the bright disc around the sun, 0..1."""
    sun_azimuth: float
    """0..1 of the picture's width."""
    sun_elevation_deg: float

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        mood = choose(rng, ["day", "haze", "dusk", "free"], [0.5, 0.2, 0.15, 0.15])
        hue = {"day": 4.3, "haze": 4.0, "dusk": 4.9}.get(mood, rng.uniform(0, 2 * np.pi)) + rng.normal(
            0, 0.15
        )
        warm = hue + np.pi * (mood in ("dusk", "free")) + rng.normal(0, 0.3)
        zenith_chroma = {"day": 0.12, "haze": 0.04, "dusk": 0.1}.get(mood, rng.uniform(0.03, 0.15))
        lightness = np.array([rng.uniform(0.5, 0.75), rng.uniform(0.82, 0.95), rng.uniform(0.35, 0.6), 0.97])
        chroma = np.array([zenith_chroma, rng.uniform(0.02, 0.08), rng.uniform(0.02, 0.07), 0.01])
        hues = np.array([hue, warm, rng.uniform(0.5, 2.3), warm])
        colors = [(int(r), int(g), int(b)) for r, g, b in oklch_to_srgb(lightness, chroma, hues)]
        return cls(
            size=size,
            seed=new_seed(rng),
            zenith=colors[0],
            horizon=colors[1],
            ground=colors[2],
            cloud=colors[3],
            cloud_cover=uniform(rng, 0.0, 1.0),
            glow=uniform(rng, 0.0, 1.0),
            sun_azimuth=uniform(rng, 0.0, 1.0),
            sun_elevation_deg=uniform(rng, 5.0, 60.0),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        height, width = self.size // 2, self.size
        elevation = (np.float32(np.pi) * (0.5 - (np.arange(height, dtype=np.float32) + 0.5) / height))[
            :, None
        ]
        elevation = np.broadcast_to(elevation, (height, width)).astype(np.float32)
        azimuth = np.float32(2 * np.pi) * (np.arange(width, dtype=np.float32) + np.float32(0.5)) / width
        up = np.clip(np.sin(elevation), 0, 1)
        zenith, horizon, ground, cloud = (
            np.array(color, np.float32) for color in (self.zenith, self.horizon, self.ground, self.cloud)
        )
        sky = mix(horizon, zenith, up ** np.float32(0.55))
        sky = self._clouds(rng, sky, cloud, up)
        sun_height = np.radians(self.sun_elevation_deg)
        cosine = np.sin(elevation) * np.sin(sun_height) + np.cos(elevation) * np.cos(sun_height) * np.cos(
            azimuth - 2 * np.pi * self.sun_azimuth
        )
        halo = np.exp((cosine - 1) * 8) * 0.5 + np.exp((cosine - 1) * 120)
        sky = mix(sky, np.float32(255.0), (self.glow * np.clip(halo, 0, 1)).astype(np.float32))
        land = ground * (1 + np.float32(0.15) * spectral_noise(rng, (height, width), 1.0, 4))[..., None]
        picture = mix(land, sky, smooth_step(elevation, 0.0, 0.02))
        return np.clip(picture + np.float32(0.5), 0, 255).astype(np.uint8)

    def _clouds(self, rng: np.random.Generator, sky: Field, cloud: Field, up: Field) -> Field:
        """Clouds, drawn out near the horizon, darker underneath."""
        shape = (len(up), up.shape[1])
        field = spectral_noise(rng, shape, 1.4, 4, stretch=(1.0, 0.35))
        density = smooth_step(field, 1.6 - 3.0 * self.cloud_cover, 1.2) * smooth_step(up, 0.08, 0.16)
        light = 1 - np.float32(0.22) * smooth_step(np.roll(field, -3, axis=0), 0.6, 2.0)
        return mix(sky, cloud * light[..., None], density * np.float32(0.9))
