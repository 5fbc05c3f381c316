"""Rooms with things floating in them: living rooms, kitchens, offices, workshops, corridors, stores, stairs.

Rooms are furnished by rules, from shapes built of parts: furniture stands at walls and on rugs, things stand in
shelves and on tables. Plain surfaces and repeated ones (blinds, railings, tiles, rows of books) occur at every
distance, and so do mirrors, glass, chrome and lacquer.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from scenes.appearance.materials import Shares, sample_material
from scenes.appearance.room_materials import RoomMaterials
from scenes.family import Family
from scenes.motion.trajectories import vector, wander
from scenes.placement.assembly import ObjectGroup
from scenes.placement.clearance import keep_clear
from scenes.placement.view import View
from scenes.random_draws import choose, integer, log_uniform, uniform
from scenes.rooms.clutter import add_things
from scenes.rooms.config import IndoorConfig
from scenes.rooms.furnishing import furnish
from scenes.rooms.interior import Extent, Interior
from scenes.rooms.lighting import add_outside, sample_light
from scenes.rooms.plan import Plan, sample_plan
from scenes.rooms.rig import sample_camera
from scenes.rooms.shell import build_shell
from scenes.shapes import SHAPES
from scenes.spec import FinalPass, Scene, SceneObject, StereoCamera
from scenes.user_assets.replacement import Replaceable


def sample_indoor(rng: np.random.Generator, config: IndoorConfig) -> Scene:
    """Draw one scene."""
    shares = Shares(config.plain_share, config.glossy_share, config.metallic_share, config.transparent_share)
    plan = sample_plan(rng, config, choose(rng, config.room_kinds))
    interior = Interior(plan, RoomMaterials(shares))
    shell = build_shell(rng, config, interior)
    furnish(rng, config, interior)
    add_things(rng, config, interior)
    camera = sample_camera(rng, config, interior)
    light = sample_light(rng, config, interior)
    if light.daylight:
        add_outside(rng, interior)
    scene = interior.assembly
    floating = _floating(rng, config, interior, camera)
    clear = (
        keep_clear(
            groups,
            camera,
            config.frames,
            clearance_m=config.clearance_m,
            nearest_m=camera.disparity_metres / (config.largest_disparity_share * config.width),
        )
        for groups in (scene.groups[shell:], floating)
    )
    kept = [*interior.carried(next(clear)), *next(clear)]
    return Scene(
        family="indoor",
        frames=config.frames,
        camera=camera,
        objects=tuple(item for thing in (*scene.groups[:shell], *kept) for item in thing),
        materials=tuple(scene.materials),
        lights=light.lights,
        world=light.world,
        exposure_key=light.exposure_key,
        final=FinalPass(uniform(rng, *config.shutter_frames)),
        notes={"daylight": float(light.daylight), "floating_objects": float(len(floating))},
    )


def _floating(
    rng: np.random.Generator, config: IndoorConfig, interior: Interior, camera: StereoCamera
) -> list[ObjectGroup]:
    """Objects of any shape in the air before the camera, where there is room for them."""
    view, plan = View(camera, config.frames), interior.plan
    nearest_m = camera.disparity_metres / (config.largest_disparity_share * config.width)
    farthest_m = max(2.5 * nearest_m, 0.8 * max(plan.width, plan.depth))
    kinds = [SHAPES[name] for name in sorted(SHAPES)]
    popularity = [kind.popularity for kind in kinds]
    floating: list[ObjectGroup] = []
    taken: list[Extent] = []
    for number in range(integer(rng, *config.floating_objects)):
        shape, relative = choose(rng, kinds, popularity).sample(rng), log_uniform(rng, *config.floating_size)
        for _ in range(8):
            depth_m = log_uniform(rng, 1.3 * nearest_m, farthest_m)
            place = view.point(uniform(rng, -0.9, 0.9), uniform(rng, -0.85, 0.85), depth_m)
            reach = 1.45 * relative * depth_m
            extent = Extent(place - reach, place + reach)
            if _is_in_air(extent, interior, plan) and not any(extent.meets(other) for other in taken):
                break
        else:
            continue
        taken.append(extent)
        speed = uniform(rng, *config.floating_speed) * depth_m
        motion = wander(
            rng, config.frames, place, Rotation.random(random_state=rng),
            speed_m=speed, turn_deg=uniform(rng, 0.0, 8.0), reach_m=0.15 * reach, reach_deg=60.0,
        )  # fmt: skip
        unit_px = relative * camera.focal_px
        material = interior.assembly.material(sample_material(rng, unit_px))
        scale = vector(relative * depth_m * rng.uniform(0.8, 1.1, 3))
        floating.append((SceneObject(f"floating {number}", shape, material, motion, scale),))
    return floating


def _is_in_air(extent: Extent, interior: Interior, plan: Plan) -> bool:
    room = np.array((plan.width, plan.depth, plan.height))
    if (extent.low < 0.0).any() or (extent.high > room).any():
        return False
    return interior.meets_none(extent)


_REPLACEABLE = Replaceable(
    props=r"floating .*",
    painted=r"wall .*|picture .*|rug .*|sofa .*",
    groups=r"((?:thing|carton|basket|toy) [0-9]+) .*",
)

FAMILY = Family("indoor", IndoorConfig, sample_indoor, _REPLACEABLE)
