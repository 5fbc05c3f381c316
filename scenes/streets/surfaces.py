"""The ground of a street: carriageway, markings, kerbs, pavements, gardens, the land beyond."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from scenes.appearance import street_materials
from scenes.placement.assembly import Assembly, anchored_object
from scenes.random_draws import chance, integer, new_seed, uniform
from scenes.shapes.anchored import MetricShape
from scenes.shapes.street.puddles import Puddles
from scenes.shapes.street.road import Course, Kerb, LevelGround, RoadMarkings, RoadStrip, Stripe
from scenes.streets.config import DrivingConfig
from scenes.streets.frontage import Side
from scenes.streets.rig import Drive
from scenes.streets.weather import Weather

_LAND_M = 900.0
"""How far the land reaches around the street."""


@dataclass(frozen=True)
class Surfacing:
    """What the ground of a neighbourhood is made of: indices of materials, and the kerbs' height."""

    tarmac: int
    paint: int
    stone: int
    paving: int
    lawn: int
    kerb_m: float


@dataclass(frozen=True)
class Ground:
    """Measures of the ground that other parts of the scene need."""

    crossings: tuple[float, ...]
    """s of the middles of the zebra crossings."""
    pavement_m: float
    """Height of the pavements above the road's edge."""
    surfacing: Surfacing


def lay_ground(
    rng: np.random.Generator,
    scene: Assembly,
    config: DrivingConfig,
    drive: Drive,
    sides: tuple[Side, Side],
    weather: Weather,
) -> Ground:
    """Add all surfaces of the ground."""
    course = drive.course
    left, right = sides
    road = (left.kerb_m, -right.kerb_m, uniform(rng, 0.0, 0.06))
    kerb_height = uniform(rng, *config.kerb_m)
    mouths = [opening for side in sides for opening in side.openings]
    crossings = tuple(
        s for s in _crossings(rng) if all(abs(s - mouth.s_m) > mouth.half_m + 5.0 for mouth in mouths)
    )
    asphalt = street_materials.asphalt(rng)
    tarmac = scene.material(weather.wetted(asphalt))
    lay(
        scene,
        "road",
        RoadStrip(course, course.start_m, course.end_m, road[0], road[1], 0.0, 0.4, road[2]),
        tarmac,
    )
    _paint(rng, scene, drive, road, crossings, weather)
    _repairs(rng, scene, course, road, weather)
    if weather.wetness > 0.4:
        _puddles(rng, scene, drive, road, scene.material(weather.standing_water(asphalt)))
    surfacing = Surfacing(
        tarmac=tarmac,
        paint=scene.material(weather.wetted(street_materials.road_paint(rng))),
        stone=scene.material(weather.wetted(street_materials.kerb_stone(rng))),
        paving=scene.material(weather.wetted(street_materials.pavement(rng))),
        lawn=scene.material(street_materials.grass(rng)),
        kerb_m=kerb_height,
    )
    for side in sides:
        lay_side(rng, scene, course, side, surfacing)
    lay(
        scene,
        "plain",
        LevelGround(course.start_m - _LAND_M, course.end_m + _LAND_M, _LAND_M, -0.3),
        surfacing.lawn,
    )
    return Ground(crossings, kerb_height - 0.006, surfacing)


def lay(scene: Assembly, name: str, shape: MetricShape, material: int) -> None:
    """A shape whose coordinates are the world's."""
    scene.add(anchored_object(name, shape, material, [(0.0, 0.0, 0.0)], [Rotation.identity()]))


def strip(
    course: Course,
    one_m: float,
    other_m: float,
    top_m: float,
    from_m: float | None = None,
    to_m: float | None = None,
) -> RoadStrip:
    """A level strip between two distances from a street's middle, along all of it or a part."""
    start_m, end_m = course.start_m if from_m is None else from_m, course.end_m if to_m is None else to_m
    return RoadStrip(course, start_m, end_m, max(one_m, other_m), min(one_m, other_m), top_m, 0.5)


def lay_side(
    rng: np.random.Generator,
    scene: Assembly,
    course: Course,
    side: Side,
    surfacing: Surfacing,
    land_from_m: float | None = None,
) -> None:
    """Kerb, pavement and land of one side; of a side street with its land from a distance on."""
    name = {"L": "left", "R": "right"}.get(side.name, f"side {side.name}")
    width = uniform(rng, 0.12, 0.3) * side.sign
    inner, outer = side.sign * (side.kerb_m + abs(width) / 2), side.sign * side.edge_m
    reach = side.sign * (side.front_m + 22.0)
    top = surfacing.kerb_m - 0.006
    main = land_from_m is None
    start_m = course.start_m if main else 0.02
    ground = _land(rng, side, surfacing.lawn, surfacing.paving)
    for number, (low, high) in enumerate(side.stretches(start_m, course.end_m, of_kerb=True)):
        kerb = Kerb(course, low, high, side.sign * side.kerb_m, width, surfacing.kerb_m, 2.0)
        lay(scene, f"{name} kerb {number}", kerb, surfacing.stone)
    for number, (low, high) in enumerate(side.stretches(start_m, course.end_m)):
        lay(scene, f"{name} pavement {number}", strip(course, inner, outer, top, low, high), surfacing.paving)
        # Side streets' land lies below the main street's, which it meets at any angle.
        level, begin = (top - 0.02, low) if main else (top - 0.035, land_from_m)
        land = strip(course, outer - 0.05 * side.sign, reach, level, begin, high)
        lay(scene, f"{name} land {number}", land, ground)


def _land(rng: np.random.Generator, side: Side, lawn: int, paving: int) -> int:
    """What front gardens and the space between houses are covered with."""
    garden = side.front_m - side.edge_m > 1.5
    return lawn if garden and not chance(rng, 0.2) else paving


def _crossings(rng: np.random.Generator) -> tuple[float, ...]:
    """One or two zebra crossings in half of the streets."""
    if not chance(rng, 0.55):
        return ()
    first = uniform(rng, 9.0, 40.0)
    return (first,) if chance(rng, 0.6) else (first, first + uniform(rng, 40.0, 80.0))


def _paint(
    rng: np.random.Generator,
    scene: Assembly,
    drive: Drive,
    road: tuple[float, float, float],
    crossings: tuple[float, ...],
    weather: Weather,
) -> None:
    course = drive.course
    half = uniform(rng, 0.05, 0.08)
    stripes: list[Stripe] = []
    centre: list[Stripe] = []
    dash, gap = uniform(rng, 2.0, 4.5), uniform(rng, 2.5, 7.0)
    inner = [k * drive.lane_m for k in range(1, len(drive.lanes) // 2)]
    for t in [*inner, *[-t for t in inner]]:
        stripes += _dashes(course, t, half, dash, gap)
    style = rng.choice(["dashed", "solid", "double"], p=[0.55, 0.25, 0.2])
    if style == "dashed":
        centre += _dashes(course, 0.0, half, dash, gap)
    else:
        offsets = (0.0,) if style == "solid" else (-0.14, 0.14)
        centre += [Stripe(course.start_m, course.end_m, t + half, t - half) for t in offsets]
    if chance(rng, 0.6) or road[0] > drive.half_road_m + 0.5:
        for edge, sign in ((road[0], 1.0), (road[1], -1.0)):
            t = sign * (drive.half_road_m if abs(edge) > drive.half_road_m + 0.5 else abs(edge) - 0.25)
            stripes.append(Stripe(course.start_m, course.end_m, t + half, t - half))
    for middle in crossings:
        stripes += _zebra(rng, drive, road, middle)
    yellow = chance(rng, 0.25)
    white = scene.material(weather.wetted(street_materials.road_paint(rng)))
    middle = scene.material(weather.wetted(street_materials.road_paint(rng, True))) if yellow else white
    centre = [piece for stripe in centre for piece in _interrupted(stripe, crossings)]
    stripes = [piece for stripe in stripes for piece in _interrupted(stripe, crossings)]
    groups = [
        ("centre line", centre, middle),
        ("markings", stripes, white),
    ]
    for name, items, material in groups:
        if items:
            lay(scene, name, RoadMarkings(course, tuple(items), road), material)


def _dashes(course: Course, t_m: float, half_m: float, dash_m: float, gap_m: float) -> list[Stripe]:
    starts = np.arange(course.start_m + 1.0, course.end_m - dash_m, dash_m + gap_m)
    return [Stripe(s, s + dash_m, t_m + half_m, t_m - half_m) for s in starts.tolist()]


def _zebra(
    rng: np.random.Generator, drive: Drive, road: tuple[float, float, float], middle_m: float
) -> list[Stripe]:
    """Bars along the street from kerb to kerb, and a stop line before them on each side."""
    long, wide = uniform(rng, 1.3, 2.0), uniform(rng, 0.4, 0.6)
    edges = np.arange(road[1] + 0.35, road[0] - 0.35 - wide, 2 * wide)
    bars = [Stripe(middle_m - long, middle_m + long, t + wide, t) for t in edges.tolist()]
    for sign in (1.0, -1.0):
        s = middle_m - sign * (long + 1.2)
        side = sign * (1.0 if drive.keep_left else -1.0)
        reach = side * (drive.half_road_m - 0.2)
        bars.append(Stripe(s - 0.2, s + 0.2, max(0.15 * side, reach), min(0.15 * side, reach)))
    return bars


def _interrupted(stripe: Stripe, crossings: tuple[float, ...]) -> list[Stripe]:
    """A line without what would run through a crossing; the crossing's own bars stay whole."""
    pieces = [stripe]
    for middle in crossings:
        if abs((stripe.from_m + stripe.to_m) / 2 - middle) < 3.5 and stripe.to_m - stripe.from_m < 4.2:
            if abs(stripe.left_m - stripe.right_m) < 0.2:
                return []
            continue
        low, high = middle - 3.6, middle + 3.6
        cut = []
        for piece in pieces:
            if piece.to_m <= low or piece.from_m >= high:
                cut.append(piece)
                continue
            if piece.from_m < low - 0.5:
                cut.append(Stripe(piece.from_m, low, piece.left_m, piece.right_m))
            if piece.to_m > high + 0.5:
                cut.append(Stripe(high, piece.to_m, piece.left_m, piece.right_m))
        pieces = cut
    return pieces


def _puddles(
    rng: np.random.Generator, scene: Assembly, drive: Drive, road: tuple[float, float, float], water: int
) -> None:
    """Water that stands along the kerbs, in the outer quarters of the road's camber."""
    quarter = (road[0] - road[1]) / 4
    spots = []
    for _ in range(integer(rng, 3, 14)):
        wide = uniform(rng, 0.2, 0.42) * min(quarter, 2.4)
        inwards = uniform(rng, wide + 0.05, quarter - wide)
        t = road[0] - inwards if chance(rng, 0.5) else road[1] + inwards
        spots.append((uniform(rng, 3.0, 0.6 * drive.view_m), t, uniform(rng, 0.5, 3.5), wide))
    lay(scene, "puddles", Puddles(drive.course, tuple(spots), road, new_seed(rng)), water)


def _repairs(
    rng: np.random.Generator,
    scene: Assembly,
    course: Course,
    road: tuple[float, float, float],
    weather: Weather,
) -> None:
    """Patches of newer tarmac, seams and covers; thinner than the road paint, which runs over them."""
    patches = []
    for _ in range(integer(rng, 0, 9)):
        s, t = uniform(rng, course.start_m, course.end_m - 12.0), uniform(rng, road[1] + 1.5, road[0] - 1.5)
        long, wide = (
            (uniform(rng, 4.0, 12.0), 0.4)
            if chance(rng, 0.4)
            else (uniform(rng, 0.5, 3.0), uniform(rng, 0.3, 1.1))
        )
        patches.append(Stripe(s, s + long, t + wide, t - wide, shear=uniform(rng, -0.2, 0.2)))
    if patches:
        shape = RoadMarkings(course, tuple(patches), road, thickness_m=0.003)
        lay(scene, "repairs", shape, scene.material(weather.wetted(street_materials.tarmac_patch(rng))))
