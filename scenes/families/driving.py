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
from scenes.placement.cover import covered_share
from scenes.placement.view import View
from scenes.random_draws import chance, choose, uniform
from scenes.spec import Light, Scene
from scenes.streets.barriers import add_barrier
from scenes.streets.config import DrivingConfig
from scenes.streets.daylight import HOURS, Daylight, sample_daylight
from scenes.streets.frontage import DISTRICTS, Side, add_boundary, add_garden, add_houses, add_skyline
from scenes.streets.headlights import beams
from scenes.streets.junctions import build_side_street, line_side_street, side_streets, with_openings
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
from scenes.streets.traffic import PARKING_M, add_moving, add_parked, hull, sample_fleet
from scenes.streets.weather import Weather, sample_final_pass, sample_weather
from scenes.user_assets.replacement import Replaceable


def sample_driving(rng: np.random.Generator, config: DrivingConfig) -> Scene:
    """Draw one scene."""
    drive = sample_drive(rng, config)
    camera = sample_camera(rng, config, drive)
    weather = sample_weather(rng, config)
    daylight = sample_daylight(rng, config, weather.raining)
    sides = with_openings(rng, config, _sample_sides(rng, config, drive))
    scene = Assembly()
    ground = lay_ground(rng, scene, config, drive, sides, weather)
    joining = side_streets(rng, drive, sides)
    for street in joining:
        build_side_street(rng, scene, street, ground.surfacing)
    underfoot = len(scene.groups)
    pavements = (Pavement(sides[0]), Pavement(sides[1]))
    fleet = sample_fleet(rng, scene, config, keep_left=drive.keep_left, lit=daylight.lamps_on)
    add_moving(rng, scene, config, drive, fleet)
    add_traffic_lights(rng, scene, drive, pavements, ground.crossings, ground.pavement_m)
    lamps = add_lamps(rng, scene, config, drive, pavements, ground.pavement_m, daylight.lamps_on)
    start_m, end_m = drive.course.start_m, drive.course.end_m
    for side, pavement in zip(sides, pavements, strict=True):
        add_houses(rng, scene, config, drive.course, side, start_m, daylight.windows_lit)
        add_barrier(rng, scene, config, drive, side, ground.crossings)
        add_boundary(rng, scene, config, drive.course, side, start_m, end_m)
        add_garden(rng, scene, drive.course, side, start_m, end_m)
        add_parked(rng, scene, config, drive, side, fleet, ground.crossings)
        add_trees(rng, scene, config, drive, pavement, ground.pavement_m)
        add_furniture(rng, scene, config, drive, pavement, ground.pavement_m)
        add_people(rng, scene, config, drive, pavement, ground.pavement_m)
    for street in joining:
        line_side_street(rng, scene, config, street, fleet, daylight.windows_lit)
    add_skyline(rng, scene, drive.course, sides)
    view = View(camera, config.frames)
    kept = keep_clear(
        [
            group
            for group in scene.groups[underfoot:]
            if not (large := hull(group)) or covered_share(large, view) <= config.largest_cover_share
        ],
        camera,
        config.frames,
        clearance_m=config.clearance_m,
        nearest_m=camera.disparity_metres / (config.largest_disparity_share * config.width),
    )
    lights: list[Light] = [*daylight.suns, *lamps]
    if daylight.lamps_on:
        lights += beams(rng, drive, camera, kept)
    return Scene(
        family="driving",
        frames=config.frames,
        camera=camera,
        objects=tuple(item for thing in (*scene.groups[:underfoot], *kept) for item in thing),
        materials=tuple(scene.materials),
        lights=tuple(lights),
        world=daylight.world,
        exposure_key=daylight.exposure_key,
        final=sample_final_pass(rng, config, weather, daylight.lamps_on),
        notes=_notes(drive, daylight, weather),
    )


def _notes(drive: Drive, daylight: Daylight, weather: Weather) -> dict[str, float]:
    return {
        "speed_m": drive.speed_m,
        "lanes": float(len(drive.lanes)),
        "hour": float(HOURS.index(daylight.hour)),
        "raining": float(weather.raining),
        "wetness": weather.wetness,
    }


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
            Side(
                sign,
                district,
                kerb,
                edge,
                edge + 0.05 + uniform(rng, *district.setback_m),
                parking,
                "LR"[sign < 0],
            )
        )
    return sides[0], sides[1]


_REPLACEABLE = Replaceable(
    props=r"(bin|bench|cabinet|bollard) .*|shrub .*",
    painted=r"house .* walls|block .*|(fence|barrier) .*",
    groups=r"(parked [LR]?[0-9.]+) .*",
)

FAMILY = Family("driving", DrivingConfig, sample_driving, _REPLACEABLE)
