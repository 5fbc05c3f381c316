"""Things near the camera, beside its line of sight: plain ones, repeated ones, glossy and clear ones.

Networks take plain surfaces for sky where nothing plain is ever near, and lose their way along palings.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from scenes.appearance import landscape_materials as looks
from scenes.appearance.landscape_materials import Surface, plain, plain_or
from scenes.appearance.material_textures import TextureSampler, bark, leaves, rock, timber
from scenes.appearance.materials import Shares
from scenes.appearance.palettes import CLOTH, FOLIAGE, PLASTER, ROCK, VIVID
from scenes.placement.ground import GroundPlacement, Spot
from scenes.random_draws import Range, chance, choose, integer, log_uniform, new_seed, uniform
from scenes.shapes.nature.camp import Banner, Paling
from scenes.shapes.nature.gear import Turned, jar
from scenes.shapes.nature.landforms import Boulder
from scenes.shapes.nature.masonry import BlockWall
from scenes.shapes.nature.plants import BroadLeaves, Mushroom
from scenes.shapes.nature.rocks import Crystals, Outcrop
from scenes.shapes.nature.trees import Tree
from scenes.spec import Shape


@dataclass(frozen=True)
class Prop:
    """A thing that may stand near the camera."""

    shape: Shape
    looks: dict[str, Surface]
    """What its parts are made of, by their names; one for a shape of one material."""
    size: Range
    """Length of a unit of its built coordinates, relative to half the height of the image where it stands."""
    sunk: float = 0.05
    """How deep it stands in the ground, relative to that unit."""


PropSampler = Callable[[np.random.Generator, Shares], Prop]


def _one(shape: Shape, look: Surface, size: Range, sunk: float = 0.05) -> Prop:
    return Prop(shape, {"": look}, size, sunk)


def smooth_boulder(rng: np.random.Generator, shares: Shares) -> Prop:
    """A rounded boulder, plain in a share of the cases."""
    shape = replace(Boulder.sample(rng), roughness=0.004, facets=integer(rng, 3, 6), detail=4)
    look = Surface(plain_or(rng, shares, ROCK, rock()), looks.gloss_or_matte(rng, shares))
    return _one(shape, look, (0.25, 0.6), 0.5)


def outcrop(rng: np.random.Generator, shares: Shares) -> Prop:
    """Bedded rock."""
    return _one(Outcrop.sample(rng), Surface(rock(), looks.gloss_or_matte(rng, shares)), (0.25, 0.6), 0.1)


def wall_end(rng: np.random.Generator, shares: Shares) -> Prop:
    """The end of a plastered or painted wall, or one of hewn stones."""
    if chance(rng, 0.6):
        shape = BlockWall(1, integer(rng, 2, 3), uniform(rng, 1.5, 3.0), 0.6, 0.0, 0.0, 0.0, new_seed(rng))
        return _one(shape, looks.plaster(rng, shares), (0.4, 0.7))
    wall = replace(BlockWall.sample(rng), courses=integer(rng, 4, 7), stones=4, arc_deg=0.0)
    return _one(wall, Surface(rock()), (0.2, 0.35))


def vessel(rng: np.random.Generator, shares: Shares) -> Prop:
    """A jar of clay, glaze, metal or glass."""
    shape = Turned(jar(rng, uniform(rng, 1.0, 2.2)), sides=36)
    kind = choose(rng, ("clay", "metal", "glass"), (0.5, 0.25, 0.25))
    look = Surface(
        plain(VIVID if chance(rng, 0.4) else PLASTER), looks.gloss_or_matte(rng, shares, looks.GLOSSY)
    )
    if kind != "clay":
        look = looks.metal(rng, shares) if kind == "metal" else looks.glass(rng, shares)
    return _one(shape, look, (0.35, 0.9), 0.02)


def banner(rng: np.random.Generator, shares: Shares) -> Prop:
    """A hanging cloth."""
    return Prop(Banner.sample(rng), {"cloth": looks.cloth(rng, shares), "wood": Surface(timber)}, (1.1, 1.9))


def paling(rng: np.random.Generator, shares: Shares) -> Prop:
    """A fence, trellis or lattice, of raw or painted wood."""
    return _one(Paling.sample(rng), Surface(plain_or(rng, shares, CLOTH, timber)), (0.5, 1.0))


def trunk(rng: np.random.Generator, shares: Shares) -> Prop:  # noqa: ARG001
    """The trunk of a tree whose boughs are mostly above the image."""
    tree = replace(
        Tree.sample(rng), leaves=0, height=uniform(rng, 2.2, 3.2), thickness=uniform(rng, 0.14, 0.24)
    )
    return _one(tree, Surface(bark), (0.7, 1.1))


def crystals(rng: np.random.Generator, shares: Shares) -> Prop:
    """Clear or milky crystals, or ice."""
    return _one(Crystals.sample(rng), looks.glass(rng, shares), (0.4, 0.9), 0.03)


def toadstool(rng: np.random.Generator, shares: Shares) -> Prop:
    """A mushroom, its cap plain in a share of the cases."""
    stem = Surface(plain(PLASTER))
    return Prop(Mushroom.sample(rng), {"stem": stem, "cap": looks.cap(rng, shares)}, (0.35, 0.7), 0.03)


def broad_leaves(rng: np.random.Generator, shares: Shares) -> Prop:
    """Large leaves, waxy in a share of the cases."""
    look = Surface(_leaf(rng, shares), looks.gloss_or_matte(rng, shares))
    return _one(BroadLeaves.sample(rng), look, (0.5, 1.0))


def _leaf(rng: np.random.Generator, shares: Shares) -> TextureSampler:
    """Leaves of one green, or veined ones."""
    return plain_or(rng, shares, FOLIAGE, leaves())


def add_foreground(
    rng: np.random.Generator,
    placement: GroundPlacement,
    shares: Shares,
    kinds: dict[PropSampler, float],
    count: int,
    depths_m: Range,
) -> int:
    """Try for a number of things of the given kinds at depths in a range; returns how many found a place.

    They stand where the cameras and the line of sight to the main character stay free.
    """
    placed = 0
    for index in range(count):
        prop = choose(rng, list(kinds), list(kinds.values()))(rng, shares)
        for _ in range(6):
            depth_m = log_uniform(rng, *depths_m)
            right = choose(rng, (-1.0, 1.0)) * uniform(rng, 0.3, 1.1)
            spot = placement.spot(right, depth_m, uniform(rng, 0.0, 2 * math.pi))
            unit_m = uniform(rng, *prop.size) * placement.view.half_view[1] * depth_m
            if _stand(rng, placement, f"near {index}", prop, spot, unit_m):
                placed += 1
                break
    return placed


def _stand(
    rng: np.random.Generator, placement: GroundPlacement, name: str, prop: Prop, spot: Spot, unit_m: float
) -> bool:
    """Stand a thing on the lowest ground under it, so that no end of it hangs free."""
    box = placement.box_of(prop.shape, spot, unit_m, prop.sunk * unit_m)
    if placement.is_wet(spot) or not placement.allows(box):
        return False
    materials = {
        part: placement.new_material(rng, look.texture, unit_m, spot.depth_m, finish=look.finish)
        for part, look in prop.looks.items()
    }
    if list(materials) == [""]:
        sunk_m = prop.sunk * unit_m
        return placement.stand(name, prop.shape, materials[""], spot, unit_m, sunk_m=sunk_m, on_lowest=True)
    return placement.stand_in_parts(name, prop.shape, materials, spot, unit_m, on_lowest=True)  # type: ignore[arg-type]
