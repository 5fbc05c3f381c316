"""The kinds of landscapes that people walk in: mountains, snow, desert, bamboo, ruins, a small town."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenes.appearance.landscape_materials import plaster
from scenes.appearance.material_textures import (
    DESERT_ROCK,
    SNOWY,
    TextureSampler,
    culm,
    grains,
    ground,
    leaves,
    masonry,
    paving,
    rock,
    roofing,
)
from scenes.appearance.materials import Shares
from scenes.appearance.palettes import (
    DRY_GRASS,
    EARTH,
    HEATH,
    MOSS,
    PLASTER,
    RED_ROCK,
    ROCK,
    SAND,
    SNOW,
    PaletteRange,
)
from scenes.landscapes.foreground import (
    PropSampler,
    banner,
    crystals,
    outcrop,
    paling,
    smooth_boulder,
    trunk,
    vessel,
    wall_end,
)
from scenes.landscapes.ruins import add_colonnade, add_ruins
from scenes.landscapes.vegetation import VegetationArea, grass, plants, trees, undergrowth
from scenes.placement.ground import GroundPlacement
from scenes.random_draws import Count, Range, chance, choose, integer, new_seed, uniform
from scenes.shapes.nature.masonry import House
from scenes.shapes.nature.trees import Bamboo, Conifer, Palm, Tree


@dataclass(frozen=True)
class Site:
    """A place that is being furnished."""

    placement: GroundPlacement
    unit_m: float
    """Depths are in this unit."""
    shares: Shares
    stones: TextureSampler
    trees: Count
    structures: Count
    plants: Count

    @property
    def area(self) -> VegetationArea:
        """Where things grow: anywhere."""
        return VegetationArea(self.placement, self.unit_m)


@dataclass(frozen=True)
class Place:
    """A kind of landscape."""

    share: float
    """How many scenes are of this kind, relative to the others."""
    floor: TextureSampler
    stones: TextureSampler
    plain_floor: PaletteRange | None
    """Colours of a floor without structure; None where there is always some."""
    water: bool
    """Whether there may be a pond."""
    relief: Range
    """Height of the outermost hills, relative to half the land's side."""
    ridged: Range
    """0 rounded hills .. 1 sharp crests."""
    clearing: Range
    """Radius of the level middle, relative to half the land's side."""
    rockiness: float
    """Share of the configured number of rocks that this kind of landscape has."""
    furnish: Callable[[np.random.Generator, Site], None]


def _mountain(rng: np.random.Generator, site: Site) -> None:
    area = site.area
    _conifers(rng, site, [leaves(HEATH)] * 2)
    undergrowth(rng, area, integer(rng, *site.plants) // 2, [leaves(HEATH), leaves(DRY_GRASS)], (0.04, 0.14))
    grass(rng, area, integer(rng, *site.plants), (HEATH, DRY_GRASS), (0.04, 0.12))


def _snow(rng: np.random.Generator, site: Site) -> None:
    _conifers(rng, site, [leaves(HEATH), grains(SNOW)])
    if chance(rng, 0.5):
        _bare_trees(rng, site, integer(rng, 3, 9))
    if chance(rng, 0.3):
        _ruins_of(rng, site, integer(rng, *site.structures) // 2, ROCK)


def _desert(rng: np.random.Generator, site: Site) -> None:
    area = site.area
    if chance(rng, 0.7):
        _ruins_of(rng, site, integer(rng, *site.structures) // 2, SAND)
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
    grass(rng, area, integer(rng, *site.plants) // 2, (DRY_GRASS,), (0.04, 0.12))


def _bamboo(rng: np.random.Generator, site: Site) -> None:
    area = site.area
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
    count = 2 * integer(rng, *site.trees)
    scales = (7.0 / site.unit_m, 11.0 / site.unit_m)
    plants(rng, area, "bamboo", clumps, count, (0.9, 9.0), scales, [culm] * 3, sway=(0.005, 0.03), sunk=0.005)
    undergrowth(rng, area, integer(rng, *site.plants), [leaves(HEATH)] * 2, (0.04, 0.16))
    grass(rng, area, integer(rng, *site.plants) // 2, (HEATH, DRY_GRASS), (0.03, 0.1))
    if chance(rng, 0.5):
        _ruins_of(rng, site, 2, ROCK)


def _ruins(rng: np.random.Generator, site: Site) -> None:
    area, colors = site.area, choose(rng, (ROCK, SAND, RED_ROCK))
    _ruins_of(rng, site, integer(rng, *site.structures), colors)
    add_colonnade(rng, site.placement, site.unit_m, rock(colors))
    if chance(rng, 0.6):
        _bare_trees(rng, site, integer(rng, 2, 5))
    undergrowth(rng, area, integer(rng, *site.plants), [leaves(HEATH), leaves(MOSS)], (0.03, 0.13))
    grass(rng, area, integer(rng, *site.plants), (HEATH, DRY_GRASS), (0.03, 0.1))


def _town(rng: np.random.Generator, site: Site) -> None:
    """Houses along both sides of a street that leads away from the camera, a wall or tower at its end."""
    placement, d = site.placement, site.unit_m
    houses = [House.sample(rng) for _ in range(4)]
    coats = [plaster(rng, site.shares).texture for _ in range(4)]
    walls = [placement.new_material(rng, coat, 4.0, 1.6 * d, size=512) for coat in coats]
    roofs = [placement.new_material(rng, roofing, 3.0, 1.6 * d) for _ in range(3)]
    half_street_m = uniform(rng, 2.2, 4.5)
    for side in (-1, 1):
        along_m = uniform(rng, 0.1, 0.5) * d
        for index in range(integer(rng, *site.structures) // 2 + 2):
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
    _ruins_of(rng, site, integer(rng, 1, 4), choose(rng, (ROCK, SAND)), ruin=0.1)
    if chance(rng, 0.6):
        kinds = [replace(Tree.sample(rng), leaves=300)]
        trees(rng, site.area, kinds, integer(rng, 2, 5), (1.3, 8.0), (0.2, 0.35), [leaves(HEATH)])


def _ruins_of(
    rng: np.random.Generator, site: Site, count: int, colors: PaletteRange, ruin: float = 1.0
) -> None:
    stones = (masonry(colors), site.stones)
    add_ruins(rng, site.placement, site.unit_m, count, stones, site.shares, ruin)


def _conifers(rng: np.random.Generator, site: Site, foliage: Sequence[TextureSampler]) -> None:
    kinds = [
        replace(Conifer.sample(rng), whorls=integer(rng, 8, 11), branches=integer(rng, 5, 7))
        for _ in range(3)
    ]
    # A scale of one is a tree of one metre's radius at the foot.
    scales = (0.9 / site.unit_m, 2.4 / site.unit_m)
    trees(rng, site.area, kinds, integer(rng, *site.trees), (1.4, 16.0), scales, foliage)


def _bare_trees(rng: np.random.Generator, site: Site, count: int) -> None:
    kinds = [replace(Tree.sample(rng), leaves=0, crooked=uniform(rng, 0.1, 0.25)) for _ in range(3)]
    scales = (1.2 / site.unit_m, 3.0 / site.unit_m)
    trees(rng, site.area, kinds, count, (1.3, 8.0), scales, [leaves(HEATH)])


PLACES: dict[str, Place] = {
    "mountain": Place(
        0.2, ground(HEATH), rock(), None, True, (0.06, 0.26), (0.5, 1.0), (0.12, 0.32), 1.0, _mountain
    ),
    "snow": Place(0.17, grains(SNOW), SNOWY, SNOW, True, (0.06, 0.26), (0.4, 1.0), (0.12, 0.32), 0.8, _snow),
    "desert": Place(
        0.15, grains(SAND), DESERT_ROCK, SAND, True, (0.01, 0.07), (0.0, 0.5), (0.05, 0.2), 1.0, _desert
    ),
    "bamboo": Place(
        0.14, ground(DRY_GRASS), rock(), None, True, (0.03, 0.15), (0.2, 0.7), (0.1, 0.2), 0.5, _bamboo
    ),
    "ruins": Place(
        0.18, ground(HEATH), rock(), None, True, (0.02, 0.14), (0.2, 0.9), (0.1, 0.3), 0.6, _ruins
    ),
    "town": Place(
        0.16, paving, rock(ROCK, EARTH), PLASTER, False, (0.03, 0.16), (0.3, 0.9), (0.2, 0.4), 0.25, _town
    ),
}
WATERY = sum(place.share for place in PLACES.values() if place.water)
"""Share of the scenes whose place may have water."""
_STONY: dict[PropSampler, float] = {smooth_boulder: 2.0, outcrop: 2.0, banner: 1.0, paling: 1.0, vessel: 1.0}
NEAR: dict[str, dict[PropSampler, float]] = {
    "mountain": _STONY | {trunk: 1.0},
    "snow": _STONY | {crystals: 1.5, trunk: 1.0},
    "desert": _STONY | {wall_end: 1.0},
    "bamboo": _STONY | {paling: 3.0, trunk: 1.0},
    "ruins": _STONY | {wall_end: 2.0},
    "town": {wall_end: 3.0, banner: 2.0, paling: 2.0, vessel: 3.0},
}
"""What stands near the camera in a place, and how often."""
