"""Landforms: eroded terrain, caves, boulders, dripstone."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, block_under, grid_triangles, icosphere, joined, revolve, solid
from scenes.geometry.mesh import Mesh
from scenes.random_draws import chance, integer, log_uniform, new_seed, uniform
from scenes.shapes.anchored import PartedShape
from scenes.shapes.solids.basic import sample_proportions
from scenes.shapes.solids.organic import wave_noise
from scenes.spec import OMIT_DEFAULT, Shape, Vector

_ROUNDING = 0.2
"""Radius of the folds of `eroded_relief`'s waves, whose deviation is about 1."""


def eroded_relief(
    rng: np.random.Generator, points: NDArray[np.float64], frequency: float, octaves: int, ridged: float
) -> NDArray[np.float64]:
    """(N,) heights of about unit deviation at points (N, 2), detailed on ridges and smooth on steep slopes.

    A sum of octaves of waves, each octave damped where those before it are steep, as water leaves it
    (I. Quilez's erosion by accumulated derivatives, after F. Musgrave's multifractals). `ridged` 0..1 folds
    the octaves into crests, rounded a little: the slope of a sharp fold jumps, and with it the damping, which would
    leave vertical steps in the land.
    """
    height = np.zeros(len(points))
    gradient = np.zeros((len(points), 2))
    amplitude, number = 1.0, frequency
    for _ in range(octaves):
        directions = rng.normal(size=(8, 2))
        directions *= number * rng.uniform(0.75, 1.35, (8, 1)) / np.linalg.norm(directions, axis=1)[:, None]
        phase = points @ directions.T + rng.uniform(0, 2 * np.pi, 8)
        wave = np.cos(phase).sum(axis=1) / 2.0
        slope = -np.sin(phase) @ directions / 2.0
        folded = np.hypot(wave, _ROUNDING)
        crest = 1.0 - folded
        octave = (1 - ridged) * wave + ridged * crest
        fold = (1 - ridged) - ridged * wave / folded
        gradient += amplitude * slope * fold[:, None] / frequency
        height += amplitude * octave / (1 + 0.5 * (gradient**2).sum(axis=1))
        amplitude *= 0.48
        number *= 2.03
    return height


@dataclass(frozen=True)
class Basin:
    """A hollow in the land with an elliptical rim: the bed of a pond. Lengths are relative to half the land's side."""

    x: float
    y: float
    long: float
    """Half its length."""
    wide: float
    """Half its width."""
    heading_rad: float
    """Of its length, from the x axis towards the y axis."""
    depth: float

    def rim_shares(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N,) where points (N, 2) are: 0 in the middle, 1 on the rim, more outside."""
        x, y = (points - (self.x, self.y)).T
        cos, sin = np.cos(self.heading_rad), np.sin(self.heading_rad)
        shares: NDArray[np.float64] = np.hypot(
            (x * cos + y * sin) / self.long, (y * cos - x * sin) / self.wide
        )
        return shares


_SHORE = (3.2, 4.0)
"""Rim shares up to which, and from which on no more, a pond keeps the land from being lower than the middle."""


@dataclass(frozen=True)
class Landscape(Shape):
    """A block of land: a level clearing in the middle, eroded hills or mountains about it.

    The cells are smaller towards the middle, where a camera stands; the land has height 0 there.
    """

    relief: float
    """Height of the hills' outermost parts, relative to half the side."""
    roll: float
    """Standard deviation of the clearing's unevenness, relative to half the side."""
    clearing: float
    """Radius of the clearing relative to half the side."""
    frequency: float
    """Lowest wave number of the hills, radians per half side."""
    octaves: int
    ridged: float
    """0 rounded hills .. 1 sharp crests."""
    cells: int
    concentration: float
    """1: equal cells; 3: those in the middle are much smaller than those at the rim."""
    seed: int
    basin: Basin | None = field(default=None, metadata=OMIT_DEFAULT)
    """The bed of a pond; None for dry land."""

    popularity: ClassVar[float] = 0.3

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            relief=uniform(rng, 0.2, 0.6),
            roll=uniform(rng, 0.01, 0.05),
            clearing=uniform(rng, 0.05, 0.4),
            frequency=uniform(rng, 2.5, 6.0),
            octaves=5,
            ridged=uniform(rng, 0.0, 1.0),
            cells=56,
            concentration=1.0,
            seed=new_seed(rng),
        )

    def line(self) -> NDArray[np.float64]:
        """(cells + 1,) the grid's coordinates along x and along y."""
        line = np.linspace(-1.0, 1.0, self.cells + 1)
        spread: NDArray[np.float64] = np.sign(line) * np.abs(line) ** self.concentration
        return spread

    def cell(self, reach: float) -> float:
        """Side of the grid's cells at a distance from the middle along x or y, both relative to half the side."""
        line = self.line()
        column = int(np.clip(np.searchsorted(line, reach), 1, self.cells))
        return float(line[column] - line[column - 1])

    @lru_cache(maxsize=4)  # noqa: B019  (records are small, and the land is asked for its heights a lot)
    def heights(self) -> NDArray[np.float64]:
        """(cells + 1, cells + 1) heights at y (rows) and x (columns), 0 in the middle."""
        y, x = np.meshgrid(self.line(), self.line(), indexing="ij")
        points = np.stack([x, y], -1).reshape(-1, 2)
        points = np.concatenate([points, [(0.0, 0.0)]])
        rng = np.random.default_rng(self.seed)
        hills = eroded_relief(rng, points, self.frequency, self.octaves, self.ridged)
        hills = (hills - hills.min()) / np.ptp(hills)
        reach = np.linalg.norm(points, axis=1)
        rise = np.clip((reach - self.clearing) / (1.0 - self.clearing), 0.0, 1.0)
        rise = rise * rise * (3 - 2 * rise)
        uneven = self.roll * wave_noise(rng, points, 3.0 / max(self.clearing, 0.05), 1.2)
        if self.basin is not None:
            # No hollow about the pond is lower than the middle: its water would stand out of it.
            shore = np.clip((self.basin.rim_shares(points) - _SHORE[0]) / (_SHORE[1] - _SHORE[0]), 0.0, 1.0)
            uneven = np.where(uneven < uneven[-1], uneven[-1] + shore * (uneven - uneven[-1]), uneven)
        height = self.relief * rise * (0.25 + 0.75 * hills) + uneven
        if self.basin is not None:
            height -= self.basin.depth * np.clip(1.0 - self.basin.rim_shares(points) ** 2, 0.0, None) ** 0.7
        return (height[:-1] - height[-1]).reshape(x.shape)

    def middle_height(self) -> float:
        """Height of the middle of the land in the mesh's own coordinates, after centring."""
        height = self.heights()
        return -float(self._floor(height) + height.max()) / 2

    def _floor(self, height: NDArray[np.float64]) -> float:
        return float(height.min()) - 0.05

    def mesh(self) -> Mesh:
        height = self.heights()
        y, x = np.meshgrid(self.line(), self.line(), indexing="ij")
        return solid(*block_under(np.stack([x, y, height], -1), self._floor(height)), smooth=True)


@dataclass(frozen=True)
class Cavern(PartedShape):
    """A winding tunnel through rock, open at both ends. Its wall is the solid; a camera inside is outside of it.

    It runs along +y from y = 0; the axis is at the origin there. Its radius is about 1.
    """

    length: float
    bend: float
    """Sideways distance of the far end's axis."""
    narrowing: float
    """Radius at the far end relative to the near one."""
    roughness: float
    """Height of the lumps on the wall."""
    wall: float
    """Thickness."""
    rings: int
    seed: int

    popularity: ClassVar[float] = 0.0
    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            length=uniform(rng, 3.0, 7.0),
            bend=uniform(rng, -1.5, 1.5),
            narrowing=uniform(rng, 0.5, 1.0),
            roughness=uniform(rng, 0.1, 0.25),
            wall=uniform(rng, 0.3, 0.6),
            rings=40,
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        along = np.linspace(0.0, 1.0, self.rings)
        theta = np.linspace(0.0, 2 * np.pi, 56, endpoint=False)
        axis = np.stack([self.bend * along**2, self.length * along, np.zeros(self.rings)], -1)
        ring = np.stack([np.cos(theta), np.zeros(56), np.sin(theta)], -1)
        wall = axis[:, None] + ring[None]
        rough = eroded_relief(rng, wall.reshape(-1, 3)[:, [0, 1]] + wall.reshape(-1, 3)[:, [2]], 2.0, 1, 0.0)
        flat = wall.reshape(-1, 3)
        lumps = wave_noise(rng, flat, 2.0, 0.7, 32) + 0.4 * np.abs(wave_noise(rng, flat, 8.0, 0.5, 32))
        radius = 1.0 - self.roughness * np.abs(lumps + 0.2 * rough).reshape(wall.shape[:2])
        radius *= (1 - (1 - self.narrowing) * along)[:, None]
        inner = axis[:, None] + radius[..., None] * ring
        outer = axis[::-1, None] + (1.05 + self.wall) * ring
        surface = np.concatenate([inner, outer])
        triangles = grid_triangles(2 * self.rings, 56, wrap_rows=True, wrap_columns=True)
        return {"rock": (surface.reshape(-1, 3), triangles)}


@dataclass(frozen=True)
class Boulder(Shape):
    """A lump of rock knocked into facets, with a rough skin: boulders, pebbles, cliffs."""

    radii: Vector
    facets: int
    """Planes that have split pieces off it."""
    bite: float
    """How deep they cut, relative to the radius."""
    roughness: float
    detail: int
    """Subdivisions of the sphere it is hewn from."""
    seed: int

    popularity: ClassVar[float] = 0.7

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            radii=sample_proportions(rng, 0.5),
            facets=integer(rng, 6, 18),
            bite=uniform(rng, 0.25, 0.6),
            roughness=uniform(rng, 0.01, 0.06),
            detail=4,
            seed=new_seed(rng),
        )

    def mesh(self) -> Mesh:
        rng = np.random.default_rng(self.seed)
        sphere, triangles = icosphere(self.detail)
        points = sphere * np.exp(0.12 * wave_noise(rng, sphere, 1.5, 1.0))[:, None]
        for _ in range(self.facets):
            normal = rng.normal(size=3)
            normal /= np.linalg.norm(normal)
            over = points @ normal - (1.0 - self.bite * rng.uniform(0.3, 1.0))
            points = points - np.outer(np.maximum(over, 0.0) * 0.93, normal)
        points *= np.exp(self.roughness * wave_noise(rng, points, 7.0, 0.5))[:, None]
        return solid(points * self.radii, triangles, smooth=True, crease_deg=None)


@dataclass(frozen=True)
class Dripstone(PartedShape):
    """A cluster of lumpy cones: stalagmites; turned over, stalactites."""

    cones: int
    slenderness: float
    """Height of the tallest relative to its radius."""
    lumps: float
    seed: int

    popularity: ClassVar[float] = 0.4
    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            cones=integer(rng, 1, 6),
            slenderness=log_uniform(rng, 3.0, 9.0),
            lumps=uniform(rng, 0.05, 0.25),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        cones = []
        for index in range(self.cones):
            height = 1.0 if index == 0 else uniform(rng, 0.25, 0.8)
            share = np.linspace(0.0, 1.0, 18)
            radius = height**0.5 / self.slenderness * (1 - share) ** 0.7 * (1 + 0.6 * np.exp(-8 * share))
            radius *= 1 + self.lumps * np.sin(share * uniform(rng, 15.0, 40.0) + uniform(rng, 0.0, 6.0))
            profile = np.concatenate([[0.0], radius[:-1], [0.0]])
            level = np.concatenate([[0.0], share[:-1] * height, [height]])
            vertices, triangles = revolve(profile, level, 18, uniform(rng, 0.0, 6.0))
            away = 0.0 if index == 0 else log_uniform(rng, 1.0, 3.0) / self.slenderness
            heading = uniform(rng, 0.0, 2 * np.pi)
            lean = rng.normal(0.0, 0.06, 2) if chance(rng, 0.7) else np.zeros(2)
            vertices[:, :2] += vertices[:, 2:] * lean + away * np.array((np.cos(heading), np.sin(heading)))
            cones.append((vertices, triangles))
        return {"stone": joined(*cones)}
