"""Trees and bushes along a street: stems, and crowns of clumps with leaves standing out of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.geometry.building import Part, Vertices, icosphere, joined, struts
from scenes.random_draws import chance, choose, integer, new_seed, uniform
from scenes.shapes.anchored import MetricShape, Surface
from scenes.shapes.solids.organic import wave_noise

_LEAF = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.12), (0.45, 0.42, 0.0), (0.45, -0.42, 0.0)])
_LEAF_TRIANGLES = np.array([(0, 2, 3), (1, 3, 2), (0, 1, 2), (0, 3, 1)], np.int64)


@dataclass(frozen=True)
class TreeDesign:
    """Measures of a tree, metres."""

    height: float
    stem_height: float
    """Height at which the crown begins."""
    stem_radius: float
    crown_width: float
    form: str
    """round, tall, cone or bare."""
    leaf: float
    """Length of a spray of leaves."""
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        """Draw a design."""
        form = choose(rng, ["round", "tall", "cone", "bare"], [0.5, 0.22, 0.18, 0.1])
        height = uniform(rng, 4.5, 11.0)
        slim = {"round": (0.55, 0.8), "tall": (0.25, 0.4), "cone": (0.35, 0.5), "bare": (0.5, 0.7)}[form]
        return cls(
            height=height,
            stem_height=uniform(rng, 1.9, 3.0) if form != "cone" else uniform(rng, 0.4, 1.2),
            stem_radius=height * uniform(rng, 0.013, 0.024),
            crown_width=min(height * uniform(rng, *slim), 6.5),
            form=form,
            leaf=uniform(rng, 0.18, 0.34),
            seed=new_seed(rng),
        )

    def clumps(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Middles (N, 3) and radii (N,) of the clumps the crown is made of."""
        rng = np.random.default_rng(self.seed)
        count = int(rng.integers(9, 14))
        share = (np.arange(count) + rng.uniform(0.2, 0.8, count)) / count
        crown = self.height - self.stem_height
        if self.form == "cone":
            reach = (1.0 - share) * 0.38 + 0.02
        else:
            reach = 0.36 * np.sqrt(np.clip(1 - (2 * share - 0.9) ** 2, 0.05, 1.0))
        angle = 2.399963 * np.arange(count) + rng.uniform(0, 2 * np.pi)
        off = reach * rng.uniform(0.4, 1.0, count) * self.crown_width
        z = self.stem_height + crown * (0.1 + 0.78 * share)
        middles = np.stack([off * np.cos(angle), off * np.sin(angle), z], -1)
        radii = (
            self.crown_width * rng.uniform(0.2, 0.3, count) * (1.15 - 0.55 * share * (self.form == "cone"))
        )
        return middles, np.minimum(radii, 0.3 * crown)


@dataclass(frozen=True)
class TreeStem(MetricShape):
    """Stem and boughs; on a bare tree, twigs."""

    design: TreeDesign

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(TreeDesign.sample(rng))

    def surface(self) -> Surface:
        design = self.design
        rng = np.random.default_rng(design.seed)
        middles, _ = design.clumps()
        radius = design.stem_radius
        top = np.array((0.0, 0.0, design.stem_height + 0.62 * (design.height - design.stem_height)))
        fork = middles * (0.0, 0.0, 1.0)
        fork[:, 2] = np.minimum(
            design.stem_height * 0.9 + 0.45 * (middles[:, 2] - design.stem_height), top[2] - 0.1
        )
        start = np.concatenate([[(0.0, 0.0, -0.3)], fork])
        end = np.concatenate([[top], middles])
        thick = np.concatenate([[1.25 * radius], np.full(len(fork), 0.45 * radius)])
        thin = np.concatenate([[0.4 * radius], np.full(len(fork), 0.15 * radius)])
        parts = [struts(start, end, thick, thin, 6)]
        if design.form == "bare":
            parts += self._twigs(rng, fork, middles)
        return Surface(*joined(*parts))

    def _twigs(self, rng: np.random.Generator, fork: Vertices, tips: Vertices) -> list[Part]:
        """Two generations of ever thinner twigs along the boughs."""
        parts = []
        start, end, radius, length = fork, tips, 0.2 * self.design.stem_radius, 0.3 * self.design.crown_width
        for children in (5, 4):
            share = rng.uniform(0.3, 1.0, (len(start), children, 1))
            foot = (start[:, None] + share * (end - start)[:, None]).reshape(-1, 3)
            along = np.repeat(end - start, children, axis=0)
            along /= np.linalg.norm(along, axis=1, keepdims=True)
            direction = along + rng.normal(0, 0.55, along.shape) + (0.0, 0.0, 0.25)
            direction /= np.linalg.norm(direction, axis=1, keepdims=True)
            tip = foot + direction * length * rng.uniform(0.5, 1.2, (len(foot), 1))
            parts.append(struts(foot, tip, np.full(len(foot), radius), np.full(len(foot), 0.4 * radius), 4))
            start, end, radius, length = foot, tip, max(0.5 * radius, 0.006), 0.5 * length
        return parts


def sprays(rng: np.random.Generator, places: Vertices, outward: Vertices, size: float) -> Part:
    """Flat pointed sprays at places (N, 3), leaning outward and in all directions."""
    count = len(places)
    aim = outward + rng.normal(0, 0.7, (count, 3))
    aim /= np.linalg.norm(aim, axis=1, keepdims=True)
    side = np.cross(aim, rng.normal(0, 1.0, (count, 3)))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    axes = np.stack([aim, side, np.cross(aim, side)], -1) * (size * rng.uniform(0.7, 1.3, (count, 1, 1)))
    vertices = places[:, None] + np.einsum("nij,kj->nki", axes, _LEAF)
    triangles = _LEAF_TRIANGLES[None] + 4 * np.arange(count)[:, None, None]
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3)


def _clump(rng: np.random.Generator, middle: NDArray[np.float64], radius: float) -> Part:
    """A lumpy ball."""
    ball, triangles = icosphere(1)
    lumps = 1 + 0.16 * wave_noise(rng, ball, 2.5, 1.0)
    return middle + ball * (radius * lumps[:, None] * (1.0, 1.0, 0.85)), triangles


@dataclass(frozen=True)
class TreeCrown(MetricShape):
    """The leaves: lumpy clumps, and sprays that break their outlines."""

    design: TreeDesign
    sprays: int
    """Sprays of leaves on each clump."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(TreeDesign.sample(rng), integer(rng, 15, 130))

    def surface(self) -> Surface:
        rng = np.random.default_rng(self.design.seed + 1)
        middles, radii = self.design.clumps()
        parts = []
        for middle, radius in zip(middles, radii, strict=True):
            parts.append(_clump(rng, middle, 0.86 * float(radius)))
            around = rng.normal(0, 1.0, (self.sprays, 3))
            around /= np.linalg.norm(around, axis=1, keepdims=True)
            reach = float(radius) * rng.uniform(0.75, 1.0, (self.sprays, 1))
            parts.append(sprays(rng, middle + around * reach * (1.0, 1.0, 0.85), around, self.design.leaf))
        return Surface(*joined(*parts))


@dataclass(frozen=True)
class Shrub(MetricShape):
    """A bush of a few clumps on the ground."""

    height: float
    leaf: float
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 0.5, 1.6), uniform(rng, 0.1, 0.25), new_seed(rng))

    def surface(self) -> Surface:
        rng = np.random.default_rng(self.seed)
        parts = []
        for _ in range(int(rng.integers(3, 6))):
            radius = self.height * float(rng.uniform(0.3, 0.45))
            middle = np.array((*rng.uniform(-0.4, 0.4, 2) * self.height, 0.85 * radius))
            parts.append(_clump(rng, middle, 0.88 * radius))
            around = rng.normal(0, 1.0, (90, 3))
            around[:, 2] = np.abs(around[:, 2])
            around /= np.linalg.norm(around, axis=1, keepdims=True)
            parts.append(sprays(rng, middle + around * radius * 0.9, around, self.leaf))
        turn = Rotation.from_euler("Z", rng.uniform(0, 2 * np.pi))
        vertices, triangles = joined(*parts)
        return Surface(turn.apply(vertices) if chance(rng, 0.5) else vertices, triangles)
