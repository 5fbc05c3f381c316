"""What a room is enclosed by: walls with openings, floors, skirting, windows, doors."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Self

import numpy as np

from scenes.geometry.building import Part
from scenes.random_draws import chance, choose, integer, uniform
from scenes.shapes.anchored import Surface
from scenes.shapes.indoor.parts import BoxCorners, IndoorShape, Top, lathe, rod, slabs, surfaces

Opening = tuple[float, float, float, float]
"""A hole in a wall: x from and to, z from and to, metres in the wall's own coordinates."""


def _around(
    width: float, height: float, openings: tuple[Opening, ...]
) -> list[tuple[float, float, float, float]]:
    """Rectangles (x, x, z, z) that cover a wall from x = 0 to `width` but for its openings, side by side."""
    edges = sorted({0.0, width, *(x for opening in openings for x in opening[:2])})
    pieces = []
    for left, right in itertools.pairwise(edges):
        inside = sorted(o for o in openings if o[0] < right - 1e-9 and o[1] > left + 1e-9)
        z = 0.0
        for opening in sorted(inside, key=lambda o: o[2]):
            if opening[2] > z:
                pieces.append((left, right, z, opening[2]))
            z = opening[3]
        if z < height:
            pieces.append((left, right, z, height))
    return pieces


@dataclass(frozen=True)
class RoomWall(IndoorShape):
    """A wall from x = 0 to its width, its face at y = 0 and its body behind; a dado of another material below."""

    width: float
    height: float
    thickness: float
    openings: tuple[Opening, ...]
    dado: float
    """Height up to which the wall has its lower material; 0 for none."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 2.0, 6.0), uniform(rng, 2.3, 3.0), 0.25, (), 0.0)

    def parts(self) -> dict[str, Surface]:
        pieces = _around(self.width, self.height, self.openings)
        lower: list[BoxCorners] = []
        upper: list[BoxCorners] = []
        for left, right, low, high in pieces:
            if self.dado > low:
                lower.append((left, -self.thickness, low, right, 0.0, min(high, self.dado)))
            if high > self.dado:
                upper.append((left, -self.thickness, max(low, self.dado), right, 0.0, high))
        return surfaces(wall=[slabs(*upper)], tiles=[slabs(*lower)] if lower else [])


@dataclass(frozen=True)
class RoomSlab(IndoorShape):
    """A floor or a ceiling: a rectangle from the anchor to (width, depth), its face at z = 0.

    It lies below its face, or above it where it hangs.
    """

    width: float
    depth: float
    made_of: str
    """floor or ceiling."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 2.0, 6.0), uniform(rng, 2.0, 6.0), "floor")

    def parts(self) -> dict[str, Surface]:
        low, high = (-0.2, 0.0) if self.made_of == "floor" else (0.0, 0.2)
        return surfaces(
            **{self.made_of: [slabs((-0.25, -0.25, low, self.width + 0.25, self.depth + 0.25, high))]}
        )


@dataclass(frozen=True)
class Skirting(IndoorShape):
    """Skirting boards along a wall between its doors, and perhaps a cornice under the ceiling."""

    width: float
    height: float
    gaps: tuple[tuple[float, float], ...]
    board: float
    """Height of the boards."""
    cornice: float
    """Its height; 0 for none."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 2.0, 6.0),
            2.5,
            (),
            uniform(rng, 0.05, 0.14),
            choose(rng, [0.0, 0.0, uniform(rng, 0.05, 0.12)]),
        )

    def parts(self) -> dict[str, Surface]:
        walls = _around(self.width, self.board, tuple((a, b, 0.0, self.board) for a, b in self.gaps))
        boards = [slabs(*((a, 0.0, low, b, 0.014, high) for a, b, low, high in walls))] if walls else []
        if self.cornice:
            c, h = self.cornice, self.height
            boards.append(
                slabs((0.0, 0.0, h - c, self.width, 0.4 * c, h), (0.0, 0.0, h - 0.4 * c, self.width, c, h))
            )
        return surfaces(trim=boards)


@dataclass(frozen=True)
class RoomWindow(IndoorShape):
    """A window in its opening: frame, bars, panes and a sill; the anchor is in the middle of the opening's foot."""

    width: float
    height: float
    thickness: float
    """Of the wall."""
    columns: int
    rows: int
    glazed: bool
    """Whether there are panes in it."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 0.9, 2.4),
            uniform(rng, 1.0, 1.6),
            0.25,
            integer(rng, 1, 4),
            choose(rng, [1, 1, 2, 3]),
            chance(rng, 0.5),
        )

    def parts(self) -> dict[str, Surface]:
        w, h, back = self.width / 2, self.height, -0.7 * self.thickness
        f = 0.05
        bars: list[BoxCorners] = [
            (-w, back - 0.03, 0.0, -w + f, back + 0.03, h), (w - f, back - 0.03, 0.0, w, back + 0.03, h),
            (-w, back - 0.03, 0.0, w, back + 0.03, f), (-w, back - 0.03, h - f, w, back + 0.03, h),
        ]  # fmt: skip
        bars += [
            (x - 0.025, back - 0.025, 0.0, x + 0.025, back + 0.025, h)
            for x in np.linspace(-w, w, self.columns + 1).tolist()[1:-1]
        ]
        bars += [
            (-w, back - 0.015, z - 0.015, w, back + 0.015, z + 0.015)
            for z in np.linspace(0.0, h, self.rows + 1).tolist()[1:-1]
        ]
        sill = slabs((-w - 0.05, back, -0.03, w + 0.05, 0.06, 0.0))
        panes: list[Part] = (
            [slabs((-w + f / 2, back - 0.004, f / 2, w - f / 2, back + 0.004, h - f / 2))]
            if self.glazed
            else []
        )
        handle = slabs((-0.008, back + 0.03, h * 0.45, 0.008, back + 0.06, h * 0.45 + 0.12))
        return surfaces(trim=[slabs(*bars), sill], pane=panes, chrome=[handle] if self.columns == 2 else [])

    def tops(self) -> tuple[Top, ...]:
        return (
            Top((-self.width / 2 + 0.05, -0.55 * self.thickness), (self.width / 2 - 0.05, 0.04), 0.0, 0.5),
        )


@dataclass(frozen=True)
class RoomDoor(IndoorShape):
    """A door with its frame in an opening that is `width` wide; it stands open by an angle. The anchor is in the
    middle of the opening on the floor."""

    width: float
    height: float
    thickness: float
    """Of the wall."""
    panels: int
    """0 for a smooth leaf."""
    glazed: bool
    """Whether its upper panels are glass."""
    open_deg: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 0.78, 0.95), uniform(rng, 1.98, 2.15), 0.25, choose(rng, [0, 2, 3, 4]), chance(rng, 0.15),
            choose(rng, [0.0, 0.0, uniform(rng, 15.0, 80.0)]),
        )  # fmt: skip

    def parts(self) -> dict[str, Surface]:
        w, h = self.width / 2, self.height
        frame = slabs(
            (-w - 0.07, -0.02, 0.0, -w, 0.018, h + 0.07), (w, -0.02, 0.0, w + 0.07, 0.018, h + 0.07),
            (-w - 0.07, -0.02, h, w + 0.07, 0.018, h + 0.07),
            (-w, -self.thickness, 0.0, -w + 0.02, 0.0, h), (w - 0.02, -self.thickness, 0.0, w, 0.0, h),
            (-w, -self.thickness, h - 0.02, w, 0.0, h),
        )  # fmt: skip
        inner = self.width - 0.05
        leaf: list[BoxCorners] = []
        panes: list[BoxCorners] = []
        if self.panels == 0:
            leaf.append((0.0, -0.04, 0.008, inner, 0.0, h - 0.025))
        else:
            rail, top = 0.11, h - 0.025
            leaf += [(0.0, -0.04, 0.008, rail, 0.0, top), (inner - rail, -0.04, 0.008, inner, 0.0, top)]
            step = (top - 0.008) / self.panels
            for k in range(self.panels + 1):
                z = min(max(0.008 + k * step, 0.008 + rail / 2), top - rail / 2)
                leaf.append((rail, -0.04, z - rail / 2, inner - rail, 0.0, z + rail / 2))
            for k in range(self.panels):
                box: BoxCorners = (rail, -0.028, 0.05 + k * step, inner - rail, -0.014, (k + 1) * step)
                (panes if self.glazed and k == self.panels - 1 else leaf).append(box)
        handle = [
            rod(
                ((inner - 0.06, y, 1.02), (inner - 0.06, 1.9 * y + (0.02 if y > -0.02 else -0.04), 1.02)),
                0.008,
                8,
            )
            for y in (0.0, -0.04)
        ]
        handle += [rod(((inner - 0.06, y, 1.02), (inner - 0.18, y, 1.02)), 0.009, 8) for y in (0.03, -0.07)]
        handle.append(slabs((inner - 0.085, -0.043, 0.93, inner - 0.035, 0.003, 1.08)))
        swung = [self._swung(part) for part in (slabs(*leaf), *handle, *([slabs(*panes)] if panes else []))]
        split = 1 + len(handle)
        return surfaces(trim=[frame], lacquer_door=swung[:1], chrome=swung[1:split], glass=swung[split:])

    def _swung(self, part: Part) -> Part:
        """The leaf's part, turned about the hinge at the opening's left side, away from the room."""
        angle = np.radians(-self.open_deg)
        turn = np.array(
            [(np.cos(angle), -np.sin(angle), 0.0), (np.sin(angle), np.cos(angle), 0.0), (0.0, 0.0, 1.0)]
        )
        return part[0] @ turn.T + np.array((-self.width / 2 + 0.025, -0.1, 0.0)), part[1]


@dataclass(frozen=True)
class Pillar(IndoorShape):
    """A round or square pillar, or a chimney breast, from floor to ceiling."""

    width: float
    depth: float
    height: float
    disc: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        w = uniform(rng, 0.25, 0.5)
        return cls(w, w * uniform(rng, 1.0, 1.6), 2.6, chance(rng, 0.3))

    def parts(self) -> dict[str, Surface]:
        if self.disc:
            return surfaces(wall=[lathe(((self.width / 2, 0.0), (self.width / 2, self.height)), sides=32)])
        w, d = self.width / 2, self.depth / 2
        return surfaces(wall=[slabs((-w, -d, 0.0, w, d, self.height))])


@dataclass(frozen=True)
class Hallway(IndoorShape):
    """What an open door leads to: a closed space behind the wall; the anchor is in the middle of the doorway."""

    width: float
    depth: float
    height: float
    thickness: float
    """Of the wall that the door is in."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 1.2, 3.0), uniform(rng, 1.2, 3.5), 2.5, 0.25)

    def parts(self) -> dict[str, Surface]:
        w, h, near, far = self.width / 2, self.height, -self.thickness, -self.thickness - self.depth
        walls = slabs(
            (-w - 0.05, far - 0.1, 0.0, w + 0.05, far, h),
            (-w - 0.1, far - 0.05, 0.0, -w, near, h),
            (w, far - 0.05, 0.0, w + 0.1, near, h),
        )
        return surfaces(
            wall=[walls],
            floor=[slabs((-w, far, -0.2, w, near - 0.005, 0.0))],
            ceiling=[slabs((-w, far, h, w, near - 0.005, h + 0.1))],
        )
