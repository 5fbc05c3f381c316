"""Meeting disparities asked for where the depths of a world are what they are: by choosing the baseline.

Streets and landscapes reach from the camera's feet to the horizon. The left view does not depend on the
baseline, and every disparity is proportional to it, so one look decides it exactly.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.scene_geometry import build_geometry
from scenes import Scene

RAYS_ACROSS = 64
"""Columns of the coarse grid of pixels that are looked at; rows in proportion."""
REACHED_PERCENT = 99.5
"""Percentile of the surfaces' disparities that is put at the greatest of a range."""


def surface_disparities(scene: Scene) -> NDArray[np.float64]:
    """(P,) px, of what a coarse grid of the left view's pixels shows in the first and last frame, but the sky."""
    caster = SceneRayCaster(build_geometry(scene))
    rows, columns = caster.coarse_pixels(RAYS_ACROSS)
    seen = [caster.cast("left", frame, rows, columns) for frame in sorted({0, scene.frames - 1})]
    return np.concatenate([hits.disparity[hits.object_index > 0] for hits in seen])


def with_disparity_at(scene: Scene, percent: float, disparity_px: float) -> Scene:
    """The scene with the baseline at which a percentile of its surfaces' disparities is as given.

    Unchanged if it shows only sky.
    """
    disparity = surface_disparities(scene)
    if not len(disparity):
        return scene
    factor = disparity_px / float(np.percentile(disparity, percent))
    camera = scene.camera
    # Six digits: no machine's last bit shows in the record.
    return replace(scene, camera=replace(camera, baseline_m=float(f"{camera.baseline_m * factor:.6g}")))
