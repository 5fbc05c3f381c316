"""Clothes: cloaks are sheets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenes.landscapes.clothes import dress, sample_outfit
from scenes.landscapes.skeleton import GROUND, Skeleton, sample_gait


@pytest.mark.parametrize("girth", [0.082, 0.112])
def test_the_strands_of_a_cloak_touch_each_other_at_its_hem(girth: float) -> None:
    for seed in range(8):
        rng = np.random.default_rng(seed)
        body = Skeleton(sample_gait(rng, 0.4))
        trunk = body.joint(GROUND, (0.0, 0.0, 0.52), (0.0, 0.0, 0.75), girth)
        thighs = [body.joint(trunk, (0.0, y, 0.5), (0.0, y, 0.275), 0.05) for y in (0.05, -0.05)]
        left, right = (body.joint(thigh, (0.0, 0.0, 0.275), (0.0, 0.0, 0.05), 0.04) for thigh in thighs)
        outfit = replace(sample_outfit(rng), cloak=True, robed=False)
        dress(rng, body, outfit, girth, (trunk, trunk, (left, right)), low=False)
        strands = [limb for limb in body.limbs["cloak"] if limb.end[2] < 0.7]
        ends = np.array([limb.end for limb in strands])
        apart = np.linalg.norm(np.diff(ends[np.argsort(ends[:, 1])], axis=0), axis=1)
        assert (apart < 2 * min(limb.end_radius for limb in strands)).all()
