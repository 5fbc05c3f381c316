"""Vans, lorries and buses in parts, each in its own material, all of one design."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, joined
from scenes.geometry.polyhedra import boxes, hexahedra, loft
from scenes.random_draws import choose, uniform
from scenes.shapes.anchored import MetricShape, Surface
from scenes.shapes.street.wheels import MIRROR_M, without_arches


@dataclass(frozen=True)
class VanDesign:
    """Measures of a van, lorry or bus, metres."""

    kind: str
    """van, lorry or bus."""
    length: float
    width: float
    height: float
    cab_height: float
    """Of a lorry's cab; of a van's and a bus's whole body."""
    cab_length: float
    nose: float
    """How far the bonnet of a van stands out before the windscreen."""
    wheel_radius: float
    clearance: float
    axles: tuple[float, ...]

    @classmethod
    def sample(cls, rng: np.random.Generator, kind: str) -> Self:
        """Draw a design."""
        if kind == "van":
            length, height = uniform(rng, 4.6, 5.9), uniform(rng, 1.95, 2.6)
            nose, radius = uniform(rng, 0.5, 0.85), 0.34
            cab = (height, 1.1 + nose)
        elif kind == "lorry":
            length, height = uniform(rng, 6.5, 9.5), uniform(rng, 3.0, 3.7)
            nose, radius = 0.12, uniform(rng, 0.44, 0.5)
            cab = (uniform(rng, 2.5, min(height, 3.1)), uniform(rng, 1.7, 2.1))
        else:
            length, height = uniform(rng, 9.0, 12.0), uniform(rng, 2.95, 3.2)
            if rng.random() < 0.2:
                height = uniform(rng, 4.1, 4.4)
            nose, radius = 0.1, 0.48
            cab = (height, 2.0)
        front = length / 2 - (0.85 if kind == "van" else uniform(rng, 1.2, 1.4) if kind == "lorry" else 2.6)
        rear = -length / 2 + (1.0 if kind == "van" else uniform(rng, 1.8, 2.2) if kind == "lorry" else 3.2)
        return cls(
            kind=kind,
            length=length,
            width={"van": uniform(rng, 1.85, 2.05), "lorry": 2.4, "bus": 2.5}[kind],
            height=height,
            cab_height=cab[0],
            cab_length=cab[1],
            nose=nose,
            wheel_radius=radius,
            clearance={"van": 0.26, "lorry": 0.45, "bus": 0.3}[kind],
            axles=(front, rear),
        )

    @property
    def track(self) -> float:
        """Distance from the middle to the middle of a wheel, metres."""
        return self.width / 2 - 0.15

    @property
    def body_rear(self) -> float:
        """x where the painted body ends: behind the cab on a lorry."""
        return self.length / 2 - self.cab_length if self.kind == "lorry" else -self.length / 2

    def profile(self) -> NDArray[np.float64]:
        """(N, 2) side view of the painted body, x and z."""
        front, rear, top = self.length / 2, self.body_rear, self.cab_height
        low, screen = self.clearance, self.screen_foot
        return np.array(
            [
                (rear, low),
                (front - 0.08, low),
                (front, low + 0.12),
                (front, min(0.85, screen[1] - 0.1)),
                (front - 0.06, min(0.95, screen[1] - 0.06)),
                screen,
                (screen[0] - 0.42 * (top - screen[1]) * (1.0 if self.nose > 0.3 else 0.2), top - 0.1),
                (screen[0] - 0.42 * (top - screen[1]) * (1.0 if self.nose > 0.3 else 0.2) - 0.18, top),
                (rear + 0.12, top),
                (rear, top - 0.1),
            ]
        )

    @property
    def screen_foot(self) -> tuple[float, float]:
        """x and z of the windscreen's lower edge."""
        return (self.length / 2 - self.nose, {"van": 1.12, "lorry": 1.45, "bus": 1.05}[self.kind])


def sample_van_design(rng: np.random.Generator) -> VanDesign:
    """A random van, lorry or bus."""
    return VanDesign.sample(rng, choose(rng, ["van", "lorry", "bus"]))


def _extruded(profile: NDArray[np.float64], half_width: float, bevel: float) -> Part:
    """A side view extruded across the vehicle's width, its edges bevelled."""
    middle = profile.mean(axis=0)
    size = np.ptp(profile, axis=0)
    inset = middle + (profile - middle) * (1 - 2 * bevel / size)
    rings = [
        np.column_stack([plan[:, 0], np.full(len(plan), y), plan[:, 1]])
        for plan, y in (
            (inset, -half_width),
            (profile, -half_width + bevel),
            (profile, half_width - bevel),
            (inset, half_width),
        )
    ]
    return loft(np.stack(rings))


@dataclass(frozen=True)
class VanBody(MetricShape):
    """The painted body of a van or bus, or a lorry's cab, with wheel arches and mirrors."""

    design: VanDesign

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_van_design(rng))

    def surface(self) -> Surface:
        design = self.design
        body = _extruded(design.profile(), design.width / 2, 0.07)
        body = without_arches(body, design.axles, design.wheel_radius, design.width)
        x, half, z = design.screen_foot[0] - 0.1, design.width / 2, design.screen_foot[1] + 0.25
        low = np.array([(x - 0.05, half - 0.13, z), (x - 0.05, -half - MIRROR_M, z)])
        return Surface(*joined(body, boxes(low, low + np.array((0.12, 0.13 + MIRROR_M, 0.35)))))


@dataclass(frozen=True)
class CargoBox(MetricShape):
    """A lorry's box: walls with ribs, a frame at the rear."""

    design: VanDesign

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(VanDesign.sample(rng, "lorry"))

    def surface(self) -> Surface:
        design = self.design
        front, rear = design.body_rear - 0.15, -design.length / 2
        half, floor = design.width / 2, 2 * design.wheel_radius + 0.12
        low = [(rear + 0.04, -half + 0.02, floor)]
        high = [(front - 0.04, half - 0.02, design.height - 0.02)]
        for x in (rear, front - 0.1):
            for y in (-half, half - 0.1):
                low.append((x, y, floor - 0.04))
                high.append((x + 0.1, y + 0.1, design.height - 0.005))
        low.append((rear + 0.01, -half + 0.01, floor - 0.12))
        high.append((front - 0.01, half - 0.01, floor + 0.06))
        for x in np.arange(rear + 0.7, front - 0.5, 0.62).tolist():  # ribs of the side walls
            low.append((x, -half + 0.006, floor))
            high.append((x + 0.05, half - 0.006, design.height - 0.05))
        # The gap between the rear doors, and their lock.
        low += [(rear + 0.015, -0.02, floor + 0.1), (rear + 0.005, 0.12, floor + 0.3)]
        high += [(rear + 0.2, 0.02, design.height - 0.15), (rear + 0.2, 0.16, design.height - 0.4)]
        return Surface(*boxes(np.array(low), np.array(high)))


@dataclass(frozen=True)
class VanGlass(MetricShape):
    """Windscreen and side windows, standing out of the body by a centimetre."""

    design: VanDesign

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_van_design(rng))

    def surface(self) -> Surface:
        design = self.design
        half = design.width / 2
        profile = design.profile()
        foot, head = profile[5], profile[6]
        low, high = (
            foot + 0.08 * (head - foot),
            foot + (0.62 if design.kind == "bus" and design.height > 4 else 0.93) * (head - foot),
        )
        normal = np.array((head[1] - foot[1], foot[0] - head[0])) / np.linalg.norm(head - foot)
        screen = []
        for y in (-half + 0.14, half - 0.14):
            for out in (-0.06, 0.012):
                screen += [(*(low + out * normal), y), (*(high + out * normal), y)]
        # Corner order: one face around, then the opposite one.
        s = np.array(screen)[:, (0, 2, 1)]
        bodies = [np.stack([s[0], s[1], s[3], s[2], s[4], s[5], s[7], s[6]])]
        for rear, front, bottom, top in self._side_windows():
            lean = 0.3 * (top - bottom) * (design.kind == "van") * (front == self._side_windows()[0][1])
            face = np.array([(rear, bottom), (front, bottom), (front - lean, top), (rear, top)])
            for side in (-1.0, 1.0):
                inner = np.column_stack([face[:, 0], np.full(4, side * (half - 0.05)), face[:, 1]])
                outer = inner + np.array((0.0, side * 0.058, 0.0))
                bodies.append(np.concatenate([inner, outer]))
        bodies += self._rear_windows()
        return Surface(*hexahedra(np.stack(bodies)))

    def _rear_windows(self) -> list[NDArray[np.float64]]:
        """Two windows in the rear doors of a van, one wide one in the tail of a bus."""
        design = self.design
        if design.kind == "lorry":
            return []
        top = min(design.height, 3.3) - 0.3
        half = design.width / 2 - 0.2
        spans = [(-half, half)] if design.kind == "bus" else [(-half, -0.08), (0.08, half)]
        rear = -design.length / 2
        return [
            np.array([(x, y, z) for x in (rear - 0.012, rear + 0.1) for y, z in self._corners(span, top)])
            for span in spans
        ]

    @staticmethod
    def _corners(span: tuple[float, float], top: float) -> list[tuple[float, float]]:
        low, high = span
        return [(low, top - 0.62), (high, top - 0.62), (high - 0.03, top - 0.12), (low + 0.03, top - 0.12)]

    def _side_windows(self) -> list[tuple[float, float, float, float]]:
        """Rear and front x, lower and upper z of each window on a side."""
        design = self.design
        foot = design.screen_foot
        front = foot[0] - 0.16
        if design.kind == "bus":
            count = int((design.length - 1.2) / 1.35)
            step = (design.length - 1.2) / count
            rows = [(1.05, 2.05)] if design.height < 4 else [(1.05, 1.95), (2.65, 3.55)]
            return [
                (front - (k + 1) * step + 0.06, front - k * step, bottom, top)
                for bottom, top in rows
                for k in range(count)
            ]
        top = min(foot[1] + 0.75, design.cab_height - 0.25)
        return [(front - (0.95 if design.kind == "van" else 1.0), front - 0.12, foot[1] + 0.02, top)]


@dataclass(frozen=True)
class VanTrim(MetricShape):
    """Black parts: frame and underbody, bumpers, grille, rear door gap."""

    design: VanDesign

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_van_design(rng))

    def surface(self) -> Surface:
        design = self.design
        half, wide = design.length / 2, design.width / 2
        inner = design.track - 0.2
        deck = 2 * design.wheel_radius + (0.05 if design.kind == "lorry" else 0.1)
        low = [
            (-half + 0.1, -inner, design.clearance - 0.02),
            (half - 0.4, -wide + 0.05, design.clearance + 0.02),
            (half - 0.4, -0.5 * wide, 0.62),
            (-half - 0.015, -wide + 0.06, design.clearance + 0.02),
        ]
        high = [
            (half - 0.2, inner, deck),
            (half + 0.02, wide - 0.05, design.clearance + 0.26),
            (half + 0.012, 0.5 * wide, 0.82),
            (-half + 0.3, wide - 0.06, design.clearance + 0.22),
        ]
        if design.kind == "van":
            self._add_door_gaps(low, high)
        return Surface(*boxes(np.array(low), np.array(high)))

    def _add_door_gaps(
        self, low: list[tuple[float, float, float]], high: list[tuple[float, float, float]]
    ) -> None:
        """The gaps between doors, as dark lines, and handles beside them."""
        design = self.design
        rear, half, top = -design.length / 2, design.width / 2, design.height - 0.16
        sill = design.clearance + 0.25
        low.append((rear - 0.004, -0.008, sill))
        high.append((rear + 0.1, 0.008, top))
        low.append((rear - 0.03, 0.05, 1.0))
        high.append((rear + 0.1, 0.2, 1.04))
        front = design.screen_foot[0] - 0.16
        for side in (-1.0, 1.0):
            for x in (front - 1.02, front - 2.1):
                low.append((x - 0.008, side * half - 0.005, sill + 0.1))
                high.append((x + 0.008, side * half + 0.005, top))
            low.append((front - 1.3, side * half - 0.02, 1.0))
            high.append((front - 1.12, side * half + 0.02, 1.035))
            low.append((rear + 0.3, side * half - 0.004, 1.2))
            high.append((front - 2.1, side * half + 0.012, 1.23))


@dataclass(frozen=True)
class VanLamps(MetricShape):
    """A van's head lamps or tail lamps."""

    design: VanDesign
    rear: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_van_design(rng), bool(rng.random() < 0.5))

    def surface(self) -> Surface:
        design = self.design
        half = design.width / 2
        if self.rear:
            size, x, z = (0.04, 0.12, 0.26), -design.length / 2, 2 * design.wheel_radius - 0.1
        else:
            size, x, z = (0.04, 0.28, 0.17), design.length / 2, design.clearance + 0.32
        low = np.array([(x - 0.03, half - 0.08 - size[1], z), (x - 0.03, -half + 0.08, z)])
        return Surface(*boxes(low, low + np.array((0.05, size[1], size[2]))))
