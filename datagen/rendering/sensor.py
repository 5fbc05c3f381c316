"""The cameras of the final pass: what is imperfect about their lenses, sensors and files.

In the order of the light: residual errors of the rig's calibration and blur, vignetting, unequal exposure and colour of
the two cameras, noise, JPEG. Ground truth is the ideal rig's.
"""

from __future__ import annotations

import hashlib
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from datagen.dataset.layout import VIEWS, View
from scenes import Scene, scene_to_json
from scenes.spec import FinalPass, StereoCamera
from stereoforge_kit.camera_effects import blurred, jpeg_compressed

READ_NOISE = 0.02
"""Light, 1 being white, at which a sensor with a gain of 1 reads as much noise as it counts photons'."""


class Sensor:
    """The two cameras of a scene's final pass. The noise is seeded by the Scene record, the frame and the view."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._final = scene, scene.final

    @cached_property
    def seed(self) -> int:
        """A number that the Scene record fixes."""
        digest = hashlib.sha256(scene_to_json(self._scene).encode()).digest()
        return int.from_bytes(digest[:8], "big")

    def project(self, radiance: NDArray[np.float32], view: View) -> NDArray[np.float32]:
        """(H, W, 3) the radiance as the view's own lens projects it: misaligned and blurred.

        radiance: (H, W, 3) linear RGB of the ideal rig.
        """
        faults = self._final.imperfections
        if view == "right":
            homography = misalignment(self._scene.camera, self._final)
            if not np.array_equal(homography, np.eye(3)):
                size = radiance.shape[1::-1]
                radiance = cv2.warpPerspective(
                    radiance, homography, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
                )
                radiance = np.maximum(radiance, 0)  # Cubic interpolation undershoots beside bright edges.
        sigma = faults.blur_px[VIEWS.index(view)]
        return blurred(radiance, (sigma, sigma)) if sigma > 0 else radiance

    def store(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """(H, W, 3) sRGB as the camera's file has it."""
        quality = self._final.imperfections.jpeg_quality
        return jpeg_compressed(picture, quality) if quality else picture

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
        variance = self._noise_variance(np.clip(light, 0.0, 1.0), view)
        if variance is not None:
            rng = np.random.default_rng((self.seed, frame, VIEWS.index(view)))
            light = light + np.sqrt(variance) * rng.standard_normal(light.shape, np.float32)
        return light.astype(np.float32)

    def _noise_variance(self, light: NDArray[np.float32], view: View) -> NDArray[np.float32] | None:
        """The variance of the noise of (H, W, 3) light in 0..1, None for no noise.

        Photons arrive independently, so the variance of their number grows with it. A gain stands for fewer photons.
        The sensor's own noise is amplified with them.
        """
        final, faults = self._final, self._final.imperfections
        if final.noise == 0 and faults.noise == 0:
            return None
        gain = faults.gain[VIEWS.index(view)]
        photons = np.float32(final.noise**2 + gain * faults.noise**2) * light
        return photons + np.float32(READ_NOISE * (gain * faults.noise) ** 2)


def vignette(final: FinalPass, height: int, width: int) -> NDArray[np.float32]:
    """(H, W) float32 share of the light that vignetting leaves; it falls with the squared distance from the centre."""
    x = (np.arange(width) + 0.5) / width * 2 - 1
    y = ((np.arange(height) + 0.5) / height * 2 - 1)[:, None]
    aspect = height / width
    squared = (x**2 + (y * aspect) ** 2) / (1 + aspect**2)
    return (1 - final.vignetting * squared).astype(np.float32)


def misalignment(camera: StereoCamera, final: FinalPass) -> NDArray[np.float64]:
    """(3, 3) from points [x, y, 1] of the ideal right view to where the real one shows them.

    Points are pixels as OpenCV counts them, the centre of the first being (0, 0). The identity for an ideal rig.
    """
    faults = final.imperfections
    if faults.rotation_deg == (0.0, 0.0, 0.0) and faults.focal_ratio == 1.0:
        turn = np.eye(3)
    else:
        x, y = (center - 0.5 for center in camera.principal_point("right"))
        ideal = np.array([[camera.focal_px, 0, x], [0, camera.focal_y_px, y], [0, 0, 1.0]])
        real = ideal * np.array([[faults.focal_ratio, 1, 1], [1, faults.focal_ratio, 1], [1, 1, 1]])
        # What a camera turned by R sees is turned the other way.
        rotation = Rotation.from_euler("xyz", faults.rotation_deg, degrees=True).as_matrix()
        turn = real @ rotation.T @ np.linalg.inv(ideal)
    lower = np.eye(3)
    lower[1, 2] = faults.lower_px
    return lower @ turn
