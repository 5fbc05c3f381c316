"""Side streets: where one joins the street, what it is made of, and what lines it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenes.appearance import street_materials
from scenes.placement.assembly import Assembly
from scenes.random_draws import chance, choose, uniform
from scenes.shapes.street.buildings import CityBlock
from scenes.shapes.street.road import Course, RoadMarkings, Stripe
from scenes.streets.along_course import on_course
from scenes.streets.config import DrivingConfig
from scenes.streets.frontage import Opening, Side, add_houses
from scenes.streets.rig import Drive
from scenes.streets.surfaces import Surfacing, lay, lay_side, strip
from scenes.streets.traffic import Fleet, add_waiting

_LENGTH_M = 70.0
_FIRST_HOUSE_M = 14.0
"""How far behind the street's own fronts the side street's houses begin: as far as a corner house is deep."""


@dataclass(frozen=True)
class SideStreet:
    """A street that joins the main one at right angles. Its s grows away from the main street's kerb."""

    course: Course
    sides: tuple[Side, Side]
    begins_m: float
    """s where its own land and houses begin: level with the main street's fronts."""
    half_road_m: float
    keep_left: bool


def with_openings(
    rng: np.random.Generator, config: DrivingConfig, sides: tuple[Side, Side]
) -> tuple[Side, Side]:
    """The sides of the main street, with openings for side streets in some: on one side, or opposite each other."""
    if not chance(rng, config.junction_share):
        return sides
    half_road, pavement = uniform(rng, 2.7, 3.6), uniform(rng, 1.2, 2.4)
    opening = Opening(uniform(rng, 15.0, 50.0), half_road, half_road + pavement)
    both, left = chance(rng, 0.3), chance(rng, 0.5)
    first, second = (
        replace(side, openings=(opening,)) if both or (side.sign > 0) == left else side for side in sides
    )
    return first, second


def side_streets(rng: np.random.Generator, drive: Drive, sides: tuple[Side, Side]) -> list[SideStreet]:
    """The side streets of all openings."""
    found = []
    for side in sides:
        for opening in side.openings:
            x, y = drive.course.point(opening.s_m, side.sign * side.kerb_m)
            heading = float(np.degrees(drive.course.heading(opening.s_m))) + 90.0 * side.sign
            course = replace(Course.sample(rng, -10.0, _LENGTH_M, 6.0), origin=(float(x), float(y), heading))
            setback = side.front_m - side.edge_m
            edge, front = opening.half_m, opening.half_m + max(setback, 0.3)
            own = [
                Side(sign, side.district, opening.half_road_m, edge, front, False, f"{side.name}{letter}")
                for sign, letter in ((1.0, "a"), (-1.0, "b"))
            ]
            found.append(
                SideStreet(
                    course, (own[0], own[1]), side.front_m - side.kerb_m, opening.half_road_m, drive.keep_left
                )
            )
    return found


def build_side_street(
    rng: np.random.Generator, scene: Assembly, street: SideStreet, surfacing: Surfacing
) -> None:
    """Its ground."""
    course, half = street.course, street.half_road_m
    name = f"side {street.sides[0].name[:-1]}"
    # It begins a little below the main road's edge, so that on a bend no gap is left between them.
    road = strip(course, half, -half, -0.004, from_m=-0.6)
    lay(scene, f"{name} road", road, surfacing.tarmac)
    for side in street.sides:
        lay_side(rng, scene, course, side, surfacing, land_from_m=street.begins_m)
    dashes = [Stripe(s, s + 2.0, 0.06, -0.06) for s in np.arange(5.0, _LENGTH_M, 5.0).tolist()]
    lane = (
        (-0.2, 0.3 - half) if street.keep_left else (half - 0.3, 0.2)
    )  # that of traffic towards the main street
    stop = Stripe(1.6, 2.0, *lane)
    marks = RoadMarkings(course, (*dashes, stop), (half, -half, 0.0))
    lay(scene, f"{name} markings", marks, surfacing.paint)


def line_side_street(
    rng: np.random.Generator,
    scene: Assembly,
    config: DrivingConfig,
    street: SideStreet,
    fleet: Fleet,
    lit: float,
) -> None:
    """Its houses, what closes it at its end, and perhaps a car that waits at its mouth."""
    for side in street.sides:
        add_houses(rng, scene, config, street.course, side, street.begins_m + _FIRST_HOUSE_M, lit)
    block = scene.material(street_materials.skyline(rng))
    name, s = f"block {street.sides[0].name}", street.course.end_m + 16.0
    scene.add(*on_course(name, [("", CityBlock.sample(rng), block)], street.course, s, 0.0, turn_deg=90.0))
    if chance(rng, 0.5):
        lane = street.half_road_m / 2 * (-1.0 if street.keep_left else 1.0)
        add_waiting(
            rng, scene, street.course, fleet, lane, choose(rng, [2.6, 3.2]), f"waiting {name.split()[1]}"
        )
