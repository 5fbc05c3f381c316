"""Vegetation: grass, ferns, broad leaves, bushes, trees, palms, conifers, bamboo, vines, mushrooms.

Plants are rooted: their lowest point is the base of the stem, about over the origin of the ground plan.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.drawing import choose, integer, log_uniform, new_seed, uniform
from scenes.geometry import Vertices, joined, revolve, struts, tube
from scenes.leaves import arched, around, horizontal_side, strips
from scenes.spec import Shape
from scenes.standing import Part, Standing

_UP = np.array((0.0, 0.0, 1.0))


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    scaled: NDArray[np.float64] = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return scaled


def _stem(path: Vertices, radius: NDArray[np.float64], sides: int = 7) -> Part:
    vertices, triangles, _ = tube(path, radius, sides)
    return vertices, triangles


def _winding_path(
    rng: np.random.Generator, start: Vertices, end: Vertices, wobble: float, points: int
) -> Vertices:
    """(points, 3) from start to end, straying sideways by about `wobble`, not at all at the start."""
    share = np.linspace(0.0, 1.0, points)
    waves = np.zeros((points, 3))
    for k in range(3):
        waves += np.outer(np.sin(np.pi * share * (k + 0.5)), rng.normal(0.0, 1.0 / (k + 1), 3))
    path: Vertices = start + np.outer(share, end - start) + wobble * waves * (1.0, 1.0, 0.3)
    return path


def leaf_cloud(
    rng: np.random.Generator, centres: Vertices, radius: NDArray[np.float64], leaves: int, size: float
) -> Part:
    """Pointed leaves on the outside of balls, hanging outward: the crowns of bushes and trees."""
    owner = rng.integers(0, len(centres), leaves)
    outward = _unit(rng.normal(size=(leaves, 3)) + 0.25 * _UP)
    base = centres[owner] + outward * (radius[owner] * rng.uniform(0.55, 1.0, leaves))[:, None]
    direction = _unit(outward + rng.normal(0.0, 0.5, (leaves, 3)) - 0.35 * _UP)
    length = size * rng.uniform(0.7, 1.3, leaves)
    paths = arched(base, direction, length, rng.uniform(0.0, 0.3, leaves), 3)
    side = horizontal_side(direction, rng)
    tilt = _unit(side + rng.normal(0.0, 0.35, (leaves, 3)))
    return strips(paths, tilt, (0.34 * length)[:, None])


@dataclass(frozen=True)
class GrassTuft(Standing):
    """Blades growing from a disc, bending outward: grass, reeds, a mop of hair."""

    blades: int
    spread: float
    """Radius of the disc relative to the blades' length."""
    lean_deg: float
    """How far the outermost blades lean outward."""
    droop: float
    """How far tips fall, relative to the length."""
    width: float
    """Half width relative to the length."""
    seed: int

    popularity: ClassVar[float] = 0.3

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            blades=integer(rng, 60, 200),
            spread=uniform(rng, 0.15, 0.9),
            lean_deg=uniform(rng, 10.0, 50.0),
            droop=uniform(rng, 0.1, 0.6),
            width=log_uniform(rng, 0.012, 0.035),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        n = self.blades
        share, heading = np.sqrt(rng.random(n)), rng.uniform(0.0, 2 * np.pi, n)
        outward = np.stack([np.cos(heading), np.sin(heading), np.zeros(n)], -1)
        lean = np.radians(self.lean_deg) * share * rng.uniform(0.5, 1.3, n)
        aside = _unit(outward + rng.normal(0.0, 0.4, (n, 3)) * (1, 1, 0))
        direction = np.cos(lean)[:, None] * _UP + np.sin(lean)[:, None] * aside
        length = rng.uniform(0.45, 1.0, n)
        base = outward * (self.spread * share)[:, None]
        paths = arched(base, direction, length, np.zeros(n), 4)
        # Blades bend the way they lean, more towards their tips.
        bend = self.droop * rng.uniform(0.3, 1.3, n) * length
        rise = np.linspace(0.0, 1.0, 4) ** 2
        paths += (bend[:, None] * rise)[..., None] * (0.8 * aside - 0.55 * _UP)[:, None]
        paths[..., 2] = np.maximum(paths[..., 2], 0.0)
        width = self.width * rng.uniform(0.7, 1.3, (n, 1)) * np.array([[1.0, 0.75]])
        return {"blades": strips(paths, horizontal_side(direction, rng), width, 0.25)}


@dataclass(frozen=True)
class Fern(Standing):
    """Arching fronds with a row of leaflets on either side."""

    fronds: int
    leaflets: int
    """On each side of a frond."""
    elevation_deg: float
    """How steeply the fronds rise at their base."""
    droop: float
    leaflet: float
    """Length of the longest leaflet relative to the frond."""
    seed: int

    popularity: ClassVar[float] = 0.3

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            fronds=integer(rng, 6, 12),
            leaflets=integer(rng, 9, 15),
            elevation_deg=uniform(rng, 35.0, 70.0),
            droop=uniform(rng, 0.4, 0.9),
            leaflet=uniform(rng, 0.16, 0.32),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        direction = around(rng, self.fronds, (self.elevation_deg - 15.0, self.elevation_deg + 12.0))
        droop = self.droop * rng.uniform(0.7, 1.3, self.fronds)
        length = rng.uniform(0.7, 1.0, self.fronds)
        spine = arched(np.zeros((self.fronds, 3)), direction, length, droop, 7)
        side = horizontal_side(direction, rng)
        stalk = strips(spine, side, np.full((self.fronds, 5), 0.012), 0.8)
        # Leaflets start a fifth of the way up the frond; longest at a third, none at the tip.
        at = np.linspace(0.2, 0.97, self.leaflets)
        size = self.leaflet * np.sin(np.pi * np.clip(at, 0, 1) ** 0.7) ** 0.8 + 0.015
        step = at * 6
        low = np.minimum(step.astype(int), 5)
        points = spine[:, low] + (spine[:, low + 1] - spine[:, low]) * (step - low)[:, None]
        ahead = _unit(spine[:, low + 1] - spine[:, low])
        parts = [stalk]
        for sign in (-1.0, 1.0):
            outward = _unit(sign * side[:, None] + 0.45 * ahead + rng.normal(0.0, 0.06, points.shape))
            base, aim = points.reshape(-1, 3), outward.reshape(-1, 3)
            lengths = (length[:, None] * size).ravel()
            paths = arched(base, aim, lengths, np.full(len(base), 0.25), 3)
            parts.append(strips(paths, ahead.reshape(-1, 3), (0.17 * lengths + 0.004)[:, None], 0.15))
        return {"fronds": joined(*parts)}


@dataclass(frozen=True)
class BroadLeaves(Standing):
    """A rosette of large leaves on arching stalks: banana, hosta, rubber plant, agave."""

    leaves: int
    elevation_deg: float
    droop: float
    width: float
    """Half width relative to the leaf's length."""
    stalk: float
    """Share of the leaf's length that is stalk."""
    seed: int

    popularity: ClassVar[float] = 0.4
    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            leaves=integer(rng, 5, 14),
            elevation_deg=uniform(rng, 30.0, 70.0),
            droop=uniform(rng, 0.3, 1.0),
            width=uniform(rng, 0.08, 0.24),
            stalk=uniform(rng, 0.0, 0.45),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        stations = 10
        direction = around(
            rng, self.leaves, (self.elevation_deg - 20.0, min(self.elevation_deg + 20.0, 85.0))
        )
        length = rng.uniform(0.6, 1.0, self.leaves)
        paths = arched(
            np.zeros((self.leaves, 3)),
            direction,
            length,
            self.droop * rng.uniform(0.5, 1.3, self.leaves),
            stations,
        )
        share = np.linspace(0.0, 1.0, stations)[1:-1]
        blade = np.clip((share - self.stalk) / (1 - self.stalk), 0.0, 1.0)
        outline = np.maximum(self.width * np.sin(np.pi * blade**0.75) ** 0.7, 0.018 * (1.2 - share))
        widths = length[:, None] * outline[None] * rng.uniform(0.8, 1.2, (self.leaves, 1))
        side = _unit(horizontal_side(direction, rng) + rng.normal(0.0, 0.2, (self.leaves, 3)))
        return {"leaves": strips(paths, side, widths, 0.14)}


@dataclass(frozen=True)
class Bush(Standing):
    """A heap of leafy balls with twigs inside."""

    clumps: int
    leaves: int
    leaf_size: float
    """Relative to the bush's radius."""
    height: float
    """Relative to the radius of the ground plan."""
    seed: int

    popularity: ClassVar[float] = 0.4

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            clumps=integer(rng, 3, 8),
            leaves=integer(rng, 120, 300),
            leaf_size=uniform(rng, 0.16, 0.34),
            height=uniform(rng, 0.6, 1.5),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        heading, reach = rng.uniform(0, 2 * np.pi, self.clumps), 0.6 * np.sqrt(rng.random(self.clumps))
        height = self.height * rng.uniform(0.45, 1.1, self.clumps)
        centres = np.stack([reach * np.cos(heading), reach * np.sin(heading), height], -1)
        radius = rng.uniform(0.35, 0.55, self.clumps) * min(1.0, self.height)
        thin = np.full(self.clumps, 0.03)
        twigs = struts(np.zeros((self.clumps, 3)), centres, thin, 0.5 * thin, 4)
        return {"twigs": twigs, "leaves": leaf_cloud(rng, centres, radius, self.leaves, self.leaf_size)}


@dataclass(frozen=True)
class Tree(Standing):
    """A winding trunk with spreading roots, boughs, and leaves about the ends of the boughs."""

    height: float
    """Of the trunk relative to the crown's radius."""
    thickness: float
    """Trunk radius relative to the crown's radius."""
    boughs: int
    crooked: float
    """How far trunk and boughs stray, relative to their length."""
    roots: int
    leaves: int
    """0 for a bare tree."""
    leaf_size: float
    """Relative to the crown's radius."""
    seed: int

    popularity: ClassVar[float] = 0.3
    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            height=uniform(rng, 0.9, 2.2),
            thickness=uniform(rng, 0.08, 0.2),
            boughs=integer(rng, 5, 9),
            crooked=uniform(rng, 0.03, 0.15),
            roots=integer(rng, 3, 7),
            leaves=integer(rng, 150, 350) if rng.random() < 0.85 else 0,
            leaf_size=uniform(rng, 0.16, 0.3),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        trunk, path = self._trunk(rng)
        boughs, ends = self._boughs(rng, path)
        parts = {"wood": joined(trunk, *self._roots(rng), *boughs)}
        if self.leaves > 0:
            radius = rng.uniform(0.3, 0.5, len(ends))
            parts["leaves"] = leaf_cloud(rng, ends, radius, self.leaves, self.leaf_size)
        return parts

    def _trunk(self, rng: np.random.Generator) -> tuple[Part, Vertices]:
        top = np.array((*rng.normal(0.0, 0.1 * self.height, 2), self.height))
        path = _winding_path(rng, np.zeros(3), top, self.crooked * self.height, 9)
        path[0, 2] = -0.05
        share = np.linspace(0.0, 1.0, 9)
        radius = self.thickness * (1 - 0.55 * share) * (1 + 0.7 * np.exp(-9 * share))
        return _stem(path, radius, 9), path

    def _roots(self, rng: np.random.Generator) -> list[Part]:
        """Buttresses that run down and outward into the ground."""
        roots = []
        for direction in around(rng, self.roots, (-14.0, -6.0), rng.uniform(0, 360)):
            reach = self.thickness * rng.uniform(3.0, 5.0)
            start = np.array((0.0, 0.0, 0.9 * self.thickness))
            root = _winding_path(rng, start, start + direction * reach, 0.08 * reach, 5)
            root[:, 2] = np.linspace(0.9, -0.5, 5) * self.thickness
            roots.append(_stem(root, self.thickness * np.linspace(0.6, 0.2, 5), 6))
        return roots

    def _boughs(self, rng: np.random.Generator, trunk: Vertices) -> tuple[list[Part], Vertices]:
        """Boughs from the upper half of the trunk, and where they end."""
        boughs, ends = [], []
        for direction in around(rng, self.boughs, (5.0, 70.0)):
            start = trunk[round(rng.uniform(0.55, 1.0) * 8)]
            reach = rng.uniform(0.55, 0.95)
            bough = _winding_path(rng, start, start + direction * reach, self.crooked * reach, 6)
            bough[:, 2] += 0.15 * reach * np.linspace(0, 1, 6) ** 2
            boughs.append(_stem(bough, self.thickness * np.linspace(0.45, 0.1, 6), 6))
            ends.append(bough[-1])
        return boughs, np.array(ends)


@dataclass(frozen=True)
class Palm(Standing):
    """A ringed, leaning trunk with a head of fronds."""

    height: float
    """Of the trunk relative to the fronds' length."""
    lean: float
    """Sideways distance of the head relative to the height."""
    fronds: int
    droop: float
    seed: int

    popularity: ClassVar[float] = 0.3
    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            height=uniform(rng, 0.8, 2.2),
            lean=uniform(rng, 0.0, 0.4),
            fronds=integer(rng, 7, 13),
            droop=uniform(rng, 0.5, 1.0),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        heading = rng.uniform(0, 2 * np.pi)
        share = np.linspace(0.0, 1.0, 22)
        bend = self.lean * self.height * share**1.7
        path = np.stack([bend * np.cos(heading), bend * np.sin(heading), self.height * share], -1)
        rings = 1 + 0.16 * (np.arange(22) % 2)
        trunk = _stem(path, 0.07 * rings * (1 - 0.35 * share + 0.5 * np.exp(-12 * share)), 8)
        direction = around(rng, self.fronds, (5.0, 65.0))
        base = np.tile(path[-1], (self.fronds, 1))
        length = rng.uniform(0.8, 1.1, self.fronds)
        spine = arched(base, direction, length, self.droop * rng.uniform(0.6, 1.2, self.fronds), 9)
        side = horizontal_side(direction, rng)
        fronds = [strips(spine, side, np.full((self.fronds, 7), 0.018), 0.8)]
        ahead = _unit(np.gradient(spine, axis=1))
        fine = np.linspace(1.2, 7.8, 26)
        low = fine.astype(int)
        points = spine[:, low] + (spine[:, low + 1] - spine[:, low]) * (fine - low)[:, None]
        along = ahead[:, low]
        size = 0.3 * np.sin(np.pi * (fine / 8.4) ** 0.8) + 0.04
        for sign in (-1.0, 1.0):
            aim = _unit(sign * side[:, None] + 0.5 * along - 0.35 * _UP + rng.normal(0, 0.08, points.shape))
            lengths = (length[:, None] * size).ravel()
            paths = arched(points.reshape(-1, 3), aim.reshape(-1, 3), lengths, np.full(lengths.shape, 0.3), 3)
            fronds.append(strips(paths, along.reshape(-1, 3), np.full((len(paths), 1), 0.022), 0.2))
        return {"wood": trunk, "leaves": joined(*fronds)}


@dataclass(frozen=True)
class Conifer(Standing):
    """A straight trunk with whorls of drooping, needled branches: spruce, fir."""

    whorls: int
    branches: int
    """In a whorl."""
    slenderness: float
    """Height relative to the radius at the foot."""
    droop: float
    bare: float
    """Share of the trunk without branches."""
    seed: int

    popularity: ClassVar[float] = 0.3

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            whorls=integer(rng, 8, 14),
            branches=integer(rng, 6, 9),
            slenderness=uniform(rng, 2.2, 4.5),
            droop=uniform(rng, 0.15, 0.6),
            bare=uniform(rng, 0.05, 0.3),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        height = self.slenderness
        trunk = _stem(
            np.linspace((0.0, 0.0, 0.0), (0.0, 0.0, height), 5), height * np.linspace(0.022, 0.002, 5), 7
        )
        level = np.linspace(self.bare, 0.97, self.whorls) + rng.normal(0, 0.008, self.whorls)
        base, direction, length = [], [], []
        for index, at in enumerate(level):
            reach = (1 - at) / (1 - self.bare) * 0.95 + 0.05
            base.append(np.tile((0.0, 0.0, at * height), (self.branches, 1)))
            direction.append(around(rng, self.branches, (0.0, 25.0), 137.5 * index))
            length.append(reach * rng.uniform(0.8, 1.1, self.branches))
        bases, directions, lengths = np.concatenate(base), np.concatenate(direction), np.concatenate(length)
        droop = self.droop * rng.uniform(0.7, 1.3, len(bases))
        spine = arched(bases, directions, lengths, droop, 5)
        side = horizontal_side(directions, rng)
        needles = [strips(spine, side, lengths[:, None] * np.array([[0.10, 0.12, 0.07]]), 0.3)]
        # Twigs along both sides of every branch, hanging a little.
        for at in (1, 2, 3):
            for sign in (-1.0, 1.0):
                aim = _unit(sign * side + 0.9 * directions - 0.35 * _UP + rng.normal(0, 0.1, side.shape))
                twig = lengths * (0.42, 0.34, 0.24)[at - 1]
                paths = arched(spine[:, at], aim, twig, np.full(len(twig), 0.3), 3)
                needles.append(strips(paths, _unit(np.cross(aim, _UP)), (0.16 * twig)[:, None], 0.3))
        return {"wood": trunk, "leaves": joined(*needles)}


@dataclass(frozen=True)
class Bamboo(Standing):
    """A clump of jointed culms with sprays of narrow leaves."""

    culms: int
    nodes: int
    radius: float
    """Of a culm relative to its height."""
    spread: float
    """Radius of the clump relative to the height."""
    leaves: int
    """Sprays a culm."""
    seed: int

    popularity: ClassVar[float] = 0.3
    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            culms=integer(rng, 2, 6),
            nodes=integer(rng, 7, 12),
            radius=uniform(rng, 0.006, 0.012),
            spread=uniform(rng, 0.04, 0.16),
            leaves=integer(rng, 6, 14),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        parts = []
        for _ in range(self.culms):
            height = rng.uniform(0.7, 1.0)
            start = np.array((*rng.normal(0.0, self.spread * 0.6, 2), 0.0))
            lean = np.array((*rng.normal(0.0, 0.09, 2), 1.0)) * height
            share = np.linspace(0.0, 1.0, 3 * self.nodes)
            path = np.array(start + share[:, None] * lean, np.float64)
            path[:, :2] += np.outer(share**3, rng.normal(0.0, 0.1, 2))
            ring = 1 + 0.3 * (np.arange(len(share)) % 3 == 1)
            parts.append(_stem(path, self.radius * ring * (1 - 0.75 * share), 7))
            parts.append(self._sprays(rng, path))
        return {"culms": joined(*parts)}

    def _sprays(self, rng: np.random.Generator, path: Vertices) -> Part:
        """Five narrow leaves at random nodes of the upper two thirds."""
        at = rng.integers(len(path) // 3, len(path), self.leaves).repeat(5)
        aside = _unit(rng.normal(size=(self.leaves, 3)) * (1, 1, 0.2)).repeat(5, axis=0)
        direction = _unit(aside + rng.normal(0.0, 0.45, aside.shape))
        length = rng.uniform(0.07, 0.13, len(at))
        base = path[at] + aside * rng.uniform(0.01, 0.06, (len(at), 1))
        paths = arched(base, direction, length, rng.uniform(0.3, 0.8, len(at)), 4)
        widths = (0.1 * length)[:, None] * np.array([[1.0, 0.8]])
        return strips(paths, horizontal_side(direction, rng), widths, 0.2)


@dataclass(frozen=True)
class Vine(Standing):
    """A hanging, winding cord with leaves along it: liana, ivy."""

    wobble: float
    """How far it strays relative to its length."""
    thickness: float
    """Radius relative to the length."""
    leaves: int
    leaf_size: float
    """Relative to the length."""
    seed: int

    popularity: ClassVar[float] = 0.3

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            wobble=uniform(rng, 0.02, 0.1),
            thickness=uniform(rng, 0.006, 0.016),
            leaves=integer(rng, 15, 60),
            leaf_size=uniform(rng, 0.05, 0.11),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        path = _winding_path(rng, np.zeros(3), np.array((0.0, 0.0, -1.0)), self.wobble, 24)
        cord = _stem(path, self.thickness * np.linspace(1.0, 0.5, 24), 6)
        at = rng.integers(1, 24, self.leaves)
        direction = _unit(rng.normal(size=(self.leaves, 3)) * (1, 1, 0.3) - 0.5 * _UP)
        length = self.leaf_size * rng.uniform(0.6, 1.3, self.leaves)
        paths = arched(path[at], direction, length, rng.uniform(0.1, 0.5, self.leaves), 4)
        widths = (0.36 * length)[:, None] * np.array([[1.0, 0.7]])
        return {"cord": cord, "leaves": strips(paths, horizontal_side(direction, rng), widths, 0.15)}


@dataclass(frozen=True)
class Mushroom(Standing):
    """A bent stem under a cap: toadstool, bolete, bracket."""

    cap_radius: float
    """Relative to the stem's height."""
    cap_height: float
    """Relative to the cap's radius."""
    rim: float
    """How far the rim curls down, relative to the cap's radius."""
    stem_radius: float
    """Relative to the stem's height."""
    bend: float
    """Sideways distance of the cap relative to the height."""
    lumps: int
    """Warts on the cap."""
    seed: int

    popularity: ClassVar[float] = 0.5
    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            cap_radius=log_uniform(rng, 0.35, 1.1),
            cap_height=uniform(rng, 0.25, 1.1),
            rim=uniform(rng, 0.0, 0.3),
            stem_radius=uniform(rng, 0.08, 0.22),
            bend=uniform(rng, 0.0, 0.35),
            lumps=integer(rng, 5, 25) if rng.random() < 0.5 else 0,
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        cap, stem = self.cap_radius, min(self.stem_radius, 0.5 * self.cap_radius)
        foot = stem * np.array([0.0, 1.5, 1.35, 1.1, 1.0, 0.95, 1.0, 0.0])
        foot_height = np.array([0.0, 0.0, 0.06, 0.2, 0.5, 0.8, 0.99, 0.99])
        angle = np.linspace(0.0, np.pi / 2, 10)
        under = np.linspace(0.0, 0.94 * cap, 5)
        under_height = 0.97 - self.rim * cap * np.linspace(0.0, 1.0, 5) ** 2
        level = float(under_height[-1]) + 0.04 * cap
        radius = np.concatenate([under, cap * np.cos(angle)])
        radius[-1] = 0.0
        height = np.concatenate([under_height, level + self.cap_height * cap * np.sin(angle)])
        heading = rng.uniform(0, 2 * np.pi)
        aside = self.bend * np.array((np.cos(heading), np.sin(heading), 0.0))
        parts = {
            "stem": revolve(foot, foot_height, 24),
            "cap": joined(revolve(radius, height, 40), *self._warts(rng, level)),
        }
        return {
            name: (v + np.outer(np.clip(v[:, 2], 0, None) ** 2, aside), t) for name, (v, t) in parts.items()
        }

    def _warts(self, rng: np.random.Generator, level: float) -> list[Part]:
        """Low cones scattered over the cap's dome."""
        if self.lumps == 0:
            return []
        elevation = np.arcsin(rng.uniform(0.15, 1.0, self.lumps))
        heading = rng.uniform(0, 2 * np.pi, self.lumps)
        flat = np.cos(elevation) * self.cap_radius
        spot = np.stack(
            [
                flat * np.cos(heading),
                flat * np.sin(heading),
                level + np.sin(elevation) * self.cap_height * self.cap_radius,
            ],
            -1,
        )
        outward = _unit(spot - (0.0, 0.0, level - 0.3 * self.cap_radius))
        size = self.cap_radius * rng.uniform(0.05, 0.12, self.lumps)
        return [
            struts(
                spot - outward * size[:, None],
                spot + outward * (0.5 * size)[:, None],
                1.3 * size,
                0.6 * size,
                6,
            )
        ]


LEAFY: tuple[type[Shape], ...] = (Fern, BroadLeaves, Bush)
"""Undergrowth that any green place may have."""


def sample_undergrowth(rng: np.random.Generator) -> Shape:
    return choose(rng, LEAFY, [0.35, 0.35, 0.3]).sample(rng)
