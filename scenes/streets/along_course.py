"""Placing things by street coordinates."""

from __future__ import annotations

from scenes.placement.assembly import GroupParts, ObjectGroup, anchored_group
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
