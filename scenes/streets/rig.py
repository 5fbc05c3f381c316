"""The stereo rig and how it drives along a street."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from scenes.motion.trajectories import quaternion, vector
from scenes.placement.view import half_view
from scenes.random_draws import chance, choose, integer, uniform
from scenes.shapes.street.road import Course
from scenes.spec import StereoCamera, Trajectory
from scenes.streets.config import DrivingConfig

_LOOK_AHEAD = Rotation.from_matrix(np.array([(0.0, 0.0, -1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]))
"""A camera looking along x, its own x axis to the right (world -y), its y axis up."""
_KEY_M = 3.0
"""Key poses are at most this far apart, so that splines through them follow the bends to a millimetre."""


@dataclass(frozen=True)
class Lane:
    """One lane of the carriageway."""

    t_m: float
    """Its middle."""
    direction: float
    """1 for traffic towards growing s, -1 for the other way."""


@dataclass(frozen=True)
class Drive:
    """How the rig moves, in street coordinates; s = 0 half way through the scene."""

    course: Course
    frames: int
    speed_m: float
    """Metres per frame; positive forwards (towards growing s), negative backwards."""
    lanes: tuple[Lane, ...]
    lane: Lane
    """The rig's own."""
    lane_m: float
    keep_left: bool
    view_m: float

    def s(self, time_frames: float) -> float:
        """s of the rig at an instant, metres."""
        return self.speed_m * (time_frames - (self.frames - 1) / 2)

    @property
    def reach_m(self) -> float:
        """How far the rig gets from s = 0, one frame before and after the scene included."""
        return abs(self.speed_m) * (self.frames + 1) / 2

    @property
    def half_road_m(self) -> float:
        """Half the width of all lanes."""
        return self.lane_m * len(self.lanes) / 2


def sample_drive(rng: np.random.Generator, config: DrivingConfig) -> Drive:
    """Draw the street's course, its lanes, and how the rig drives along it."""
    fast = chance(rng, config.fast_share)
    speed = uniform(rng, *(config.fast_m if fast else config.slow_m))
    backwards = chance(rng, config.backwards_share)
    keep_left = chance(rng, config.left_hand_share)
    each_way, lane_m = integer(rng, *config.lanes), uniform(rng, *config.lane_m)
    # t grows to the left: traffic towards growing s has negative t where one keeps to the right.
    side = 1.0 if keep_left else -1.0
    lanes = [
        Lane(side * direction * (k + 0.5) * lane_m, direction)
        for direction in (1.0, -1.0)
        for k in range(each_way)
    ]
    own = choose(rng, lanes[each_way:] if backwards else lanes[:each_way])
    view_m = uniform(rng, *config.view_m)
    reach = speed * (config.frames + 1) / 2
    bend = 0.0 if chance(rng, config.straight_share) else uniform(rng, *config.bend_deg)
    course = Course.sample(rng, -reach - 14.0, reach + view_m, bend)
    return Drive(
        course=course,
        frames=config.frames,
        speed_m=-speed if backwards else speed,
        lanes=tuple(lanes),
        lane=own,
        lane_m=lane_m,
        keep_left=keep_left,
        view_m=view_m,
    )


def sample_camera(rng: np.random.Generator, config: DrivingConfig, drive: Drive) -> StereoCamera:
    """Draw the rig's camera, moving along the drive.

    Its baseline is so small that the road keeps within the largest disparity allowed; a rig of the user's own stays as
    it is.
    """
    focal_mm = choose(rng, config.focal_lengths_mm)
    height_m, pitch = uniform(rng, *config.camera_height_m), uniform(rng, *config.pitch_deg)
    roll, yaw = uniform(rng, *config.roll_deg), uniform(rng, *config.yaw_deg)
    baseline_m = uniform(rng, *config.baseline_m)
    still = config.camera(focal_mm, baseline_m, Trajectory.static())
    largest_m = _largest_baseline_m(config, still, height_m, pitch, roll)
    baseline_m = still.baseline_m if config.rig else min(baseline_m, largest_m)
    aside = uniform(rng, -0.25, 0.25)
    times, places, turns = [], [], []
    count = 2 + math.floor(2 * drive.reach_m / _KEY_M)
    for time in np.linspace(-1.0, float(config.frames), count).tolist():
        s = drive.s(time)
        nod = pitch + rng.normal(0.0, 0.12)
        attitude = drive.course.facing(s, yaw) * Rotation.from_euler("Y", nod, degrees=True) * _LOOK_AHEAD
        attitude = attitude * Rotation.from_euler("Z", roll + rng.normal(0.0, 0.1), degrees=True)
        middle = np.array(drive.course.place(s, drive.lane.t_m + aside, height_m + rng.normal(0.0, 0.006)))
        times.append(time)
        places.append(vector(middle - attitude.as_matrix()[:, 0] * baseline_m / 2))
        turns.append(quaternion(attitude))
    motion = Trajectory(tuple(times), tuple(places), tuple(turns))
    return config.camera(focal_mm, baseline_m, motion)


def _largest_baseline_m(
    config: DrivingConfig, camera: StereoCamera, height_m: float, pitch_deg: float, roll_deg: float
) -> float:
    """The baseline at which the road at the lower edge of the image has the largest disparity allowed."""
    half_x, half_y = half_view(camera)
    down = math.radians(pitch_deg + 0.5)
    lean = math.radians(abs(roll_deg) + 0.4)
    # How far a ray through a lower corner drops for every metre of depth.
    drop = math.sin(down) + math.cos(down) * (half_y * math.cos(lean) + half_x * math.sin(lean))
    # Kerbs, camber and the rig's bounce raise what is seen by a little.
    nearest_m = (height_m - 0.25) / max(drop, 1e-3)
    return config.largest_disparity_share * config.width * nearest_m / camera.focal_px
