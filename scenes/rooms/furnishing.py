"""What stands in which room, by rules: first what every room of its kind has, then more of what fits."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from scenes.random_draws import chance, choose, integer, uniform
from scenes.rooms.config import IndoorConfig
from scenes.rooms.interior import Extent, Interior, Placed, extent_of
from scenes.shapes.indoor import (
    containers,
    devices,
    fixtures,
    lamps,
    objects,
    seating,
    stairs,
    storage,
    tables,
)
from scenes.shapes.indoor.parts import IndoorShape
from scenes.shapes.indoor.shell import Pillar, RoomSlab
from scenes.shapes.indoor.stairs import Railing, Stairs

Furnish = Callable[[np.random.Generator, Interior], object]
_IN_FRONT = 0.04
"""How far a chair's seat stays from the table's edge, metres."""


def furnish(rng: np.random.Generator, config: IndoorConfig, interior: Interior) -> None:
    """Furnish a room of its plan's kind."""
    essentials, extras = _PROGRAMMES[interior.plan.kind]
    for add in essentials:
        add(rng, interior)
    kinds, weights = list(extras), list(extras.values())
    for _ in range(integer(rng, *config.furniture)):
        choose(rng, kinds, weights)(rng, interior)


def _at_wall(name: str, sample: Callable[[np.random.Generator], IndoorShape]) -> Furnish:
    def add(rng: np.random.Generator, interior: Interior) -> Placed | None:
        return interior.try_at_wall(rng, name, sample(rng))

    return add


def _free(name: str, sample: Callable[[np.random.Generator], IndoorShape]) -> Furnish:
    def add(rng: np.random.Generator, interior: Interior) -> Placed | None:
        return interior.try_on_floor(rng, name, sample(rng))

    return add


def _on_wall(
    name: str, sample: Callable[[np.random.Generator], IndoorShape], low_m: float, high_m: float
) -> Furnish:
    """Something that hangs on a wall, its middle between two heights."""

    def add(rng: np.random.Generator, interior: Interior) -> Placed | None:
        return interior.try_at_wall(rng, name, sample(rng), z=uniform(rng, low_m, high_m))

    return add


def _chairs_around(rng: np.random.Generator, interior: Interior, table: Placed) -> None:
    """Chairs of one kind on the sides of a table, some pulled out."""
    shape = table.shape
    assert isinstance(shape, tables.Table)
    chair = seating.Chair.sample(rng)
    w, d, seat = shape.width / 2, shape.depth / 2, chair.width / 2
    if shape.round:
        angles = np.arange(4) * math.pi / 2
        sides = [(w * math.cos(a), w * math.sin(a), a + math.pi / 2) for a in angles.tolist()]
    else:
        along = [0.0] if w < 0.65 else [-0.45 * w, 0.45 * w]
        sides = [(x, side * d, 0.0 if side < 0 else math.pi) for side in (-1.0, 1.0) for x in along]
        sides += [(side * w, 0.0, -side * -math.pi / 2) for side in (-1.0, 1.0)]
    for x, y, yaw in sides:
        if not chance(rng, 0.75):
            continue
        under = -0.1 if shape.stand in ("legs", "tapered") else 0.0
        out = seat + (uniform(rng, 0.0, 0.3) if chance(rng, 0.4) else under + uniform(rng, _IN_FRONT, 0.12))
        # A chair faces +y of its own; here it faces the table.
        away = np.array((math.sin(yaw), -math.cos(yaw)))
        place = interior.to_world(table, x + out * away[0], y + out * away[1])
        interior.try_near(rng, "chair", chair, place, table.yaw + yaw + rng.normal(0.0, 0.12), besides=table)


def _dining(rng: np.random.Generator, interior: Interior) -> None:
    table = interior.try_on_floor(rng, "table", tables.Table.dining(rng), straight=True, tries=25)
    if table is not None:
        _chairs_around(rng, interior, table)


def _sitting(rng: np.random.Generator, interior: Interior) -> None:
    """A sofa at a wall, a low table on a rug before it, an armchair beside."""
    sofa = interior.try_at_wall(rng, "sofa", seating.Sofa.sample(rng), out=uniform(rng, 0.02, 0.3), tries=25)
    if sofa is None:
        return
    depth = float(
        sofa.extent.high[1 - round(sofa.yaw / (math.pi / 2)) % 2]
        - sofa.extent.low[1 - round(sofa.yaw / (math.pi / 2)) % 2]
    )
    before = interior.to_world(sofa, uniform(rng, -0.3, 0.3), depth + uniform(rng, 0.65, 0.95))
    if chance(rng, 0.65):
        rug = fixtures.Rug.sample(rng)
        if _inside(interior, rug, before, sofa.yaw):
            interior.put(rng, "rug", rug, (*before, 0.0), sofa.yaw, solid=False)
    interior.try_near(rng, "table", tables.Table.low(rng), before, sofa.yaw + choose(rng, [0.0, 0.0, 0.2]))
    for side in (-1.0, 1.0):
        if chance(rng, 0.45):
            aside = interior.to_world(sofa, side * uniform(rng, 1.6, 2.2), depth + uniform(rng, 0.3, 1.3))
            armchair = seating.Sofa(
                1, 0.95, 0.85, uniform(rng, 0.75, 0.9), 0.15, choose(rng, ["fabric", "leather"]), 0
            )
            interior.try_near(rng, "armchair", armchair, aside, sofa.yaw + side * uniform(rng, 1.2, 2.0))


def _inside(interior: Interior, shape: IndoorShape, place: tuple[float, float], yaw: float) -> bool:
    extent = extent_of(shape, (*place, 0.0), yaw)
    room = (interior.plan.width, interior.plan.depth)
    return bool((extent.low[:2] > 0.02).all() and (extent.high[:2] < np.array(room) - 0.02).all())


def _rug(rng: np.random.Generator, interior: Interior) -> None:
    rug = fixtures.Rug.sample(rng)
    for _ in range(6):
        place = (uniform(rng, 0.0, interior.plan.width), uniform(rng, 0.0, interior.plan.depth))
        yaw = choose(rng, [0.0, math.pi / 2, uniform(rng, 0.0, math.pi)])
        extent = extent_of(rug, (*place, 0.0), yaw)
        if _inside(interior, rug, place, yaw) and interior.meets_none(extent):
            interior.put(rng, "rug", rug, (*place, 0.0), yaw, solid=False)
            return


def _television(rng: np.random.Generator, interior: Interior) -> None:
    board = interior.try_at_wall(rng, "sideboard", storage.Cabinet.sideboard(rng), tries=20)
    if board is None or not board.shape.tops():
        return
    interior.try_on(rng, "television", devices.Screen.television(rng), board, board.shape.tops()[0], yaw=0.0)


def _desk(rng: np.random.Generator, interior: Interior) -> None:
    shape = tables.Desk.sample(rng)
    desk = interior.try_at_wall(rng, "desk", shape, tries=16)
    if desk is None:
        return
    (top,) = shape.tops()
    middle = uniform(rng, -0.15, 0.15)
    for k in range(choose(rng, [1, 1, 2])):
        screen = devices.Screen.sample(rng)
        x, y = interior.to_world(desk, middle + k * 0.72 - 0.1, 0.2)
        place = (x, y, top.z)
        extent = extent_of(screen, place, desk.yaw)
        inside = abs(middle + k * 0.72 - 0.1) + screen.width / 2 < shape.width / 2
        if inside and interior.meets_none(extent, desk):
            interior.put(rng, "screen", screen, place, desk.yaw, base=desk)
    keys = interior.to_world(desk, middle - 0.1, shape.depth - 0.2)
    interior.put(rng, "keyboard", devices.Keyboard.sample(rng), (*keys, top.z), desk.yaw, base=desk)
    seat = interior.to_world(desk, middle, shape.depth + uniform(rng, 0.1, 0.5))
    chair = seating.OfficeChair.sample(rng) if chance(rng, 0.75) else seating.Chair.sample(rng)
    interior.try_near(rng, "chair", chair, seat, desk.yaw + math.pi + rng.normal(0.0, 0.4), besides=desk)


def _bed(rng: np.random.Generator, interior: Interior) -> None:
    bed = interior.try_at_wall(rng, "bed", seating.Bed.sample(rng), tries=30)
    if bed is None:
        return
    assert isinstance(bed.shape, seating.Bed)
    for side in (-1.0, 1.0):
        table = storage.Cabinet(
            0.42, 0.36, uniform(rng, 0.4, 0.6), 1, choose(rng, [1, 2]), "knob", "wood", "wood", 0.06, False
        )
        spot = interior.to_world(bed, side * (bed.shape.width / 2 + 0.3), 0.01)
        stand = interior.try_near(rng, "sideboard", table, spot, bed.yaw)
        if stand is not None and chance(rng, 0.7):
            interior.try_on(rng, "lamp", lamps.Lamp.table(rng), stand, table.tops()[0], yaw=0.0)


def _kitchen_row(rng: np.random.Generator, interior: Interior) -> None:
    row = storage.KitchenRow.sample(rng)
    low = storage.KitchenRow(3, 0, 2, False, row.front, row.stretch)
    for shape in (row, replace(row, upper=False), low):
        if interior.try_at_wall(rng, "kitchen", shape, tries=20) is not None:
            break
    interior.try_at_wall(rng, "fridge", storage.Fridge.sample(rng), tries=20)


def _workbench(rng: np.random.Generator, interior: Interior) -> None:
    bench = interior.try_at_wall(rng, "workbench", tables.Workbench.sample(rng), tries=20)
    if bench is not None and chance(rng, 0.8):
        shape = fixtures.PegBoard.sample(rng)
        x, y = interior.to_world(bench, 0.0, 0.0)
        place = (x, y, uniform(rng, 1.5, 1.7))
        if interior.is_free(extent_of(shape, place, bench.yaw)):
            interior.put(rng, "pegboard", shape, place, bench.yaw)


def _racks(rng: np.random.Generator, interior: Interior) -> None:
    """Equal racks side by side along walls."""
    shape = storage.Rack.sample(rng)
    for _ in range(integer(rng, 2, 6)):
        interior.try_at_wall(rng, "rack", shape)


def _bookshelves(rng: np.random.Generator, interior: Interior) -> None:
    shape = storage.Shelf.sample(rng)
    for _ in range(choose(rng, [1, 1, 2, 3])):
        interior.try_at_wall(rng, "shelf", shape)


def _ceiling_lamps(rng: np.random.Generator, interior: Interior) -> None:
    """One lamp in the middle, or a row or grid of equal ones in a large room."""
    lamp, plan = lamps.CeilingLamp.sample(rng), interior.plan
    large = plan.kind in ("office", "workshop", "corridor", "store room") or lamp.form in ("tube", "panel")
    spacing = uniform(rng, 1.8, 2.6) if large else 9.0
    columns, rows = max(1, round(plan.width / spacing)), max(1, round(plan.depth / spacing))
    yaw = choose(rng, [0.0, math.pi / 2])
    for i in range(columns):
        for j in range(rows):
            place = ((i + 0.5) * plan.width / columns, (j + 0.5) * plan.depth / rows, plan.height)
            extent = extent_of(lamp, place, yaw)
            if interior.is_free(Extent(extent.low, extent.high - (0.0, 0.0, 0.01))):
                interior.put(rng, "ceiling lamp", lamp, place, yaw)


def _stairs(rng: np.random.Generator, interior: Interior) -> None:
    """A flight along the wall x = 0 that leads up to a gallery along the wall y = 0."""
    plan = interior.plan
    stairs = Stairs.up_to(rng, plan.height / 2 + uniform(rng, 0.0, 0.15))
    stairs = replace(stairs, tread=min(stairs.tread, (plan.depth - 1.7) / stairs.steps))
    level = stairs.steps * stairs.rise
    # The flight's own x axis runs along the wall, towards -y of the room; its railing is towards the room.
    interior.put(rng, "stairs", stairs, (0.0, 1.24 + stairs.length, 0.0), -math.pi / 2)
    gallery = RoomSlab(plan.width - 0.5, 0.7, "floor")
    interior.put(rng, "gallery", gallery, (0.25, 0.25, level), 0.0)
    rail = plan.width - stairs.width - 0.1
    if rail > 0.8:
        shape = Railing(rail, uniform(rng, 0.9, 1.05), uniform(rng, 0.08, 0.13))
        place = (stairs.width + 0.05 + rail / 2, 1.16, level)
        interior.put(rng, "railing", shape, place)


def _pipes(rng: np.random.Generator, interior: Interior) -> None:
    z = interior.plan.height - uniform(rng, 0.1, 0.5)
    shape = fixtures.Pipes.sample(rng)
    down = replace(shape, drop=z if shape.drop else 0.0)
    interior.try_at_wall(rng, "pipes", down, z=z)


def _pillar(rng: np.random.Generator, interior: Interior) -> None:
    shape = Pillar.sample(rng)
    whole = Pillar(shape.width, shape.depth, interior.plan.height, shape.disc)
    interior.try_on_floor(rng, "pillar", whole, straight=True)


def _radiator(rng: np.random.Generator, interior: Interior) -> None:
    """Under a window if there is one."""
    plan, shape = interior.plan, fixtures.Radiator.sample(rng)
    windows = [o for o in plan.openings if not o.door and o.hole[2] > shape.height + 0.2]
    if windows and chance(rng, 0.8):
        opening = choose(rng, windows)
        place, yaw = (*plan.at_wall(opening.wall, opening.middle), 0.0), plan.yaw(opening.wall)
        if interior.is_free(extent_of(shape, place, yaw)):
            interior.put(rng, "radiator", shape, place, yaw)
        return
    interior.try_at_wall(rng, "radiator", shape)


_picture = _on_wall("picture", fixtures.WallPicture.sample, 1.35, 1.75)
_mirror = _on_wall("mirror", fixtures.WallMirror.sample, 1.25, 1.55)
_plate = _on_wall("plate", fixtures.WallPlate.sample, 1.0, 2.1)
_notices = _on_wall(
    "picture",
    lambda rng: fixtures.WallPicture(uniform(rng, 0.2, 0.5), uniform(rng, 0.28, 0.6), 0.0),
    1.3,
    1.7,
)
_sideboard = _at_wall("sideboard", storage.Cabinet.sideboard)
_wardrobe = _at_wall("wardrobe", storage.Cabinet.wardrobe)
_rack = _at_wall("rack", storage.Rack.sample)
_plant = _free("plant", objects.PottedPlant.sample)
_floor_lamp = _free("lamp", lamps.Lamp.floor)
_chair = _free("chair", seating.Chair.sample)
_stool = _free("stool", seating.Stool.sample)
_armchair = _free(
    "armchair",
    lambda rng: seating.Sofa(
        1, 0.95, 0.85, uniform(rng, 0.75, 0.9), 0.15, choose(rng, ["fabric", "leather"]), 0
    ),
)
_table = _free("table", tables.Table.low)
_bench_table = _free("table", tables.Table.dining)
_carton = _free("carton", containers.Carton.sample)
_basket = _free("basket", containers.Basket.sample)
_toy = _free("toy", objects.Toy.sample)
_reel = _free("tool", objects.Tool.sample)
_free_railing = _free("railing", stairs.Railing.sample)

_PROGRAMMES: dict[str, tuple[tuple[Furnish, ...], dict[Furnish, float]]] = {
    "living room": (
        (_radiator, _sitting, _television, _bookshelves, _ceiling_lamps),
        {_dining: 0.5, _bookshelves: 1.2, _sideboard: 1, _plant: 1.2, _floor_lamp: 0.8, _armchair: 0.6, _picture: 3,
         _mirror: 0.6, _plate: 0.8, _table: 0.6, _basket: 0.5, _toy: 1, _rug: 0.6, _chair: 0.5, _desk: 0.3,
         _radiator: 0.3},
    ),
    "bedroom": (
        (_radiator, _bed, _wardrobe, _ceiling_lamps),
        {_sideboard: 1.2, _wardrobe: 0.8, _desk: 0.8, _picture: 2.5, _mirror: 1.2, _plant: 0.8, _chair: 0.8, _rug: 1,
         _toy: 1.2, _basket: 1, _floor_lamp: 0.6, _bookshelves: 0.8, _plate: 0.8, _carton: 0.4},
    ),
    "kitchen": (
        (_kitchen_row, _dining, _radiator, _ceiling_lamps),
        {_dining: 0.6, _stool: 1, _chair: 0.6, _sideboard: 0.8, _bookshelves: 0.5, _plant: 0.6,
         _picture: 1.2, _plate: 1.2, _basket: 1, _carton: 0.4, _rug: 0.3},
    ),
    "office": (
        (_radiator, _desk, _desk, _ceiling_lamps),
        {_desk: 2.5, _bookshelves: 1.5, _wardrobe: 0.8, _sideboard: 1, _plant: 1, _picture: 1.2, _notices: 1.2,
         _plate: 1, _dining: 0.7, _carton: 0.6, _chair: 0.5, _floor_lamp: 0.3, _pillar: 0.3},
    ),
    "workshop": (
        (_workbench, _rack, _ceiling_lamps, _pipes),
        {_workbench: 1, _rack: 1, _bench_table: 1, _stool: 1, _carton: 1, _basket: 1, _reel: 1.5, _pipes: 1, _plate: 1,
         _notices: 1, _wardrobe: 0.8, _pillar: 0.4, _free_railing: 0.6, _radiator: 0.4},
    ),
    "corridor": (
        (_ceiling_lamps, _pipes),
        {_picture: 2, _plate: 2, _notices: 1.5, _sideboard: 1, _wardrobe: 0.6, _chair: 0.8, _plant: 0.8, _radiator: 1,
         _pipes: 0.6, _mirror: 0.6, _carton: 0.6, _bookshelves: 0.5, _rug: 0.4},
    ),
    "store room": (
        (_racks, _ceiling_lamps, _pipes),
        {_racks: 0.6, _rack: 1, _bookshelves: 0.8, _carton: 3, _basket: 2, _reel: 1, _wardrobe: 0.5, _stool: 0.6,
         _pipes: 0.6, _plate: 0.8, _chair: 0.5, _bench_table: 0.4, _free_railing: 0.3},
    ),
    "stairs": (
        (_stairs, _ceiling_lamps, _radiator),
        {_picture: 3, _plate: 1.5, _plant: 1.2, _sideboard: 1, _chair: 0.8, _mirror: 0.8, _bookshelves: 0.6, _rug: 0.8,
         _free_railing: 0.5, _carton: 0.3, _floor_lamp: 0.4},
    ),
}  # fmt: skip
"""For each kind of room what it has, and what more it may have, with weights."""
