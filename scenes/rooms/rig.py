"""Where the stereo rig is in a room: held by a person, on a tripod, or on a robot."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.motion.trajectories import wander
from scenes.placement.boxes import OrientedBox
from scenes.placement.view import View
from scenes.random_draws import chance, choose, log_uniform, uniform
from scenes.rooms.config import IndoorConfig
from scenes.rooms.interior import Extent, Interior
from scenes.rooms.plan import Plan
from scenes.spec import StereoCamera, Trajectory

_CANDIDATES = 120
_MARGIN_M = 0.2
"""Between the rig and furniture, besides the clearance; it may wander by half of this."""
_WALL_MARGIN_M = 0.15
"""Between a camera and a wall."""
_LARGE_M3 = 0.02
"""Things with a larger box than this limit the baseline; smaller ones that come too near are left out."""
_NEAR_M = 1.2
"""Depth up to which walls and furniture count as near."""
_FREE_SHARE = 0.6
"""Views of which less than this share is free of near things are chosen less often."""


def sample_camera(rng: np.random.Generator, config: IndoorConfig, interior: Interior) -> StereoCamera:
    """Draw a camera that stands free and sees much of the room.

    The baseline is so small that the room and its furniture keep within the largest disparity allowed; a rig of the
    user's own stays as it is.
    """
    plan = interior.plan
    focal_mm = log_uniform(rng, *config.focal_mm)
    drawn = config.camera(focal_mm, log_uniform(rng, *config.baseline_m), Trajectory.static())
    baseline_m = drawn.baseline_m
    carrier = choose(
        rng, ["person", "tripod", "robot"], [config.person_share, *((1 - config.person_share) / 2,) * 2]
    )
    half_view = View(drawn, 1).half_view
    centres = np.array([(thing.extent.low + thing.extent.high) / 2 for thing in interior.placed])
    best: list[tuple[float, NDArray[np.float64], Rotation]] = []
    for _ in range(_CANDIDATES):
        place, turn = _candidate(rng, plan, carrier)
        if _stands_free(place, baseline_m, turn, interior, config.clearance_m):
            free = 1.0 - near_share(place, turn, half_view, interior)
            interest = _interest(place, turn, half_view, centres, plan)
            best.append((interest * min(1.0, free / _FREE_SHARE) ** 2, place, turn))
    if not best:
        place, turn = _candidate(rng, plan, carrier)
        best.append((0.0, place, turn))
    best.sort(key=lambda item: -item[0])
    _, place, turn = best[int(rng.integers(min(5, len(best))))]
    depth_m = min(
        _nearest_shell_m(plan, drawn, place, turn), _nearest_furniture_m(interior, drawn, place, turn)
    )
    baseline_m = min(
        baseline_m, 0.95 * config.largest_disparity_share * config.width * depth_m / drawn.focal_px
    )
    motion = wander(
        rng,
        config.frames,
        place,
        turn,
        speed_m=uniform(rng, *config.camera_speed_m),
        turn_deg=uniform(rng, *config.camera_turn_deg),
        reach_m=0.5 * _MARGIN_M,
        reach_deg=3.0,
    )
    return config.camera(focal_mm, baseline_m, motion)


def _candidate(rng: np.random.Generator, plan: Plan, carrier: str) -> tuple[NDArray[np.float64], Rotation]:
    if carrier == "person":
        height, pitch, roll = uniform(rng, 1.3, 1.8), uniform(rng, -4.0, 28.0), rng.normal(0.0, 1.5)
    elif carrier == "tripod":
        height, pitch, roll = uniform(rng, 0.7, 1.6), uniform(rng, -3.0, 15.0), rng.normal(0.0, 0.3)
    else:
        height, pitch, roll = uniform(rng, 0.2, 0.8), uniform(rng, -8.0, 8.0), rng.normal(0.0, 0.4)
    if plan.kind == "stairs":
        pitch -= 8.0
    # Most cameras stand near a wall and look across the room.
    edge = rng.uniform(0.3, 0.95, 2) ** 0.5 * np.where(rng.random(2) < 0.5, -1.0, 1.0)
    room = np.array((plan.width, plan.depth))
    place = np.array((*(room / 2 + edge * (room / 2 - _MARGIN_M)), height))
    aim = room * rng.uniform(0.25, 0.75, 2) - place[:2]
    yaw = math.degrees(math.atan2(aim[1], aim[0])) + rng.normal(0.0, 15.0)
    if chance(rng, 0.15):
        yaw = uniform(rng, 0.0, 360.0)
    attitude = Rotation.from_euler("ZXZ", (yaw - 90.0, 90.0 - pitch, roll), degrees=True)
    return place, attitude


def _stands_free(
    place: NDArray[np.float64], baseline_m: float, turn: Rotation, interior: Interior, clearance_m: float
) -> bool:
    right = place + turn.apply((baseline_m, 0.0, 0.0))
    margin = clearance_m + _MARGIN_M
    low, high = np.minimum(place, right) - margin, np.maximum(place, right) + margin
    plan = interior.plan
    room = np.array((plan.width, plan.depth))
    ends = np.stack([place, right])[:, :2]
    if (ends < _WALL_MARGIN_M).any() or (ends > room - _WALL_MARGIN_M).any():
        return False
    return interior.meets_none(Extent(low, high))


def _interest(
    place: NDArray[np.float64],
    turn: Rotation,
    half_view: tuple[float, float],
    centres: NDArray[np.float64],
    plan: Plan,
) -> float:
    """How much a view shows: things in it at middle distances; less where the nearest wall fills it."""
    if not len(centres):
        return 0.0
    local = turn.inv().apply(centres - place)
    depth = -local[:, 2]
    inside = (np.abs(local[:, :2]) < np.array(half_view) * depth[:, None]).all(axis=1)
    seen = (depth > 0.5) & inside
    ahead = -turn.as_matrix()[:, 2]
    wall = _to_shell(plan, place, ahead[None])[0]
    return float(np.sqrt(np.minimum(1.0, 2.0 / depth[seen])).sum()) * min(1.0, wall / 2.5)


def near_share(
    place: NDArray[np.float64], turn: Rotation, half_view: tuple[float, float], interior: Interior
) -> float:
    """Share of a view that walls, floor and furniture nearer than `_NEAR_M` take up."""
    half_x, half_y = half_view
    across, up = np.meshgrid(np.linspace(-half_x, half_x, 11), np.linspace(-half_y, half_y, 7))
    rays = turn.apply(np.stack([across.ravel(), up.ravel(), -np.ones(across.size)], -1))
    near = _to_shell(interior.plan, place, rays) < _NEAR_M
    large = [t.extent for t in interior.placed if np.prod(t.extent.high - t.extent.low) > _LARGE_M3]
    if large:
        low, high = (np.array([getattr(extent, end) for extent in large]) - place for end in ("low", "high"))
        with np.errstate(divide="ignore", invalid="ignore"):
            one, two = low / rays[:, None], high / rays[:, None]
        enters, leaves = np.fmin(one, two).max(axis=2), np.fmax(one, two).min(axis=2)
        near |= ((enters < leaves) & (leaves > 0) & (enters < _NEAR_M)).any(axis=1)
    return float(near.mean())


def _to_shell(plan: Plan, place: NDArray[np.float64], rays: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) how often each ray (N, 3) from inside fits between a place and the room's walls, floor or ceiling."""
    room = np.array((plan.width, plan.depth, plan.height))
    with np.errstate(divide="ignore"):
        reach = np.where(rays > 0, (room - place) / rays, np.where(rays < 0, -place / rays, np.inf))
    nearest: NDArray[np.float64] = reach.min(axis=1)
    return nearest


def _nearest_furniture_m(
    interior: Interior, camera: StereoCamera, place: NDArray[np.float64], turn: Rotation
) -> float:
    """The least depth at which a camera sees the box of a piece of furniture; infinite where it sees none."""
    large = [t.extent for t in interior.placed if np.prod(t.extent.high - t.extent.low) > _LARGE_M3]
    if not large:
        return math.inf
    points = np.concatenate(
        [OrientedBox((e.low + e.high) / 2, (e.high - e.low) / 2, np.eye(3)).surface_points for e in large]
    )
    x, y, z = turn.inv().apply(points - place).T
    half_x, half_y = View(camera, 1).half_view
    # As `scenes.placement.clearance` has it, with a little more on all sides.
    near = np.abs(x - camera.baseline_m / 2) < -1.15 * half_x * z + camera.baseline_m / 2 + 0.05
    seen = (z < -0.01) & near & (np.abs(y) < -1.15 * half_y * z + 0.05)
    return float(-z[seen].max()) if seen.any() else math.inf


def _nearest_shell_m(plan: Plan, camera: StereoCamera, place: NDArray[np.float64], turn: Rotation) -> float:
    """The least depth at which a camera sees the room's walls, floor or ceiling, without what is in the room."""
    half_x, half_y = View(camera, 1).half_view
    across, up = np.meshgrid(np.linspace(-half_x, half_x, 13), np.linspace(-half_y, half_y, 9))
    rays = turn.apply(np.stack([across.ravel(), up.ravel(), -np.ones(across.size)], -1))
    return float(_to_shell(plan, place, rays).min())
