"""Cars, vans, lorries and buses, part by part: body, glass, trim, lamps, wheels.

A vehicle's parts share one design and one origin: the ground below its middle; x is forward, y to the left,
z up, metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from manifold3d import Manifold, Mesh64
from numpy.typing import NDArray

from scenes.drawing import choose, integer, uniform
from scenes.geometry import Triangles, Vertices, joined, manifold_arrays, revolve
from scenes.metric import MetricShape, Surface, boxes, hexahedra, loft, outward
from scenes.spec import Vector

_Part = tuple[Vertices, Triangles]

MIRROR_M = 0.12
"""How far door mirrors stand out of the body."""


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


def any_car(rng: np.random.Generator) -> CarDesign:
    return CarDesign.sample(rng, choose(rng, ["hatchback", "saloon", "estate", "suv"]))


def _without_arches(body: _Part, axles: tuple[float, ...], wheel_radius: float, width: float) -> _Part:
    """The body with a tunnel for each pair of wheels."""
    solid = Manifold(Mesh64(np.ascontiguousarray(body[0]), np.ascontiguousarray(body[1].astype(np.uint64))))
    arch = Manifold.cylinder(width + 1.0, wheel_radius * 1.16, circular_segments=28, center=True)
    for axle in axles:
        solid -= arch.rotate((90.0, 0.0, 0.0)).translate((axle, 0.0, wheel_radius))
    return manifold_arrays(solid)


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
        return cls(any_car(rng))

    def surface(self) -> Surface:
        design = self.design
        lower = _without_arches(self._lower(), design.axles, design.wheel_radius, design.width)
        return Surface(*joined(lower, self._roof(), self._pillars(), self._mirrors()))

    def _lower(self) -> _Part:
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

    def _roof(self) -> _Part:
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

    def _pillars(self) -> _Part:
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

    def _mirrors(self) -> _Part:
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
        return cls(any_car(rng))

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
        return cls(any_car(rng))

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
        return cls(any_car(rng), bool(rng.random() < 0.5))

    def surface(self) -> Surface:
        design = self.design
        x = (-design.length / 2 + 0.05) if self.rear else (design.length / 2 - 0.1)
        z = (design.boot_height - 0.24) if self.rear else (design.bonnet_height - 0.13)
        y = float(design.half_width(np.array(x))) - 0.2
        size = np.array((0.1, 0.185, 0.1)) if self.rear else np.array((0.13, 0.2, 0.075))
        return Surface(*joined(*(_lens(np.array((x, side * y, z)), size) for side in (1.0, -1.0))))


def _lens(middle: NDArray[np.float64], size: NDArray[np.float64]) -> _Part:
    """A rounded lamp: an ellipsoid of the given half extents."""
    latitude = np.linspace(-np.pi / 2, np.pi / 2, 7)
    vertices, triangles = revolve(np.cos(latitude), np.sin(latitude), 10)
    return vertices * size + middle, triangles


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


def any_van(rng: np.random.Generator) -> VanDesign:
    return VanDesign.sample(rng, choose(rng, ["van", "lorry", "bus"]))


def _pulled(profile: NDArray[np.float64], half_width: float, bevel: float) -> _Part:
    """A side view pulled across the vehicle's width, its edges bevelled."""
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
        return cls(any_van(rng))

    def surface(self) -> Surface:
        design = self.design
        body = _pulled(design.profile(), design.width / 2, 0.07)
        body = _without_arches(body, design.axles, design.wheel_radius, design.width)
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
        return Surface(*boxes(np.array(low), np.array(high)))


@dataclass(frozen=True)
class VanGlass(MetricShape):
    """Windscreen and side windows, standing out of the body by a centimetre."""

    design: VanDesign

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(any_van(rng))

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
        return Surface(*hexahedra(np.stack(bodies)))

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
        return cls(any_van(rng))

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
        return Surface(*boxes(np.array(low), np.array(high)))


@dataclass(frozen=True)
class VanLamps(MetricShape):
    """A van's head lamps or tail lamps."""

    design: VanDesign
    rear: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(any_van(rng), bool(rng.random() < 0.5))

    def surface(self) -> Surface:
        design = self.design
        half = design.width / 2
        if self.rear:
            size, x, z = (0.04, 0.12, 0.26), -design.length / 2, 2 * design.wheel_radius - 0.1
        else:
            size, x, z = (0.04, 0.28, 0.17), design.length / 2, design.clearance + 0.32
        low = np.array([(x - 0.03, half - 0.08 - size[1], z), (x - 0.03, -half + 0.08, z)])
        return Surface(*boxes(low, low + np.array((0.05, size[1], size[2]))))


@dataclass(frozen=True)
class Wheel(MetricShape):
    """A wheel about the y axis, its origin in its middle: tyre, recessed rim, hub.

    Texture coordinates are those of a picture of its side, whose rim unrolls onto the tread.
    """

    radius: float
    width: float
    rim: float
    """Radius of the rim relative to the wheel."""
    sides: int = 24

    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 0.28, 0.5), uniform(rng, 0.18, 0.26), uniform(rng, 0.6, 0.72), integer(rng, 12, 28)
        )

    def surface(self) -> Surface:
        r, w, rim = self.radius, self.width / 2, self.rim * self.radius
        # Radius and distance from the middle plane, from the hub outwards.
        half = [
            (0.0, 0.62 * w),
            (0.18 * rim, 0.62 * w),
            (0.22 * rim, 0.5 * w),
            (0.9 * rim, 0.58 * w),
            (0.95 * rim, 0.9 * w),
            (1.04 * rim, 0.93 * w),
            (0.93 * r, w),
            (r, 0.8 * w),
        ]
        profile = np.array([*half, (r, 0.0), *[(a, -b) for a, b in half[::-1]]])
        vertices, triangles = revolve(profile[:, 0], profile[:, 1], self.sides)
        tread = np.clip(0.8 * w - np.abs(vertices[:, 2]), 0.0, None)
        tread[np.hypot(vertices[:, 0], vertices[:, 1]) < 0.9 * r] = 0.0
        plan = vertices[:, :2] * (1 + tread / r)[:, None]
        # Revolved about z; the axle is y.
        axle_y = np.stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]], -1)
        triangles = outward(axle_y, triangles)
        return Surface(axle_y, triangles, plan[triangles])


@dataclass(frozen=True)
class WheelSet(MetricShape):
    """All wheels of a vehicle that stands still, in its own frame."""

    wheel: Wheel
    places: tuple[tuple[float, float], ...]
    """x and y of each."""

    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        x, y = uniform(rng, 1.1, 1.5), uniform(rng, 0.7, 0.9)
        return cls(Wheel.sample(rng), ((x, y), (x, -y), (-x, y), (-x, -y)))

    def surface(self) -> Surface:
        one = self.wheel.surface()
        hubs = [np.array((x, y, self.wheel.radius)) for x, y in self.places]
        vertices, triangles = joined(*((one.vertices + hub, one.triangles) for hub in hubs))
        assert one.uv is not None
        return Surface(vertices, triangles, np.tile(one.uv, (len(hubs), 1, 1)))


VEHICLE_PARTS = (
    *(CarBody, CarGlass, CarTrim, CarLamps),
    *(VanBody, CargoBox, VanGlass, VanTrim, VanLamps),
    *(Wheel, WheelSet),
)
"""What makes an object a part of a vehicle."""
