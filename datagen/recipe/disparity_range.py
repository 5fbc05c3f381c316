"""Choosing the baseline so that a scene has the disparities asked for.

In streets and landscapes, which reach from the camera's feet to the horizon, the depths are given. But the left view
does not depend on the baseline and every disparity is proportional to it, so the disparities with one baseline give
those with any other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.scene_geometry import build_geometry
from scenes import Scene

RAYS_ACROSS = 64
"""Columns of the coarse grid of pixels through which rays are cast; rows in proportion."""
REACHED_PERCENT = 99.5
"""Percentile of the surfaces' disparities that becomes the greatest disparity of a range."""


def surface_disparities(scene: Scene) -> NDArray[np.float64]:
    """(P,) px, the disparities of surfaces at a coarse grid of the left view's pixels, in the first and last frame."""
    caster = SceneRayCaster(build_geometry(scene))
    rows, columns = caster.coarse_pixels(RAYS_ACROSS)
    first_and_last = [caster.cast("left", frame, rows, columns) for frame in sorted({0, scene.frames - 1})]
    return np.concatenate([hits.disparity[hits.object_index > 0] for hits in first_and_last])


def with_disparity_at(scene: Scene, percent: float, disparity_px: float) -> Scene:
    """The scene with the baseline at which a percentile of its surfaces' disparities has a given value in px.

    The scene is unchanged if it shows only sky.
    """
    disparity = surface_disparities(scene)
    if not len(disparity):
        return scene
    factor = disparity_px / float(np.percentile(disparity, percent))
    camera = scene.camera
    # Six digits: no machine's last bit shows in the record.
    return replace(scene, camera=replace(camera, baseline_m=float(f"{camera.baseline_m * factor:.6g}")))
