"""Building the room itself: walls, floor, ceiling, skirting, windows and doors, and what hangs in windows."""

from __future__ import annotations

import numpy as np

from scenes.random_draws import chance, choose, integer, uniform
from scenes.rooms.config import IndoorConfig
from scenes.rooms.interior import Extent, Interior
from scenes.rooms.plan import KINDS, WALL_M, Plan, RoomOpening
from scenes.shapes.indoor.hangings import Blind, Curtain
from scenes.shapes.indoor.shell import Hallway, RoomDoor, RoomSlab, RoomWall, RoomWindow, Skirting


def build_shell(rng: np.random.Generator, config: IndoorConfig, interior: Interior) -> int:
    """Build the room. Returns the number of things that are the room itself, which are never left out."""
    plan = interior.plan
    dado = uniform(rng, 1.1, 2.2) if chance(rng, KINDS[plan.kind].tiled) else 0.0
    for made_of, z in (("floor", 0.0), ("ceiling", plan.height)):
        interior.put(rng, made_of, RoomSlab(plan.width, plan.depth, made_of), (0.0, 0.0, z), solid=False)
    for wall in range(4):
        openings = tuple(opening.hole for opening in plan.of_wall(wall))
        shape = RoomWall(plan.wall_length(wall), plan.height, WALL_M, openings, dado)
        interior.put(rng, "wall", shape, (*plan.at_wall(wall, 0.0), 0.0), plan.yaw(wall), solid=False)
    rooms = len(interior.assembly.groups)
    board, cornice = uniform(rng, 0.05, 0.14), uniform(rng, 0.05, 0.12) if chance(rng, 0.3) else 0.0
    for wall in range(4):
        gaps = tuple((o.hole[0] - 0.07, o.hole[1] + 0.07) for o in plan.of_wall(wall) if o.door)
        skirting = Skirting(plan.wall_length(wall), plan.height, gaps, board, cornice)
        interior.put(rng, "skirting", skirting, (*plan.at_wall(wall, 0.0), 0.0), plan.yaw(wall), solid=False)
    panels, columns, rows = choose(rng, [0, 2, 3, 4]), integer(rng, 1, 3), choose(rng, [1, 1, 2, 3])
    hanging = choose(rng, ["blind", "curtain", "both", "none"], [0.35, 0.3, 0.1, 0.25])
    blind = Blind.sample(rng)
    for opening in plan.openings:
        if opening.door:
            _add_door(rng, interior, opening, panels)
        else:
            _add_window(rng, config, interior, opening, (columns, rows), hanging, blind)
    return rooms


def _zone(plan: Plan, opening: RoomOpening, depth: float) -> Extent:
    """The space before an opening, up to its top."""
    a, b = (
        plan.at_wall(opening.wall, s, out) for s, out in ((opening.hole[0], 0.0), (opening.hole[1], depth))
    )
    low, high = np.minimum(a, b), np.maximum(a, b)
    return Extent(np.array((*low, opening.hole[2])), np.array((*high, opening.hole[3])))


def _add_door(rng: np.random.Generator, interior: Interior, opening: RoomOpening, panels: int) -> None:
    plan, (x, y) = interior.plan, interior.plan.at_wall(opening.wall, opening.middle)
    yaw = plan.yaw(opening.wall)
    angle = choose(rng, [0.0, uniform(rng, 10.0, 85.0)], [0.65, 0.35])
    door = RoomDoor(opening.width, opening.hole[3], WALL_M, panels, chance(rng, 0.15), angle)
    interior.put(rng, "door", door, (x, y, 0.0), yaw, solid=False)
    if angle or door.glazed:
        hall = Hallway(uniform(rng, 1.5, 3.0), uniform(rng, 1.2, 3.5), opening.hole[3] + 0.4, WALL_M)
        interior.put(rng, "hallway", hall, (x, y, 0.0), yaw, solid=False)
    interior.kept_free.append(_zone(plan, opening, 0.75))


def _add_window(
    rng: np.random.Generator,
    config: IndoorConfig,
    interior: Interior,
    opening: RoomOpening,
    bars: tuple[int, int],
    hanging: str,
    blind: Blind,
) -> None:
    plan, (x, y) = interior.plan, interior.plan.at_wall(opening.wall, opening.middle)
    yaw, sill, height = plan.yaw(opening.wall), opening.hole[2], opening.hole[3] - opening.hole[2]
    window = RoomWindow(opening.width, height, WALL_M, *bars, chance(rng, config.glazed_share))
    interior.put(rng, "window", window, (x, y, sill), yaw)
    if hanging in ("blind", "both"):
        inside = plan.at_wall(opening.wall, opening.middle, -0.08)
        shape = Blind(
            opening.width,
            height,
            blind.form,
            min(1.0, blind.let_down * uniform(rng, 0.8, 1.2)),
            blind.tilt_deg,
        )
        interior.put(rng, "blind", shape, (*inside, sill), yaw, solid=False)
    if hanging in ("curtain", "both"):
        low = 0.04 if chance(rng, 0.6) else max(sill - 0.15, 0.04)
        drawn = uniform(rng, 0.1, 0.42)
        top = min(opening.hole[3] + 0.12, plan.height - 0.06)
        curtain = Curtain(opening.width, top - low, drawn, uniform(rng, 7.0, 13.0), int(rng.integers(2**53)))
        interior.put(rng, "curtain", curtain, (x, y, low), yaw)
    interior.kept_free.append(_zone(plan, opening, 0.2))
