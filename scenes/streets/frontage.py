"""What lines a street: rows of houses by district, gardens, fences, the skyline behind them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenes.appearance import street_materials, vehicle_materials
from scenes.appearance.materials import Shares
from scenes.placement.assembly import Assembly
from scenes.random_draws import Range, chance, choose, integer, new_seed, uniform
from scenes.shapes.anchored import MetricShape
from scenes.shapes.street.boundaries import Fence, Hedge
from scenes.shapes.street.buildings import (
    NOMINAL_BAY_M,
    CityBlock,
    HouseDesign,
    HouseRoof,
    HouseTrim,
    HouseWalls,
    HouseWindows,
    ShopFront,
)
from scenes.shapes.street.road import Course
from scenes.shapes.street.roadside_plants import Shrub
from scenes.shapes.street.shops import ShopGoods, ShopPanes, ShopRoom
from scenes.streets.along_course import add_in_spans, on_course
from scenes.streets.config import DrivingConfig


@dataclass(frozen=True)
class District:
    """A kind of street side."""

    share: float
    """How many street sides are of this kind, relative to the others."""
    houses: tuple[str, ...]
    """Kinds of `HouseDesign`; none for open land."""
    setback_m: Range
    """Depth of the front gardens."""
    gap_m: Range
    """Between houses."""
    plastered: float
    """Share of walls that are plaster, not brick."""
    trees: float
    """How many of the sides have a row of trees on the pavement."""
    boundary: tuple[str, ...] = ()
    """What may stand between pavement and garden: styles of `Fence`, or "hedge"."""


DISTRICTS: dict[str, District] = {
    "centre": District(0.24, ("city",), (0.0, 0.0), (0.06, 0.06), 0.6, 0.35),
    "offices": District(0.12, ("office", "city"), (0.0, 4.0), (0.06, 8.0), 0.8, 0.5),
    "terraces": District(
        0.24, ("terrace",), (0.0, 3.5), (0.06, 0.06), 0.35, 0.25, ("railing", "wall", "hedge", "picket")
    ),
    "suburb": District(
        0.2,
        ("detached", "terrace"),
        (3.0, 8.0),
        (2.5, 9.0),
        0.5,
        0.4,
        ("hedge", "picket", "wall", "boards", "mesh"),
    ),
    "works": District(
        0.08, ("hall", "office"), (2.0, 10.0), (4.0, 14.0), 0.5, 0.15, ("mesh", "boards", "wall")
    ),
    "park": District(0.12, (), (6.0, 12.0), (0.0, 0.0), 0.0, 0.9, ("railing", "hedge", "wall", "mesh")),
}


@dataclass(frozen=True)
class Opening:
    """Where a side street joins."""

    s_m: float
    """Of its middle."""
    half_road_m: float
    half_m: float
    """Half its width with its pavements."""


@dataclass(frozen=True)
class Side:
    """One side of the street in street coordinates; `sign` is 1 on the left, -1 on the right."""

    sign: float
    district: District
    kerb_m: float
    """Distance of the kerb from the street's middle."""
    edge_m: float
    """Distance of the pavement's far edge."""
    front_m: float
    """Distance of the house fronts."""
    parking: bool
    """Whether a parking lane runs along the kerb."""
    name: str
    """What its things are told apart by: L, R; for side streets more letters."""
    openings: tuple[Opening, ...] = ()

    def is_open(self, s_m: float, reach_m: float) -> bool:
        """Whether what reaches `reach_m` to both sides of s would stand in the mouth of a side street."""
        return any(abs(s_m - opening.s_m) < opening.half_m + reach_m for opening in self.openings)

    def stretches(self, start_m: float, end_m: float, *, of_kerb: bool = False) -> list[tuple[float, float]]:
        """From and to s of what lies between the openings, up to the road for kerbs, else up to the pavements."""
        edges = [start_m]
        for opening in self.openings:
            half = opening.half_road_m if of_kerb else opening.half_m
            edges += [opening.s_m - half, opening.s_m + half]
        edges.append(end_m)
        pieces = zip(edges[::2], edges[1::2], strict=True)
        within = [(max(low, start_m), min(high, end_m)) for low, high in pieces]
        return [(low, high) for low, high in within if high > low]

    def turn_deg(self) -> float:
        """Rotation at which a thing's y axis points away from the street, degrees."""
        return 0.0 if self.sign > 0 else 180.0


@dataclass(frozen=True)
class _Style:
    """A house design, built once, with the materials of all parts but the walls."""

    design: HouseDesign
    walls: HouseWalls
    parts: tuple[tuple[str, MetricShape, int], ...]


def add_houses(
    rng: np.random.Generator,
    scene: Assembly,
    config: DrivingConfig,
    course: Course,
    side: Side,
    start_m: float,
    lit: float,
) -> None:
    """A row of houses along one side, of a few designs, each house with its own wall."""
    district = side.district
    if not district.houses:
        return
    walls = [
        scene.material(street_materials.wall(rng, district.plastered, config.shares))
        for _ in range(integer(rng, 2, 3))
    ]
    styles = [_sample_style(rng, scene, config.shares, district, lit) for _ in range(integer(rng, 2, 3))]
    gap_m = uniform(rng, *district.gap_m)
    s, number = start_m + uniform(rng, 0.0, 8.0), 0
    while True:
        style = choose(rng, styles)
        step_m, back_m = _room_for(course, side, s, style.design)
        if s + step_m > course.end_m - 4.0:
            return
        if side.is_open(s + step_m / 2, step_m / 2):
            s = max(opening.s_m + opening.half_m for opening in side.openings) + 0.05
            continue
        _add_house(
            scene,
            f"house {side.name}{number}",
            style,
            choose(rng, walls),
            course,
            side,
            s + step_m / 2,
            back_m,
        )
        s += step_m + gap_m * (uniform(rng, 0.6, 1.4) if gap_m > 1.0 else 1.0)
        number += 1


def _room_for(course: Course, side: Side, s_m: float, design: HouseDesign) -> tuple[float, float]:
    """How much of the street a house needs, and how far its straight front must stand back from a bend."""
    ahead = np.linspace(s_m, s_m + 1.6 * design.width, 12)
    curvature = np.gradient(course.heading(ahead), ahead)
    # The street's length at a distance from its middle, for each metre along its middle.
    front = 1 - curvature * side.sign * side.front_m
    back = 1 - curvature * side.sign * (side.front_m + design.depth + 1.0)
    step_m = (design.width + 0.06) / float(min(front.min(), back.min()))
    return step_m, float(np.abs(curvature).max()) * design.width**2 / 8


def _sample_style(
    rng: np.random.Generator, scene: Assembly, shares: Shares, district: District, lit: float
) -> _Style:
    design = HouseDesign.sample(rng, choose(rng, district.houses))
    frame = choose(rng, street_materials.WINDOW_FRAMES)
    windows = street_materials.windows(rng, design.opening, design.sill, NOMINAL_BAY_M, frame, lit)
    upper = scene.material(windows)
    parts: list[tuple[str, MetricShape, int]] = [
        ("trim", HouseTrim(design), scene.material(street_materials.trim(rng))),
        ("roof", HouseRoof(design), scene.material(street_materials.roof(rng))),
    ]
    if design.shop and not design.sides and chance(rng, shares.transparent):
        parts += _open_shop(rng, scene, design, lit)
    else:
        ground = scene.material(street_materials.shop_window(rng, lit)) if design.shop else upper
        parts.append(("ground floor windows", HouseWindows(design, ground=True), ground))
    if design.floors > 1:
        parts.append(("windows", HouseWindows(design, ground=False), upper))
    if design.shop:
        front = replace(ShopFront.sample(rng), width=design.width, height=design.ground_floor - 0.72)
        parts.append(("shop front", front, scene.material(street_materials.shop_board(rng))))
    return _Style(design, HouseWalls(design), tuple(parts))


def _open_shop(
    rng: np.random.Generator, scene: Assembly, design: HouseDesign, lit: float
) -> list[tuple[str, MetricShape, int]]:
    """Shops that one sees into: panes, rooms, goods."""
    return [
        ("panes", ShopPanes(design), scene.material(vehicle_materials.clear_glass(rng))),
        ("shop", ShopRoom(design, integer(rng, 1, 3)), scene.material(street_materials.shop_room(rng, lit))),
        *(
            (
                f"goods {kind}",
                ShopGoods(design, new_seed(rng)),
                scene.material(street_materials.shop_goods(rng, lit)),
            )
            for kind in range(2)
        ),
    ]


def _add_house(
    scene: Assembly,
    name: str,
    style: _Style,
    wall: int,
    course: Course,
    side: Side,
    s_m: float,
    back_m: float,
) -> None:
    design = style.design
    parts = [("walls", style.walls, wall), *style.parts]
    t = side.sign * (side.front_m + back_m)
    # The design's origin is the front's end; the place asked for is its middle.
    middle = course.point(s_m, t)
    along = course.facing(s_m, side.turn_deg()).apply((design.width / 2, 0.0, 0.0))[:2]
    (origin_s, origin_t) = course.locate((middle - along)[None])[0]
    turn = side.turn_deg() + float(np.degrees(course.heading(s_m) - course.heading(float(origin_s))))
    scene.add(*on_course(name, parts, course, float(origin_s), float(origin_t), turn_deg=turn))


def add_boundary(
    rng: np.random.Generator,
    scene: Assembly,
    config: DrivingConfig,
    course: Course,
    side: Side,
    start_m: float,
    end_m: float,
) -> None:
    """Fences, walls or hedges between the pavement and what lies behind, with gaps for gates."""
    if side.front_m - side.edge_m < 1.5 or not side.district.boundary:
        return
    kind = choose(rng, side.district.boundary)
    shape: Fence | Hedge
    if kind == "hedge":
        t = side.sign * (side.edge_m + 0.5)
        shape = replace(Hedge.sample(rng, course), t_m=t)
        material = street_materials.foliage(rng)
    else:
        t = side.sign * (side.edge_m + 0.2)
        shape = replace(Fence.sample(rng, kind, course), t_m=t)
        material = street_materials.fence(rng, kind, config.shares)
    index = scene.material(material)
    for number, (low, high) in enumerate(side.stretches(start_m, end_m)):
        add_in_spans(scene, f"fence {side.name}{number}", shape, index, low, high)


def add_garden(
    rng: np.random.Generator, scene: Assembly, course: Course, side: Side, start_m: float, end_m: float
) -> None:
    """Shrubs in front gardens and parks."""
    depth = side.front_m - side.edge_m
    if depth < 2.5:
        return
    kinds = [Shrub.sample(rng) for _ in range(2)]
    leaves = scene.material(street_materials.foliage(rng))
    for number in range(integer(rng, 0, 10)):
        shrub = choose(rng, kinds)
        s, t = uniform(rng, start_m, end_m), side.sign * (side.edge_m + uniform(rng, 1.3, depth - 0.9))
        name, turn = f"shrub {side.name}{number}", uniform(rng, 0.0, 360.0)
        if side.is_open(s, 1.2):
            continue
        scene.add(*on_course(name, [("", shrub, leaves)], course, s, t, turn_deg=turn))


def add_skyline(rng: np.random.Generator, scene: Assembly, course: Course, sides: tuple[Side, Side]) -> None:
    """Large plain buildings behind the rows and across the end of the street."""
    materials = [scene.material(street_materials.skyline(rng)) for _ in range(integer(rng, 2, 3))]
    far_m = course.end_m
    for number in range(integer(rng, 6, 16)):
        ahead = chance(rng, 0.35)
        s = far_m + uniform(rng, 15.0, 120.0) if ahead else uniform(rng, 30.0, far_m)
        side = choose(rng, sides)
        aside = uniform(rng, 0.0, 60.0) if ahead else side.front_m + uniform(rng, 45.0, 140.0)
        block = CityBlock.sample(rng)
        if side.is_open(s, block.width):
            continue
        turn, material = uniform(rng, -30.0, 30.0), choose(rng, materials)
        parts = [("", block, material)]
        scene.add(*on_course(f"block {number}", parts, course, s, side.sign * aside, turn_deg=turn))
