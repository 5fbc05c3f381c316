"""Characters in wide landscapes, after MPI Sintel (Butler et al. 2012), with procedural characters.

People in robes or boots, some with an animal, stand or walk in mountains, snow, desert, a bamboo forest, a
small town or among ruins. Eroded land reaches to the horizon; the final pass has fog, motion blur and
defocus. Lengths are metres, a person is about 1.75 m tall; the distance follows from how large the main
person shall appear.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from scenes.appearance.lights import sample_area_light, sample_sun
from scenes.appearance.material_textures import (
    CHARACTER_TEXTURES,
    DESERT_ROCK,
    SNOWY,
    TextureSampler,
    culm,
    grains,
    ground,
    leaves,
    masonry,
    paving,
    plaster,
    rock,
    roofing,
)
from scenes.appearance.palettes import DRY_GRASS, EARTH, HEATH, MOSS, RED_ROCK, ROCK, SAND, SNOW
from scenes.family import Family
from scenes.landscapes.characters import Character, Coat, place_character, sample_creature
from scenes.landscapes.people import sample_person, statue
from scenes.landscapes.terrain import (
    Land,
    LandscapeConfig,
    half_height,
    linear,
    sample_camera,
    sample_final,
    sample_focus,
)
from scenes.landscapes.vegetation import VegetationArea, boulders, grass, plants, trees, undergrowth
from scenes.placement.ground import GroundPlacement, Spot
from scenes.random_draws import Count, Range, chance, choose, integer, log_uniform, new_seed, uniform
from scenes.shapes.nature.landforms import Landscape
from scenes.shapes.nature.masonry import Archway, BlockWall, Column, House, Steps
from scenes.shapes.nature.trees import Bamboo, Conifer, Palm, Tree
from scenes.spec import Light, Scene, World
from scenes.textures.sky import Sky
from scenes.user_assets.replacement import Replaceable

PERSON_M = 1.75
"""Height of a person."""


@dataclass(frozen=True)
class SintelConfig(LandscapeConfig):
    """Values are drawn uniformly from the ranges, once for each scene or once for each object, as the fields say.

    Raises ValueError for ranges from which no scene can be sampled.
    """

    crowd = ("people", "trees", "structures", "boulders", "plants")

    focal_mm: Range = (20.0, 60.0)
    """Focal length on a sensor 32 mm wide."""
    focus_disparity_share: Range = (0.01, 0.05)
    """Disparity of the main person, as a share of the image width (0.01 is 10 px at 960);
    it sets the baseline."""
    focus_height_share: Range = (0.35, 0.8)
    """Height of that person, as a share of the image height."""
    sky_strength: Range = (0.4, 1.3)
    """Brightness of the sky's light."""
    fog_share: float = 0.6
    """Share of the scenes with fog in the final pass, 0..1."""
    people: Count = (1, 4)
    """People per scene; the first is the main one, at which the camera looks."""
    beast_share: float = 0.3
    """Share of the scenes with an animal beside the people, 0..1."""
    trees: Count = (14, 30)
    """Trees or bamboo clumps per scene, where the place has them."""
    structures: Count = (6, 12)
    """Columns, arches, walls and steps per scene, where the place has them; houses in towns."""
    boulders: Count = (10, 30)
    """Rocks per scene."""
    plants: Count = (15, 40)
    """Low plants per scene, where the place has them; as many tufts of grass."""
    lamps: Count = (0, 1)
    """Soft lamps per scene beside sun and sky."""


@dataclass(frozen=True)
class _Place:
    """A kind of landscape."""

    share: float
    """How many scenes are of this kind, relative to the others."""
    floor: TextureSampler
    stones: TextureSampler
    relief: Range
    """Height of the outermost hills, relative to half the land's side."""
    ridged: Range
    """0 rounded hills .. 1 sharp crests."""
    clearing: Range
    """Radius of the level middle, relative to half the land's side."""
    rockiness: float
    """Share of the configured number of rocks that this kind of landscape has."""
    furnish: Callable[[np.random.Generator, SintelConfig, _Plan], None]


@dataclass(frozen=True)
class _Plan:
    """Decisions that come before anything is placed."""

    name: str
    place: _Place
    depth_m: float
    """Depth of the main person."""
    placement: GroundPlacement

    @property
    def area(self) -> VegetationArea:
        return VegetationArea(self.placement, self.depth_m)


def sample_sintel(rng: np.random.Generator, config: SintelConfig) -> Scene:
    """Draw one scene."""
    plan = _sample_plan(rng, config)
    placement, depth_m = plan.placement, plan.depth_m
    sky = Sky.sample(rng, 1024)
    placement.lay_ground(rng, plan.place.floor, 1.5 * depth_m)
    people = _people(rng, config, plan)
    plan.place.furnish(rng, config, plan)
    stones = (plan.place.stones, plan.place.stones)
    rocks = round(plan.place.rockiness * integer(rng, *config.boulders))
    boulders(rng, plan.area, "rock", rocks, stones, (0.8, 9.0), (0.025, 0.16))
    crags = round(plan.place.rockiness * integer(rng, 4, 9))
    boulders(rng, plan.area, "crag", crags, stones, (9.0, 30.0), (0.3, 1.3), (0.4, 0.8))
    base = Scene(
        family="sintel",
        frames=config.frames,
        camera=placement.view.camera,
        objects=(),
        materials=(),
        lights=_lights(rng, config, plan),
        world=World(sky, uniform(rng, *config.sky_strength)),
        exposure_key=uniform(rng, 0.18, 0.32),
        final=sample_final(
            rng, depth_m, linear(sky.horizon), config.fog_share, (2.5 * depth_m, 40 * depth_m)
        ),
        notes={"people": float(people), "place": float(sorted(_PLACES).index(plan.name))},
    )
    return placement.scene(base)


def _sample_plan(rng: np.random.Generator, config: SintelConfig) -> _Plan:
    names = sorted(_PLACES)
    name = choose(rng, names, [_PLACES[key].share for key in names])
    place, focal_mm = _PLACES[name], config.lens_mm(uniform(rng, *config.focal_mm))
    depth_m = PERSON_M / (2 * half_height(focal_mm, config) * uniform(rng, *config.focus_height_share))
    land = _sample_land(rng, place, depth_m)
    focus = sample_focus(rng, config, focal_mm, depth_m, PERSON_M, uniform(rng, 0.5, 1.3) * PERSON_M)
    camera = sample_camera(rng, config, land, focus)
    return _Plan(name, place, depth_m, GroundPlacement(land, camera, config.frames, 1.15 * focus.nearest_m))


def _sample_land(rng: np.random.Generator, place: _Place, depth_m: float) -> Land:
    shape = Landscape(
        relief=uniform(rng, *place.relief),
        roll=uniform(rng, 0.0001, 0.0006),
        clearing=uniform(rng, *place.clearing),
        frequency=uniform(rng, 3.0, 9.0),
        octaves=7,
        ridged=uniform(rng, *place.ridged),
        cells=120,
        concentration=2.4,
        seed=new_seed(rng),
    )
    return Land(shape, uniform(rng, 30.0, 60.0) * depth_m)


def _people(rng: np.random.Generator, config: SintelConfig, plan: _Plan) -> int:
    """The main person, others about them, sometimes an animal; returns how many people were placed."""
    placement, d = plan.placement, plan.depth_m
    placed = 0
    for index in range(integer(rng, *config.people)):
        character = sample_person(rng, 52 if index == 0 else 38)
        scale_m = PERSON_M * uniform(rng, 0.92, 1.06)
        right = uniform(rng, -0.45, 0.45)
        # Mostly seen from the front or the side, now and then from behind.
        heading = -math.pi / 2 + uniform(rng, -2.2, 2.2)
        spot = placement.spot(right, d, heading)
        if index > 0:
            spot = placement.spot(uniform(rng, -0.9, 0.9), d * log_uniform(rng, 0.9, 3.5), heading)
        placed += _dressed(rng, placement, f"person {index}", character, spot, scale_m, checked=index > 0)
        if index == 0:
            placement.keep_view_free(right, 0.5 * scale_m / (d * placement.view.half_view[0]), d)
    if chance(rng, config.beast_share):
        character = sample_creature(rng, Coat(integer(rng, 0, 1500), 0.03, 48))
        spot = placement.spot(uniform(rng, -0.9, 0.9), d * log_uniform(rng, 1.0, 2.5), uniform(rng, 0.0, 6.3))
        _dressed(rng, placement, "beast", character, spot, uniform(rng, 0.8, 2.0), checked=True)
    return placed


def _dressed(
    rng: np.random.Generator,
    placement: GroundPlacement,
    name: str,
    character: Character,
    spot: Spot,
    scale_m: float,
    *,
    checked: bool,
) -> bool:
    """Put a character on the ground in materials of its own."""
    names = {part.material for part in character.parts}
    materials = {
        material: placement.new_material(
            rng,
            CHARACTER_TEXTURES[material],
            (0.5 if material in ("cloth", "fur") else 0.2) * scale_m,
            spot.depth_m,
            size=256 if material in ("cloth", "fur") else 128,
            gloss=0.5 if material == "eye" else 0.0,
        )
        for material in sorted(names)
    }
    return place_character(placement, name, character, materials, spot, scale_m, checked=checked)


def _mountain(rng: np.random.Generator, config: SintelConfig, plan: _Plan) -> None:
    area = plan.area
    _conifers(rng, config, plan, [leaves(HEATH)] * 2)
    undergrowth(
        rng, area, integer(rng, *config.plants) // 2, [leaves(HEATH), leaves(DRY_GRASS)], (0.04, 0.14)
    )
    grass(rng, area, integer(rng, *config.plants), (HEATH, DRY_GRASS), (0.04, 0.12))


def _snow(rng: np.random.Generator, config: SintelConfig, plan: _Plan) -> None:
    _conifers(rng, config, plan, [leaves(HEATH), grains(SNOW)])
    if chance(rng, 0.5):
        _bare_trees(rng, plan, integer(rng, 3, 9))
    if chance(rng, 0.3):
        _ruined(rng, plan, integer(rng, *config.structures) // 2, masonry(ROCK))


def _desert(rng: np.random.Generator, config: SintelConfig, plan: _Plan) -> None:
    area = plan.area
    if chance(rng, 0.7):
        _ruined(rng, plan, integer(rng, *config.structures) // 2, masonry(SAND))
    if chance(rng, 0.6):
        palms = [Palm.sample(rng) for _ in range(2)]
        trees(
            rng,
            area,
            palms,
            integer(rng, 3, 10),
            (1.5, 8.0),
            (0.25, 0.5),
            [leaves(DRY_GRASS), leaves(HEATH)],
        )
    grass(rng, area, integer(rng, *config.plants) // 2, (DRY_GRASS,), (0.04, 0.12))


def _bamboo(rng: np.random.Generator, config: SintelConfig, plan: _Plan) -> None:
    area = plan.area
    clumps = [
        Bamboo(
            integer(rng, 2, 4),
            integer(rng, 8, 11),
            uniform(rng, 0.006, 0.011),
            uniform(rng, 0.05, 0.14),
            5,
            new_seed(rng),
        )
        for _ in range(4)
    ]
    count = 2 * integer(rng, *config.trees)
    scales = (7.0 / plan.depth_m, 11.0 / plan.depth_m)
    plants(rng, area, "bamboo", clumps, count, (0.9, 9.0), scales, [culm] * 3, sway=(0.005, 0.03), sunk=0.005)
    undergrowth(rng, area, integer(rng, *config.plants), [leaves(HEATH)] * 2, (0.04, 0.16))
    grass(rng, area, integer(rng, *config.plants) // 2, (HEATH, DRY_GRASS), (0.03, 0.1))
    if chance(rng, 0.5):
        _ruined(rng, plan, 2, masonry(ROCK))


def _ruins(rng: np.random.Generator, config: SintelConfig, plan: _Plan) -> None:
    area, colors = plan.area, choose(rng, (ROCK, SAND, RED_ROCK))
    stone, stones = masonry(colors), rock(colors)
    _ruined(rng, plan, integer(rng, *config.structures), stone)
    _colonnade(rng, plan, stones)
    if chance(rng, 0.6):
        _bare_trees(rng, plan, integer(rng, 2, 5))
    undergrowth(rng, area, integer(rng, *config.plants), [leaves(HEATH), leaves(MOSS)], (0.03, 0.13))
    grass(rng, area, integer(rng, *config.plants), (HEATH, DRY_GRASS), (0.03, 0.1))


def _town(rng: np.random.Generator, config: SintelConfig, plan: _Plan) -> None:
    """Houses along both sides of a street that leads away from the camera, a wall or tower at its end."""
    placement, d = plan.placement, plan.depth_m
    houses = [House.sample(rng) for _ in range(4)]
    walls = [placement.new_material(rng, plaster, 4.0, 2 * d, size=512) for _ in range(4)]
    roofs = [placement.new_material(rng, roofing, 3.0, 2 * d) for _ in range(3)]
    half_street_m = uniform(rng, 2.2, 4.5)
    for side in (-1, 1):
        along_m = uniform(rng, 0.2, 0.8) * d
        for index in range(integer(rng, *config.structures) // 2 + 2):
            shape, width_m = choose(rng, houses), uniform(rng, 4.0, 6.5)
            facing = choose(rng, (0.0, math.pi / 2 * side))
            extent = (shape.length if facing == 0.0 else 1.0) * width_m
            across = (1.0 if facing == 0.0 else shape.length) * width_m
            centre = np.array(
                (side * (half_street_m + across / 2 + uniform(rng, 0.0, 1.0)), along_m + extent / 2)
            )
            spot = placement.spot_at(centre, facing + float(rng.normal(0.0, 0.06)))
            materials = {"walls": choose(rng, walls), "roof": choose(rng, roofs)}
            placement.stand_in_parts(f"house {side} {index}", shape, materials, spot, width_m, on_lowest=True)
            along_m += extent * uniform(rng, 1.05, 1.5)
    _ruined(rng, plan, integer(rng, 1, 4), masonry(choose(rng, (ROCK, SAND))), ruin=0.1)
    if chance(rng, 0.6):
        kinds = [replace(Tree.sample(rng), leaves=300)]
        trees(rng, plan.area, kinds, integer(rng, 2, 5), (1.3, 8.0), (0.2, 0.35), [leaves(HEATH)])


def _conifers(
    rng: np.random.Generator, config: SintelConfig, plan: _Plan, foliage: Sequence[TextureSampler]
) -> None:
    kinds = [
        replace(Conifer.sample(rng), whorls=integer(rng, 8, 11), branches=integer(rng, 5, 7))
        for _ in range(3)
    ]
    # A scale of one is a tree of one metre's radius at the foot.
    scales = (0.9 / plan.depth_m, 2.4 / plan.depth_m)
    trees(rng, plan.area, kinds, integer(rng, *config.trees), (1.4, 16.0), scales, foliage)


def _bare_trees(rng: np.random.Generator, plan: _Plan, count: int) -> None:
    kinds = [replace(Tree.sample(rng), leaves=0, crooked=uniform(rng, 0.1, 0.25)) for _ in range(3)]
    scales = (1.2 / plan.depth_m, 3.0 / plan.depth_m)
    trees(rng, plan.area, kinds, count, (1.3, 8.0), scales, [leaves(HEATH)])


def _ruined(
    rng: np.random.Generator, plan: _Plan, count: int, stone: TextureSampler, ruin: float = 1.0
) -> None:
    """Walls, towers, arches, steps, columns and a statue, here and there; `ruin` scales their decay."""
    placement, d = plan.placement, plan.depth_m
    masonry_materials = [placement.new_material(rng, stone, 2.0, 1.8 * d, size=512) for _ in range(2)]
    hewn = placement.new_material(rng, plan.place.stones, 2.0, 1.3 * d, size=512)
    for index in range(count):
        kind = choose(rng, (BlockWall, Archway, Steps, Column, "statue"), (0.3, 0.25, 0.12, 0.2, 0.13))
        spot = placement.random_spot(rng, (1.1 * d, 7.0 * d), 1.1)
        material = choose(rng, masonry_materials)
        name = f"ruin {index}"
        if kind is Archway:
            shape = replace(Archway.sample(rng), seed=new_seed(rng))
            shape = replace(shape, ruin=shape.ruin * ruin)
            facing = replace(spot, heading_rad=float(rng.normal(0.0, 0.5)))
            placement.stand(name, shape, material, facing, uniform(rng, 2.2, 4.5), on_lowest=True)
        elif kind is BlockWall:
            wall = BlockWall.sample(rng)
            wall = replace(wall, ruin=wall.ruin * ruin)
            placement.stand(name, wall, hewn, spot, uniform(rng, 0.45, 0.8), on_lowest=True)
        elif kind is Steps:
            placement.stand(name, Steps.sample(rng), material, spot, uniform(rng, 0.3, 0.45), on_lowest=True)
        elif kind is Column:
            _column(rng, placement, name, Column.sample(rng), hewn, spot)
        else:
            _statue(rng, placement, name, hewn, spot)


def _column(
    rng: np.random.Generator, placement: GroundPlacement, name: str, shape: Column, material: int, spot: Spot
) -> None:
    """PartedShape, or one time in four lying on the ground."""
    scale_m = uniform(rng, 3.0, 6.5) / shape.slenderness
    if chance(rng, 0.25):
        fallen = Rotation.from_euler("X", 90.0, degrees=True)
        placement.stand(name, shape, material, spot, scale_m, sunk_m=-0.6 * scale_m, lean=fallen)
    else:
        placement.stand(name, shape, material, spot, scale_m, on_lowest=True)


def _statue(
    rng: np.random.Generator, placement: GroundPlacement, name: str, material: int, spot: Spot
) -> None:
    """A person of stone on a stepped plinth."""
    scale_m = uniform(rng, 1.6, 3.2)
    plinth = BlockWall(2, 3, 0.5, 2.6, 0.0, 0.0, 0.02, new_seed(rng))
    facing = replace(spot, heading_rad=-math.pi / 2 + float(rng.normal(0.0, 0.6)))
    block_m = 0.3 * scale_m
    character = statue(rng, sample_person(rng, 40))
    body = replace(facing, ground_m=facing.ground_m + np.array((0.0, 0.0, 0.98 * block_m)))
    upright = replace(facing, heading_rad=facing.heading_rad + math.pi / 2)
    box = placement.box_of(character, body, scale_m)
    if placement.allows(box) and placement.stand(f"{name} plinth", plinth, material, upright, block_m):
        placement.stand(f"{name} statue", character, material, body, scale_m, checked=False)


def _colonnade(rng: np.random.Generator, plan: _Plan, stone: TextureSampler) -> None:
    """Two rows of columns of one kind, some broken, that lead away from the camera or across the view."""
    placement, d = plan.placement, plan.depth_m
    material = placement.new_material(rng, stone, 2.0, 1.5 * d)
    whole = replace(Column.sample(rng), broken=0.0)
    kinds = [whole, *(replace(whole, broken=uniform(rng, 0.2, 0.8), seed=new_seed(rng)) for _ in range(3))]
    height_m, gap_m, row_m = uniform(rng, 3.5, 7.0), uniform(rng, 2.0, 3.5), uniform(rng, 2.5, 5.0)
    turn = Rotation.from_euler("Z", float(rng.normal(0.0, 0.5))).as_matrix()[:2, :2]
    origin = np.array((uniform(rng, -1.0, 1.0), uniform(rng, 0.9, 1.6) * d))
    for index in range(integer(rng, 8, 16)):
        flat = origin + turn @ np.array(((index % 2 - 0.5) * 2 * row_m, index // 2 * gap_m))
        spot = placement.spot_at(flat, 0.0)
        placement.stand(
            f"column {index}",
            choose(rng, kinds),
            material,
            spot,
            height_m / whole.slenderness,
            on_lowest=True,
        )


def _lights(rng: np.random.Generator, config: SintelConfig, plan: _Plan) -> tuple[Light, ...]:
    """One sun, often low; sometimes a lamp that lightens the shadows of the people."""
    placement, d = plan.placement, plan.depth_m
    target = placement.spot(0.0, d).ground_m + np.array((0.0, 0.0, 0.5 * PERSON_M))
    lights: list[Light] = [sample_sun(rng, placement.pose)]
    lights += [sample_area_light(rng, placement.pose, target, d) for _ in range(integer(rng, *config.lamps))]
    return tuple(lights)


_PLACES: dict[str, _Place] = {
    "mountain": _Place(0.2, ground(HEATH), rock(), (0.06, 0.26), (0.5, 1.0), (0.12, 0.32), 1.0, _mountain),
    "snow": _Place(0.17, grains(SNOW), SNOWY, (0.06, 0.26), (0.4, 1.0), (0.12, 0.32), 0.8, _snow),
    "desert": _Place(0.15, grains(SAND), DESERT_ROCK, (0.01, 0.07), (0.0, 0.5), (0.05, 0.2), 1.0, _desert),
    "bamboo": _Place(0.14, ground(DRY_GRASS), rock(), (0.03, 0.15), (0.2, 0.7), (0.1, 0.2), 0.5, _bamboo),
    "ruins": _Place(0.18, ground(HEATH), rock(), (0.02, 0.14), (0.2, 0.9), (0.1, 0.3), 0.6, _ruins),
    "town": _Place(0.16, paving, rock(ROCK, EARTH), (0.03, 0.16), (0.3, 0.9), (0.2, 0.4), 0.25, _town),
}

_REPLACEABLE = Replaceable(
    props=r"(rock|crag) .*", painted=r"ground|(rock|crag|column|ruin) .*|house .* walls"
)

FAMILY = Family("sintel", SintelConfig, sample_sintel, _REPLACEABLE)
