"""Furnishing: putting things where there is room for them, on the floor, at walls and on one another."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.appearance.room_materials import RoomMaterials
from scenes.placement.assembly import Assembly, ObjectGroup, anchored_object
from scenes.random_draws import uniform
from scenes.rooms.plan import Plan
from scenes.shapes.anchored import frame_of
from scenes.shapes.indoor.parts import IndoorShape, Top

_GAP_M = 0.004
"""Between things that stand side by side."""


@dataclass(frozen=True)
class Extent:
    """An axis-aligned box in the world that a thing takes up."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def meets(self, other: Extent) -> bool:
        """Whether two boxes share more than a face."""
        return bool((self.low < other.high - _GAP_M).all() and (other.low < self.high - _GAP_M).all())


@dataclass(frozen=True)
class Placed:
    """A thing in the room."""

    shape: IndoorShape
    place: tuple[float, float, float]
    yaw: float
    extent: Extent
    group: int
    """Its number among `Assembly.groups`."""


def extent_of(shape: IndoorShape, place: tuple[float, float, float], yaw: float) -> Extent:
    """The box that a shape takes up at a place."""
    frame = frame_of(shape)
    x, y = (frame.low + frame.high)[:2] / 2
    a, b = (frame.high - frame.low)[:2] / 2
    cos, sin = math.cos(yaw), math.sin(yaw)
    middle = np.array((cos * x - sin * y, sin * x + cos * y))
    half = np.array((abs(cos) * a + abs(sin) * b, abs(sin) * a + abs(cos) * b))
    low = np.array((*(middle - half), frame.low[2])) + place
    high = np.array((*(middle + half), frame.high[2])) + place
    return Extent(low, high)


class Interior:
    """A room that is being furnished."""

    def __init__(self, plan: Plan, materials: RoomMaterials) -> None:
        self.plan, self.materials = plan, materials
        self.assembly = Assembly()
        self.placed: list[Placed] = []
        self.kept_free: list[Extent] = []
        """Where nothing may stand: before doors and windows."""
        self._numbers: dict[str, int] = {}
        self._bases: dict[int, int] = {}
        """What carries a thing, both as numbers among `Assembly.groups`."""
        self._taken: list[tuple[float, ...]] = []
        """Extents of `placed`: their lower corners, then their upper ones."""

    def put(
        self,
        rng: np.random.Generator,
        name: str,
        shape: IndoorShape,
        place: tuple[float, float, float],
        yaw: float = 0.0,
        *,
        solid: bool = True,
        base: Placed | None = None,
    ) -> Placed:
        """Add a thing with a material for each of its parts; others keep away from it where it is `solid`.

        base: What carries it, if that is not the room.
        """
        group = len(self.assembly.groups)
        if base is not None:
            self._bases[group] = base.group
        number = self._numbers.get(name, 0)
        self._numbers[name] = number + 1
        turn = Rotation.from_euler("Z", yaw)
        parts = []
        for part in shape.part_names():
            material = self.assembly.material(self.materials.pick(rng, part))
            full = f"{name} {number} {part}"
            parts.append(anchored_object(full, replace(shape, only=part), material, [place], [turn]))
        self.assembly.add(*parts)
        placed = Placed(shape, place, yaw, extent_of(shape, place, yaw), group)
        if solid:
            self.placed.append(placed)
            self._taken.append((*placed.extent.low.tolist(), *placed.extent.high.tolist()))
        return placed

    def meets_none(self, extent: Extent, besides: Placed | None = None) -> bool:
        """Whether a box meets no thing, `besides` excepted."""
        if not self._taken:
            return True
        taken = np.array(self._taken)
        low, high = extent.low + _GAP_M, extent.high - _GAP_M
        met = ((taken[:, :3] < high) & (taken[:, 3:] > low)).all(axis=1)
        return all(self.placed[k] is besides for k in np.flatnonzero(met).tolist())

    def is_free(self, extent: Extent, besides: Placed | None = None) -> bool:
        """Whether a box is inside the room and meets nothing, `besides` excepted."""
        if (
            (extent.low[:2] < -1e-6).any()
            or extent.low[2] < -1e-6
            or extent.high[2] > self.plan.height + 1e-6
        ):
            return False
        if extent.high[0] > self.plan.width + 1e-6 or extent.high[1] > self.plan.depth + 1e-6:
            return False
        if any(extent.meets(zone) for zone in self.kept_free):
            return False
        return self.meets_none(extent, besides)

    def try_at_wall(
        self,
        rng: np.random.Generator,
        name: str,
        shape: IndoorShape,
        *,
        z: float = 0.0,
        out: float = 0.0,
        tries: int = 10,
    ) -> Placed | None:
        """Put a thing with its back to some wall where there is room; None where there is none."""
        frame = frame_of(shape)
        for _ in range(tries):
            wall = int(rng.integers(4))
            low, high = -float(frame.low[0]) + 0.02, self.plan.wall_length(wall) - float(frame.high[0]) - 0.02
            if high < low:
                continue
            s = uniform(rng, low, high)
            if rng.random() < 0.35:  # Into a corner, as people do.
                s = low if rng.random() < 0.5 else high
            place, yaw = (*self.plan.at_wall(wall, s, out), z), self.plan.yaw(wall)
            if self.is_free(extent_of(shape, place, yaw)) and self._clear_of_windows(wall, shape, s, z):
                return self.put(rng, name, shape, place, yaw)
        return None

    def _clear_of_windows(self, wall: int, shape: IndoorShape, s: float, z: float) -> bool:
        """Whether a thing at a wall leaves its windows and doors uncovered."""
        frame = frame_of(shape)
        left, right = s + float(frame.low[0]), s + float(frame.high[0])
        low, high = z + float(frame.low[2]), z + float(frame.high[2])
        return not any(
            left < o.hole[1] + 0.08
            and right > o.hole[0] - 0.08
            and low < o.hole[3]
            and high > o.hole[2] + 0.02
            for o in self.plan.of_wall(wall)
        )

    def try_on_floor(
        self,
        rng: np.random.Generator,
        name: str,
        shape: IndoorShape,
        *,
        tries: int = 10,
        straight: bool = False,
    ) -> Placed | None:
        """Put a thing anywhere on the floor where there is room."""
        for _ in range(tries):
            yaw = float(rng.integers(4)) * math.pi / 2 if straight else uniform(rng, 0.0, 2 * math.pi)
            place = (uniform(rng, 0.0, self.plan.width), uniform(rng, 0.0, self.plan.depth), 0.0)
            if self.is_free(extent_of(shape, place, yaw)):
                return self.put(rng, name, shape, place, yaw)
        return None

    def try_near(
        self,
        rng: np.random.Generator,
        name: str,
        shape: IndoorShape,
        place: tuple[float, float],
        yaw: float,
        besides: Placed | None = None,
    ) -> Placed | None:
        """Put a thing at a place on the floor if there is room, but for a thing that it may reach under."""
        spot = (place[0], place[1], 0.0)
        if not self.is_free(extent_of(shape, spot, yaw), besides):
            return None
        return self.put(rng, name, shape, spot, yaw)

    def try_on(
        self,
        rng: np.random.Generator,
        name: str,
        shape: IndoorShape,
        base: Placed,
        top: Top,
        *,
        yaw: float,
        tries: int = 6,
    ) -> Placed | None:
        """Put a thing on a top of a piece of furniture, turned by `yaw` against it, where nothing stands yet."""
        frame = frame_of(shape)
        if float(frame.high[2]) > top.headroom:
            return None
        own = extent_of(shape, (0.0, 0.0, 0.0), yaw)
        low, high = np.array(top.low) - own.low[:2], np.array(top.high) - own.high[:2]
        if (low > high).any():
            return None
        for _ in range(tries):
            x, y = rng.uniform(low, high).tolist()
            cos, sin = math.cos(base.yaw), math.sin(base.yaw)
            place = (
                base.place[0] + cos * x - sin * y,
                base.place[1] + sin * x + cos * y,
                base.place[2] + top.z,
            )
            extent = extent_of(shape, place, base.yaw + yaw)
            if self.meets_none(extent, base):
                return self.put(rng, name, shape, place, base.yaw + yaw, base=base)
        return None

    def carried(self, kept: Sequence[ObjectGroup]) -> list[ObjectGroup]:
        """Those of the things kept whose carriers are kept too."""
        numbers = {id(group): number for number, group in enumerate(self.assembly.groups)}
        there = {numbers[id(group)] for group in kept}
        return [group for group in kept if self._bases.get(numbers[id(group)], numbers[id(group)]) in there]

    def to_world(self, base: Placed, x: float, y: float) -> tuple[float, float]:
        """World x, y of a place given in the coordinates of a thing."""
        cos, sin = math.cos(base.yaw), math.sin(base.yaw)
        return base.place[0] + cos * x - sin * y, base.place[1] + sin * x + cos * y
