"""What is in and on vehicles: seats and drivers behind the glass, number plates, signs and bands on their sides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from scenes.geometry.building import Part, joined, revolve
from scenes.geometry.polyhedra import boxes, hexahedra
from scenes.random_draws import chance
from scenes.shapes.anchored import MetricShape, Surface
from scenes.shapes.street.cars import CarDesign, sample_car_design
from scenes.shapes.street.vans import VanDesign, sample_van_design

_SEAT_Y = 0.36
"""How far the seats of a row are from the middle, metres."""


def _ball(middle: tuple[float, float, float], size: tuple[float, float, float]) -> Part:
    latitude = np.linspace(-np.pi / 2, np.pi / 2, 7)
    vertices, triangles = revolve(np.cos(latitude), np.sin(latitude), 10)
    return vertices * size + middle, triangles


def _seat_rows(design: CarDesign) -> tuple[float, float]:
    """x of the backs of the front and of the rear seats."""
    front = design.windscreen[1] - 0.62
    return front, max(front - 0.85, design.rear_window[1] + 0.12)


@dataclass(frozen=True)
class CarInterior(MetricShape):
    """What one sees through the windows of a car: dashboard, wheel, seats with head rests, all above the belt line."""

    design: CarDesign
    left_hand_drive: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_car_design(rng), chance(rng, 0.5))

    def surface(self) -> Surface:
        design = self.design
        belt, top = design.belt_height, design.height
        half = 0.86 * design.width / 2
        nose, tail = design.windscreen[0] - 0.12, design.rear_window[0] + 0.08
        tray = [(nose, -half + 0.1), (nose, half - 0.1), (tail, half - 0.1), (tail, -half + 0.1)]
        floor = np.array([[(x, y, z) for z in (belt - 0.02, belt + 0.035) for x, y in tray]])
        dash = np.array(
            [
                [
                    (nose - 0.05, -half + 0.14, belt), (nose - 0.05, half - 0.14, belt),
                    (nose - 0.55, half - 0.12, belt), (nose - 0.55, -half + 0.12, belt),
                    (nose - 0.2, -half + 0.16, belt + 0.07), (nose - 0.2, half - 0.16, belt + 0.07),
                    (nose - 0.5, half - 0.14, belt + 0.09), (nose - 0.5, -half + 0.14, belt + 0.09),
                ]
            ]
        )  # fmt: skip
        parts = [hexahedra(floor), hexahedra(dash)]
        low: list[tuple[float, float, float]] = []
        high: list[tuple[float, float, float]] = []
        front, rear = _seat_rows(design)
        for x, gap in ((front, 0.3), (rear, 0.36)):
            for y in (-_SEAT_Y, _SEAT_Y):
                low += [(x - 0.12, y - 0.23, belt), (x - 0.1, y - 0.12, top - gap)]
                high += [(x, y + 0.23, top - gap + 0.01), (x - 0.01, y + 0.12, top - gap + 0.16)]
        side = 1.0 if self.left_hand_drive else -1.0
        wheel = nose - 0.62
        low.append((wheel - 0.03, side * _SEAT_Y - 0.18, belt + 0.02))
        high.append((wheel, side * _SEAT_Y + 0.18, belt + 0.14))
        return Surface(*joined(*parts, boxes(np.array(low), np.array(high))))


@dataclass(frozen=True)
class CarOccupant(MetricShape):
    """The driver of a car as far as one sees him: his shoulders or his head."""

    design: CarDesign
    left_hand_drive: bool
    head: bool

    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_car_design(rng), chance(rng, 0.5), chance(rng, 0.5))

    def surface(self) -> Surface:
        design = self.design
        x = _seat_rows(design)[0] + 0.13
        y = _SEAT_Y if self.left_hand_drive else -_SEAT_Y
        crown = design.height - 0.15
        if self.head:
            return Surface(*_ball((x, y, crown - 0.11), (0.095, 0.08, 0.12)))
        shoulders = _ball((x - 0.01, y, crown - 0.38), (0.11, 0.21, 0.17))
        arms = [_ball((x + 0.17, y + side * 0.19, crown - 0.45), (0.2, 0.05, 0.06)) for side in (-1.0, 1.0)]
        return Surface(*joined(shoulders, *arms))


@dataclass(frozen=True)
class NumberPlates(MetricShape):
    """The plates of a vehicle, in front and behind."""

    length: float
    """Of the vehicle."""
    front_m: float
    """Height of the front plate's lower edge."""
    rear_m: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_car_design(rng).length, 0.4, 0.6)

    def surface(self) -> Surface:
        half = self.length / 2
        low = np.array([(half - 0.1, -0.26, self.front_m), (-half - 0.024, -0.26, self.rear_m)])
        high = np.array([(half + 0.03, 0.26, self.front_m + 0.115), (-half + 0.1, 0.26, self.rear_m + 0.115)])
        return Surface(*boxes(low, high))


@dataclass(frozen=True)
class VanSign(MetricShape):
    """A firm's sign on both sides of a van or, as a band, of a bus."""

    design: VanDesign

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_van_design(rng))

    def surface(self) -> Surface:
        design = self.design
        half, rear = design.width / 2, -design.length / 2
        front = design.screen_foot[0] - (0.5 if design.kind == "bus" else 1.3)
        arch = 2.5 * design.wheel_radius
        bottom, top = (arch, 1.0) if design.kind == "bus" else (max(1.0, arch), design.height - 0.35)
        low = np.array([(rear + 0.25, side * half - 0.004, bottom) for side in (-1.0, 1.0)])
        high = np.array([(front, side * half + 0.004, top) for side in (-1.0, 1.0)])
        return Surface(*boxes(low, high))
