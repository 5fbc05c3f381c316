"""Ruins on the ground: walls, towers, arches, steps, columns, statues, colonnades."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from scenes.appearance.landscape_materials import gloss_or_matte
from scenes.appearance.material_textures import TextureSampler
from scenes.appearance.materials import Shares
from scenes.landscapes.people import sample_person, statue
from scenes.placement.ground import GroundPlacement, Spot
from scenes.random_draws import chance, choose, integer, new_seed, uniform
from scenes.shapes.nature.masonry import Archway, BlockWall, Column, Steps

_COURSES_M = 6.0
"""Most that a texture of masonry, of about 20 courses, spans."""


def add_ruins(
    rng: np.random.Generator,
    placement: GroundPlacement,
    unit_m: float,
    count: int,
    samplers: tuple[TextureSampler, TextureSampler],
    shares: Shares,
    ruin: float = 1.0,
) -> None:
    """Walls, towers, arches, steps, columns and a statue, here and there.

    Distances are in units of `unit_m`. `samplers` are of dressed and of hewn stone; `ruin` scales their decay.
    """
    d, (dressed, hewn_stone) = unit_m, samplers
    masonry_materials = [
        placement.new_material(rng, dressed, 3.0, 1.5 * d, size=512, largest_m=_COURSES_M) for _ in range(2)
    ]
    hewn = placement.new_material(rng, hewn_stone, 2.0, 1.2 * d, size=512, finish=gloss_or_matte(rng, shares))
    for index in range(count):
        kind = choose(rng, (BlockWall, Archway, Steps, Column, "statue"), (0.3, 0.25, 0.12, 0.2, 0.13))
        spot = placement.random_spot(rng, (0.6 * d, 6.0 * d), 1.1)
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
    """A column, one time in four lying on the ground."""
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
    character = statue(rng, sample_person(rng, 30))
    body = replace(facing, ground_m=facing.ground_m + np.array((0.0, 0.0, 0.98 * block_m)))
    upright = replace(facing, heading_rad=facing.heading_rad + math.pi / 2)
    box = placement.box_of(character, body, scale_m)
    if placement.allows(box) and placement.stand(f"{name} plinth", plinth, material, upright, block_m):
        placement.stand(f"{name} statue", character, material, body, scale_m, checked=False)


def add_colonnade(
    rng: np.random.Generator, placement: GroundPlacement, unit_m: float, stone: TextureSampler
) -> None:
    """Two rows of columns of one kind, some broken, that lead away from the camera or across the view."""
    d = unit_m
    material = placement.new_material(rng, stone, 2.0, 1.2 * d)
    whole = replace(Column.sample(rng), broken=0.0)
    kinds = [whole, *(replace(whole, broken=uniform(rng, 0.2, 0.8), seed=new_seed(rng)) for _ in range(3))]
    height_m, gap_m, row_m = uniform(rng, 3.5, 7.0), uniform(rng, 2.0, 3.5), uniform(rng, 2.5, 5.0)
    turn = Rotation.from_euler("Z", float(rng.normal(0.0, 0.5))).as_matrix()[:2, :2]
    origin = np.array((uniform(rng, -1.0, 1.0), uniform(rng, 0.7, 1.5) * d))
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
