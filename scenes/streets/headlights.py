"""Lamps that drive along: the beams of the rig's own vehicle and of those near it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from scenes.motion.trajectories import quaternion
from scenes.placement.assembly import ObjectGroup
from scenes.random_draws import uniform
from scenes.spec import AreaLight, Color, StereoCamera, Trajectory
from scenes.streets.rig import Drive

BEAMS = 4
"""How many vehicles throw light on the street: the nearest. The others' lamps are only seen."""
_FARTHEST_M = 70.0
_SPREAD_DEG = 64.0
"""Aimed a little above the road, so that the beam fades towards the bumper, as a head lamp's does."""


def beams(
    rng: np.random.Generator, drive: Drive, camera: StereoCamera, things: Sequence[ObjectGroup]
) -> list[AreaLight]:
    """The light of the vehicle that carries the rig, and of those of the moving ones among `things` that are near."""
    lamps = [
        item.motion
        for group in things
        for item in group
        if item.name.endswith(" head lamps") and len(item.motion.times_frames) > 1
    ]
    middle = (drive.frames - 1) / 2
    here = camera.pose("left", middle)[:3, 3]
    distances = [float(np.linalg.norm(motion.pose(middle)[:3, 3] - here)) for motion in lamps]
    nearest = [k for k in np.argsort(distances, kind="stable")[:BEAMS] if distances[k] < _FARTHEST_M]
    return [_beam(rng, _own_lamps(drive)), *(_beam(rng, lamps[k]) for k in nearest)]


def _own_lamps(drive: Drive) -> Trajectory:
    """The motion of the head lamps below the rig."""
    count = 2 + math.floor(2 * drive.reach_m / 3.0)
    times = np.linspace(-1.0, float(drive.frames), count).tolist()
    course, s = drive.course, [drive.s(time) for time in times]
    places = tuple(course.place(at + 1.6, drive.lane.t_m, 0.65) for at in s)
    return Trajectory(tuple(times), places, tuple(quaternion(course.facing(at)) for at in s))


def _beam(rng: np.random.Generator, carrier: Trajectory) -> AreaLight:
    """The light of both lamps of a vehicle, from the middle between them onto the road ahead."""
    warmth = uniform(rng, -0.3, 1.0)  # from xenon to halogen
    color: Color = (1.0 + 0.12 * warmth, 0.97, 0.95 - 0.3 * warmth)
    return AreaLight(
        position_m=(0.3, 0.0, 0.0),
        target_m=(20.0, 0.0, 1.0),
        color=color,
        power_w=uniform(rng, 40.0, 120.0),
        size_m=0.22,
        spread_deg=_SPREAD_DEG,
        motion=carrier,
    )
