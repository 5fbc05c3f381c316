"""Placing things by street coordinates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from scenes.placement.assembly import Assembly, GroupParts, ObjectGroup, anchored_group, anchored_object
from scenes.shapes.street.boundaries import Fence, Hedge
from scenes.shapes.street.road import Course


def on_course(
    name: str,
    parts: GroupParts,
    course: Course,
    s_m: float,
    t_m: float,
    *,
    turn_deg: float = 0.0,
    z_m: float = 0.0,
) -> ObjectGroup:
    """A static thing of several metric parts at a place (s, t) of a street, `z_m` above the world's z = 0.

    Its x axis is turned by `turn_deg` from the street's direction.
    """
    return anchored_group(name, parts, course.place(s_m, t_m, z_m), course.facing(s_m, turn_deg))


def add_in_spans(
    scene: Assembly,
    name: str,
    shape: Fence | Hedge,
    material: int,
    from_m: float,
    to_m: float,
    span_m: float = 12.0,
) -> None:
    """A boundary along a street, as things of about `span_m` each: what comes too near is judged span by span."""
    panel_m = shape.panel if isinstance(shape, Fence) else 1.5
    step_m = panel_m * max(1, round(span_m / panel_m))
    for number, start_m in enumerate(np.arange(from_m, to_m - panel_m, step_m).tolist()):
        # A hair longer, so that rounding does not cost a span its last panel.
        piece = replace(
            shape, from_m=start_m, to_m=min(start_m + step_m + 0.01, to_m), seed=shape.seed + number
        )
        scene.add(
            anchored_object(f"{name}.{number}", piece, material, [(0.0, 0.0, 0.0)], [Rotation.identity()])
        )
