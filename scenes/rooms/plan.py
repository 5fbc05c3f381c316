"""The plan of a room: its size, its walls, and where its windows and doors are.

The floor is the rectangle from (0, 0) to (width, depth) at z = 0. Wall k has a frame of its own: s runs along
it from its left end, seen from inside, and things at it have their back to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenes.random_draws import Range, chance, integer, uniform
from scenes.rooms.config import IndoorConfig
from scenes.shapes.indoor.shell import Opening

WALL_M = 0.25
"""Thickness of the walls."""
_STAIR_WALLS = (0, 3)
"""Walls without openings where there are stairs: the gallery is at one, the flight at the other."""


@dataclass(frozen=True)
class RoomKind:
    """What a kind of room is like."""

    width_m: Range
    depth_m: Range
    height_m: Range
    windows: float
    """Chance of each possible window."""
    doors: tuple[int, int] = (1, 2)
    """How many doors there are, from and to."""
    tiled: float = 0.05
    """Chance that the lower part of the walls is tiled."""


KINDS: dict[str, RoomKind] = {
    "living room": RoomKind((3.6, 6.0), (3.6, 5.5), (2.4, 3.0), 0.8),
    "bedroom": RoomKind((3.0, 4.6), (3.0, 4.6), (2.3, 2.8), 0.7),
    "kitchen": RoomKind((2.8, 4.6), (2.6, 4.6), (2.4, 2.8), 0.6, tiled=0.6),
    "office": RoomKind((3.4, 7.5), (3.2, 6.0), (2.5, 3.0), 0.8),
    "workshop": RoomKind((4.0, 8.0), (3.6, 6.0), (2.6, 3.6), 0.4),
    "corridor": RoomKind((1.5, 2.4), (6.0, 13.0), (2.3, 2.9), 0.3, (3, 7), tiled=0.2),
    "store room": RoomKind((2.6, 6.0), (3.0, 7.0), (2.4, 3.4), 0.2),
    "stairs": RoomKind((2.6, 4.2), (5.0, 6.5), (4.9, 5.6), 0.5, (1, 3)),
}


@dataclass(frozen=True)
class RoomOpening:
    """A window or a door."""

    wall: int
    hole: Opening
    """s from and to, z from and to."""
    door: bool

    @property
    def middle(self) -> float:
        """Its s."""
        return (self.hole[0] + self.hole[1]) / 2

    @property
    def width(self) -> float:
        """Along the wall."""
        return self.hole[1] - self.hole[0]


@dataclass(frozen=True)
class Plan:
    """A room without anything in it."""

    kind: str
    width: float
    depth: float
    height: float
    openings: tuple[RoomOpening, ...]

    def wall_length(self, wall: int) -> float:
        """Metres along a wall, 0 to 3."""
        return self.width if wall % 2 == 0 else self.depth

    def yaw(self, wall: int) -> float:
        """Radians by which a thing is turned whose back is at a wall."""
        return wall * math.pi / 2

    def at_wall(self, wall: int, s: float, out: float = 0.0) -> tuple[float, float]:
        """World x, y of a place at a wall, `out` metres into the room."""
        w, d = self.width, self.depth
        return ((s, out), (w - out, s), (w - s, d - out), (out, d - s))[wall]

    def of_wall(self, wall: int) -> list[RoomOpening]:
        """The windows and doors of one wall."""
        return [opening for opening in self.openings if opening.wall == wall]


def sample_plan(rng: np.random.Generator, config: IndoorConfig, kind: str) -> Plan:
    """Draw a room of a kind with its windows and doors."""
    usual = KINDS[kind]
    scale = uniform(rng, *config.room_size)
    width, depth = (scale * uniform(rng, *limits) for limits in (usual.width_m, usual.depth_m))
    plan = Plan(kind, width, depth, uniform(rng, *usual.height_m), ())
    openings: list[RoomOpening] = []
    for _ in range(integer(rng, *usual.doors)):
        openings += _door(rng, plan, openings)
    for wall in range(4):
        if kind == "stairs" and wall in _STAIR_WALLS:
            continue
        if chance(rng, usual.windows * (0.9 if wall in (0, 2) else 0.55)):
            openings += _windows(rng, plan, wall, openings)
    return Plan(kind, width, depth, plan.height, tuple(openings))


def _door(rng: np.random.Generator, plan: Plan, others: list[RoomOpening]) -> list[RoomOpening]:
    wide, high = uniform(rng, 0.78, 0.98), min(uniform(rng, 1.98, 2.15), plan.height - 0.15)
    for _ in range(8):
        wall = integer(rng, 0, 3)
        if plan.kind == "stairs" and wall in _STAIR_WALLS:
            continue
        length = plan.wall_length(wall)
        if length < wide + 0.6:
            continue
        s = uniform(rng, 0.25, length - wide - 0.25)
        hole = (s, s + wide, 0.0, high)
        if _is_free(wall, hole, others):
            return [RoomOpening(wall, hole, True)]
    return []


def _windows(rng: np.random.Generator, plan: Plan, wall: int, others: list[RoomOpening]) -> list[RoomOpening]:
    """One to three equal windows in a wall."""
    length = plan.wall_length(wall)
    sill = uniform(rng, 0.15, 0.3) if chance(rng, 0.15) else uniform(rng, 0.75, 1.05)
    if plan.kind == "kitchen":
        sill = uniform(rng, 1.15, 1.3)
    top = min(2.9, plan.height) - uniform(rng, 0.2, 0.5)
    wide = uniform(rng, 0.8, min(2.4, max(0.9, 0.55 * length)))
    count = max(1, min(integer(rng, 1, 3), int(length / (wide + 0.5))))
    step = length / count
    made: list[RoomOpening] = []
    for k in range(count):
        s = (k + 0.5) * step - wide / 2
        hole = (s, s + wide, sill, top)
        if s > 0.15 and s + wide < length - 0.15 and _is_free(wall, hole, others):
            made.append(RoomOpening(wall, hole, False))
    return made


def _is_free(wall: int, hole: Opening, others: list[RoomOpening]) -> bool:
    return all(
        other.wall != wall or hole[0] > other.hole[1] + 0.3 or hole[1] < other.hole[0] - 0.3
        for other in others
    )
