"""Shops behind the openings of a house's ground floor: panes, the room behind them, and what is on show in it.

All share the design and the origin of their house (`scenes.shapes.street.buildings`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, joined, revolve
from scenes.geometry.polyhedra import boxes
from scenes.random_draws import integer, new_seed, uniform
from scenes.shapes.anchored import MetricShape, Surface
from scenes.shapes.street.buildings import WALL_M, HouseDesign, storeys

ROOM_M = 2.6
"""Depth of the rooms, from the outside of the front."""
_FLOOR_M = 0.12
_Box = tuple[tuple[float, float, float], tuple[float, float, float]]


def sample_shop_design(rng: np.random.Generator) -> HouseDesign:
    """A house with a shop, for shapes that are sampled on their own."""
    while not (design := HouseDesign.sample(rng, "city")).shop:
        pass
    return design


@dataclass(frozen=True)
class ShopPanes(MetricShape):
    """The panes in the openings of the ground floor's front, and above the door."""

    design: HouseDesign

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_shop_design(rng))

    def surface(self) -> Surface:
        design = self.design
        _, _, openings = storeys(design, front=True)[0]
        items: list[_Box] = []
        for bay, o in enumerate(openings):
            bottom = min(o.top, 2.15) if bay == design.door_bay else o.bottom - 0.01
            if o.top - bottom > 0.1:
                items.append(
                    (
                        (o.left - 0.01, design.reveal, bottom),
                        (o.right + 0.01, design.reveal + 0.01, o.top + 0.01),
                    )
                )
        return Surface(*boxes(np.array([low for low, _ in items]), np.array([high for _, high in items])))


@dataclass(frozen=True)
class ShopRoom(MetricShape):
    """Floor, ceiling, back wall and partitions of the rooms behind the panes."""

    design: HouseDesign
    rooms: int
    """How many shops share the ground floor."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_shop_design(rng), integer(rng, 1, 3))

    def surface(self) -> Surface:
        design = self.design
        low, high, top = WALL_M - 0.04, design.width - WALL_M + 0.04, design.ground_floor
        items: list[_Box] = [
            ((low, ROOM_M, -0.2), (high, design.depth - 0.3, top)),
            ((low, WALL_M - 0.02, -0.2), (high, ROOM_M + 0.01, _FLOOR_M)),
            ((low, WALL_M - 0.015, top - 0.45), (high, ROOM_M + 0.012, top + 0.05)),
        ]
        bays = np.linspace(0, design.bays, self.rooms + 1).round()[1:-1]
        items += [
            ((x - 0.04, WALL_M - 0.01, 0.0), (x + 0.04, ROOM_M + 0.02, top - 0.1))
            for x in [low + 0.03, high - 0.03, *(bays * design.bay).tolist()]
        ]
        return Surface(*boxes(np.array([low for low, _ in items]), np.array([high for _, high in items])))


@dataclass(frozen=True)
class ShopGoods(MetricShape):
    """What is on show: full shelves at the back, tables and figures before them."""

    design: HouseDesign
    seed: int

    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_shop_design(rng), new_seed(rng))

    def surface(self) -> Surface:
        rng = np.random.default_rng(self.seed)
        design = self.design
        parts: list[Part] = []
        for bay in range(design.bays):
            middle, half = (bay + 0.5) * design.bay, 0.42 * design.bay
            span = (max(middle - half, WALL_M + 0.12), min(middle + half, design.width - WALL_M - 0.12))
            kind = rng.integers(4)
            if kind < 2:
                parts.append(_shelf(rng, span, min(2.3, design.ground_floor - 0.7)))
            if kind == 1:
                parts.append(_table(rng, span))
            elif kind > 1:
                parts += [
                    _figure(rng, uniform(rng, *span), uniform(rng, 0.75, 1.3))
                    for _ in range(integer(rng, 1, 3))
                ]
        return Surface(*joined(*parts))


def _row(
    rng: np.random.Generator, span: tuple[float, float], y: tuple[float, float], z: float, tallest: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Low and high corners of boxes side by side on a board at a height."""
    edges = [span[0]]
    while edges[-1] < span[1] - 0.35:
        edges.append(edges[-1] + uniform(rng, 0.1, 0.35))
    left = np.array(edges)
    wide = np.append(np.diff(left), 0.2) * rng.uniform(0.7, 0.97, len(left))
    deep = rng.uniform(0.5, 1.0, len(left)) * (y[1] - y[0])
    high = rng.uniform(0.35, 1.0, len(left)) * tallest
    low_corner = np.stack([left, y[1] - deep, np.full(len(left), z)], -1)
    return low_corner, low_corner + np.stack([wide, deep, high], -1)


def _shelf(rng: np.random.Generator, span: tuple[float, float], height: float) -> Part:
    """Boards with rows of things, along the back wall."""
    front, back = ROOM_M - 0.42, ROOM_M + 0.01
    gap = uniform(rng, 0.36, 0.5)
    low, high = [], []
    for z in np.arange(_FLOOR_M + 0.1, height - gap, gap).tolist():
        low.append(np.array([(span[0], front, z - 0.03)]))
        high.append(np.array([(span[1], back, z)]))
        rows = _row(rng, span, (front + 0.03, back - 0.02), z - 0.002, gap - 0.06)
        low.append(rows[0])
        high.append(rows[1])
    return boxes(np.concatenate(low), np.concatenate(high))


def _table(rng: np.random.Generator, span: tuple[float, float]) -> Part:
    """A table near the window, with things on it."""
    top, y = uniform(rng, 0.6, 0.85), (0.6, 1.15)
    low = np.array([(span[0], y[0], top - 0.05), (span[0] + 0.1, y[0] + 0.1, _FLOOR_M - 0.01)])
    high = np.array([(span[1], y[1], top), (span[1] - 0.1, y[1] - 0.1, top - 0.04)])
    rows = _row(rng, (span[0] + 0.05, span[1] - 0.05), (y[0] + 0.05, y[1] - 0.05), top - 0.002, 0.45)
    return boxes(np.concatenate([low, rows[0]]), np.concatenate([high, rows[1]]))


def _figure(rng: np.random.Generator, x: float, y: float) -> Part:
    """A dressed dummy."""
    height = uniform(rng, 1.5, 1.8)
    profile = np.array(
        [
            (0.0, 0.0), (0.2, 0.0), (0.2, 0.02), (0.03, 0.03), (0.03, 0.3), (0.17, 0.32), (0.16, 0.5),
            (0.12, 0.63), (0.17, 0.8), (0.14, 0.86), (0.045, 0.88), (0.05, 0.9), (0.075, 0.95), (0.05, 0.99),
            (0.0, 1.0),
        ]
    )  # fmt: skip
    vertices, triangles = revolve(profile[:, 0], profile[:, 1] * height, 12)
    return vertices * (1.0, 0.75, 1.0) + (x, y, _FLOOR_M), triangles
