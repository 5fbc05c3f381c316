"""Skies: equirectangular pictures for the environment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.appearance.painting import (
    Field,
    Picture,
    Srgb,
    mix,
    oklch_to_srgb,
    paint,
    smooth_step,
    spectral_noise,
    to_bytes,
)
from scenes.random_draws import choose, new_seed, uniform
from scenes.spec import Texture


@dataclass(frozen=True)
class Sky(Texture):
    """A sky: a gradient from zenith to horizon, clouds, the sun's glow, and the ground's colour below.

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
            cloud_cover=uniform(rng, 0.0, 1.0) ** 1.5,
            glow=uniform(rng, 0.0, 1.0),
            sun_azimuth=uniform(rng, 0.0, 1.0),
            sun_elevation_deg=uniform(rng, 5.0, 60.0),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        half, width = self.size // 4, self.size
        # Rows from the zenith down to the horizon, columns once around.
        step = np.float32(np.pi / 2 / half)
        elevation = np.float32(np.pi / 2) - step * (
            np.arange(half, dtype=np.float32)[:, None] + np.float32(0.5)
        )
        azimuth = step * (np.arange(width, dtype=np.float32)[None, :] + np.float32(0.5))
        up = np.sin(elevation)
        sky = mix(paint(self.horizon), paint(self.zenith), up ** np.float32(0.55))
        sky = self._clouds(rng, sky, up, width)
        sun_height = np.float32(np.radians(self.sun_elevation_deg))
        around = np.cos(azimuth - np.float32(2 * np.pi * self.sun_azimuth))
        cosine = up * np.sin(sun_height) + np.cos(elevation) * np.cos(sun_height) * around
        halo = np.float32(0.5) * np.exp((cosine - 1) * 8) + np.exp((cosine - 1) * 120)
        sky = mix(sky, paint((255, 255, 255)), np.float32(self.glow) * np.clip(halo, 0, 1))
        # Land below the horizon is only seen in reflections and as light from below.
        return to_bytes(np.concatenate([sky, np.broadcast_to(paint(self.ground), sky.shape)], axis=1))

    def _clouds(self, rng: np.random.Generator, sky: Picture, up: Field, width: int) -> Picture:
        """Clouds, smaller and denser towards the horizon, darker underneath."""
        rows = len(up)
        noise = spectral_noise(rng, (2 * rows, width), 1.6, 5, stretch=(1.0, 0.8))
        # A layer of clouds in perspective: near the horizon, rows of the noise pass ever faster.
        field = noise[(rows * (1 - up[:, 0]) ** np.float32(0.6)).astype(np.int32)]
        density = smooth_step(field, 1.8 - 3.2 * self.cloud_cover, 1.0) * smooth_step(up, 0.03, 0.12)
        light = 1 - np.float32(0.15) * smooth_step(np.roll(field, -3, axis=0), 0.4, 1.8)
        return mix(sky, paint(self.cloud) * light, density * np.float32(0.9))
