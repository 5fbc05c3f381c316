"""Buildings and ruins: columns, arches, walls and towers of blocks, steps, houses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from manifold3d import Manifold, OpType
from numpy.typing import NDArray

from scenes.geometry.building import Part, cross_section, grid_triangles, joined, manifold_arrays
from scenes.random_draws import chance, integer, new_seed, uniform
from scenes.shapes.anchored import PartedShape
from scenes.shapes.solids.organic import wave_noise

_BOX = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
_BOX_FACES = np.array(
    [
        (0, 1, 3),
        (0, 3, 2),
        (4, 6, 7),
        (4, 7, 5),
        (0, 4, 5),
        (0, 5, 1),
        (2, 3, 7),
        (2, 7, 6),
        (0, 2, 6),
        (0, 6, 4),
        (1, 5, 7),
        (1, 7, 3),
    ],
    np.int64,
)


def oriented_boxes(
    centre: NDArray[np.float64], half: NDArray[np.float64], turn: NDArray[np.float64] | None = None
) -> Part:
    """Boxes about (N, 3) centres with (N, 3) half sides, each turned by a (N, 3, 3) rotation."""
    corners = _BOX[None] * half[:, None]
    if turn is not None:
        corners = np.einsum("nij,nkj->nki", turn, corners)
    triangles = _BOX_FACES[None] + 8 * np.arange(len(centre))[:, None, None]
    return (centre[:, None] + corners).reshape(-1, 3), triangles.reshape(-1, 3)


@dataclass(frozen=True)
class Column(PartedShape):
    """A fluted or plain shaft on a base, with a capital, or broken off."""

    slenderness: float
    """Height relative to the shaft's radius."""
    flutes: int
    """0 for a plain round shaft."""
    flute_depth: float
    entasis: float
    """How much thinner the top is, as a share of the radius."""
    capital: float
    """Overhang of the capital relative to the radius."""
    broken: float
    """Share of the height that is missing, with a ragged end; 0 for a whole column."""
    seed: int

    popularity: ClassVar[float] = 0.6
    smooth: ClassVar[bool] = True
    crease_deg: ClassVar[float | None] = 35.0

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            slenderness=uniform(rng, 7.0, 16.0),
            flutes=integer(rng, 10, 22) if chance(rng, 0.6) else 0,
            flute_depth=uniform(rng, 0.05, 0.12),
            entasis=uniform(rng, 0.05, 0.25),
            capital=uniform(rng, 0.2, 0.6),
            broken=uniform(rng, 0.15, 0.75) if chance(rng, 0.45) else 0.0,
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        height = self.slenderness * (1 - self.broken)
        low = self._slab(1.45, 0.0, 0.35)
        torus = self._drum(np.array([0.0, 1.3, 1.42, 1.3, 0.0]), np.array([0.33, 0.33, 0.5, 0.68, 0.68]))
        parts = [low, torus, self._shaft(height)]
        if self.broken == 0.0:
            reach = 1 - self.entasis
            flare = reach + self.capital * np.array([0.0, 0.25, 0.8, 1.0])
            radius = np.concatenate([[0.0], flare, [0.0]])
            level = height + np.array([-0.5, -0.5, -0.35, 0.1, 0.25, 0.25])
            parts += [
                self._drum(radius, level),
                self._slab(reach + self.capital + 0.05, height + 0.23, height + 0.6),
            ]
        return {"stone": joined(*parts)}

    @staticmethod
    def _slab(half: float, low: float, high: float) -> Part:
        middle, size = np.array([[0.0, 0.0, (low + high) / 2]]), np.array([[half, half, (high - low) / 2]])
        return oriented_boxes(middle, size)

    @staticmethod
    def _drum(radius: NDArray[np.float64], height: NDArray[np.float64]) -> Part:
        theta = np.linspace(0, 2 * np.pi, 32, endpoint=False)
        x, y = radius[:, None] * np.cos(theta), radius[:, None] * np.sin(theta)
        z = np.broadcast_to(height[:, None], x.shape)
        vertices = np.stack([x, y, z], -1).reshape(-1, 3)
        return vertices, grid_triangles(len(radius), 32, wrap_columns=True)

    def _shaft(self, height: float) -> Part:
        """The shaft with its flutes; a broken one ends in a tilted, ragged face."""
        rng = np.random.default_rng(self.seed)
        sides = 4 * self.flutes if self.flutes else 36
        theta = np.linspace(0, 2 * np.pi, sides, endpoint=False)
        level = np.linspace(0.5, height, 14)
        taper = 1 - self.entasis * (level / self.slenderness) ** 1.6
        groove = 1 - self.flute_depth * np.abs(np.sin(self.flutes * theta / 2)) if self.flutes else 1.0
        radius = taper[:, None] * np.broadcast_to(groove, theta.shape)
        rows = np.stack(
            np.broadcast_arrays(radius * np.cos(theta), radius * np.sin(theta), level[:, None]), -1
        )
        centre_top = np.array((0.0, 0.0, height))
        if self.broken > 0:
            tilt = rng.normal(0.0, 0.5, 2)
            drop = rows[-1, :, :2] @ tilt + 0.25 * wave_noise(rng, rows[-1], 3.0, 0.5)
            rows[-1, :, 2] -= np.clip(drop, -0.9, 0.9)
            rows[-2, :, 2] = np.minimum(rows[-2, :, 2], rows[-1, :, 2] - 0.05)
            centre_top[2] = rows[-1, :, 2].mean() - 0.1
        ends = np.tile([(0.0, 0.0, 0.5)], (sides, 1)), np.tile(centre_top, (sides, 1))
        grid = np.concatenate([ends[0][None], rows, ends[1][None]])
        return grid.reshape(-1, 3), grid_triangles(len(grid), sides, wrap_columns=True)


@dataclass(frozen=True)
class Archway(PartedShape):
    """A wall with round-arched openings side by side: gates, arcades, aqueducts, bridges."""

    openings: int
    opening: float
    """Width of an opening relative to its pier's spacing."""
    rise: float
    """Height of an opening's straight sides relative to its width."""
    above: float
    """Height of the wall over the arches relative to the spacing."""
    thickness: float
    pointed: float
    """0 round arches .. 1 pointed ones."""
    ruin: float
    """How much of the top has crumbled, relative to the spacing."""
    seed: int

    popularity: ClassVar[float] = 0.5
    smooth: ClassVar[bool] = True
    crease_deg: ClassVar[float | None] = 35.0

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            openings=integer(rng, 1, 4),
            opening=uniform(rng, 0.5, 0.78),
            rise=uniform(rng, 0.7, 1.8),
            above=uniform(rng, 0.15, 0.6),
            thickness=uniform(rng, 0.15, 0.45),
            pointed=uniform(rng, 0.0, 1.0) if chance(rng, 0.5) else 0.0,
            ruin=uniform(rng, 0.1, 0.5) if chance(rng, 0.6) else 0.0,
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        half = self.opening / 2
        angle = np.linspace(0.0, np.pi, 21)
        arch_height = half * (np.sin(angle) + self.pointed * (1 - np.abs(np.cos(angle))) * 0.8)
        sill = self.rise * self.opening
        top = sill + float(arch_height.max()) + self.above
        x = np.linspace(0.0, self.openings, 12 * self.openings + 1)
        crumbled = self.ruin * np.abs(wave_noise(rng, x[:, None], 1.5, 0.6))
        edge = np.maximum(top - np.minimum(crumbled, 0.8 * self.above + 0.1 * self.ruin), 0.3)
        wall = np.concatenate([[(0.0, 0.0), (self.openings, 0.0)], np.stack([x[::-1], edge[::-1]], -1)])
        body = cross_section(wall)
        for index in range(self.openings):
            middle = index + 0.5
            outline = np.concatenate(
                [
                    [(middle - half, -1.0), (middle + half, -1.0)],
                    np.stack([middle + half * np.cos(angle), sill + arch_height], -1),
                ]
            )
            body = body - cross_section(outline)
        solid_wall = Manifold.extrude(body, self.thickness)
        vertices, triangles = manifold_arrays(solid_wall)
        # The plan lies in x and y: stand it up, centred.
        upright = np.stack(
            [vertices[:, 0] - self.openings / 2, self.thickness / 2 - vertices[:, 2], vertices[:, 1]], -1
        )
        return {"stone": (upright, triangles)}


@dataclass(frozen=True)
class BlockWall(PartedShape):
    """Courses of single stones along a line or an arc, the top courses partly fallen: walls, towers."""

    courses: int
    stones: int
    """In a course."""
    stone_height: float
    """Relative to a stone's length."""
    depth: float
    """Thickness relative to a stone's length."""
    arc_deg: float
    """Angle the wall turns through; 360 is a round tower, 0 a straight wall."""
    ruin: float
    """Share of the height that has crumbled away on average."""
    looseness: float
    """How far stones stray from their places, relative to their height."""
    seed: int

    popularity: ClassVar[float] = 0.6

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            courses=integer(rng, 5, 12),
            stones=integer(rng, 6, 14),
            stone_height=uniform(rng, 0.35, 0.7),
            depth=uniform(rng, 0.4, 0.9),
            arc_deg=0.0 if chance(rng, 0.6) else uniform(rng, 60.0, 360.0),
            ruin=uniform(rng, 0.0, 0.6),
            looseness=uniform(rng, 0.02, 0.12),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        # A course's ends are staggered; on a full circle it closes on itself.
        course = np.arange(self.courses).repeat(self.stones)
        place = np.tile(np.arange(self.stones), self.courses) + 0.5 * (course % 2)
        skyline = 1 - self.ruin * np.abs(
            wave_noise(rng, np.linspace(0, 1, 4 * self.stones)[:, None], 4.0, 0.6)
        )
        standing = course < np.maximum(1, self.courses * skyline[(4 * place).astype(int) % (4 * self.stones)])
        standing = _carried(course, place, standing)
        course, place = course[standing], place[standing]
        count = len(course)
        length = rng.uniform(0.40, 0.49, count)
        half = np.stack(
            [
                length,
                self.depth / 2 * rng.uniform(0.88, 1.1, count),
                self.stone_height / 2 * rng.uniform(0.92, 0.99, count),
            ],
            -1,
        )
        along = place - self.stones / 2
        stray = self.looseness * self.stone_height * rng.uniform(-1, 1, (count, 3)) * (0.5, 1.0, 0.1)
        level = (course + 0.5) * self.stone_height
        if self.arc_deg == 0.0:
            centre = np.stack([along, np.zeros(count), level], -1) + stray
            heading = np.zeros(count)
        else:
            radius = self.stones / np.radians(self.arc_deg)
            heading = along / radius
            reach = radius + stray[:, 1]
            centre = np.stack([reach * np.sin(heading), reach * np.cos(heading), level], -1)
        heading = -heading + rng.normal(0.0, 0.4 * self.looseness, count)
        turn = np.zeros((count, 3, 3))
        turn[:, 0, 0] = turn[:, 1, 1] = np.cos(heading)
        turn[:, 0, 1], turn[:, 1, 0] = -np.sin(heading), np.sin(heading)
        turn[:, 2, 2] = 1.0
        return {"stone": oriented_boxes(centre, half, turn)}


def _carried(
    course: NDArray[np.int64], place: NDArray[np.float64], standing: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """(N,) the standing stones that rest on one below them, which rests on one below it, down to the ground."""
    carried = standing & (course == 0)
    for level in range(1, int(course.max()) + 1):
        below = place[carried & (course == level - 1)]
        here = np.flatnonzero(standing & (course == level))
        if len(below) and len(here):
            carried[here] = np.abs(place[here, None] - below).min(axis=1) < 0.75
    return carried


@dataclass(frozen=True)
class Steps(PartedShape):
    """A flight of worn steps up to a landing."""

    steps: int
    rise: float
    """Height of a step relative to its depth."""
    width: float
    """Relative to a step's depth."""
    landing: float
    """Depth of the landing relative to a step's."""
    wear: float
    seed: int

    popularity: ClassVar[float] = 0.5

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            steps=integer(rng, 3, 12),
            rise=uniform(rng, 0.4, 0.8),
            width=uniform(rng, 3.0, 10.0),
            landing=uniform(rng, 1.0, 4.0),
            wear=uniform(rng, 0.02, 0.1),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        start = np.arange(self.steps) + rng.uniform(-self.wear, self.wear, self.steps)
        end = self.steps + self.landing
        half = np.stack(
            [
                self.width / 2 * rng.uniform(1 - self.wear, 1.0, self.steps),
                (end - start) / 2,
                np.full(self.steps, self.rise / 2) * rng.uniform(1.0, 1.0 + self.wear, self.steps),
            ],
            -1,
        )
        centre = np.stack(
            [np.zeros(self.steps), (start + end) / 2 - end / 2, (np.arange(self.steps) + 0.5) * self.rise], -1
        )
        return {"stone": oriented_boxes(centre, half)}


@dataclass(frozen=True)
class House(PartedShape):
    """Walls with windows and a door cut into them, and a gabled roof that overhangs them."""

    length: float
    """Relative to the width."""
    height: float
    """Of the walls relative to the width."""
    pitch: float
    """Height of the gable relative to half the width."""
    storeys: int
    bays: int
    """Windows along the long side."""
    overhang: float
    chimney: bool
    seed: int

    popularity: ClassVar[float] = 0.4

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            length=uniform(rng, 1.1, 2.2),
            height=uniform(rng, 0.7, 1.8),
            pitch=uniform(rng, 0.5, 1.3),
            storeys=integer(rng, 1, 3),
            bays=integer(rng, 2, 4),
            overhang=uniform(rng, 0.04, 0.14),
            chimney=chance(rng, 0.6),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        gable = np.array(
            [
                (-0.5, 0.0),
                (0.5, 0.0),
                (0.5, self.height),
                (0.0, self.height + self.pitch / 2),
                (-0.5, self.height),
            ]
        )
        walls = self._upright(Manifold.extrude(cross_section(gable), self.length)) - self._openings()
        parts = {"walls": manifold_arrays(walls), "roof": self._roof()}
        if self.chimney:
            top = self.height + self.pitch / 2
            middle = np.array([[0.22, 0.25 * self.length, (self.height + top + 0.15) / 2]])
            stack = oriented_boxes(middle, np.array([[0.07, 0.07, (top + 0.15 - self.height) / 2]]))
            parts["walls"] = joined(parts["walls"], stack)
        return parts

    def _upright(self, body: Manifold) -> Manifold:
        """Stand a gable's prism up: its plan's y becomes z, its height runs along y."""
        return body.translate((0.0, 0.0, -self.length / 2)).rotate((90.0, 0.0, 0.0))

    def _openings(self) -> Manifold:
        """Recesses, not holes, so that walls stay closed: windows on all sides, a door in front."""
        rng = np.random.default_rng(self.seed)
        storey = self.height / self.storeys
        wide, high = 0.16 * uniform(rng, 0.8, 1.3), 0.42 * storey
        cuts = []
        for level in range(self.storeys):
            sill = (level + 0.55) * storey
            for bay in range(self.bays):
                y = ((bay + 0.5) / self.bays - 0.5) * self.length
                cuts += [((side * 0.5, y, sill), (0.12, wide, high)) for side in (-1, 1)]
            cuts += [
                ((x, side * self.length / 2, sill), (wide, 0.12, high))
                for x in (-0.22, 0.22)
                for side in (-1, 1)
            ]
        door = 0.75 * storey
        cuts.append(((0.0, -self.length / 2, door / 2 - 0.01), (0.17, 0.12, door)))
        return Manifold.batch_boolean(
            [Manifold.cube(size, True).translate(at) for at, size in cuts], OpType.Add
        )

    def _roof(self) -> Part:
        """Two slabs that meet in the ridge."""
        slope = np.array((0.5, -self.pitch / 2))
        slope /= np.linalg.norm(slope)
        normal = np.array((-slope[1], slope[0]))
        ridge = np.array((0.0, self.height + self.pitch / 2))
        eaves = np.array((0.5, self.height)) + slope * self.overhang
        lift = 0.05 * normal
        peak = np.array((0.0, ridge[1] + 0.05 / normal[1]))
        right = [ridge, eaves, eaves + lift, peak]
        outline = np.array([*right, *[(-x, z) for x, z in right[2:0:-1]]])
        roof = Manifold.extrude(cross_section(outline), self.length + 2 * self.overhang)
        shift = -self.length / 2 - self.overhang
        return manifold_arrays(roof.translate((0.0, 0.0, shift)).rotate((90.0, 0.0, 0.0)))
