"""Meeting a range of disparities where the depths of a world are what they are: by choosing the baseline.

Streets and landscapes reach from the camera's feet to the horizon. What the left eye sees does not depend on the
baseline, and every disparity is proportional to it, so one look decides it exactly.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from datagen.raycast import SceneRayCaster
from datagen.scene_geometry import SceneGeometry
from scenes import Scene

RAYS_ACROSS = 64
"""Columns of the coarse grid of pixels that are looked at; rows in proportion."""
REACHED_PERCENT = 99.5
"""Percentile of the surfaces' disparities, over the first and last frame's pixels, that is put at the greatest."""


def with_greatest_disparity(scene: Scene, greatest_px: float) -> Scene:
    """The scene with the baseline at which its near surfaces have `greatest_px`; unchanged if it shows only sky."""
    camera = scene.camera
    caster = SceneRayCaster(SceneGeometry(scene))
    rows, columns = caster.coarse_pixels(RAYS_ACROSS)
    seen = [caster.cast("left", frame, rows, columns) for frame in sorted({0, scene.frames - 1})]
    disparity = np.concatenate([hits.disparity[hits.object_index > 0] for hits in seen])
    if not len(disparity):
        return scene
    factor = greatest_px / float(np.percentile(disparity, REACHED_PERCENT))
    # Six digits: no machine's last bit shows in the record.
    return replace(scene, camera=replace(camera, baseline_m=float(f"{camera.baseline_m * factor:.6g}")))
