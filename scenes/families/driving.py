"""Drives through streets, after the Driving set (Mayer et al. 2016) and KITTI.

A stereo rig drives along a lane of a street that winds between houses, gardens or parks, forwards or
backwards, fast or slow, among other vehicles, parked cars and people on the pavements.

The disparity of the road at the lower edge of a 16:9 image is about 0.28 * baseline / camera height as a share
of the image width, whatever the focal length: 5 to 20 % by default (KITTI: 9 %). From there it falls to a
few pixels at the end of the street, and 0 in the sky.
"""

from __future__ import annotations

import numpy as np

from scenes.family import Family
from scenes.placement.assembly import Assembly
from scenes.placement.clearance import keep_clear
from scenes.random_draws import chance, choose, uniform
from scenes.spec import Light, Scene
from scenes.streets.config import DrivingConfig
from scenes.streets.daylight import sample_daylight
from scenes.streets.frontage import DISTRICTS, Side, add_boundary, add_garden, add_houses, add_skyline
from scenes.streets.rig import Drive, sample_camera, sample_drive
from scenes.streets.roadside import (
    Pavement,
    add_furniture,
    add_lamps,
    add_people,
    add_traffic_lights,
    add_trees,
)
from scenes.streets.surfaces import lay_ground
from scenes.streets.traffic import PARKING_M, add_moving, add_parked, sample_fleet
from scenes.user_assets.replacement import Replaceable


def sample_driving(rng: np.random.Generator, config: DrivingConfig) -> Scene:
    """Draw one scene."""
    drive = sample_drive(rng, config)
    camera = sample_camera(rng, config, drive)
    daylight = sample_daylight(rng, config)
    sides = _sample_sides(rng, config, drive)
    scene = Assembly()
    ground = lay_ground(rng, scene, config, drive, sides)
    underfoot = len(scene.groups)
    pavements = (Pavement(sides[0]), Pavement(sides[1]))
    fleet = sample_fleet(rng, scene, config, daylight.dusk)
    add_moving(rng, scene, config, drive, fleet)
    add_traffic_lights(rng, scene, drive, pavements, ground.crossings, ground.pavement_m)
    lamps = add_lamps(rng, scene, config, drive, pavements, ground.pavement_m, daylight.dusk)
    start_m, end_m = drive.course.start_m, drive.course.end_m
    for side, pavement in zip(sides, pavements, strict=True):
        add_houses(rng, scene, drive.course, side, start_m, daylight.windows_lit)
        add_boundary(rng, scene, drive.course, side, start_m, end_m)
        add_garden(rng, scene, drive.course, side, start_m, end_m)
        add_parked(rng, scene, config, drive, side, fleet, ground.crossings)
        add_trees(rng, scene, config, drive, pavement, ground.pavement_m)
        add_furniture(rng, scene, config, drive, pavement, ground.pavement_m)
        add_people(rng, scene, config, drive, pavement, ground.pavement_m)
    add_skyline(rng, scene, drive.course, sides)
    kept = keep_clear(
        scene.groups[underfoot:],
        camera,
        config.frames,
        clearance_m=config.clearance_m,
        nearest_m=camera.disparity_metres / (config.largest_disparity_share * config.width),
    )
    lights: tuple[Light, ...] = (*daylight.suns, *lamps)
    return Scene(
        family="driving",
        frames=config.frames,
        camera=camera,
        objects=tuple(item for thing in (*scene.groups[:underfoot], *kept) for item in thing),
        materials=tuple(scene.materials),
        lights=lights,
        world=daylight.world,
        exposure_key=uniform(rng, 0.12, 0.2) if daylight.dusk else uniform(rng, 0.2, 0.3),
        notes=_notes(drive, daylight.dusk),
    )


def _notes(drive: Drive, dusk: bool) -> dict[str, float]:
    return {"speed_m": drive.speed_m, "lanes": float(len(drive.lanes)), "dusk": float(dusk)}


def _sample_sides(rng: np.random.Generator, config: DrivingConfig, drive: Drive) -> tuple[Side, Side]:
    """Left and right side; in three streets out of four both are of one district."""
    kinds, shares = list(DISTRICTS.values()), [district.share for district in DISTRICTS.values()]
    first = choose(rng, kinds, shares)
    sides = []
    for sign in (1.0, -1.0):
        district = first if sign > 0 or chance(rng, 0.7) else choose(rng, kinds, shares)
        parking = chance(rng, 0.65)
        kerb = drive.half_road_m + (PARKING_M if parking else uniform(rng, 0.1, 0.4))
        edge = kerb + uniform(rng, *config.pavement_m)
        sides.append(
            Side(sign, district, kerb, edge, edge + 0.05 + uniform(rng, *district.setback_m), parking)
        )
    return sides[0], sides[1]


_REPLACEABLE = Replaceable(
    props=r"(bin|bench|cabinet|bollard) .*|shrub .*",
    painted=r"house .* walls|block .*|fence .*",
    groups=r"(parked [LR]?[0-9.]+) .*",
)

FAMILY = Family("driving", DrivingConfig, sample_driving, _REPLACEABLE)
