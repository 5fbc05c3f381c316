"""People on foot, part by part: clothes above, clothes below, skin, features, hair, and what they wear besides.

The parts of one person share one design and one origin: the ground between the feet; x is forward, y to the
left, z up, metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, joined, revolve, tube
from scenes.geometry.polyhedra import boxes, loft
from scenes.random_draws import chance, uniform
from scenes.shapes.anchored import MetricShape, Surface


@dataclass(frozen=True)
class PersonDesign:
    """Measures of a person of 1.75 m, all scaled by `height` / 1.75, in one moment of a step."""

    height: float
    girth: float
    """Width of the body relative to a slim one."""
    stride_deg: float
    """How far the legs are apart, front to back."""
    lead: float
    """Which leg is in front: 1 left, -1 right."""
    arms_deg: float
    """How far the upper arms stand off the body, sideways."""
    skirt: float
    """Length of a skirt below the waist, metres; 0 for trousers alone."""
    coat: float
    """How far the coat comes down below the waist, metres; 0 for a jacket or shirt."""
    hair: str
    """short, bob, long, tail, or bald with a rim of hair."""
    hat: str
    """none, cap, woollen or brimmed."""
    bag: str
    """none, backpack or hand."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        """Draw a design."""
        child = chance(rng, 0.15)
        return cls(
            height=uniform(rng, 1.05, 1.45) if child else uniform(rng, 1.55, 1.92),
            girth=uniform(rng, 0.92, 1.3),
            stride_deg=uniform(rng, 3.0, 24.0),
            lead=1.0 if chance(rng, 0.5) else -1.0,
            arms_deg=uniform(rng, 4.0, 14.0),
            skirt=uniform(rng, 0.25, 0.6) if chance(rng, 0.25) else 0.0,
            coat=uniform(rng, 0.15, 0.5) if chance(rng, 0.35) else 0.0,
            hair=str(rng.choice(["short", "short", "bob", "long", "tail", "bald"])),
            hat=str(rng.choice(["none", "none", "none", "cap", "woollen", "brimmed"])),
            bag=str(rng.choice(["none", "none", "backpack", "hand"])),
        )

    @property
    def scale(self) -> float:
        """Size relative to a person of 1.75 m."""
        return self.height / 1.75

    def hip(self, side: float) -> NDArray[np.float64]:
        """(3,) the left (1) or right (-1) hip joint of the unscaled body, metres."""
        return np.array((0.0, 0.095 * side * self.girth, 0.9))

    def leg(self, side: float) -> NDArray[np.float64]:
        """(3, 3) hip, knee and ankle of the left (1) or right (-1) leg."""
        swing = np.radians(self.stride_deg * side * self.lead)
        bend = 0.25 * abs(swing) + (0.5 * abs(swing) if swing < 0 else 0.0)
        hip = self.hip(side)
        knee = hip + 0.43 * np.array((np.sin(swing), 0.0, -np.cos(swing)))
        ankle = knee + 0.4 * np.array((np.sin(swing - bend), 0.0, -np.cos(swing - bend)))
        return np.stack([hip, knee, ankle])

    @property
    def drop(self) -> float:
        """How much the stride lowers the body: the lower ankle is 7 cm above the ground."""
        return float(min(self.leg(side)[2, 2] for side in (1.0, -1.0))) - 0.07

    def arm(self, side: float) -> NDArray[np.float64]:
        """(3, 3) shoulder, elbow and wrist."""
        swing = np.radians(-0.9 * self.stride_deg * side * self.lead)
        out = np.sin(np.radians(self.arms_deg)) * side
        shoulder = np.array((0.0, 0.19 * side * (0.5 + 0.5 * self.girth), 1.4))
        elbow = shoulder + 0.28 * np.array((np.sin(swing), out, -np.cos(swing)))
        wrist = elbow + 0.25 * np.array((np.sin(swing + 0.35), 0.3 * out, -np.cos(swing + 0.35)))
        return np.stack([shoulder, elbow, wrist])

    def placed(self, *parts: Part) -> Surface:
        """Parts of the unscaled standing body, lowered onto the ground and scaled."""
        vertices, triangles = joined(*parts)
        return Surface((vertices - (0.0, 0.0, self.drop)) * self.scale, triangles)


def _limb(joints: NDArray[np.float64], radii: tuple[float, float, float]) -> Part:
    """A round limb through three joints, its ends drawn in."""
    ends = joints[[0, -1]] + 0.6 * np.array([[radii[0]], [radii[-1]]]) * _directions(joints)
    middle = [(joints[k] + joints[k + 1]) / 2 for k in (0, 1)]
    path = np.stack([ends[0], joints[0], middle[0], joints[1], middle[1], joints[2], ends[1]])
    a, b, c = radii
    radius = np.array([0.55 * a, a, (a + b) / 2, b, (b + c) / 2, c, 0.6 * c])
    vertices, triangles, _ = tube(path, radius, 8)
    return vertices, triangles


def _directions(joints: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2, 3) unit vectors out of both ends of a chain."""
    ends = np.stack([joints[0] - joints[1], joints[-1] - joints[-2]])
    return ends / np.linalg.norm(ends, axis=1, keepdims=True)


def _stack(levels: list[tuple[float, float, float, float]], girth: float) -> Part:
    """An upright body of elliptic sections: height, half width, half depth, and middle x of each."""
    angle = np.linspace(0, 2 * np.pi, 14, endpoint=False)
    rings = [
        np.stack([x + deep * girth * np.cos(angle), wide * girth * np.sin(angle), np.full(14, z)], -1)
        for z, wide, deep, x in levels
    ]
    return loft(np.stack(rings))


def _ball(middle: tuple[float, float, float], size: tuple[float, float, float]) -> Part:
    latitude = np.linspace(-np.pi / 2, np.pi / 2, 8)
    vertices, triangles = revolve(np.cos(latitude), np.sin(latitude), 11)
    return vertices * size + middle, triangles


@dataclass(frozen=True)
class _PersonPart(MetricShape):
    """A part of a person; parts of one design fit together."""

    design: PersonDesign

    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(PersonDesign.sample(rng))


@dataclass(frozen=True)
class PersonTop(_PersonPart):
    """Shirt, jacket or coat: torso, sleeves, a collar."""

    def surface(self) -> Surface:
        design = self.design
        levels = [
            (0.88, 0.13, 0.09, 0.0),
            (0.9, 0.172, 0.115, 0.0),
            (1.0, 0.16, 0.11, 0.0),
            (1.12, 0.158, 0.11, 0.0),
            (1.28, 0.185, 0.125, 0.0),
            (1.4, 0.18, 0.11, -0.005),
            (1.46, 0.13, 0.085, -0.01),
            (1.5, 0.062, 0.062, -0.01),
            (1.52, 0.05, 0.05, -0.01),
        ]
        sleeves = [_limb(design.arm(side), (0.062, 0.05, 0.042)) for side in (1.0, -1.0)]
        collar = _stack([(1.47, 0.085, 0.08, -0.012), (1.535, 0.068, 0.07, -0.012)], 1.0)
        parts = [_stack(levels, design.girth), *sleeves, collar]
        if design.coat:
            low, wide = 0.9 - design.coat, 0.19 + 0.1 * design.coat
            tails = [(low, wide, 0.15, 0.0), (low + 0.02, wide + 0.01, 0.155, 0.0), (0.98, 0.176, 0.122, 0.0)]
            parts.append(_stack(tails, design.girth))
        return design.placed(*parts)


@dataclass(frozen=True)
class PersonLegs(_PersonPart):
    """Trousers or skirt."""

    def surface(self) -> Surface:
        design = self.design
        hips = [
            (0.8, 0.1, 0.08, 0.0),
            (0.83, 0.165, 0.11, 0.0),
            (0.93, 0.165, 0.11, 0.0),
            (0.96, 0.12, 0.08, 0.0),
        ]
        parts = [_stack(hips, design.girth)]
        for side in (1.0, -1.0):
            leg = design.leg(side)
            thick = 0.5 + 0.5 * design.girth
            parts.append(_limb(leg, (0.085 * thick, 0.062 * thick, 0.05)))
        if design.skirt:
            low = 0.9 - design.skirt
            spread = 0.12 + 0.25 * design.skirt
            skirt = [
                (low, spread, spread, 0.0),
                (low + 0.02, spread + 0.06, spread + 0.03, 0.0),
                (0.95, 0.172, 0.118, 0.0),
            ]
            parts.append(_stack(skirt, design.girth))
        return design.placed(*parts)


@dataclass(frozen=True)
class PersonThings(_PersonPart):
    """Shoes, hat and bag."""

    def surface(self) -> Surface:
        design = self.design
        parts = []
        for side in (1.0, -1.0):
            x, y, z = design.leg(side)[2]
            parts.append(_ball((x + 0.055, y, z - 0.035), (0.13, 0.047, 0.042)))
            parts.append(
                boxes(np.array((x - 0.06, y - 0.04, z - 0.07)), np.array((x + 0.16, y + 0.04, z - 0.05)))
            )
        parts += self._hat()
        if design.bag == "backpack":
            back = -0.1 * design.girth
            parts.append(boxes(np.array((back - 0.16, -0.14, 1.02)), np.array((back, 0.14, 1.44))))
        elif design.bag == "hand":
            x, y, z = design.arm(-1.0)[2]
            parts.append(
                boxes(np.array((x - 0.17, y - 0.08, z - 0.48)), np.array((x + 0.17, y + 0.04, z - 0.14)))
            )
        return design.placed(*parts)

    def _hat(self) -> list[Part]:
        hat = self.design.hat
        if hat == "none":
            return []
        if hat == "woollen":
            return [
                _stack(
                    [(1.69, 0.1, 0.115, -0.01), (1.73, 0.099, 0.112, -0.01), (1.79, 0.06, 0.07, -0.015)], 1.0
                )
            ]
        crown = _stack(
            [(1.7, 0.096, 0.11, -0.005), (1.75, 0.09, 0.1, -0.01), (1.79, 0.06, 0.065, -0.01)], 1.0
        )
        if hat == "cap":
            return [crown, _stack([(1.698, 0.07, 0.08, 0.12), (1.708, 0.07, 0.08, 0.12)], 1.0)]
        return [crown, _stack([(1.698, 0.18, 0.19, 0.0), (1.71, 0.17, 0.18, 0.0)], 1.0)]


@dataclass(frozen=True)
class PersonSkin(_PersonPart):
    """Head with nose, chin and ears, neck and hands."""

    def surface(self) -> Surface:
        design = self.design
        neck = [(1.45, 0.05, 0.052, -0.01), (1.6, 0.05, 0.05, 0.0)]
        parts = [_ball((0.012, 0.0, 1.635), (0.098, 0.076, 0.118)), _stack(neck, 1.0)]
        parts.append(_ball((0.108, 0.0, 1.62), (0.02, 0.014, 0.024)))
        parts.append(_ball((0.055, 0.0, 1.545), (0.042, 0.042, 0.032)))
        parts += [_ball((0.0, side * 0.078, 1.63), (0.022, 0.012, 0.032)) for side in (1.0, -1.0)]
        for side in (1.0, -1.0):
            hand = design.arm(side)[2] + 0.05 * _directions(design.arm(side))[1]
            parts.append(_ball((float(hand[0]), float(hand[1]), float(hand[2])), (0.042, 0.03, 0.075)))
        return design.placed(*parts)


@dataclass(frozen=True)
class PersonFeatures(_PersonPart):
    """Eyes, brows and mouth."""

    def surface(self) -> Surface:
        parts = [_ball((0.103, 0.0, 1.578), (0.009, 0.026, 0.007))]
        for side in (1.0, -1.0):
            parts.append(_ball((0.1, side * 0.032, 1.648), (0.01, 0.014, 0.009)))
            parts.append(_ball((0.1, side * 0.034, 1.67), (0.012, 0.02, 0.005)))
        return self.design.placed(*parts)


@dataclass(frozen=True)
class PersonHair(_PersonPart):
    """Hair over the head, of one of several cuts."""

    def surface(self) -> Surface:
        cut = self.design.hair
        if cut == "bald":
            return self.design.placed(_ball((-0.03, 0.0, 1.62), (0.085, 0.083, 0.06)))
        parts = [_ball((-0.014, 0.0, 1.672), (0.1, 0.086, 0.098))]
        if cut == "bob":
            parts += [_ball((-0.02, side * 0.055, 1.6), (0.075, 0.035, 0.1)) for side in (1.0, -1.0)]
            parts.append(_ball((-0.06, 0.0, 1.6), (0.05, 0.075, 0.1)))
        elif cut == "long":
            parts.append(_ball((-0.065, 0.0, 1.53), (0.055, 0.09, 0.2)))
            parts += [_ball((-0.02, side * 0.065, 1.56), (0.06, 0.03, 0.14)) for side in (1.0, -1.0)]
        elif cut == "tail":
            parts.append(_ball((-0.12, 0.0, 1.69), (0.035, 0.03, 0.03)))
            parts.append(_ball((-0.14, 0.0, 1.58), (0.028, 0.032, 0.12)))
        return self.design.placed(*parts)
