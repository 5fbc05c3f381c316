"""Street furniture: lamp posts, signs, traffic lights, bollards, bins, benches, cabinets, shelters.

The anchor is on the ground; x is along the street or away from the post, z up, metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, joined, regular_polygon, revolve, struts, tube
from scenes.geometry.polyhedra import boxes, loft
from scenes.random_draws import chance, choose, integer, uniform
from scenes.shapes.anchored import MetricShape, Surface


def _post(height: float, foot: float, top: float, sides: int = 12) -> Part:
    """A tapering round post, a little below the ground at its foot."""
    start, end = np.array([(0.0, 0.0, -0.2)]), np.array([(0.0, 0.0, height)])
    return struts(start, end, np.array([foot]), np.array([top]), sides)


@dataclass(frozen=True)
class LampDesign:
    """A street lamp's measures, metres."""

    kind: str
    """arm, double or globe."""
    height: float
    reach: float
    """How far the arm stands out along x."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        """Draw a design."""
        kind = choose(rng, ["arm", "double", "globe"], [0.6, 0.15, 0.25])
        height = uniform(rng, 3.2, 4.2) if kind == "globe" else uniform(rng, 5.5, 9.0)
        return cls(kind, height, uniform(rng, 0.9, 2.2) if kind != "globe" else 0.0)

    @property
    def heads(self) -> list[tuple[float, float]]:
        """x and z of the light sources."""
        if self.kind == "globe":
            return [(0.0, self.height + 0.2)]
        sides = (1.0, -1.0) if self.kind == "double" else (1.0,)
        return [(side * self.reach, self.height + 0.25) for side in sides]


@dataclass(frozen=True)
class LampPost(MetricShape):
    """Post and arm of a street lamp."""

    design: LampDesign

    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(LampDesign.sample(rng))

    def surface(self) -> Surface:
        design = self.design
        parts = [_post(design.height, 0.085, 0.05), _post(0.9, 0.12, 0.11)]
        if design.kind == "globe":
            parts.append(
                boxes(np.array((-0.09, -0.09, design.height)), np.array((0.09, 0.09, design.height + 0.06)))
            )
        for x, z in design.heads if design.kind != "globe" else []:
            share = np.linspace(0.0, 1.0, 9)
            path = np.stack(
                [x * share, np.zeros(9), design.height - 0.05 + 0.3 * np.sin(share * np.pi / 2)], -1
            )
            vertices, triangles, _ = tube(path, np.linspace(0.05, 0.035, 9), 8)
            side = np.sign(x)
            low = np.array((min(x - 0.1 * side, x + 0.5 * side), -0.14, z - 0.05))
            high = np.array((max(x - 0.1 * side, x + 0.5 * side), 0.14, z + 0.05))
            parts += [(vertices, triangles), boxes(low, high)]
        return Surface(*joined(*parts))


@dataclass(frozen=True)
class LampLight(MetricShape):
    """The glass of a street lamp."""

    design: LampDesign

    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(LampDesign.sample(rng))

    def surface(self) -> Surface:
        parts = []
        for x, z in self.design.heads:
            latitude = np.linspace(-np.pi / 2, np.pi / 2, 7)
            ball, triangles = revolve(np.cos(latitude), np.sin(latitude), 10)
            if self.design.kind == "globe":
                parts.append((ball * 0.19 + (x, 0.0, z), triangles))
            else:
                middle = x + 0.22 * np.sign(x)
                parts.append((ball * (0.22, 0.11, 0.05) + (middle, 0.0, z - 0.05), triangles))
        return Surface(*joined(*parts))


@dataclass(frozen=True)
class SignPost(MetricShape):
    """The post of a traffic sign, and the back of its plate."""

    height: float
    plate: float
    """Half the plate's width."""
    corners: int
    """Of the plate: 0 for a disc, else 3, 4, 8."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 2.2, 3.0), uniform(rng, 0.28, 0.45), choose(rng, [0, 3, 4, 8]))

    def surface(self) -> Surface:
        post = _post(self.height + 0.02, 0.032, 0.032, 10)
        plate = _plate(self.corners, self.plate * 1.0, 0.034, 0.046, self.height - self.plate)
        return Surface(*joined(post, plate))


def _plate(corners: int, half: float, near: float, far: float, z: float) -> Part:
    """An upright plate facing along x, between two distances from the post."""
    outline = _plate_outline(corners) * half
    rings = [
        np.column_stack([np.full(len(outline), x), outline[:, 0], outline[:, 1] + z]) for x in (near, far)
    ]
    return loft(np.stack(rings))


def _plate_outline(corners: int) -> NDArray[np.float64]:
    """(N, 2) outline within the square of half width 1."""
    if corners == 0:
        return regular_polygon(28)
    if corners == 4:
        return regular_polygon(4, float(np.sqrt(2.0)), np.pi / 4)
    if corners == 3:
        return np.array([(-0.97, -0.78), (0.97, -0.78), (0.0, 0.9)])
    return regular_polygon(8, 1 / float(np.cos(np.pi / 8)), np.pi / 8)


@dataclass(frozen=True)
class SignFace(MetricShape):
    """The painted face of a traffic sign's plate; its picture fills it once."""

    post: SignPost

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(SignPost.sample(rng))

    def surface(self) -> Surface:
        post = self.post
        vertices, triangles = _plate(post.corners, post.plate, 0.045, 0.05, post.height - post.plate)
        # Half a metre of texture coordinates either way is the whole picture.
        plan = np.stack([vertices[:, 1], vertices[:, 2] - (post.height - post.plate)], -1)
        uv = (plan / post.plate + 1) / 2
        return Surface(vertices, triangles, uv[triangles])


@dataclass(frozen=True)
class TrafficLight(MetricShape):
    """Post, arm and black housing of a traffic light facing along x."""

    height: float
    reach: float
    """How far an arm carries a second light over the street; 0 for none."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 2.9, 3.6), uniform(rng, 2.0, 4.0) if chance(rng, 0.5) else 0.0)

    @property
    def heads(self) -> list[tuple[float, float]]:
        """y and z of the middle of each housing."""
        return [(0.0, self.height - 0.3), *([(self.reach, 5.3)] if self.reach else [])]

    def surface(self) -> Surface:
        parts = [_post(5.75 if self.reach else self.height, 0.07, 0.06)]
        if self.reach:
            start, end = np.array([(0.0, 0.0, 5.7)]), np.array([(0.0, self.reach + 0.2, 5.75)])
            parts.append(struts(start, end, np.array([0.05]), np.array([0.035]), 10))
        for y, z in self.heads:
            parts.append(boxes(np.array((0.06, y - 0.16, z - 0.45)), np.array((0.28, y + 0.16, z + 0.45))))
            parts.append(boxes(np.array((0.1, y - 0.28, z - 0.58)), np.array((0.115, y + 0.28, z + 0.58))))
        return Surface(*joined(*parts))


@dataclass(frozen=True)
class TrafficLightLens(MetricShape):
    """The lens of a traffic light that is on."""

    light: TrafficLight
    green: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(TrafficLight.sample(rng), chance(rng, 0.5))

    def surface(self) -> Surface:
        parts = []
        for y, z in self.light.heads:
            outline = regular_polygon(20, 0.1)
            level = z + (-0.28 if self.green else 0.28)
            rings = [
                np.column_stack([np.full(20, x), y + size * outline[:, 0], level + size * outline[:, 1]])
                for x, size in ((0.27, 1.0), (0.285, 1.0), (0.305, 0.6))
            ]
            parts.append(loft(np.stack(rings)))
        return Surface(*joined(*parts))


@dataclass(frozen=True)
class Bollard(MetricShape):
    """A post that keeps cars off the pavement."""

    height: float
    radius: float
    cap: float
    """Radius of the knob relative to the post; 0 for a plain one."""

    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 0.7, 1.1),
            uniform(rng, 0.05, 0.11),
            uniform(rng, 1.1, 1.4) if chance(rng, 0.5) else 0.0,
        )

    def surface(self) -> Surface:
        r, h = self.radius, self.height
        if self.cap:
            profile = [
                (0, -0.1),
                (r, -0.1),
                (r, h - 2.4 * r),
                (self.cap * r, h - 2.2 * r),
                (self.cap * r, h - 0.5 * r),
                (0.6 * r, h),
                (0, h),
            ]
        else:
            profile = [(0, -0.1), (r, -0.1), (r, h - 0.3 * r), (0.8 * r, h), (0, h)]
        line = np.array(profile, np.float64)
        return Surface(*revolve(line[:, 0], line[:, 1], 16))


@dataclass(frozen=True)
class LitterBin(MetricShape):
    """A bin: a round one on a foot or a wheeled box with a lid."""

    round: bool
    height: float
    width: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(chance(rng, 0.5), uniform(rng, 0.8, 1.15), uniform(rng, 0.4, 0.65))

    def surface(self) -> Surface:
        w, h = self.width / 2, self.height
        if self.round:
            line = np.array(
                [
                    (0, 0),
                    (0.8 * w, 0),
                    (w, 0.06),
                    (w, h - 0.08),
                    (1.06 * w, h - 0.07),
                    (1.06 * w, h),
                    (0.7 * w, h),
                    (0.66 * w, h - 0.15),
                    (0, h - 0.15),
                ]
            )
            return Surface(*revolve(line[:, 0], line[:, 1], 20))
        tub = np.array(
            [
                [(0.8 * x * w, 0.8 * y * w, 0.05) for x, y in _SQUARE],
                [(x * w, y * w, h - 0.08) for x, y in _SQUARE],
            ]
        )
        lid = boxes(np.array((-1.08 * w, -1.08 * w, h - 0.1)), np.array((1.04 * w, 1.04 * w, h - 0.03)))
        wheels = boxes(np.array((-w, -0.75 * w, 0.0)), np.array((-0.6 * w, 0.75 * w, 0.16)))
        return Surface(*joined(loft(tub), lid, wheels))


_SQUARE = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))


@dataclass(frozen=True)
class Bench(MetricShape):
    """Slats on two feet, with a back; one sits facing along y."""

    length: float
    slats: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 1.4, 2.2), integer(rng, 3, 5))

    def surface(self) -> Surface:
        half = self.length / 2
        low, high = [], []
        for slat in range(self.slats):
            y = -0.2 + 0.44 * slat / self.slats
            low.append((-half, y, 0.42))
            high.append((half, y + 0.35 / self.slats, 0.46))
        for z in (0.62, 0.78):
            low.append((-half, -0.3, z))
            high.append((half, -0.265, z + 0.1))
        for x in (-half + 0.15, half - 0.2):
            low += [(x, -0.2, -0.02), (x + 0.003, -0.27, 0.3)]
            high += [(x + 0.05, 0.22, 0.421), (x + 0.047, -0.22, 0.86)]
        return Surface(*boxes(np.array(low), np.array(high)))


@dataclass(frozen=True)
class StreetCabinet(MetricShape):
    """A grey box of the telephone or power company, with a plinth and a rim."""

    width: float
    height: float
    depth: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 0.6, 1.5), uniform(rng, 0.9, 1.5), uniform(rng, 0.3, 0.5))

    def surface(self) -> Surface:
        w, d, h = self.width / 2, self.depth / 2, self.height
        low = [
            (-w + 0.02, -d + 0.02, -0.05),
            (-w, -d, 0.12),
            (-w - 0.03, -d - 0.03, h - 0.05),
            (-0.01, d - 0.02, 0.16),
        ]
        high = [
            (w - 0.02, d - 0.02, 0.13),
            (w, d, h - 0.03),
            (w + 0.03, d + 0.03, h),
            (0.01, d + 0.012, h - 0.1),
        ]
        return Surface(*boxes(np.array(low), np.array(high)))


@dataclass(frozen=True)
class BusShelter(MetricShape):
    """Frame and roof of a shelter that opens along y."""

    length: float
    depth: float
    height: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 2.6, 4.4), uniform(rng, 1.1, 1.5), uniform(rng, 2.3, 2.6))

    def surface(self) -> Surface:
        half, d, h = self.length / 2, self.depth, self.height
        low = [(-half - 0.1, -0.1, h), (-half + 0.3, 0.12, 0.42)]
        high = [(half + 0.1, d + 0.15, h + 0.1), (half - 0.3, 0.42, 0.46)]
        for x in (-half, 0.0, half - 0.06):
            low.append((x, 0.0, -0.1))
            high.append((x + 0.06, 0.06, h + 0.005))
        for x in (-half, half - 0.06):
            low.append((x, d - 0.1, -0.1))
            high.append((x + 0.06, d - 0.04, h + 0.005))
        for z in (0.25, 2.05):
            low.append((-half + 0.01, 0.01, z))
            high.append((half - 0.01, 0.05, z + 0.05))
        return Surface(*boxes(np.array(low), np.array(high)))


@dataclass(frozen=True)
class ShelterPanes(MetricShape):
    """The glass in the back and the sides of a shelter."""

    shelter: BusShelter

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(BusShelter.sample(rng))

    def surface(self) -> Surface:
        half, d = self.shelter.length / 2, self.shelter.depth
        low = [(-half + 0.02, 0.024, 0.29), (-half + 0.024, 0.05, 0.3), (half - 0.036, 0.05, 0.3)]
        high = [(half - 0.02, 0.036, 2.06), (-half + 0.036, d - 0.08, 2.05), (half - 0.024, d - 0.08, 2.05)]
        return Surface(*boxes(np.array(low), np.array(high)))
