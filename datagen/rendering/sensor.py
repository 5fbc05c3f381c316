"""The sensor of the final pass: vignetting, unequal exposure and colour of the two cameras, photon noise."""

from __future__ import annotations

import hashlib
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import VIEWS, View
from scenes import Scene, scene_to_json
from scenes.spec import FinalPass


class Sensor:
    """The sensors of a scene's two cameras. The noise is seeded by the Scene record, the frame and the view."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._final = scene, scene.final

    @cached_property
    def _seed(self) -> int:
        digest = hashlib.sha256(scene_to_json(self._scene).encode()).digest()
        return int.from_bytes(digest[:8], "big")

    def expose(
        self, radiance: NDArray[np.float32], exposure: float, view: View, frame: int
    ) -> NDArray[np.float32]:
        """(H, W, 3) float32 light on the sensor, 1 being white.

        Args:
            radiance: (H, W, 3) linear RGB.
            exposure: The scene's factor from radiance to light.
            view: "left" or "right".
            frame: The frame's number from 0, which seeds the noise.
        """
        light = radiance * np.float32(exposure) * vignette(self._final, *radiance.shape[:2])[..., None]
        if view == "right":
            light = light * np.float32(2.0**self._final.exposure_difference_ev)
            light = light * np.array(self._final.right_view_color, np.float32)
        if self._final.noise > 0:
            rng = np.random.default_rng((self._seed, frame, VIEWS.index(view)))
            # Photons arrive independently: the deviation of their number grows with the root of it.
            deviation = self._final.noise * np.sqrt(np.clip(light, 0.0, 1.0))
            light = light + deviation * rng.standard_normal(light.shape, np.float32)
        return light.astype(np.float32)


def vignette(final: FinalPass, height: int, width: int) -> NDArray[np.float32]:
    """(H, W) float32 share of the light that vignetting leaves; it falls with the squared distance from the centre."""
    x = (np.arange(width) + 0.5) / width * 2 - 1
    y = ((np.arange(height) + 0.5) / height * 2 - 1)[:, None]
    aspect = height / width
    squared = (x**2 + (y * aspect) ** 2) / (1 + aspect**2)
    return (1 - final.vignetting * squared).astype(np.float32)
