"""Trees: broad-leaved ones, palms, conifers, bamboo. Each is rooted about the origin of the ground plan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from scenes.geometry.building import Part, Vertices, joined
from scenes.geometry.leaves import arched, around, strips, width_directions
from scenes.geometry.stems import UP, leaf_cloud, normalized, stem, winding_path
from scenes.random_draws import integer, new_seed, uniform
from scenes.shapes.anchored import PartedShape


@dataclass(frozen=True)
class Tree(PartedShape):
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
        path = winding_path(rng, np.zeros(3), top, self.crooked * self.height, 9)
        path[0, 2] = -0.05
        share = np.linspace(0.0, 1.0, 9)
        radius = self.thickness * (1 - 0.55 * share) * (1 + 0.7 * np.exp(-9 * share))
        return stem(path, radius, 9), path

    def _roots(self, rng: np.random.Generator) -> list[Part]:
        """Buttresses that run down and outward into the ground."""
        roots = []
        for direction in around(rng, self.roots, (-14.0, -6.0), rng.uniform(0, 360)):
            reach = self.thickness * rng.uniform(3.0, 5.0)
            start = np.array((0.0, 0.0, 0.9 * self.thickness))
            root = winding_path(rng, start, start + direction * reach, 0.08 * reach, 5)
            root[:, 2] = np.linspace(0.9, -0.5, 5) * self.thickness
            roots.append(stem(root, self.thickness * np.linspace(0.6, 0.2, 5), 6))
        return roots

    def _boughs(self, rng: np.random.Generator, trunk: Vertices) -> tuple[list[Part], Vertices]:
        """Boughs from the upper half of the trunk, and where they end."""
        boughs, ends = [], []
        for direction in around(rng, self.boughs, (5.0, 70.0)):
            start = trunk[round(rng.uniform(0.55, 1.0) * 8)]
            reach = rng.uniform(0.55, 0.95)
            bough = winding_path(rng, start, start + direction * reach, self.crooked * reach, 6)
            bough[:, 2] += 0.15 * reach * np.linspace(0, 1, 6) ** 2
            boughs.append(stem(bough, self.thickness * np.linspace(0.45, 0.1, 6), 6))
            ends.append(bough[-1])
        return boughs, np.array(ends)


@dataclass(frozen=True)
class Palm(PartedShape):
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
        trunk = stem(path, 0.07 * rings * (1 - 0.35 * share + 0.5 * np.exp(-12 * share)), 8)
        direction = around(rng, self.fronds, (5.0, 65.0))
        base = np.tile(path[-1], (self.fronds, 1))
        length = rng.uniform(0.8, 1.1, self.fronds)
        spine = arched(base, direction, length, self.droop * rng.uniform(0.6, 1.2, self.fronds), 9)
        side = width_directions(direction, rng)
        fronds = [strips(spine, side, np.full((self.fronds, 7), 0.018), 0.8)]
        ahead = normalized(np.gradient(spine, axis=1))
        fine = np.linspace(1.2, 7.8, 26)
        low = fine.astype(int)
        points = spine[:, low] + (spine[:, low + 1] - spine[:, low]) * (fine - low)[:, None]
        along = ahead[:, low]
        size = 0.3 * np.sin(np.pi * (fine / 8.4) ** 0.8) + 0.04
        for sign in (-1.0, 1.0):
            aim = normalized(
                sign * side[:, None] + 0.5 * along - 0.35 * UP + rng.normal(0, 0.08, points.shape)
            )
            lengths = (length[:, None] * size).ravel()
            paths = arched(points.reshape(-1, 3), aim.reshape(-1, 3), lengths, np.full(lengths.shape, 0.3), 3)
            fronds.append(strips(paths, along.reshape(-1, 3), np.full((len(paths), 1), 0.022), 0.2))
        return {"wood": trunk, "leaves": joined(*fronds)}


@dataclass(frozen=True)
class Conifer(PartedShape):
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
        trunk = stem(
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
        side = width_directions(directions, rng)
        needles = [strips(spine, side, lengths[:, None] * np.array([[0.10, 0.12, 0.07]]), 0.3)]
        # Twigs along both sides of every branch, hanging a little.
        for at in (1, 2, 3):
            for sign in (-1.0, 1.0):
                aim = normalized(sign * side + 0.9 * directions - 0.35 * UP + rng.normal(0, 0.1, side.shape))
                twig = lengths * (0.42, 0.34, 0.24)[at - 1]
                paths = arched(spine[:, at], aim, twig, np.full(len(twig), 0.3), 3)
                needles.append(strips(paths, normalized(np.cross(aim, UP)), (0.16 * twig)[:, None], 0.3))
        return {"wood": trunk, "leaves": joined(*needles)}


@dataclass(frozen=True)
class Bamboo(PartedShape):
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
            parts.append(stem(path, self.radius * ring * (1 - 0.75 * share), 7))
            parts.append(self._sprays(rng, path))
        return {"culms": joined(*parts)}

    def _sprays(self, rng: np.random.Generator, path: Vertices) -> Part:
        """Five narrow leaves at random nodes of the upper two thirds."""
        at = rng.integers(len(path) // 3, len(path), self.leaves).repeat(5)
        aside = normalized(rng.normal(size=(self.leaves, 3)) * (1, 1, 0.2)).repeat(5, axis=0)
        direction = normalized(aside + rng.normal(0.0, 0.45, aside.shape))
        length = rng.uniform(0.07, 0.13, len(at))
        base = path[at] + aside * rng.uniform(0.01, 0.06, (len(at), 1))
        paths = arched(base, direction, length, rng.uniform(0.3, 0.8, len(at)), 4)
        widths = (0.1 * length)[:, None] * np.array([[1.0, 0.8]])
        return strips(paths, width_directions(direction, rng), widths, 0.2)
