"""Solids carved out of other solids with boolean operations (manifold3d)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.geometry.building import manifold_arrays, solid
from scenes.geometry.mesh import Mesh
from scenes.random_draws import choose, integer, log_uniform, new_seed, uniform
from scenes.shapes.solids.basic import sample_proportions
from scenes.spec import Shape, Vector


def _primitive(kind: str) -> Manifold:
    """A named body of about unit size about the origin."""
    if kind == "cube":
        return Manifold.cube((2.0, 2.0, 2.0), True)
    if kind == "cylinder":
        return Manifold.cylinder(2.0, 1.0, 1.0, 32, True)
    return Manifold.sphere(1.1, 32)


_KINDS = ("cube", "cylinder", "sphere")


def _placed(body: Manifold, rotation: Rotation, scale: float, offset: NDArray[np.float64]) -> Manifold:
    matrix = np.column_stack([rotation.as_matrix() * scale, offset])
    return body.transform(matrix)


def _tidy(body: Manifold) -> Manifold:
    """The largest connected part, without the slivers that intersections leave."""
    return max(body.simplify(2e-3).decompose(), key=lambda part: part.volume())


@dataclass(frozen=True)
class CarvedSolid(Shape):
    """A primitive from which other primitives have been subtracted."""

    base: str
    """cube, cylinder or sphere."""
    proportions: Vector
    cuts: int
    cut_size: float
    """Size of the cutters relative to the base."""
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        cuts = integer(rng, 1, 5)
        return cls(
            base=choose(rng, _KINDS),
            proportions=sample_proportions(rng, 0.4),
            cuts=cuts,
            cut_size=log_uniform(rng, 0.45, 0.9) / cuts**0.25,
            seed=new_seed(rng),
        )

    def mesh(self) -> Mesh:
        rng = np.random.default_rng(self.seed)
        body = _primitive(self.base)
        for _ in range(self.cuts):
            cutter = _primitive(choose(rng, _KINDS))
            cutter = cutter.scale((1.0, 1.0, uniform(rng, 0.8, 3.0)))
            offset = rng.normal(size=3)
            offset *= uniform(rng, 0.3, 1.1) / np.linalg.norm(offset)
            left = body - _placed(cutter, Rotation.random(random_state=rng), self.cut_size, offset)
            # A cut that would leave too little is not made.
            if left.volume() > 0.3 * body.volume():
                body = left
        vertices, triangles = manifold_arrays(_tidy(body))
        return solid(vertices * self.proportions, triangles, smooth=True, crease_deg=30.0)


@dataclass(frozen=True)
class Shell(Shape):
    """A hollow primitive with openings: bowls, lanterns, houses with windows."""

    base: str
    """cube, cylinder or sphere."""
    proportions: Vector
    wall: float
    """Thickness relative to half the size."""
    openings: int
    opening_size: float
    """Relative to half the size."""
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            base=choose(rng, _KINDS),
            proportions=sample_proportions(rng, 0.5),
            wall=uniform(rng, 0.06, 0.2),
            openings=integer(rng, 1, 4),
            opening_size=uniform(rng, 0.35, 0.75),
            seed=new_seed(rng),
        )

    def mesh(self) -> Mesh:
        rng = np.random.default_rng(self.seed)
        inside = 1.0 - self.wall
        body = _primitive(self.base) - _primitive(self.base).scale((inside, inside, inside))
        for _ in range(self.openings):
            bore = _primitive(choose(rng, _KINDS)).scale((1.0, 1.0, 1.5)).translate((0.0, 0.0, 1.5))
            turn = Rotation.random(random_state=rng)
            body -= _placed(bore, turn, self.opening_size, turn.as_matrix()[:, 2] * 0.4)
        vertices, triangles = manifold_arrays(_tidy(body))
        return solid(vertices * self.proportions, triangles, smooth=True, crease_deg=30.0)
