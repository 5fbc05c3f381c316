"""Low vegetation: grass, ferns, broad leaves, bushes, vines, mushrooms; trees are in `scenes.shapes.nature.trees`.

Plants are rooted: their lowest point is the base of the stem, about over the origin of the ground plan.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from scenes.geometry.building import Part, joined, revolve, struts
from scenes.geometry.leaves import arched, around, strips, width_directions
from scenes.geometry.stems import UP, leaf_cloud, normalized, stem, winding_path
from scenes.random_draws import choose, integer, log_uniform, new_seed, uniform
from scenes.shapes.anchored import PartedShape
from scenes.spec import Shape


@dataclass(frozen=True)
class GrassTuft(PartedShape):
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
        aside = normalized(outward + rng.normal(0.0, 0.4, (n, 3)) * (1, 1, 0))
        direction = np.cos(lean)[:, None] * UP + np.sin(lean)[:, None] * aside
        length = rng.uniform(0.45, 1.0, n)
        base = outward * (self.spread * share)[:, None]
        paths = arched(base, direction, length, np.zeros(n), 4)
        # Blades bend the way they lean, more towards their tips.
        bend = self.droop * rng.uniform(0.3, 1.3, n) * length
        rise = np.linspace(0.0, 1.0, 4) ** 2
        paths += (bend[:, None] * rise)[..., None] * (0.8 * aside - 0.55 * UP)[:, None]
        paths[..., 2] = np.maximum(paths[..., 2], 0.0)
        width = self.width * rng.uniform(0.7, 1.3, (n, 1)) * np.array([[1.0, 0.75]])
        return {"blades": strips(paths, width_directions(direction, rng), width, 0.25)}


@dataclass(frozen=True)
class Fern(PartedShape):
    """Arching fronds, each with two rows of leaflets."""

    fronds: int
    leaflets: int
    """In each row of a frond."""
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
        side = width_directions(direction, rng)
        stalk = strips(spine, side, np.full((self.fronds, 5), 0.012), 0.8)
        # Leaflets start a fifth of the way up the frond; longest at a third, none at the tip.
        at = np.linspace(0.2, 0.97, self.leaflets)
        size = self.leaflet * np.sin(np.pi * np.clip(at, 0, 1) ** 0.7) ** 0.8 + 0.015
        step = at * 6
        low = np.minimum(step.astype(int), 5)
        points = spine[:, low] + (spine[:, low + 1] - spine[:, low]) * (step - low)[:, None]
        ahead = normalized(spine[:, low + 1] - spine[:, low])
        parts = [stalk]
        for sign in (-1.0, 1.0):
            outward = normalized(sign * side[:, None] + 0.45 * ahead + rng.normal(0.0, 0.06, points.shape))
            base, aim = points.reshape(-1, 3), outward.reshape(-1, 3)
            lengths = (length[:, None] * size).ravel()
            paths = arched(base, aim, lengths, np.full(len(base), 0.25), 3)
            parts.append(strips(paths, ahead.reshape(-1, 3), (0.17 * lengths + 0.004)[:, None], 0.15))
        return {"fronds": joined(*parts)}


@dataclass(frozen=True)
class BroadLeaves(PartedShape):
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
        side = normalized(width_directions(direction, rng) + rng.normal(0.0, 0.2, (self.leaves, 3)))
        return {"leaves": strips(paths, side, widths, 0.14)}


@dataclass(frozen=True)
class Bush(PartedShape):
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
class Vine(PartedShape):
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
        path = winding_path(rng, np.zeros(3), np.array((0.0, 0.0, -1.0)), self.wobble, 24)
        cord = stem(path, self.thickness * np.linspace(1.0, 0.5, 24), 6)
        at = rng.integers(1, 24, self.leaves)
        direction = normalized(rng.normal(size=(self.leaves, 3)) * (1, 1, 0.3) - 0.5 * UP)
        length = self.leaf_size * rng.uniform(0.6, 1.3, self.leaves)
        paths = arched(path[at], direction, length, rng.uniform(0.1, 0.5, self.leaves), 4)
        widths = (0.36 * length)[:, None] * np.array([[1.0, 0.7]])
        return {"cord": cord, "leaves": strips(paths, width_directions(direction, rng), widths, 0.15)}


@dataclass(frozen=True)
class Mushroom(PartedShape):
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
        outward = normalized(spot - (0.0, 0.0, level - 0.3 * self.cap_radius))
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


UNDERGROWTH: tuple[type[Shape], ...] = (Fern, BroadLeaves, Bush)
"""Kinds of undergrowth."""


def sample_undergrowth(rng: np.random.Generator) -> Shape:
    """A random fern, broad-leaved plant or bush."""
    return choose(rng, UNDERGROWTH, [0.35, 0.35, 0.3]).sample(rng)
