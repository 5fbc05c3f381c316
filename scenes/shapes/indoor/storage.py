"""Shelves, racks, cupboards, chests of drawers, kitchens."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Self

import numpy as np

from scenes.geometry.building import Part
from scenes.random_draws import chance, choose, integer, uniform
from scenes.shapes.anchored import Surface
from scenes.shapes.indoor.parts import BoxCorners, IndoorShape, Top, lathe, rod, slabs, surfaces


@dataclass(frozen=True)
class Shelf(IndoorShape):
    """An open shelf with its back at the wall: boards between sides, in one bay or several."""

    width: float
    depth: float
    height: float
    levels: int
    bays: int
    board: str
    backed: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        bays = choose(rng, [1, 1, 2, 3])
        height = choose(rng, [uniform(rng, 0.75, 1.2), uniform(rng, 1.6, 2.2), uniform(rng, 1.9, 2.3)])
        return cls(
            width=bays * uniform(rng, 0.6, 0.9),
            depth=uniform(rng, 0.24, 0.4),
            height=height,
            levels=max(2, round(height / uniform(rng, 0.3, 0.42))),
            bays=bays,
            board=choose(rng, ["wood", "lacquer"], [0.7, 0.3]),
            backed=chance(rng, 0.7),
        )

    def _levels(self) -> list[float]:
        """Heights of the boards' upper sides, the lowest first."""
        return np.linspace(0.08, self.height, self.levels + 1).tolist()[:-1]

    def parts(self) -> dict[str, Surface]:
        w, d, h, t = self.width / 2, self.depth, self.height, 0.022
        bodies: list[BoxCorners] = [
            (x - t / 2, 0.0, 0.0, x + t / 2, d, h) for x in np.linspace(-w, w, self.bays + 1).tolist()
        ]
        bodies += [(-w, 0.0, z - t, w, d - 0.003, z) for z in [*self._levels(), h]]
        bodies.append((-w, 0.02, 0.0, w, d - 0.02, 0.06))
        back: list[Part] = [slabs((-w, 0.001, 0.06, w, 0.007, h - t))] if self.backed else []
        return surfaces(**{self.board: [slabs(*bodies)], f"{self.board}_back": back})

    def tops(self) -> tuple[Top, ...]:
        step = self.width / self.bays
        gap = (self.height - 0.08) / self.levels
        inside = [
            Top(
                (-self.width / 2 + k * step + 0.015, 0.012),
                (-self.width / 2 + (k + 1) * step - 0.015, self.depth - 0.008),
                z,
                gap - 0.035,
            )
            for k in range(self.bays)
            for z in self._levels()
        ]
        above = Top((-self.width / 2, 0.0), (self.width / 2, self.depth), self.height, 0.4)
        return (*inside, above)


@dataclass(frozen=True)
class Rack(IndoorShape):
    """An open rack of steel posts and shelves, with crossed braces."""

    width: float
    depth: float
    height: float
    levels: int
    wire: bool
    """Whether the shelves are grids of wire."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            width=uniform(rng, 0.9, 1.6),
            depth=uniform(rng, 0.4, 0.6),
            height=uniform(rng, 1.7, 2.3),
            levels=integer(rng, 3, 5),
            wire=chance(rng, 0.4),
        )

    def _levels(self) -> list[float]:
        return np.linspace(0.12, self.height - 0.06, self.levels).tolist()

    def parts(self) -> dict[str, Surface]:
        w, d, h = self.width / 2, self.depth, self.height
        corners = [(x, y) for x in (-w, w) for y in (0.03, d)]
        posts = [slabs(*((x - 0.018, y - 0.018, 0.0, x + 0.018, y + 0.018, h) for x, y in corners))]
        for x in (-w, w):
            posts.append(rod(((x, 0.03, 0.2), (x, d, h - 0.3)), 0.006, 6))
            posts.append(rod(((x, d, 0.2), (x, 0.03, h - 0.3)), 0.006, 6))
        decks: list[Part] = []
        for z in self._levels():
            if self.wire:
                decks.append(slabs((-w, 0.02, z - 0.03, w, 0.03, z), (-w, d - 0.01, z - 0.03, w, d, z)))
                bars = np.linspace(-w + 0.02, w - 0.02, round(self.width / 0.035))
                decks.append(slabs(*((x - 0.002, 0.02, z - 0.008, x + 0.002, d, z) for x in bars.tolist())))
            else:
                decks.append(slabs((-w, 0.02, z - 0.03, w, d, z)))
        return surfaces(metal=posts, **{"chrome_decks" if self.wire else "metal_decks": decks})

    def tops(self) -> tuple[Top, ...]:
        levels = self._levels()
        rooms = [*(b - a - 0.05 for a, b in itertools.pairwise(levels)), 0.45]
        w = self.width / 2 - 0.03
        return tuple(
            Top((-w, 0.05), (w, self.depth - 0.03), z, room) for z, room in zip(levels, rooms, strict=True)
        )


@dataclass(frozen=True)
class Cabinet(IndoorShape):
    """A cupboard, sideboard or chest of drawers: a body with fronts and handles, on a plinth or on feet."""

    width: float
    depth: float
    height: float
    columns: int
    rows: int
    handle: str
    """bar, knob or none."""
    body: str
    front: str
    foot: float
    glazed: bool
    """Whether the upper half of a tall one has glass doors."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls.sideboard(rng)

    @classmethod
    def sideboard(cls, rng: np.random.Generator) -> Self:
        """A low cabinet or a chest of drawers."""
        columns = integer(rng, 1, 4)
        return cls._of(
            rng, columns * uniform(rng, 0.4, 0.6), uniform(rng, 0.4, 0.5), uniform(rng, 0.5, 1.05), columns,
            choose(rng, [1, 2, 3, 4]),
        )  # fmt: skip

    @classmethod
    def wardrobe(cls, rng: np.random.Generator) -> Self:
        """A tall cupboard."""
        columns = integer(rng, 1, 4)
        return cls._of(
            rng, columns * uniform(rng, 0.42, 0.55), uniform(rng, 0.4, 0.62), uniform(rng, 1.7, 2.2), columns,
            choose(rng, [1, 1, 2]),
        )  # fmt: skip

    @classmethod
    def _of(
        cls, rng: np.random.Generator, width: float, depth: float, height: float, columns: int, rows: int
    ) -> Self:
        body = choose(rng, ["wood", "lacquer", "metal"], [0.5, 0.4, 0.1])
        return cls(
            width=width,
            depth=depth,
            height=height,
            columns=columns,
            rows=rows,
            handle=choose(rng, ["bar", "knob", "none"], [0.5, 0.3, 0.2]),
            body=body,
            front=body if chance(rng, 0.7) else "lacquer",
            foot=choose(rng, [0.06, 0.14]),
            glazed=height > 1.5 and chance(rng, 0.25),
        )

    def parts(self) -> dict[str, Surface]:
        w, d, h, foot = self.width / 2, self.depth, self.height, self.foot
        body = [slabs((-w, 0.0, foot, w, d - 0.022, h))]
        if foot < 0.1:
            body.append(slabs((-w + 0.02, 0.02, 0.0, w - 0.02, d - 0.06, foot)))
        else:
            body += [
                slabs(*((x - 0.02, y - 0.02, 0.0, x + 0.02, y + 0.02, foot + 0.01) for y in (0.05, d - 0.07)))
                for x in (-w + 0.06, w - 0.06)
            ]
        fronts, handles, panes = [], [], []
        wide, tall = self.width / self.columns, (h - foot) / self.rows
        for column in range(self.columns):
            for row in range(self.rows):
                x, z = -w + column * wide, foot + row * tall
                face: BoxCorners = (x + 0.003, d - 0.02, z + 0.003, x + wide - 0.003, d, z + tall - 0.003)
                if self.glazed and (self.rows == 1 or row > 0):
                    panes.append(slabs(face))
                else:
                    fronts.append(slabs(face))
                handles += self._handle(x, z, wide, tall, column)
        return surfaces(
            **{self.body: body, f"{self.front}_front": fronts, "glass": panes, "chrome_handles": handles}
        )

    def _handle(self, x: float, z: float, wide: float, tall: float, column: int) -> list[Part]:
        d = self.depth
        drawer = wide > tall
        if self.handle == "none":
            return []
        if self.handle == "knob":
            at = x + wide / 2 if drawer else x + (0.05 if column % 2 else wide - 0.05)
            vertices, triangles = lathe(
                ((0.008, 0.0), (0.008, 0.012), (0.016, 0.02), (0.012, 0.03)), sides=10
            )
            # Turned from upright to pointing into the room.
            turned = np.stack([vertices[:, 0], vertices[:, 2], vertices[:, 1]], -1)
            return [(turned + np.array((at, d, z + tall / 2)), triangles[:, ::-1])]
        if drawer:
            long = min(0.16, 0.5 * wide)
            middle, top = x + wide / 2, z + tall - 0.06
            return [
                slabs(
                    (middle - long / 2, d + 0.016, top - 0.006, middle + long / 2, d + 0.028, top + 0.006),
                    (middle - long / 2, d, top - 0.005, middle - long / 2 + 0.01, d + 0.017, top + 0.005),
                    (middle + long / 2 - 0.01, d, top - 0.005, middle + long / 2, d + 0.017, top + 0.005),
                )
            ]
        at, middle, long = x + (0.04 if column % 2 else wide - 0.04), z + tall / 2, min(0.2, 0.5 * tall)
        return [
            slabs(
                (at - 0.006, d + 0.016, middle - long / 2, at + 0.006, d + 0.028, middle + long / 2),
                (at - 0.005, d, middle - long / 2, at + 0.005, d + 0.017, middle - long / 2 + 0.01),
                (at - 0.005, d, middle + long / 2 - 0.01, at + 0.005, d + 0.017, middle + long / 2),
            )
        ]

    def tops(self) -> tuple[Top, ...]:
        if self.height > 1.9:
            return ()
        return (
            Top((-self.width / 2 + 0.02, 0.02), (self.width / 2 - 0.02, self.depth - 0.03), self.height, 0.6),
        )


@dataclass(frozen=True)
class KitchenRow(IndoorShape):
    """A row of kitchen cupboards under a worktop with a sink and a hob; wall cupboards and a hood above."""

    units: int
    """Cupboards 0.6 m wide."""
    sink: int
    """Number of the cupboard below the sink."""
    hob: int
    """Number of the cupboard below the hob; the oven is there."""
    upper: bool
    """Whether there are wall cupboards."""
    front: str
    stretch: float
    """Width of the cupboards relative to 0.6 m."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        units = integer(rng, 3, 6)
        sink = integer(rng, 0, units - 1)
        hob = choose(rng, [k for k in range(units) if k != sink])
        return cls(
            units,
            sink,
            hob,
            chance(rng, 0.75),
            choose(rng, ["lacquer", "wood"], [0.7, 0.3]),
            uniform(rng, 0.92, 1.05),
        )

    def _x(self, unit: int) -> float:
        """Left end of a cupboard before all is stretched."""
        return 0.6 * (unit - self.units / 2)

    def parts(self) -> dict[str, Surface]:
        wider = np.array((self.stretch, 1.0, 1.0))
        return {
            name: Surface(part.vertices * wider, part.triangles) for name, part in self._unstretched().items()
        }

    def _unstretched(self) -> dict[str, Surface]:
        w = 0.3 * self.units
        fronts: list[Part] = [slabs((-w, 0.0, 0.1, w, 0.54, 0.86))]
        handles: list[Part] = []
        for unit in range(self.units):
            if unit == self.hob:
                continue
            x = self._x(unit)
            rows = [(0.1, 0.86)] if unit % 2 == 0 else [(0.1, 0.4), (0.4, 0.68), (0.68, 0.86)]
            for low, high in rows:
                fronts.append(slabs((x + 0.003, 0.545, low + 0.003, x + 0.597, 0.565, high - 0.003)))
                handles.append(slabs((x + 0.2, 0.575, high - 0.05, x + 0.4, 0.59, high - 0.04)))
                handles.append(
                    slabs(
                        (x + 0.2, 0.564, high - 0.048, x + 0.21, 0.577, high - 0.042),
                        (x + 0.39, 0.564, high - 0.048, x + 0.4, 0.577, high - 0.042),
                    )
                )
        x = self._x(self.hob)
        dark = [
            slabs((x + 0.005, 0.55, 0.14, x + 0.595, 0.57, 0.7), (x + 0.03, 0.08, 0.9, x + 0.57, 0.53, 0.908))
        ]
        steel = [
            slabs((x + 0.003, 0.545, 0.72, x + 0.597, 0.572, 0.855)),
            rod(((x + 0.08, 0.6, 0.67), (x + 0.52, 0.6, 0.67)), 0.009),
            *(
                lathe(((0.09, 0.0), (0.09, 0.006)), (x + dx, dy, 0.907), 24)
                for dx, dy in ((0.17, 0.2), (0.43, 0.2), (0.17, 0.41), (0.43, 0.41))
            ),
            *self._sink_and_tap(),
        ]
        if self.upper:
            handles += self._wall_cupboards(fronts, steel)
        top = self._worktop()
        return surfaces(
            **{self.front: fronts},
            chrome_handles=handles,
            stone=[top],
            glass_black=dark,
            chrome_steel=steel,
            plastic_plinth=[slabs((-w + 0.01, 0.02, 0.0, w - 0.01, 0.5, 0.1))],
        )

    def _worktop(self) -> Part:
        """The worktop around the sink's hole."""
        w, x = 0.3 * self.units, self._x(self.sink)
        return slabs(
            (-w, 0.0, 0.86, x + 0.06, 0.6, 0.9),
            (x + 0.54, 0.0, 0.86, w, 0.6, 0.9),
            (x + 0.06, 0.0, 0.86, x + 0.54, 0.1, 0.9),
            (x + 0.06, 0.5, 0.86, x + 0.54, 0.6, 0.9),
        )

    def _sink_and_tap(self) -> list[Part]:
        x = self._x(self.sink)
        a, b = x + 0.06, x + 0.54
        basin = slabs(
            (a, 0.1, 0.862, b, 0.5, 0.87),
            (a - 0.02, 0.08, 0.899, a + 0.006, 0.52, 0.904),
            (b - 0.006, 0.08, 0.899, b + 0.02, 0.52, 0.904),
            (a, 0.08, 0.899, b, 0.106, 0.904),
            (a, 0.494, 0.899, b, 0.52, 0.904),
        )
        angle = np.linspace(0.0, np.pi, 9)
        arc = [(x + 0.3, 0.13 - 0.075 * (np.cos(t) - 1), 1.12 + 0.075 * np.sin(t)) for t in angle.tolist()]
        tap = rod(((x + 0.3, 0.055, 0.9), (x + 0.3, 0.055, 1.0), (x + 0.3, 0.06, 1.1)), 0.014)
        spout = rod(tuple((px, py - 0.075, pz) for px, py, pz in arc), 0.011)
        lever = rod(((x + 0.3, 0.055, 0.98), (x + 0.38, 0.055, 1.01)), 0.007)
        return [basin, tap, spout, lever]

    def _wall_cupboards(self, fronts: list[Part], steel: list[Part]) -> list[Part]:
        handles: list[Part] = []
        for unit in range(self.units):
            x = self._x(unit)
            if unit == self.hob:
                steel.append(
                    slabs(
                        (x + 0.01, 0.0, 1.6, x + 0.59, 0.45, 1.66), (x + 0.17, 0.0, 1.66, x + 0.43, 0.27, 2.2)
                    )
                )
                continue
            fronts.append(
                slabs(
                    (x + 0.001, 0.0, 1.45, x + 0.599, 0.32, 2.15),
                    (x + 0.003, 0.323, 1.453, x + 0.297, 0.34, 2.147),
                    (x + 0.303, 0.323, 1.453, x + 0.597, 0.34, 2.147),
                )
            )
            handles += [
                slabs((at - 0.005, 0.339, 1.48, at + 0.005, 0.36, 1.6)) for at in (x + 0.26, x + 0.34)
            ]
        return handles

    def tops(self) -> tuple[Top, ...]:
        k = self.stretch
        taken = sorted((self.sink, self.hob))
        edges = [-1, *taken, self.units]
        room = 0.5 if self.upper else 0.7
        free = [
            Top((k * (self._x(a + 1) + 0.03), 0.04), (k * (self._x(b) - 0.03), 0.56), 0.9, room)
            for a, b in itertools.pairwise(edges)
            if b - a > 1
        ]
        x = self._x(self.hob)
        return (*free, Top((k * (x + 0.05), 0.1), (k * (x + 0.55), 0.52), 0.913, 0.4))


@dataclass(frozen=True)
class Fridge(IndoorShape):
    """A fridge with a freezer below."""

    width: float
    height: float
    split: float
    body: str

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 0.55, 0.7), uniform(rng, 1.5, 2.0), uniform(rng, 0.3, 0.45),
            choose(rng, ["lacquer", "metal"], [0.6, 0.4]),
        )  # fmt: skip

    def parts(self) -> dict[str, Surface]:
        w, h, z = self.width / 2, self.height, self.split * self.height
        doors = [
            slabs(
                (-w, 0.0, 0.04, w, 0.58, h),
                (-w, 0.585, 0.06, w, 0.64, z - 0.004),
                (-w, 0.585, z + 0.004, w, 0.64, h),
            )
        ]
        handles = [
            slabs((-w + 0.04, 0.67, low, -w + 0.06, 0.69, high))
            for low, high in ((z - 0.4, z - 0.06), (z + 0.08, z + 0.5))
        ]
        handles += [
            slabs((-w + 0.04, 0.638, zz, -w + 0.06, 0.675, zz + 0.02))
            for zz in (z - 0.4, z - 0.08, z + 0.08, z + 0.48)
        ]
        return surfaces(
            **{self.body: doors},
            chrome=handles,
            plastic=[slabs((-w + 0.02, 0.05, 0.0, w - 0.02, 0.56, 0.05))],
        )
