"""Vegetation and stones on the ground: trees, undergrowth, grass, mushrooms, boulders.

Each function places a few shapes in a few materials at many spots, so that most objects share their meshes.
Depths and scales are in units of the area's `unit_m`, the distance of the scene's subject; where a spot is
not allowed, nothing is placed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from scenes.appearance.landscape_materials import cap, gloss_or_matte
from scenes.appearance.material_textures import TextureSampler, bark, horn, leaves
from scenes.appearance.materials import Shares
from scenes.appearance.palettes import FOLIAGE, PaletteRange
from scenes.placement.ground import GroundPlacement, Spot, sway_of
from scenes.random_draws import Range, choose, log_uniform, uniform
from scenes.shapes.anchored import PartedShape
from scenes.shapes.nature.landforms import Boulder
from scenes.shapes.nature.plants import GrassTuft, Mushroom, sample_undergrowth
from scenes.shapes.nature.rocks import Outcrop, Scree
from scenes.spec import Shape

T = TypeVar("T")

SpotFilter = Callable[[Spot], bool]


def anywhere(_: Spot) -> bool:
    """A filter that lets all spots through."""
    return True


@dataclass(frozen=True)
class VegetationArea:
    """The part of the ground that vegetation grows on."""

    placement: GroundPlacement
    unit_m: float
    contains: SpotFilter = anywhere
    """Whether a spot belongs to the area."""

    def spots(self, rng: np.random.Generator, count: int, depths: Range, spread: float) -> list[Spot]:
        """Random spots at depths in units of `unit_m`: of `count` draws those that belong to the area."""
        near, far = depths
        drawn = [
            self.placement.random_spot(rng, (near * self.unit_m, far * self.unit_m), spread)
            for _ in range(count)
        ]
        return [spot for spot in drawn if self.contains(spot)]


NO_SWAY_BEYOND = 2.2
"""Plants farther away than this many units do not sway: it would hardly be seen, and so they share meshes."""


def _pairings(rng: np.random.Generator, kinds: Sequence[T], materials: Sequence[int]) -> list[tuple[T, int]]:
    """Pairs of a kind and a material, each used at least once; few pairs, so that objects share meshes."""
    count = max(len(kinds), len(materials)) + 2
    order = rng.permutation(count)
    return [(kinds[k % len(kinds)], materials[int(order[k]) % len(materials)]) for k in range(count)]


def trees(
    rng: np.random.Generator,
    area: VegetationArea,
    kinds: Sequence[PartedShape],
    count: int,
    depths: Range,
    scales: Range,
    foliage: Sequence[TextureSampler],
    trunk: TextureSampler = bark,
) -> None:
    """Trees of a few kinds, their wood and leaves in materials of their own."""
    placement, unit_m = area.placement, area.unit_m
    seen_m = 1.6 * depths[0] * unit_m
    wood = [placement.new_material(rng, trunk, unit_m, seen_m) for _ in range(2)]
    green = [placement.new_material(rng, sampler, unit_m, seen_m) for sampler in foliage]
    pairs = [(kind, leaf, choose(rng, wood)) for kind, leaf in _pairings(rng, kinds, green)]
    for index, spot in enumerate(area.spots(rng, count, depths, 1.2)):
        kind, leaf, stem = choose(rng, pairs)
        materials = {"wood": stem, "leaves": leaf}
        placement.stand_in_parts(f"tree {index}", kind, materials, spot, log_uniform(rng, *scales) * unit_m)


def plants(
    rng: np.random.Generator,
    area: VegetationArea,
    name: str,
    kinds: Sequence[Shape],
    count: int,
    depths: Range,
    scales: Range,
    foliage: Sequence[TextureSampler],
    *,
    sway: Range = (0.01, 0.06),
    sunk: float = 0.02,
    spread: float = 1.2,
) -> None:
    """Plants of a few kinds; near ones sway by a share `sway` of their height.

    `sunk` is how deep they stand in the ground, relative to their scale; 0 is on the lowest ground under them.
    `spread` is the outermost image column.
    """
    placement, unit_m = area.placement, area.unit_m
    middle_m = math.sqrt(scales[0] * scales[1]) * unit_m
    green = [placement.new_material(rng, sampler, middle_m, 1.4 * depths[0] * unit_m) for sampler in foliage]
    pairs = _pairings(rng, kinds, green)
    for index, spot in enumerate(area.spots(rng, count, depths, spread)):
        (shape, material), scale_m = choose(rng, pairs), log_uniform(rng, *scales) * unit_m
        moves = spot.depth_m < NO_SWAY_BEYOND * unit_m
        motion = sway_of(rng, shape, uniform(rng, *sway)) if moves else None
        placement.stand(
            f"{name} {index}",
            shape,
            material,
            spot,
            scale_m,
            sunk_m=sunk * scale_m,
            deformation=motion,
            on_lowest=sunk == 0.0,
        )


def undergrowth(
    rng: np.random.Generator,
    area: VegetationArea,
    count: int,
    foliage: Sequence[TextureSampler],
    scales: Range = (0.12, 0.4),
) -> None:
    """Ferns, broad-leaved plants and bushes, six of them close to the camera."""
    kinds = [sample_undergrowth(rng) for _ in range(7)]
    low, high = scales
    plants(rng, area, "near plant", kinds[:3], 6, (0.5, 0.9), (0.6 * low, 0.6 * high), foliage[:2])
    plants(rng, area, "plant", kinds, count, (0.8, 6.0), scales, foliage)


def grass(
    rng: np.random.Generator,
    area: VegetationArea,
    count: int,
    colors: Sequence[PaletteRange] = (FOLIAGE,),
    scales: Range = (0.06, 0.2),
) -> None:
    """Swaying tufts of grass near the camera."""
    kinds = [GrassTuft.sample(rng) for _ in range(4)]
    foliage = [leaves(kind) for kind in colors]
    plants(
        rng,
        area,
        "grass",
        kinds,
        count,
        (0.6, 3.5),
        scales,
        foliage,
        sway=(0.02, 0.1),
        sunk=0.0,
        spread=1.1,
    )


def mushrooms(
    rng: np.random.Generator,
    area: VegetationArea,
    name: str,
    count: int,
    depths: Range,
    scales: Range,
    glow: float,
    shares: Shares,
) -> None:
    """Mushrooms of a few kinds; `glow` is the emission of their caps (`Material.emission`)."""
    placement, unit_m = area.placement, area.unit_m
    kinds = [Mushroom.sample(rng) for _ in range(5)]
    middle_m, seen_m = math.sqrt(scales[0] * scales[1]) * unit_m, 1.5 * depths[0] * unit_m
    pale = placement.new_material(rng, horn, middle_m, seen_m)
    looks = [cap(rng, shares) for _ in range(3)]
    caps = [
        placement.new_material(rng, look.texture, middle_m, seen_m, finish=look.finish, emission=glow)
        for look in looks
    ]
    pairs = _pairings(rng, kinds, caps)
    for index, spot in enumerate(area.spots(rng, count, depths, 1.1)):
        kind, top = choose(rng, pairs)
        materials = {"stem": pale, "cap": top}
        placement.stand_in_parts(f"{name} {index}", kind, materials, spot, log_uniform(rng, *scales) * unit_m)


def boulders(
    rng: np.random.Generator,
    area: VegetationArea,
    name: str,
    count: int,
    stones: Sequence[TextureSampler],
    shares: Shares,
    depths: Range = (0.7, 8.0),
    scales: Range = (0.04, 0.35),
    sunk: Range = (0.2, 0.6),
) -> None:
    """Boulders and bedded rocks, sunk into the ground by `sunk` relative to their scale."""
    placement, unit_m = area.placement, area.unit_m
    kinds: list[Shape] = [replace(Boulder.sample(rng), detail=3) for _ in range(3)]
    kinds += [Outcrop.sample(rng) for _ in range(2)]
    middle_m = math.sqrt(scales[0] * scales[1]) * unit_m
    finishes = [gloss_or_matte(rng, shares) for _ in stones]
    rocks = [
        placement.new_material(rng, sampler, middle_m, 1.8 * depths[0] * unit_m, finish=finish)
        for sampler, finish in zip(stones, finishes, strict=True)
    ]
    pairs = _pairings(rng, kinds, rocks)
    for index, spot in enumerate(area.spots(rng, count, depths, 1.15)):
        (shape, material), scale_m = choose(rng, pairs), log_uniform(rng, *scales) * unit_m
        sunk_m = scale_m * uniform(rng, *sunk)
        placement.stand(f"{name} {index}", shape, material, spot, scale_m, sunk_m=sunk_m, wades=True)


def scree(
    rng: np.random.Generator,
    area: VegetationArea,
    count: int,
    stones: TextureSampler,
    depths: Range = (0.3, 3.0),
    scales: Range = (0.1, 0.4),
) -> None:
    """Patches of small stones, which give plain ground structure near the camera."""
    placement, unit_m = area.placement, area.unit_m
    kinds = [Scree.sample(rng) for _ in range(3)]
    middle_m = math.sqrt(scales[0] * scales[1]) * unit_m
    rocks = [placement.new_material(rng, stones, middle_m, unit_m) for _ in range(2)]
    pairs = _pairings(rng, kinds, rocks)
    for index, spot in enumerate(area.spots(rng, count, depths, 1.1)):
        shape, material = choose(rng, pairs)
        scale_m = log_uniform(rng, *scales) * unit_m
        placement.stand(f"scree {index}", shape, material, spot, scale_m, on_lowest=True, wades=True)
