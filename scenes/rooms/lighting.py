"""Light in rooms: daylight at the windows, lamps, both, or little of either; and what is outside."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from scenes.appearance import street_materials
from scenes.appearance.painting import shade
from scenes.motion.trajectories import vector
from scenes.placement.assembly import anchored_group
from scenes.random_draws import chance, choose, integer, uniform
from scenes.rooms.config import IndoorConfig
from scenes.rooms.interior import Interior, Placed
from scenes.rooms.plan import Plan, RoomOpening
from scenes.shapes.indoor.lamps import CeilingLamp, Lamp
from scenes.shapes.indoor.shell import RoomSlab
from scenes.shapes.street.buildings import CityBlock
from scenes.shapes.street.roadside_plants import Shrub
from scenes.spec import AreaLight, Color, Light, SunLight, World
from scenes.textures.sky import Sky

_GROUND_M = (70.0, 90.0)
"""How far the ground outside reaches away from the house, and to either side of a wall's middle."""


@dataclass(frozen=True)
class RoomLight:
    """The light of a room."""

    lights: tuple[Light, ...]
    world: World
    daylight: bool
    exposure_key: float


def sample_light(rng: np.random.Generator, config: IndoorConfig, interior: Interior) -> RoomLight:
    """Draw the time of day, which lamps are on, and how bright all of it is."""
    windows = [opening for opening in interior.plan.openings if not opening.door]
    drawn = rng.random()
    lamps_only = not windows or drawn < config.lamplight_share
    lamps_too = lamps_only or drawn < config.lamplight_share + config.mixed_share
    dim = chance(rng, config.dim_share)
    lights: list[Light] = []
    if not lamps_only:
        cool = _light_color(uniform(rng, -0.25, 0.1))
        strength = uniform(rng, 12.0, 30.0)
        lights += [_window_light(interior.plan, opening, cool, strength) for opening in windows]
        if chance(rng, 0.6):
            lights.append(_sun(rng, interior.plan, windows))
    if lamps_too:
        warm = _light_color(uniform(rng, 0.0, 0.5))
        lights += _lamp_lights(rng, interior, warm, uniform(rng, 25.0, 60.0))
    sky = Sky.sample(rng, 512)
    if lamps_only:
        dark = shade(uniform(rng, 0.05, 0.25), 0.04, 270.0)
        sky = replace(sky, zenith=dark, horizon=dark, cloud=dark, ground=dark, glow=0.0)
    strength = uniform(rng, 0.2, 0.6) if lamps_only else uniform(rng, 1.5, 5.0)
    key = uniform(rng, 0.08, 0.13) if dim else uniform(rng, 0.16, 0.26)
    return RoomLight(tuple(lights), World(sky, strength, sampled=False), not lamps_only, key)


def _light_color(warmth: float) -> Color:
    color = np.exp(np.array([0.55 * warmth, 0.0, -1.2 * warmth]))
    return vector(color / (color @ (0.2126, 0.7152, 0.0722)))


def _window_light(plan: Plan, opening: RoomOpening, color: Color, radiance: float) -> AreaLight:
    """The sky's light through a window: a lamp just inside it, so that few paths are lost."""
    high = opening.hole[3] - opening.hole[2]
    side = math.sqrt(opening.width * high)
    z = (opening.hole[2] + opening.hole[3]) / 2
    position = (*plan.at_wall(opening.wall, opening.middle, 0.02), z)
    target = (*plan.at_wall(opening.wall, opening.middle, 2.0), z - 0.5)
    return AreaLight(position, target, color, radiance * side * side, 0.9 * side)


def _sun(rng: np.random.Generator, plan: Plan, windows: list[RoomOpening]) -> SunLight:
    """A sun that shines through one of the windows, more or less."""
    opening = windows[int(rng.integers(len(windows)))]
    (x0, y0), (x1, y1) = plan.at_wall(opening.wall, 0.0), plan.at_wall(opening.wall, 0.0, 1.0)
    heading = math.atan2(y1 - y0, x1 - x0) + uniform(rng, -0.9, 0.9)
    down = math.radians(uniform(rng, 12.0, 50.0))
    direction = (math.cos(down) * math.cos(heading), math.cos(down) * math.sin(heading), -math.sin(down))
    return SunLight(
        direction, _light_color(uniform(rng, 0.0, 0.3)), uniform(rng, 8.0, 30.0), uniform(rng, 0.5, 1.5)
    )


def _lamp_lights(rng: np.random.Generator, interior: Interior, color: Color, power_w: float) -> list[Light]:
    lights: list[Light] = []
    hung = [thing for thing in interior.placed if isinstance(thing.shape, CeilingLamp)]
    standing = [thing for thing in interior.placed if isinstance(thing.shape, Lamp)]
    for thing in hung:
        assert isinstance(thing.shape, CeilingLamp)
        x, y, z = thing.place
        low = z - thing.shape.light_below_m - 0.03
        share = power_w * 2.2 / math.sqrt(len(hung))
        lights.append(AreaLight((x, y, low), (x, y, 0.0), color, share, min(0.6, thing.shape.size + 0.1)))
    lights += [_standing_light(rng, thing, color, 0.35 * power_w) for thing in standing if chance(rng, 0.8)]
    if not lights:
        plan = interior.plan
        place = (plan.width / 2, plan.depth / 2, plan.height - 0.05)
        lights.append(AreaLight(place, (place[0], place[1], 0.0), color, 2.0 * power_w, 0.5))
    return lights


def _standing_light(rng: np.random.Generator, thing: Placed, color: Color, power_w: float) -> AreaLight:
    """Light from above a lamp's shade, up or down."""
    assert isinstance(thing.shape, Lamp)
    x, y, z = thing.place
    top = z + thing.shape.height
    if chance(rng, 0.5):
        return AreaLight((x, y, top + 0.02), (x, y, top + 1.0), color, power_w, 0.15)
    return AreaLight((x, y, top - thing.shape.shade_height - 0.01), (x, y, 0.0), color, power_w, 0.15)


def add_outside(rng: np.random.Generator, interior: Interior) -> None:
    """What is seen through open windows: houses across the street, shrubs and the ground below."""
    plan, scene = interior.plan, interior.assembly
    windows = {opening.wall for opening in plan.openings if not opening.door}
    floor_z = -uniform(rng, 0.2, 0.6) - integer(rng, 0, 3) * 2.9
    for wall in sorted(windows):
        middle = plan.wall_length(wall) / 2
        material = scene.material(street_materials.skyline(rng))
        leaves = scene.material(street_materials.foliage(rng))
        reach = uniform(rng, *_GROUND_M)
        ground = RoomSlab(2 * reach, reach, "floor")
        x, y = plan.at_wall(wall, middle - reach, -reach - 1.0)
        # The grounds of two walls meet at a corner: no two of them are level with each other.
        low = (x, y, floor_z - 0.01 * wall)
        covered = scene.material(choose(rng, (street_materials.grass, street_materials.pavement))(rng))
        turn = Rotation.from_euler("Z", plan.yaw(wall))
        scene.add(*anchored_group(f"outside {wall} ground", [("", ground, covered)], low, turn))
        for k in range(integer(rng, 3, 5)):
            away = uniform(rng, 14.0, 40.0)
            block = CityBlock.sample(rng)
            along = 26.0 * (k // 2 + k % 2) * (1 if k % 2 else -1)
            x, y = plan.at_wall(wall, middle + along + uniform(rng, -8.0, 8.0), -away - block.depth / 2)
            turn = Rotation.from_euler("Z", plan.yaw(wall) + uniform(rng, -0.2, 0.2))
            scene.add(
                *anchored_group(f"outside {wall} {k}", [("block", block, material)], (x, y, floor_z), turn)
            )
        for k in range(integer(rng, 0, 5) if floor_z > -3.5 else 0):
            x, y = plan.at_wall(wall, middle + uniform(rng, -6.0, 6.0), -uniform(rng, 2.5, 9.0))
            turn = Rotation.from_euler("Z", uniform(rng, 0.0, 6.28))
            scene.add(
                *anchored_group(
                    f"outside {wall} shrub {k}", [("", Shrub.sample(rng), leaves)], (x, y, floor_z), turn
                )
            )
