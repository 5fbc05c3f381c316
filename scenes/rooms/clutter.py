"""Small things: on tables, in shelves, on window sills and on the floor."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from scenes.random_draws import chance, choose, integer, uniform
from scenes.rooms.config import IndoorConfig
from scenes.rooms.interior import Interior, Placed
from scenes.shapes.indoor.books import BookRow, BookStack
from scenes.shapes.indoor.containers import Basket, Carton, Package
from scenes.shapes.indoor.devices import Laptop
from scenes.shapes.indoor.lamps import Lamp
from scenes.shapes.indoor.objects import PottedPlant, Tool, Toy
from scenes.shapes.indoor.parts import IndoorShape, Top
from scenes.shapes.indoor.storage import Rack, Shelf
from scenes.shapes.indoor.vessels import FruitBowl, Vessel

Sampler = Callable[[np.random.Generator], IndoorShape]


def _vessel(*kinds: str) -> Sampler:
    return lambda rng: Vessel.of(rng, choose(rng, kinds))


def _small_plant(rng: np.random.Generator) -> PottedPlant:
    pot = uniform(rng, 0.05, 0.09)
    return PottedPlant(
        pot, pot * uniform(rng, 2.2, 4.0), chance(rng, 0.45), integer(rng, 10, 20), int(rng.integers(2**53))
    )


_TABLEWARE = {_vessel("plate"): 2.0, _vessel("tumbler", "wineglass"): 2.0, _vessel("cup"): 1.5, _vessel("bowl"): 1.0,
              _vessel("bottle"): 1.0, FruitBowl.sample: 0.5, _vessel("candle"): 0.4, _vessel("jar"): 0.5}  # fmt: skip
_LIVING = {BookStack.sample: 2.0, _vessel("vase"): 1.2, _small_plant: 1.2, _vessel("cup", "tumbler"): 1.5,
           _vessel("candle"): 0.6, Toy.sample: 0.8, Laptop.sample: 0.4, Lamp.table: 0.4, FruitBowl.sample: 0.4,
           _vessel("bottle", "wineglass"): 0.7, Package.sample: 0.4}  # fmt: skip
_COOKING = {_vessel("pot"): 1.5, _vessel("jar"): 2.0, _vessel("bottle"): 1.5, Package.sample: 1.5,
            _vessel("bowl"): 1.0, _vessel("cup", "tumbler"): 1.5, FruitBowl.sample: 0.6,
            _small_plant: 0.5, _vessel("plate"): 0.8}  # fmt: skip
_WORKING = {BookStack.sample: 2.0, _vessel("cup", "tumbler"): 1.5, Laptop.sample: 0.8, _small_plant: 0.6,
            Lamp.table: 0.5, Package.sample: 1.0, _vessel("bottle"): 0.6, BookRow.sample: 0.8}  # fmt: skip
_MAKING = {Tool.sample: 4.0, _vessel("jar"): 1.0, Package.sample: 1.5, Carton.sample: 0.8, Basket.sample: 0.6,
           _vessel("cup", "bottle"): 0.6}  # fmt: skip
_STORED = {Carton.sample: 3.0, Package.sample: 2.0, Basket.sample: 1.5, _vessel("jar", "bottle"): 1.5, Tool.sample: 1.0,
           BookStack.sample: 0.6, _vessel("pot"): 0.5}  # fmt: skip

_BY_ROOM: dict[str, dict[Sampler, float]] = {
    "living room": _LIVING,
    "bedroom": _LIVING,
    "kitchen": _COOKING,
    "office": _WORKING,
    "workshop": _MAKING,
    "corridor": _LIVING,
    "store room": _STORED,
    "stairs": _LIVING,
}
_FLOOR: dict[Sampler, float] = {
    Carton.sample: 1.0,
    Toy.sample: 1.0,
    Basket.sample: 0.8,
    BookStack.sample: 0.6,
    Tool.sample: 0.4,
}


def add_things(rng: np.random.Generator, config: IndoorConfig, interior: Interior) -> None:
    """Fill shelves, then strew things over tops and over the floor, until there are as many as the config says."""
    left = integer(rng, *config.things)
    bases = [thing for thing in interior.placed if thing.shape.tops()]
    order = rng.permutation(len(bases)).tolist()
    for base in (bases[k] for k in order):
        if isinstance(base.shape, Shelf | Rack):
            for top in base.shape.tops():
                if left > 0 and chance(rng, 0.9):
                    left -= _fill_level(rng, interior, base, top)
    tops = [
        (base, top) for base in bases for top in base.shape.tops() if not isinstance(base.shape, Shelf | Rack)
    ]
    kinds = _BY_ROOM[interior.plan.kind]
    floor = integer(rng, 0, 5)
    for _ in range(floor):
        interior.try_on_floor(rng, "thing", choose(rng, list(_FLOOR), list(_FLOOR.values()))(rng), tries=5)
    if not tops:
        return
    areas = [max((t.high[0] - t.low[0]) * (t.high[1] - t.low[1]), 0.01) for _, t in tops]
    for _ in range(left):
        base, top = choose(rng, tops, areas)
        dishes = base.shape.__class__.__name__ == "Table" and interior.plan.kind in ("kitchen", "living room")
        menu = _TABLEWARE if dishes and chance(rng, 0.6) else kinds
        shape = choose(rng, list(menu), list(menu.values()))(rng)
        yaw = uniform(rng, 0.0, 2 * math.pi) if chance(rng, 0.5) else rng.normal(0.0, 0.3)
        interior.try_on(rng, "thing", shape, base, top, yaw=yaw, tries=4)


def _fill_level(rng: np.random.Generator, interior: Interior, base: Placed, top: Top) -> int:
    """Fill a shelf's level from left to right; returns how many things were put there."""
    stores = isinstance(base.shape, Rack) or interior.plan.kind in ("workshop", "store room", "kitchen")
    menu = _STORED if stores else {BookRow.sample: 5.0, **_LIVING}
    if interior.plan.kind == "kitchen":
        menu = _COOKING
    if interior.plan.kind == "office":
        menu = {BookRow.sample: 6.0, **_WORKING}
    x, count = top.low[0] + 0.01, 0
    while x < top.high[0] - 0.06:
        if chance(rng, 0.15):
            x += uniform(rng, 0.05, 0.25)
            continue
        shape = _fitted(rng, choose(rng, list(menu), list(menu.values()))(rng), top, top.high[0] - x)
        width = float(shape.frame.high[0] - shape.frame.low[0])
        if x + width > top.high[0]:
            x += 0.08
            continue
        slot = Top((x, top.low[1]), (x + width + 0.001, top.high[1]), top.z, top.headroom)
        if interior.try_on(rng, "thing", shape, base, slot, yaw=0.0, tries=2) is not None:
            x += width + uniform(rng, 0.004, 0.06)
            count += 1
        else:
            x += 0.08
    return count


def _fitted(rng: np.random.Generator, shape: IndoorShape, top: Top, room: float) -> IndoorShape:
    """A row of books made to fit its shelf; other things as they are."""
    if not isinstance(shape, BookRow):
        return shape
    deep = min(shape.depth, top.high[1] - top.low[1] - 0.01)
    return BookRow(
        min(uniform(rng, 0.15, 0.7), room - 0.005), min(shape.height, top.headroom - 0.01), deep, shape.seed
    )
