"""Irregular bodies: blobs, rocks, saplings, terrain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from scenes.geometry.building import Triangles, Vertices, block_under, icosphere, joined, solid, struts
from scenes.geometry.mesh import Mesh
from scenes.random_draws import integer, log_uniform, new_seed, uniform
from scenes.shapes.solids.basic import sample_proportions
from scenes.spec import Shape, Vector


def wave_noise(
    rng: np.random.Generator, points: NDArray[np.float64], frequency: float, slope: float, waves: int = 24
) -> NDArray[np.float64]:
    """(N,) smooth noise of unit variance at points (N, D): a sum of plane waves of random direction and phase.

    Wave numbers run log-uniformly from `frequency` to 4 * `frequency` (radians per unit), amplitudes fall
    as number^-slope.
    """
    directions = rng.normal(size=(waves, points.shape[1]))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    numbers = frequency * np.exp(rng.uniform(0.0, np.log(4.0), waves))
    amplitudes = numbers**-slope
    phases = rng.uniform(0.0, 2 * np.pi, waves)
    field = np.cos(points @ (directions * numbers[:, None]).T + phases) @ amplitudes
    noise: NDArray[np.float64] = field / np.sqrt((amplitudes**2).sum() / 2)
    return noise


@dataclass(frozen=True)
class Blob(Shape):
    """A sphere pushed in and out by smooth noise: potatoes, clouds, coral."""

    radii: Vector
    amplitude: float
    """Standard deviation of the logarithm of the radius."""
    frequency: float
    """Lowest wave number on the unit sphere: 1 gives a few large bulges, 4 many small ones."""
    slope: float
    """How fast finer bulges become shallower; 0 is spiky, 2 soft."""
    seed: int

    popularity: ClassVar[float] = 1.5

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        frequency = log_uniform(rng, 1.0, 4.0)
        return cls(
            radii=sample_proportions(rng, 0.5),
            amplitude=float(uniform(rng, 0.15, 0.5) / np.sqrt(frequency)),
            frequency=frequency,
            slope=uniform(rng, 0.5, 2.0),
            seed=new_seed(rng),
        )

    def mesh(self) -> Mesh:
        sphere, triangles = icosphere(4)
        noise = wave_noise(np.random.default_rng(self.seed), sphere, self.frequency, self.slope)
        swollen = sphere * np.exp(self.amplitude * noise)[:, None]
        return solid(swollen * self.radii, triangles, smooth=True, crease_deg=None)


@dataclass(frozen=True)
class Rock(Shape):
    """The convex hull of random points: crystals, boulders, irregular polyhedra."""

    corners: int
    radii: Vector
    roundness: float
    """0: points anywhere in a ball, few of them on the hull; 1: all on its surface."""
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            corners=integer(rng, 6, 60),
            radii=sample_proportions(rng, 0.4),
            roundness=uniform(rng, 0.3, 1.0),
            seed=new_seed(rng),
        )

    def mesh(self) -> Mesh:
        rng = np.random.default_rng(self.seed)
        points = rng.normal(size=(self.corners, 3))
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        points *= rng.uniform(self.roundness, 1.0, (self.corners, 1))
        hull = ConvexHull(points * self.radii)
        triangles = hull.simplices.astype(np.int64)
        a, b, c = (hull.points[triangles[:, corner]] for corner in range(3))
        inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
        triangles[inward] = triangles[inward, ::-1]
        return solid(hull.points, triangles)


@dataclass(frozen=True)
class Sapling(Shape):
    """A young tree: a trunk that forks, thinner at each generation, with leaves on its twigs.

    All its parts are closed; they overlap where they meet.
    """

    generations: int
    children: int
    """Branches at each fork."""
    spread_deg: float
    """Mean angle of a branch to its parent."""
    shrink: float
    """Length of a branch relative to its parent."""
    thickness: float
    """Trunk radius relative to the trunk's length."""
    leaf_size: float
    """Leaf length relative to the trunk's length; 0 for a bare tree."""
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        children = integer(rng, 2, 4)
        return cls(
            generations=integer(rng, 3, 4) if children > 2 else integer(rng, 4, 5),
            children=children,
            spread_deg=uniform(rng, 25.0, 55.0),
            shrink=uniform(rng, 0.62, 0.82),
            thickness=uniform(rng, 0.04, 0.1),
            leaf_size=uniform(rng, 0.12, 0.35) if rng.random() < 0.8 else 0.0,
            seed=new_seed(rng),
        )

    def mesh(self) -> Mesh:
        rng = np.random.default_rng(self.seed)
        start = np.zeros((1, 3))
        direction = np.array([(0.0, 0.0, 1.0)])
        length, radius = 1.0, self.thickness
        parts = []
        for generation in range(self.generations + 1):
            end = start + direction * length * rng.uniform(0.75, 1.25, (len(start), 1))
            thin = np.full(len(start), radius)
            parts.append(struts(start, end, thin, thin * 0.7, 6 if generation < 2 else 4))
            if generation == self.generations:
                break
            start = end.repeat(self.children, axis=0)
            direction = self._fork(rng, direction)
            length, radius = length * self.shrink, radius * 0.65
        if self.leaf_size > 0:
            parts.append(_leaves(rng, end, direction, self.leaf_size))
        return solid(*joined(*parts))

    def _fork(self, rng: np.random.Generator, direction: Vertices) -> Vertices:
        """Children's directions: evenly spread about the parent's, jittered, turned a little upward."""
        count = len(direction) * self.children
        spin = (
            rng.uniform(0, 2 * np.pi, (len(direction), 1))
            + 2 * np.pi * np.arange(self.children) / self.children
        )
        spin = spin.ravel() + rng.normal(0, 0.3, count)
        tilt = np.radians(self.spread_deg) * rng.uniform(0.6, 1.3, count)
        parent = direction.repeat(self.children, axis=0)
        u = np.cross(parent, np.eye(3)[np.abs(parent).argmin(axis=1)])
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        v = np.cross(parent, u)
        side = np.cos(spin)[:, None] * u + np.sin(spin)[:, None] * v
        child = np.cos(tilt)[:, None] * parent + np.sin(tilt)[:, None] * side
        child[:, 2] += 0.15
        forked: Vertices = child / np.linalg.norm(child, axis=1, keepdims=True)
        return forked


def _leaves(
    rng: np.random.Generator, tips: Vertices, direction: Vertices, size: float
) -> tuple[Vertices, Triangles]:
    """Two flat double pyramids at each twig's end."""
    tips, direction = tips.repeat(2, axis=0), direction.repeat(2, axis=0)
    count = len(tips)
    octahedron = np.array([(0, 0, 0), (0, 0, 2), (0.5, 0, 1), (-0.5, 0, 1), (0, 0.05, 1), (0, -0.05, 1)]) / 2
    faces = np.array(
        [(0, 4, 2), (0, 3, 4), (0, 5, 3), (0, 2, 5), (1, 2, 4), (1, 4, 3), (1, 3, 5), (1, 5, 2)], np.int64
    )
    axis = np.cross([(0.0, 0.0, 1.0)], direction)
    lean = Rotation.from_rotvec(axis + rng.normal(0, 0.5, (count, 3)))
    spin = Rotation.from_rotvec(rng.uniform(0, 2 * np.pi, (count, 1)) * np.array([(0.0, 0.0, 1.0)]))
    sizes = size * rng.uniform(0.7, 1.3, (count, 1, 1))
    turned = np.einsum("nij,kj->nki", (lean * spin).as_matrix(), octahedron) * sizes
    vertices = (tips[:, None] + turned).reshape(-1, 3)
    triangles = faces[None] + 6 * np.arange(count)[:, None, None]
    return vertices, triangles.reshape(-1, 3)


@dataclass(frozen=True)
class Terrain(Shape):
    """A block with a hilly top: the ground of a scene, or a piece of landscape.

    The cells are smaller towards the middle, where a camera stands. The hills have height 0 in the middle, so
    that a camera's height over the ground is known.
    """

    relief: float
    """Standard deviation of the hills' height, relative to half the side."""
    frequency: float
    """Lowest wave number, radians per half side."""
    slope: float
    """How fast finer hills become lower."""
    depth: float
    """Thickness below the lowest point, relative to half the side."""
    cells: int
    concentration: float
    """1: equal cells; 3: those in the middle are much smaller than those at the rim."""
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            relief=uniform(rng, 0.05, 0.2),
            frequency=uniform(rng, 2.0, 5.0),
            slope=uniform(rng, 0.8, 1.6),
            depth=uniform(rng, 0.05, 0.3),
            cells=40,
            concentration=1.0,
            seed=new_seed(rng),
        )

    def height(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height of the hills at points (N, 2) of [-1, 1]^2, before the mesh is centred; 0 in the middle."""
        centred = np.concatenate([[(0.0, 0.0)], points])
        noise = wave_noise(np.random.default_rng(self.seed), centred, self.frequency, self.slope)
        relative: NDArray[np.float64] = self.relief * (noise[1:] - noise[0])
        return relative

    def middle_height(self) -> float:
        """Height of the middle of the top in the mesh's own coordinates, after centring."""
        height = self.height(self._plan())
        return -float(height.min() - self.depth + height.max()) / 2

    def _plan(self) -> NDArray[np.float64]:
        """(N, 2) grid points of the top, row by row."""
        line = np.linspace(-1.0, 1.0, self.cells + 1)
        line = np.sign(line) * np.abs(line) ** self.concentration
        y, x = np.meshgrid(line, line, indexing="ij")
        return np.stack([x, y], -1).reshape(-1, 2)

    def mesh(self) -> Mesh:
        plan = self._plan()
        height = self.height(plan)
        top = np.column_stack([plan, height]).reshape(self.cells + 1, self.cells + 1, 3)
        return solid(*block_under(top, float(height.min()) - self.depth, (0.0, 0.0)), smooth=True)
