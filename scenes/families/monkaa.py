"""Soft, furry creatures among plants, after Monkaa (Mayer et al. 2016), with procedural creatures.

Creatures with limbs, tails and eyes walk, sit, graze, reach or look about in a jungle, a meadow, a grove of giant
mushrooms or a cave, some at a pond; they are near, far, in groups, or nobody is there. Plants sway, lamps are
coloured, the camera drifts. Lengths are in units of a few metres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenes.appearance.landscape_materials import CHARACTER_SURFACES
from scenes.appearance.lights import sample_area_light, sample_light_color, sample_sun
from scenes.appearance.material_textures import TextureSampler, ground, leaves, rock
from scenes.appearance.materials import Shares
from scenes.appearance.palettes import DRY_GRASS, EARTH, FOLIAGE, MOSS, ROCK, VIVID
from scenes.family import Family
from scenes.landscapes.characters import Character, place_character
from scenes.landscapes.creatures import Coat, sample_creature
from scenes.landscapes.foreground import (
    PropSampler,
    add_foreground,
    broad_leaves,
    crystals,
    outcrop,
    paling,
    smooth_boulder,
    toadstool,
    trunk,
    vessel,
)
from scenes.landscapes.framing import Framing, sample_framing
from scenes.landscapes.terrain import (
    Land,
    LandscapeConfig,
    half_height,
    linear,
    sample_camera,
    sample_final,
    sample_focus,
)
from scenes.landscapes.vegetation import (
    VegetationArea,
    anywhere,
    boulders,
    grass,
    mushrooms,
    plants,
    scree,
    trees,
    undergrowth,
)
from scenes.landscapes.water import add_water, with_pond
from scenes.motion.trajectories import vector
from scenes.placement.ground import GroundPlacement, Spot, sway_of
from scenes.random_draws import Count, Range, chance, choose, integer, log_uniform, new_seed, uniform
from scenes.shapes.nature.landforms import Cavern, Dripstone, Landscape
from scenes.shapes.nature.plants import Bush, Vine
from scenes.shapes.nature.trees import Palm, Tree
from scenes.spec import AreaLight, Light, Scene, World
from scenes.textures.sky import Sky
from scenes.user_assets.replacement import Replaceable

PLACES = ("jungle", "meadow", "mushrooms", "cave")
"""Kinds of places; a scene notes the index of its own."""


@dataclass(frozen=True)
class MonkaaConfig(LandscapeConfig):
    """Values are drawn uniformly from the ranges, once for each scene or once for each object, as the fields say.

    Raises ValueError for ranges from which no scene can be sampled.
    """

    crowd = (
        "creatures",
        "fur_locks",
        "undergrowth",
        "grass_tufts",
        "trees",
        "boulders",
        "bushes",
        "toadstools",
    )

    focus_disparity_share: Range = (0.022, 0.076)
    """Disparity at the unit of depth, log-uniform, as a share of the image width (0.022 is 21 px at 960); it sets the
    baseline. In most scenes the main creature stands at the unit of depth."""
    creatures: Count = (1, 4)
    """Creatures per scene that has any; the first is the main one, at which the camera looks. Groups have up to two
    more."""
    focus_distance_m: Range = (2.5, 6.0)
    """Depth at which the baseline is set, where the main creature stands in most scenes."""
    fur_locks: Count = (2000, 5500)
    """Locks of fur on a furry creature; three in four are furry, the others have bare skin."""
    undergrowth: Count = (30, 60)
    """Ferns, bushes and broad-leaved plants per scene."""
    grass_tufts: Count = (30, 70)
    """Tufts of grass per scene."""
    trees: Count = (6, 14)
    """Trees and palms per scene, giant mushrooms among mushrooms, dripstones in caves."""
    boulders: Count = (6, 20)
    """Stones per scene."""
    bushes: Count = (10, 18)
    """Bushes far back that close the view, half as many again in the jungle; none in caves."""
    toadstools: Count = (6, 16)
    """Small mushrooms per scene, twice as many among giant ones; none in the jungle."""
    cave_share: float = 0.2
    """Share of the scenes that are in a cave, 0..1."""
    lamps: Count = (1, 4)
    """Coloured soft lamps per scene."""


@dataclass(frozen=True)
class _Plan:
    """Decisions that come before anything is placed."""

    place: str
    framing: Framing
    depth_m: float
    """Depth at which the baseline is set, where the main creature stands in most scenes; the unit of all lengths."""
    size_m: float
    """Height of the main creature."""
    placement: GroundPlacement
    shares: Shares

    @property
    def focus_m(self) -> float:
        """Depth of the main creature."""
        return self.framing.first_depth * self.depth_m


def sample_monkaa(rng: np.random.Generator, config: MonkaaConfig) -> Scene:
    """Draw one scene."""
    plan, land = _sample_plan(rng, config)
    placement = plan.placement
    sky = Sky.sample(rng, 1024)
    placement.lay_ground(rng, _floor(plan.place), plan.depth_m)
    add_water(rng, placement, land, plan.depth_m)
    cave = _cave(rng, plan) if plan.place == "cave" else None
    creatures = _creatures(rng, config, plan)
    area = VegetationArea(placement, plan.depth_m, anywhere if cave is None else cave.contains)
    nearest_m = placement.clearance_m
    near = add_foreground(
        rng, placement, plan.shares, _NEAR[plan.place], integer(rng, *config.foreground),
        (1.05 * nearest_m, max(1.3 * nearest_m, 0.75 * plan.depth_m)),
    )  # fmt: skip
    _FURNISH[plan.place](rng, config, plan)
    foliage = [leaves() for _ in range(4)]
    if chance(rng, 0.5):
        foliage.append(leaves(VIVID))
    undergrowth(rng, area, integer(rng, *config.undergrowth), foliage)
    grass(rng, area, integer(rng, *config.grass_tufts), (FOLIAGE, FOLIAGE, DRY_GRASS))
    boulders(rng, area, "boulder", integer(rng, *config.boulders), (rock(), rock()), plan.shares)
    scree(rng, area, integer(rng, 2, 8), rock(ROCK, EARTH))
    base = Scene(
        family="monkaa",
        frames=config.frames,
        camera=placement.view.camera,
        objects=(),
        materials=(),
        lights=_lights(rng, config, plan, cave),
        world=World(sky, uniform(rng, *config.sky_strength)),
        exposure_key=uniform(rng, 0.17, 0.28),
        final=sample_final(
            rng, plan.focus_m, linear(sky.horizon), config.fog_share, (2.5 * plan.focus_m, 20 * plan.focus_m)
        ),
        notes={
            "creatures": float(creatures),
            "place": float(PLACES.index(plan.place)),
            "framing": plan.framing.note,
            "near_things": float(near),
            "water": float(land.shape.basin is not None),
        },
    )
    return placement.scene(base)


def _sample_plan(rng: np.random.Generator, config: MonkaaConfig) -> tuple[_Plan, Land]:
    place = "cave" if chance(rng, config.cave_share) else choose(rng, PLACES[:3], (0.45, 0.3, 0.25))
    depth_m, focal_mm = uniform(rng, *config.focus_distance_m), config.lens_mm(uniform(rng, *config.focal_mm))
    framing = sample_framing(rng, config, config.creatures)
    size_m = framing.height_share * 2 * half_height(focal_mm, config) * depth_m
    land = _sample_land(rng, place, depth_m)
    if chance(rng, config.water_share):
        land = with_pond(rng, land, depth_m, framing.first_depth * depth_m)
    high_m = uniform(rng, *framing.camera_height) * size_m
    focus = sample_focus(rng, config, focal_mm, depth_m, size_m, high_m, framing.aim, framing.above)
    camera = sample_camera(rng, config, land, focus)
    placement = GroundPlacement(land, camera, config.frames, 1.15 * focus.nearest_m, land.water_m)
    return _Plan(place, framing, depth_m, size_m, placement, config.shares), land


def _sample_land(rng: np.random.Generator, place: str, depth_m: float) -> Land:
    steep = place in ("jungle", "cave")
    shape = Landscape(
        relief=uniform(rng, 0.12, 0.4) if steep else uniform(rng, 0.02, 0.22),
        roll=uniform(rng, 0.0005, 0.002),
        clearing=uniform(rng, 0.12, 0.3),
        frequency=uniform(rng, 3.0, 8.0),
        octaves=6,
        ridged=uniform(rng, 0.0, 0.8),
        cells=90,
        concentration=2.2,
        seed=new_seed(rng),
    )
    return Land(shape, uniform(rng, 14.0, 24.0) * depth_m)


def _floor(place: str) -> TextureSampler:
    return {
        "jungle": ground(MOSS),
        "meadow": ground(FOLIAGE),
        "mushrooms": ground(MOSS),
        "cave": rock(ROCK, EARTH),
    }[place]


def _creatures(rng: np.random.Generator, config: MonkaaConfig, plan: _Plan) -> int:
    """The main creature before the camera, the others about it; returns how many were placed."""
    placement, framing, placed = plan.placement, plan.framing, 0
    for index in range(framing.characters):
        furry = chance(rng, 0.7)
        coat = Coat(
            tufts=integer(rng, *config.fur_locks) if furry else 0,
            tuft_length=log_uniform(rng, 0.028, 0.075),
            cells=54 if index == 0 else 40,
        )
        character = sample_creature(rng, coat)
        size_m = plan.size_m if index == 0 else plan.size_m * log_uniform(rng, 0.4, 1.1)
        scale_m = size_m / max(character.height, 0.75 * character.reach)
        right = uniform(rng, -0.45, 0.45)
        spot = placement.spot(right, plan.focus_m, _towards_camera(rng, 1.2))
        if index > 0:
            near, beyond = (depth * plan.depth_m for depth in framing.other_depths)
            across = uniform(rng, -framing.spread, framing.spread)
            spot = placement.spot(across, log_uniform(rng, near, beyond), _towards_camera(rng, 2.2))
        materials = _creature_materials(rng, plan, character, furry, scale_m, spot.depth_m)
        # The main creature is not checked: the camera was set up for it.
        placed += place_character(
            placement, f"creature {index}", character, materials, spot, scale_m, checked=index > 0
        )
        if index == 0:
            wide = character.reach * scale_m / (plan.focus_m * placement.view.half_view[0])
            placement.keep_view_free(right, 0.6 * wide, plan.focus_m)
    return placed


def _towards_camera(rng: np.random.Generator, spread_rad: float) -> float:
    return -math.pi / 2 + uniform(rng, -spread_rad, spread_rad)


def _creature_materials(
    rng: np.random.Generator, plan: _Plan, character: Character, furry: bool, scale_m: float, depth_m: float
) -> dict[str, int]:
    looks = {
        "fur": CHARACTER_SURFACES["fur" if furry else "hide"](rng, plan.shares),
        "eye": CHARACTER_SURFACES["eye"](rng, plan.shares),
    }
    if any(part.material == "horn" for part in character.parts):
        looks["horn"] = CHARACTER_SURFACES["horn"](rng, plan.shares)
    sizes = {"fur": (0.5, 256), "eye": (0.5, 128), "horn": (0.1, 128)}
    return {
        name: plan.placement.new_material(
            rng, look.texture, sizes[name][0] * scale_m, depth_m, size=sizes[name][1], finish=look.finish
        )
        for name, look in looks.items()
    }


def _jungle(rng: np.random.Generator, config: MonkaaConfig, plan: _Plan) -> None:
    """Winding trees and palms, vines from above the image, a wall of leaves behind."""
    area = VegetationArea(plan.placement, plan.depth_m)
    kinds = [Palm.sample(rng) if chance(rng, 0.35) else _old_tree(rng) for _ in range(4)]
    trees(rng, area, kinds, integer(rng, *config.trees), (1.7, 9.0), (0.7, 1.6), [leaves()] * 3)
    _thicket(rng, area, 3 * integer(rng, *config.bushes) // 2, (4.0, 11.0), 1.2)
    _vines(rng, plan, integer(rng, 4, 10))


def _meadow(rng: np.random.Generator, config: MonkaaConfig, plan: _Plan) -> None:
    """A few trees, toadstools in the grass, bushes far back."""
    area = VegetationArea(plan.placement, plan.depth_m)
    kinds = [Palm.sample(rng) if chance(rng, 0.2) else _old_tree(rng) for _ in range(3)]
    count = max(2, integer(rng, *config.trees) // 2)
    trees(rng, area, kinds, count, (2.5, 12.0), (0.7, 1.6), [leaves()] * 2)
    _thicket(rng, area, integer(rng, *config.bushes), (5.0, 13.0), 0.8)
    mushrooms(
        rng, area, "toadstool", integer(rng, *config.toadstools), (0.8, 4.0), (0.08, 0.25), 0.0, plan.shares
    )


def _grove(rng: np.random.Generator, config: MonkaaConfig, plan: _Plan) -> None:
    """Mushrooms as large as trees, small ones between them."""
    area = VegetationArea(plan.placement, plan.depth_m)
    glow = uniform(rng, 0.1, 0.6) if chance(rng, 0.3) else 0.0
    mushrooms(rng, area, "giant", integer(rng, *config.trees), (1.6, 9.0), (0.5, 2.2), glow, plan.shares)
    toadstools = 2 * integer(rng, *config.toadstools)
    mushrooms(rng, area, "toadstool", toadstools, (0.8, 4.0), (0.06, 0.4), glow, plan.shares)
    _thicket(rng, area, integer(rng, *config.bushes), (5.0, 12.0), 0.9)


def _cave_inside(rng: np.random.Generator, config: MonkaaConfig, plan: _Plan) -> None:
    """Dripstones from floor and roof, glowing mushrooms."""
    placement, d = plan.placement, plan.depth_m
    stone = placement.new_material(rng, rock(), 0.4 * d, 1.5 * d)
    shapes = [Dripstone.sample(rng) for _ in range(4)]
    for index in range(2 * integer(rng, *config.trees)):
        spot = placement.random_spot(rng, (0.8 * d, 4.5 * d), 1.1)
        shape, scale_m = choose(rng, shapes), log_uniform(rng, 0.15, 0.8) * d
        if index % 2:
            placement.stand(f"stalagmite {index}", shape, stone, spot, scale_m, sunk_m=0.05 * scale_m)
        else:
            placement.hang(f"stalactite {index}", shape, stone, spot, 1.3 * _CAVE_RADIUS * d, scale_m)
    area = VegetationArea(placement, d)
    glow = uniform(rng, 0.3, 1.5)
    mushrooms(
        rng, area, "toadstool", integer(rng, *config.toadstools), (0.8, 4.0), (0.08, 0.35), glow, plan.shares
    )


_PLANTS: dict[PropSampler, float] = {smooth_boulder: 1.0, broad_leaves: 2.0, toadstool: 1.5, outcrop: 1.0}
_NEAR: dict[str, dict[PropSampler, float]] = {
    "jungle": _PLANTS | {trunk: 1.5, paling: 1.0},
    "meadow": _PLANTS | {paling: 2.0, vessel: 1.0},
    "mushrooms": _PLANTS | {toadstool: 4.0, crystals: 1.0, vessel: 1.0},
    "cave": {smooth_boulder: 2.0, outcrop: 2.0, crystals: 3.0, toadstool: 1.5, vessel: 0.5},
}
"""What stands near the camera in a place, and how often."""
_FURNISH = {"jungle": _jungle, "meadow": _meadow, "mushrooms": _grove, "cave": _cave_inside}

_CAVE_RADIUS = 1.35
"""Of the tunnel at the camera, in focus distances."""


@dataclass(frozen=True)
class _Tunnel:
    """The space inside a cave."""

    radius_m: float
    end_m: float
    """y of its far mouth."""
    bend_m: float

    def contains(self, spot: Spot) -> bool:
        """Whether a spot is well inside the cave, or well outside of it."""
        x, y, _ = spot.ground_m
        if y > self.end_m + self.radius_m:
            return True
        share = y / self.end_m
        return bool(abs(x - self.bend_m * share * abs(share)) < 0.6 * self.radius_m and y < self.end_m)


def _cave(rng: np.random.Generator, plan: _Plan) -> _Tunnel:
    d, placement = plan.depth_m, plan.placement
    radius_m, start_m = _CAVE_RADIUS * d, -1.5 * d
    shape = Cavern(
        length=uniform(rng, 4.0, 7.0),
        bend=uniform(rng, -1.6, 1.6),
        narrowing=uniform(rng, 0.75, 1.0),
        roughness=uniform(rng, 0.08, 0.17),
        wall=uniform(rng, 0.5, 0.9),
        rings=64,
        seed=new_seed(rng),
    )
    stone = placement.new_material(
        rng, rock(ROCK, choose(rng, (MOSS, EARTH))), 3.0 * radius_m, 1.6 * d, size=512
    )
    spot = Spot(np.array((0.0, start_m, 0.0)), 1.6 * d)
    placement.stand("cave", shape, stone, spot, radius_m, sunk_m=-0.3 * radius_m, checked=False)
    return _Tunnel(radius_m, start_m + shape.length * radius_m, shape.bend * radius_m)


def _old_tree(rng: np.random.Generator) -> Tree:
    return Tree(
        height=uniform(rng, 1.2, 3.0),
        thickness=uniform(rng, 0.12, 0.26),
        boughs=integer(rng, 6, 10),
        crooked=uniform(rng, 0.05, 0.15),
        roots=integer(rng, 4, 8),
        leaves=integer(rng, 280, 520),
        leaf_size=uniform(rng, 0.18, 0.3),
        seed=new_seed(rng),
    )


def _thicket(rng: np.random.Generator, area: VegetationArea, count: int, depths: Range, scale: float) -> None:
    """Bushes far back, dense enough to close the view."""
    kinds = [Bush.sample(rng) for _ in range(3)]
    scales = (0.5 * scale, 1.3 * scale)
    plants(rng, area, "bush", kinds, count, depths, scales, [leaves()] * 3, sway=(0.005, 0.02), sunk=0.2)


def _vines(rng: np.random.Generator, plan: _Plan, count: int) -> None:
    """Vines that hang down from above the image."""
    placement, d = plan.placement, plan.depth_m
    shapes = [Vine.sample(rng) for _ in range(3)]
    green = [placement.new_material(rng, leaves(), 0.5 * d, 1.2 * d) for _ in range(2)]
    for index in range(count):
        spot = placement.random_spot(rng, (0.8 * d, 2.5 * d), 1.0)
        # The slope of the image's upper edge, with some margin for the camera's motion.
        edge = -placement.pose[2, 2] + (placement.view.half_view[1] + 0.12) * placement.pose[2, 1]
        top_m = placement.pose[2, 3] + edge * spot.depth_m - spot.ground_m[2]
        scale_m = min(log_uniform(rng, 0.4, 1.2) * d, 0.8 * top_m)
        shape = choose(rng, shapes)
        sway = sway_of(rng, shape, uniform(rng, 0.02, 0.08))
        if scale_m > 0:
            placement.hang(f"vine {index}", shape, choose(rng, green), spot, top_m, scale_m, deformation=sway)


def _lights(
    rng: np.random.Generator, config: MonkaaConfig, plan: _Plan, cave: _Tunnel | None
) -> tuple[Light, ...]:
    """A sun, and coloured lamps about the creature; in a cave the lamps hang under its roof."""
    placement, d = plan.placement, plan.depth_m
    target = placement.spot(0.0, plan.focus_m).ground_m + np.array((0.0, 0.0, 0.5 * plan.size_m))
    lights: list[Light] = [sample_sun(rng, placement.pose)]
    for index in range(integer(rng, *config.lamps) + (1 if cave else 0)):
        if cave is None:
            lights.append(sample_area_light(rng, placement.pose, target, d))
        else:
            lights.append(_cave_lamp(rng, plan, cave, index))
    return tuple(lights)


def _cave_lamp(rng: np.random.Generator, plan: _Plan, cave: _Tunnel, index: int) -> AreaLight:
    """One near the camera first, the others further in."""
    d = plan.depth_m
    along = uniform(rng, -0.2, 0.6) * d if index == 0 else uniform(rng, 0.5, 0.9) * cave.end_m
    share = along / cave.end_m
    position = np.array(
        (
            cave.bend_m * share * abs(share) + uniform(rng, -0.35, 0.35) * cave.radius_m,
            along,
            uniform(rng, 0.4, 0.7) * cave.radius_m,
        )
    )
    target = np.array((cave.bend_m * share * share, along + d, 0.0))
    return AreaLight(
        position_m=vector(position),
        target_m=vector(target),
        color=sample_light_color(rng, 0.8),
        power_w=log_uniform(rng, 2.0, 8.0) * math.pi * d * d,
        size_m=d * uniform(rng, 0.2, 0.5),
    )


_REPLACEABLE = Replaceable(props=r"boulder .*", painted=r"ground|cave|(boulder|giant|toadstool) .*")

FAMILY = Family("monkaa", MonkaaConfig, sample_monkaa, _REPLACEABLE)
