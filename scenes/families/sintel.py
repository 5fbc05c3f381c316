"""Characters in wide landscapes, after MPI Sintel (Butler et al. 2012), with procedural characters.

People in robes, tunics or armour, some with an animal, walk, fight, reach, kneel in mountains, snow, desert, a bamboo
forest, a small town or among ruins, some at a pond; they are near, far, in groups, or nobody is there. Things
stand close to the camera. Eroded land reaches to the horizon; the final pass has fog, motion blur and defocus.
Lengths are metres, a person is about 1.75 m tall; the distance follows from how large the main person shall appear.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenes.appearance.landscape_materials import CHARACTER_SURFACES, plain
from scenes.appearance.lights import sample_area_light, sample_sun
from scenes.appearance.materials import Shares
from scenes.family import Family
from scenes.landscapes.characters import Character, place_character
from scenes.landscapes.creatures import Coat, sample_creature
from scenes.landscapes.foreground import (
    add_foreground,
)
from scenes.landscapes.framing import Framing, sample_framing
from scenes.landscapes.people import sample_person
from scenes.landscapes.places import NEAR, PLACES, WATERY, Place, Site
from scenes.landscapes.terrain import (
    Land,
    LandscapeConfig,
    half_height,
    linear,
    sample_camera,
    sample_final,
    sample_focus,
)
from scenes.landscapes.vegetation import VegetationArea, boulders, scree
from scenes.landscapes.water import add_water, with_pond
from scenes.placement.ground import GroundPlacement, Spot
from scenes.random_draws import Count, Range, chance, choose, integer, log_uniform, new_seed, uniform
from scenes.shapes.nature.landforms import Landscape
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
    sky_strength: Range = (0.4, 1.3)
    """Brightness of the sky's light."""
    fog_share: float = 0.5
    """Share of the scenes with fog in the final pass, 0..1."""
    people: Count = (1, 4)
    """People per scene that has any; the first is the main one, at which the camera looks. Groups have up to two
    more."""
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
class _Plan:
    """Decisions that come before anything is placed."""

    name: str
    place: Place
    framing: Framing
    unit_m: float
    """Depth at which the baseline is set, where the main person stands in most scenes."""
    placement: GroundPlacement
    shares: Shares

    @property
    def area(self) -> VegetationArea:
        return VegetationArea(self.placement, self.unit_m)

    @property
    def focus_m(self) -> float:
        """Depth of the main person."""
        return self.framing.first_depth * self.unit_m


def sample_sintel(rng: np.random.Generator, config: SintelConfig) -> Scene:
    """Draw one scene."""
    plan, land = _sample_plan(rng, config)
    placement, unit_m = plan.placement, plan.unit_m
    sky = Sky.sample(rng, 1024)
    _lay_floor(rng, config, plan)
    add_water(rng, placement, land, unit_m)
    people = _people(rng, config, plan)
    near = add_foreground(
        rng, placement, plan.shares, NEAR[plan.name], integer(rng, *config.foreground), _near_depths(plan)
    )
    plan.place.furnish(rng, _site(config, plan))
    _stones(rng, config, plan)
    base = Scene(
        family="sintel",
        frames=config.frames,
        camera=placement.view.camera,
        objects=(),
        materials=(),
        lights=_lights(rng, config, plan),
        world=World(sky, uniform(rng, *config.sky_strength)),
        exposure_key=uniform(rng, 0.16, 0.28),
        final=sample_final(
            rng, plan.focus_m, linear(sky.horizon), config.fog_share, (2.5 * plan.focus_m, 40 * plan.focus_m)
        ),
        notes={
            "people": float(people),
            "place": float(sorted(PLACES).index(plan.name)),
            "framing": plan.framing.note,
            "near_things": float(near),
            "water": float(land.shape.basin is not None),
        },
    )
    return placement.scene(base)


def _sample_plan(rng: np.random.Generator, config: SintelConfig) -> tuple[_Plan, Land]:
    names = sorted(PLACES)
    name = choose(rng, names, [PLACES[key].share for key in names])
    place, focal_mm = PLACES[name], config.lens_mm(uniform(rng, *config.focal_mm))
    framing = sample_framing(rng, config, config.people)
    unit_m = PERSON_M / (2 * half_height(focal_mm, config) * framing.height_share)
    land = _sample_land(rng, place, unit_m)
    if place.water and chance(rng, config.water_share / WATERY):
        land = with_pond(rng, land, unit_m, framing.first_depth * unit_m)
    high_m = uniform(rng, *framing.camera_height) * PERSON_M
    focus = sample_focus(rng, config, focal_mm, unit_m, PERSON_M, high_m, framing.aim, framing.above)
    camera = sample_camera(rng, config, land, focus)
    placement = GroundPlacement(land, camera, config.frames, 1.15 * focus.nearest_m, land.water_m)
    return _Plan(name, place, framing, unit_m, placement, config.shares), land


def _sample_land(rng: np.random.Generator, place: Place, unit_m: float) -> Land:
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
    return Land(shape, uniform(rng, 30.0, 60.0) * unit_m)


def _lay_floor(rng: np.random.Generator, config: SintelConfig, plan: _Plan) -> None:
    """The ground, plain in some of the places that have such ground."""
    colors = plan.place.plain_floor
    floor = plan.place.floor
    if colors is not None and chance(rng, 0.5 * config.plain_share):
        floor = plain(colors, 0.05)
    plan.placement.lay_ground(rng, floor, plan.unit_m)


def _near_depths(plan: _Plan) -> Range:
    """Depths of the things near the camera, from as near as is allowed to before the main person."""
    nearest_m = plan.placement.clearance_m
    return 1.05 * nearest_m, max(1.3 * nearest_m, 0.75 * plan.unit_m)


def _stones(rng: np.random.Generator, config: SintelConfig, plan: _Plan) -> None:
    """Rocks and crags, and small stones near the camera."""
    stones, rockiness = (plan.place.stones, plan.place.stones), plan.place.rockiness
    count = round(rockiness * integer(rng, *config.boulders))
    boulders(rng, plan.area, "rock", count, stones, plan.shares, (0.45, 8.0), (0.03, 0.2))
    crags = round(rockiness * integer(rng, 4, 9))
    boulders(rng, plan.area, "crag", crags, stones, plan.shares, (5.0, 24.0), (0.4, 1.5), (0.4, 0.8))
    scree(rng, plan.area, round(rockiness * integer(rng, 5, 16)), plan.place.stones)


def _site(config: SintelConfig, plan: _Plan) -> Site:
    stones = plan.place.stones
    return Site(
        plan.placement, plan.unit_m, plan.shares, stones, config.trees, config.structures, config.plants
    )


def _people(rng: np.random.Generator, config: SintelConfig, plan: _Plan) -> int:
    """The main person, others about them, sometimes an animal; returns how many people were placed."""
    placement, framing, placed = plan.placement, plan.framing, 0
    for index in range(framing.characters):
        far = framing.kind == "far" or index > 0
        character = sample_person(rng, 30 if far else 54)
        scale_m = PERSON_M * uniform(rng, 0.9, 1.07)
        # Mostly seen from the front or the side, now and then from behind.
        heading = -math.pi / 2 + uniform(rng, -2.2, 2.2)
        right = uniform(rng, -0.5, 0.5)
        spot = placement.spot(right, plan.focus_m, heading)
        if index > 0:
            near, beyond = (depth * plan.unit_m for depth in framing.other_depths)
            across = uniform(rng, -framing.spread, framing.spread)
            spot = placement.spot(across, log_uniform(rng, near, beyond), heading)
        placed += _dressed(rng, plan, f"person {index}", character, spot, scale_m, checked=index > 0)
        if index == 0:
            half = 0.4 * scale_m / (plan.focus_m * placement.view.half_view[0])
            placement.keep_view_free(right, half, plan.focus_m)
    if framing.characters and chance(rng, config.beast_share):
        character = sample_creature(rng, Coat(integer(rng, 0, 1500), 0.03, 44))
        depth_m = plan.focus_m * log_uniform(rng, 0.9, 2.2)
        spot = placement.spot(uniform(rng, -0.9, 0.9), depth_m, uniform(rng, 0.0, 6.3))
        _dressed(rng, plan, "beast", character, spot, uniform(rng, 0.8, 2.0), checked=True)
    return placed


def _dressed(
    rng: np.random.Generator,
    plan: _Plan,
    name: str,
    character: Character,
    spot: Spot,
    scale_m: float,
    *,
    checked: bool,
) -> bool:
    """Put a character on the ground in materials of its own."""
    placement, materials = plan.placement, {}
    for made_of in sorted({part.material for part in character.parts}):
        look = CHARACTER_SURFACES[made_of](rng, plan.shares)
        broad = made_of in ("cloth", "cloak", "trousers", "fur")
        materials[made_of] = placement.new_material(
            rng, look.texture, (0.5 if broad else 0.2) * scale_m, spot.depth_m,
            size=256 if broad else 128, finish=look.finish,
        )  # fmt: skip
    return place_character(placement, name, character, materials, spot, scale_m, checked=checked)


def _lights(rng: np.random.Generator, config: SintelConfig, plan: _Plan) -> tuple[Light, ...]:
    """One sun, often low; sometimes a lamp that lightens the shadows of the people."""
    placement, d = plan.placement, plan.unit_m
    target = placement.spot(0.0, plan.focus_m).ground_m + np.array((0.0, 0.0, 0.5 * PERSON_M))
    lights: list[Light] = [sample_sun(rng, placement.pose)]
    lights += [sample_area_light(rng, placement.pose, target, d) for _ in range(integer(rng, *config.lamps))]
    return tuple(lights)


_REPLACEABLE = Replaceable(
    props=r"(rock|crag) .*", painted=r"ground|(rock|crag|column|ruin) .*|house .* walls"
)

FAMILY = Family("sintel", SintelConfig, sample_sintel, _REPLACEABLE)
