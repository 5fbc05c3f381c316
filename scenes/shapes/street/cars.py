"""Cars in parts, each in its own material: body, glass, trim, lamps, all of one design."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, joined, revolve
from scenes.geometry.polyhedra import boxes, hexahedra, loft
from scenes.random_draws import choose, uniform
from scenes.shapes.anchored import MetricShape, Surface
from scenes.shapes.street.wheels import MIRROR_M, without_arches
from scenes.spec import Vector


@dataclass(frozen=True)
class CarDesign:
    """Measures of a passenger car, metres."""

    length: float
    width: float
    height: float
    wheelbase: float
    wheel_radius: float
    bonnet_height: float
    """Top of the bonnet at the front edge."""
    belt_height: float
    """Lower edge of the side windows."""
    windscreen: tuple[float, float]
    """x of its lower and of its upper edge."""
    rear_window: tuple[float, float]
    """x of its lower and of its upper edge."""
    boot_height: float
    """Top of the body at the rear end; the belt height for a car without a separate boot."""
    clearance: float
    """Height of the sills above the ground."""
    side_pillars: tuple[float, ...]
    """x of the pillars between the side windows."""
    roundness: float
    """How much the ends are drawn in, seen from above, metres."""

    @classmethod
    def sample(cls, rng: np.random.Generator, kind: str) -> Self:
        """A hatchback, saloon, estate or suv."""
        long = {"hatchback": (3.6, 4.3), "saloon": (4.3, 4.9), "estate": (4.4, 4.9), "suv": (4.2, 4.9)}[kind]
        tall = {"hatchback": (1.42, 1.56), "saloon": (1.38, 1.47), "estate": (1.42, 1.52), "suv": (1.6, 1.82)}
        length, height = uniform(rng, *long), uniform(rng, *tall[kind])
        front, rear = length / 2 + uniform(rng, -0.04, 0.06), -length / 2
        belt = height * uniform(rng, 0.61, 0.66)
        bonnet = uniform(rng, 0.95, 1.2) * (length / 4.4)
        cowl = front - bonnet
        rake = uniform(rng, 0.55, 0.8)
        drop = {
            "hatchback": (0.08, uniform(rng, 0.3, 0.6)),
            "saloon": (uniform(rng, 0.75, 1.0), 0.6),
            "estate": (0.06, uniform(rng, 0.15, 0.4)),
            "suv": (0.06, uniform(rng, 0.2, 0.45)),
        }[kind]
        wheelbase = length * uniform(rng, 0.58, 0.62)
        middle = uniform(rng, -0.1, 0.15)
        pillars = (middle,) if kind in ("hatchback", "saloon") else (middle, middle - uniform(rng, 0.9, 1.0))
        return cls(
            length=length,
            width=uniform(rng, 1.68, 1.88),
            height=height,
            wheelbase=wheelbase,
            wheel_radius=uniform(rng, 0.29, 0.33) if kind != "suv" else uniform(rng, 0.34, 0.38),
            bonnet_height=belt - uniform(rng, 0.14, 0.26),
            belt_height=belt,
            windscreen=(cowl, cowl - rake),
            rear_window=(rear + drop[0], rear + sum(drop)),
            boot_height=belt + (uniform(rng, -0.04, 0.04) if kind == "saloon" else 0.0),
            clearance=uniform(rng, 0.16, 0.22) if kind != "suv" else uniform(rng, 0.24, 0.32),
            side_pillars=pillars,
            roundness=uniform(rng, 0.1, 0.24),
        )

    @property
    def axles(self) -> tuple[float, ...]:
        """x of the front and of the rear axle, metres."""
        return (self.wheelbase / 2, -self.wheelbase / 2)

    @property
    def track(self) -> float:
        """Distance from the middle to the middle of a wheel."""
        return self.width / 2 - 0.125

    def half_width(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of the body seen from above: nearly parallel sides, rounded ends."""
        share = np.clip(np.abs(2 * x / self.length), 0.0, 1.0)
        return self.width / 2 - self.roundness * share**4 - 0.22 * np.clip(share - 0.93, 0, 1) * self.width

    def top(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Upper edge of the body without the cabin."""
        front, rear = self.length / 2, -self.length / 2
        cowl, tail = self.windscreen[0], self.rear_window[0]
        knots = [rear, rear + 0.06, max(tail, rear + 0.1), cowl, front - 0.16, front - 0.02, front]
        heights = [
            self.boot_height - 0.14,
            self.boot_height - 0.02,
            self.belt_height + 0.01,
            self.belt_height - 0.01,
            self.bonnet_height + 0.04,
            self.bonnet_height - 0.06,
            self.bonnet_height - 0.16,
        ]
        return np.interp(x, knots, heights)

    def bottom(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Lower edge: the sills, rising a little at the bumpers."""
        share = np.abs(2 * x / self.length)
        return self.clearance + 0.1 * np.clip((share - 0.72) / 0.28, 0.0, 1.0) ** 2


def sample_car_design(rng: np.random.Generator) -> CarDesign:
    """A random passenger car of any kind."""
    return CarDesign.sample(rng, choose(rng, ["hatchback", "saloon", "estate", "suv"]))


def _outline(front: float, rear: float, half_width: float, bow: float, height: float) -> NDArray[np.float64]:
    """(12, 3) cabin outline at a height: a bowed front, straight sides, a slightly bowed rear."""
    y = np.array([-1.0, -0.93, -0.45, 0.45, 0.93, 1.0]) * half_width
    curve = (np.abs(y) / half_width) ** 2.2
    nose = np.stack([front - bow * curve, y], -1)
    tail = np.stack([rear + 0.5 * bow * curve, y], -1)[::-1]
    return np.column_stack([np.concatenate([nose, tail]), np.full(12, height)])


@dataclass(frozen=True)
class CarBody(MetricShape):
    """The painted shell: lower body with wheel arches, pillars, roof, door mirrors."""

    design: CarDesign

    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_car_design(rng))

    def surface(self) -> Surface:
        design = self.design
        lower = without_arches(self._lower(), design.axles, design.wheel_radius, design.width)
        return Surface(*joined(lower, self._roof(), self._pillars(), self._mirrors()))

    def _lower(self) -> Part:
        design = self.design
        half = design.length / 2
        ends = np.array([0.0, 0.012, 0.04, 0.09, 0.16, 0.27])
        inner = [design.windscreen[0], max(design.rear_window[0], -half + 0.3)]
        x = np.unique(np.concatenate([half - ends, -half + ends, inner, np.linspace(-0.5, 0.5, 9) * half]))[
            ::-1
        ]
        wide, top, bottom = design.half_width(x), design.top(x), design.bottom(x)
        rise = top - bottom
        # One side of a section, from below to the top: tucked in sill, bulging flank, shoulder, bonnet.
        shape = [(0.0, 0.0), (0.86, 0.0), (0.95, 0.1), (0.99, 0.3), (1.0, 0.55)]
        shape += [(0.985, 0.78), (0.955, 0.93), (0.9, 0.995), (0.55, 1.03), (0.0, 1.045)]
        across = np.array([y for y, _ in shape])
        up = np.array([z for _, z in shape])
        across, up = np.concatenate([across, -across[-2:0:-1]]), np.concatenate([up, up[-2:0:-1]])
        rings = np.empty((len(x), len(across), 3))
        rings[:, :, 0] = x[:, None]
        rings[:, :, 1] = wide[:, None] * across
        rings[:, :, 2] = bottom[:, None] + rise[:, None] * np.minimum(up, 1.0) + 0.6 * np.maximum(up - 1, 0)
        return loft(rings)

    def _roof(self) -> Part:
        design = self.design
        front, rear = design.windscreen[1], design.rear_window[1]
        half = 0.74 * design.width / 2
        levels = [(0.06, 0.02, -0.085), (0.03, 0.015, -0.04), (-0.06, -0.04, -0.012), (-0.35, -0.3, 0.0)]
        rings = [
            _outline(front + lead, rear - lead, half + side, 0.12, design.height + drop)
            for lead, side, drop in levels
        ]
        return loft(np.stack(rings))

    def _cabin_side(self, x: float, share: float) -> Vector:
        """A point of the left side window's plane: x along the belt line, share of the height to the roof."""
        design = self.design
        low, high = 0.925 * design.width / 2, 0.74 * design.width / 2
        top = design.height - 0.06
        return (
            x,
            low + share * (high - low),
            design.belt_height - 0.03 + share * (top - design.belt_height + 0.03),
        )

    def _pillar(
        self, bottom: tuple[float, float], top: tuple[float, float], side: float
    ) -> NDArray[np.float64]:
        """(8, 3) a bar in the plane of the side windows, standing out of it by a centimetre."""
        corners = [
            self._cabin_side(bottom[0], 0.0),
            self._cabin_side(bottom[1], 0.0),
            self._cabin_side(top[1], 1.0),
            self._cabin_side(top[0], 1.0),
        ]
        inner, outer = np.array(corners), np.array(corners)
        inner[:, 1] -= 0.07
        outer[:, 1] += 0.008
        bar = np.concatenate([inner, outer])
        bar[:, 1] *= side
        return bar

    def _pillars(self) -> Part:
        design = self.design
        (w_low, w_high), (r_low, r_high) = design.windscreen, design.rear_window
        thick = 0.07
        bars = [((w_low + 0.02, w_low - 0.08), (w_high + 0.05, w_high - 0.03))]
        bars += [
            ((x + thick / 2, x - thick / 2), (x + thick / 2 - 0.02, x - thick / 2 - 0.02))
            for x in design.side_pillars
        ]
        bars.append(((r_low + 0.2, r_low - 0.02), (r_high + 0.12, r_high - 0.04)))
        return hexahedra(np.stack([self._pillar(*bar, side) for bar in bars for side in (1.0, -1.0)]))

    def _mirrors(self) -> Part:
        x, half, z = self.design.windscreen[0] - 0.28, self.design.width / 2, self.design.belt_height
        low = np.array([(x - 0.07, half - 0.16, z - 0.01), (x - 0.07, -half - MIRROR_M, z - 0.01)])
        return boxes(low, low + np.array((0.13, 0.16 + MIRROR_M, 0.13)))


@dataclass(frozen=True)
class CarGlass(MetricShape):
    """All windows of a car as one body of dark glass inside the pillars."""

    design: CarDesign

    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_car_design(rng))

    def surface(self) -> Surface:
        design = self.design
        (w_low, w_high), (r_low, r_high) = design.windscreen, design.rear_window
        low, high = 0.925 * design.width / 2, 0.74 * design.width / 2
        bottom, top = design.belt_height - 0.06, design.height - 0.05
        rings = []
        for share in (0.0, 0.35, 0.7, 1.0):
            bulge = 0.03 * (1 - (2 * share - 1) ** 2)
            rings.append(
                _outline(
                    w_low + share * (w_high - w_low) + bulge,
                    r_low + share * (r_high - r_low) - bulge,
                    low + share * (high - low),
                    0.16,
                    bottom + share * (top - bottom),
                )
            )
        return Surface(*loft(np.stack(rings)))


@dataclass(frozen=True)
class CarTrim(MetricShape):
    """Black plastic: underbody, bumper strips, grille, door handles, wipers' cowl."""

    design: CarDesign

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_car_design(rng))

    def surface(self) -> Surface:
        design = self.design
        half, wide, low = design.length / 2, design.width / 2, design.clearance
        inner = design.track - 0.13
        grille = design.bonnet_height - 0.17
        items = [
            # Low and high corner of each box.
            ((-half + 0.3, -inner, low - 0.02), (half - 0.3, inner, design.wheel_radius * 2.0)),
            ((half - 0.3, -0.62 * wide, low + 0.09), (half + 0.012, 0.62 * wide, low + 0.24)),
            ((half - 0.3, -0.42 * wide, grille - 0.16), (half + 0.01, 0.42 * wide, grille)),
            ((-half - 0.012, -0.66 * wide, low + 0.1), (-half + 0.3, 0.66 * wide, low + 0.26)),
        ]
        for x in design.side_pillars:
            z = design.belt_height - 0.13
            items += [
                ((x + 0.02, -wide * 0.988, z), (x + 0.2, -wide * 0.9, z + 0.03)),
                ((x + 0.02, wide * 0.9, z), (x + 0.2, wide * 0.988, z + 0.03)),
            ]
        low_m, high_m = (np.array([item[k] for item in items]) for k in (0, 1))
        return Surface(*boxes(low_m, high_m))


@dataclass(frozen=True)
class CarLamps(MetricShape):
    """A car's head lamps or tail lamps."""

    design: CarDesign
    rear: bool

    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(sample_car_design(rng), bool(rng.random() < 0.5))

    def surface(self) -> Surface:
        design = self.design
        x = (-design.length / 2 + 0.05) if self.rear else (design.length / 2 - 0.1)
        z = (design.boot_height - 0.24) if self.rear else (design.bonnet_height - 0.13)
        y = float(design.half_width(np.array(x))) - 0.2
        size = np.array((0.1, 0.185, 0.1)) if self.rear else np.array((0.13, 0.2, 0.075))
        return Surface(*joined(*(_lens(np.array((x, side * y, z)), size) for side in (1.0, -1.0))))


def _lens(middle: NDArray[np.float64], size: NDArray[np.float64]) -> Part:
    """A rounded lamp: an ellipsoid of the given half extents."""
    latitude = np.linspace(-np.pi / 2, np.pi / 2, 7)
    vertices, triangles = revolve(np.cos(latitude), np.sin(latitude), 10)
    return vertices * size + middle, triangles
