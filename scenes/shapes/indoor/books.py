"""Books in rows and stacks, with pictures on their spines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, Triangles, joined
from scenes.geometry.polyhedra import turned
from scenes.random_draws import integer, new_seed, uniform
from scenes.shapes.anchored import Surface
from scenes.shapes.indoor.parts import IndoorShape, slabs, surfaces

SPINE_CELLS = 6
"""Spines along one side of the picture of book spines (`scenes.textures.interiors.BookSpines`)."""


def _spine_uv(
    rng: np.random.Generator, vertices: NDArray[np.float64], triangles: Triangles
) -> NDArray[np.float64]:
    """(F, 3, 2) one cell of the picture of spines for each box of eight vertices, stood upright on it."""
    boxed = vertices.reshape(-1, 8, 3)
    low, high = boxed.min(axis=1, keepdims=True), boxed.max(axis=1, keepdims=True)
    share = 0.04 + 0.92 * ((boxed - low) / (high - low))[..., [0, 2]]
    cell = rng.integers(0, SPINE_CELLS, (len(boxed), 1, 2))
    uv = ((cell + share) / SPINE_CELLS).reshape(-1, 2)
    return uv[triangles]


@dataclass(frozen=True)
class BookRow(IndoorShape):
    """Books side by side, their spines towards +y, some leaning; the anchor is at the middle of the foot."""

    width: float
    height: float
    depth: float
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 0.15, 0.6), uniform(rng, 0.2, 0.3), uniform(rng, 0.13, 0.2), new_seed(rng))

    def parts(self) -> dict[str, Surface]:
        rng = np.random.default_rng(self.seed)
        covers, pages = [], []
        x = -self.width / 2
        while True:
            thick = rng.uniform(0.012, 0.05)
            if x + thick > self.width / 2:
                break
            tall, deep = self.height * rng.uniform(0.7, 1.0), self.depth * rng.uniform(0.75, 1.0)
            out = rng.uniform(-0.012, 0.0)
            front = self.depth / 2 + out
            covers += [
                (x, front - 0.003, 0.0, x + thick - 0.0008, front, tall),
                (x, front - deep, 0.0, x + 0.002, front - 0.002, tall),
                (x + thick - 0.0028, front - deep, 0.0, x + thick - 0.0008, front - 0.002, tall),
            ]
            pages.append(
                (x + 0.0015, front - deep + 0.004, 0.003, x + thick - 0.0023, front - 0.0025, tall - 0.004)
            )
            x += thick
        if not covers:
            covers = [(-0.015, -0.07, 0.0, 0.015, 0.07, self.height)]
            pages = [(-0.013, -0.066, 0.003, 0.013, 0.0705, self.height - 0.01)]
        vertices, triangles = slabs(*covers)
        # The three boards of a book share its cell.
        cells = np.random.default_rng(self.seed + 1)
        uv = _spine_uv(cells, vertices, triangles)
        whole = Surface(vertices, triangles, uv)
        return {"spines": whole, **surfaces(paper=[slabs(*pages)])}


@dataclass(frozen=True)
class BookStack(IndoorShape):
    """A few books or magazines lying on one another, each turned a little."""

    count: int
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(integer(rng, 1, 6), new_seed(rng))

    def parts(self) -> dict[str, Surface]:
        rng = np.random.default_rng(self.seed)
        covers: list[Part] = []
        pages: list[Part] = []
        z = 0.0
        for _ in range(self.count):
            thick, wide, deep = rng.uniform(0.008, 0.04), rng.uniform(0.06, 0.11), rng.uniform(0.085, 0.15)
            yaw, offset = rng.uniform(-14.0, 14.0), (rng.uniform(-0.01, 0.01), rng.uniform(-0.01, 0.01), z)
            boards = slabs(
                (-wide, -deep, 0.0, wide, deep, 0.002),
                (-wide, -deep, thick - 0.002, wide, deep, thick),
                (-wide, -deep, 0.001, -wide + 0.002, deep, thick - 0.001),
            )
            covers.append(turned(boards, yaw, offset))
            pages.append(
                turned(
                    slabs((-wide + 0.001, -deep + 0.003, 0.001, wide - 0.003, deep - 0.003, thick - 0.001)),
                    yaw,
                    offset,
                )
            )
            z += thick
        vertices, triangles = joined(*covers)
        uv = _spine_uv(np.random.default_rng(self.seed + 1), vertices, triangles)
        return {"spines": Surface(vertices, triangles, uv), **surfaces(paper=pages)}
