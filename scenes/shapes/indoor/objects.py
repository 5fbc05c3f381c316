"""Things that stand about in rooms: books, vessels, boxes, baskets, screens, toys, tools, plants in pots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, Triangles, joined, tube
from scenes.geometry.leaves import arched, around, strips, width_directions
from scenes.geometry.polyhedra import hexahedra, turned
from scenes.geometry.stems import leaf_cloud
from scenes.random_draws import chance, choose, integer, new_seed, uniform
from scenes.shapes.anchored import Surface
from scenes.shapes.indoor.parts import IndoorShape, cushion, fronted, lathe, rod, slabs, surfaces

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


VESSELS = ("bottle", "tumbler", "wineglass", "cup", "bowl", "plate", "vase", "pot", "jar", "candle")
_VESSEL_SIZE = {
    "bottle": (0.22, 0.32),
    "tumbler": (0.09, 0.14),
    "wineglass": (0.15, 0.22),
    "cup": (0.07, 0.11),
    "bowl": (0.06, 0.1),
    "plate": (0.018, 0.026),
    "vase": (0.15, 0.4),
    "pot": (0.12, 0.22),
    "jar": (0.1, 0.2),
    "candle": (0.08, 0.25),
}
_VESSEL_MADE_OF = {
    "bottle": ("glass", "glass", "plastic"),
    "tumbler": ("glass",),
    "wineglass": ("glass",),
    "cup": ("ceramic",),
    "bowl": ("ceramic", "ceramic", "wood", "glass"),
    "plate": ("ceramic",),
    "vase": ("ceramic", "glass", "metal"),
    "pot": ("chrome", "enamel"),
    "jar": ("glass", "ceramic"),
    "candle": ("wax",),
}


@dataclass(frozen=True)
class Vessel(IndoorShape):
    """A turned thing: bottle, glass, cup, bowl, plate, vase, cooking pot, jar, candle."""

    form: str
    height: float
    slim: float
    """0.8 to 1.25: how wide it is for its height."""
    made_of: str
    lean: float
    """0..1, picks a silhouette within the kind."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls.of(rng, choose(rng, VESSELS))

    @classmethod
    def of(cls, rng: np.random.Generator, kind: str) -> Self:
        """Draw one of a kind (`VESSELS`)."""
        return cls(
            kind,
            uniform(rng, *_VESSEL_SIZE[kind]),
            uniform(rng, 0.85, 1.25),
            choose(rng, _VESSEL_MADE_OF[kind]),
            uniform(rng, 0.0, 1.0),
        )

    def _profile(self) -> list[tuple[float, float]]:
        """(radius, height) relative to the vessel's height, from the foot up the outside and down the inside."""
        a = self.lean
        if self.form == "bottle":
            s = 0.5 + 0.15 * a
            return [
                (0.13, 0.0),
                (0.14, 0.02),
                (0.14, s),
                (0.12, s + 0.1),
                (0.05, s + 0.24),
                (0.045, 0.95),
                (0.055, 0.96),
                (0.055, 1.0),
            ]
        if self.form == "tumbler":
            r = 0.3 + 0.06 * a
            return [(r - 0.05, 0.0), (r, 1.0), (r - 0.025, 1.0), (r - 0.07, 0.08)]
        if self.form == "wineglass":
            r = 0.2 + 0.05 * a
            return [
                (0.2, 0.0),
                (0.19, 0.015),
                (0.025, 0.04),
                (0.02, 0.45),
                (0.12, 0.5),
                (r, 0.7),
                (r - 0.03, 1.0),
                (r - 0.04, 1.0),
                (r - 0.012, 0.7),
                (0.11, 0.52),
            ]
        if self.form == "cup":
            r = 0.42 + 0.08 * a
            return [
                (0.6 * r, 0.0),
                (r - 0.05 * a, 0.3),
                (r, 1.0),
                (r - 0.05, 1.0),
                (r - 0.1, 0.3),
                (0.4 * r, 0.1),
            ]
        if self.form == "bowl":
            r = 0.95 + 0.4 * a
            return [
                (0.5, 0.0),
                (0.55, 0.08),
                (0.8 * r, 0.4),
                (r, 1.0),
                (r - 0.06, 1.0),
                (0.75 * r, 0.45),
                (0.4, 0.14),
            ]
        if self.form == "plate":
            return [(3.0, 0.0), (3.4, 0.25), (5.2, 0.85), (5.3, 1.0), (3.4, 0.45), (3.0, 0.3)]
        if self.form == "vase":
            b = 0.2 + 0.12 * a
            return [
                (0.12, 0.0),
                (b, 0.25 + 0.2 * a),
                (0.1, 0.8),
                (0.13, 1.0),
                (0.11, 1.0),
                (0.08, 0.8),
                (b - 0.03, 0.3 + 0.2 * a),
                (0.1, 0.05),
            ]
        if self.form == "pot":
            r = 0.55 + 0.25 * a
            return [
                (r, 0.0),
                (r + 0.01, 0.05),
                (r + 0.01, 0.8),
                (r + 0.03, 0.82),
                (0.9 * r, 0.88),
                (0.1, 0.92),
                (0.05, 0.93),
                (0.1, 1.0),
            ]
        if self.form == "jar":
            r = 0.34 + 0.1 * a
            return [
                (r - 0.02, 0.0),
                (r, 0.04),
                (r, 0.75),
                (0.75 * r, 0.84),
                (0.78 * r, 0.86),
                (0.78 * r, 1.0),
            ]
        return [
            (0.12 + 0.2 * a, 0.0),
            (0.12 + 0.2 * a, 0.92),
            (0.1 + 0.2 * a, 0.94),
            (0.015, 0.95),
            (0.01, 1.0),
        ]

    def parts(self) -> dict[str, Surface]:
        h = self.height
        body = [lathe([(r * h * self.slim, z * h) for r, z in self._profile()], sides=24)]
        if self.form == "cup":
            r = (0.4 + 0.08 * self.lean) * h * self.slim
            angle = np.linspace(-1.45, 1.45, 9)
            body.append(
                rod(
                    [
                        (r + 0.28 * h * np.cos(t) - 0.05 * h, 0.0, h * (0.55 + 0.3 * np.sin(t)))
                        for t in angle.tolist()
                    ],
                    0.05 * h,
                    6,
                )
            )
        if self.form == "pot":
            r = (0.56 + 0.25 * self.lean) * h * self.slim
            body += [
                rod(
                    (
                        (s * r, -0.15 * h, 0.65 * h),
                        (s * (r + 0.12 * h), 0.0, 0.65 * h),
                        (s * r, 0.15 * h, 0.65 * h),
                    ),
                    0.035 * h,
                    6,
                )
                for s in (-1, 1)
            ]
        if self.form == "bottle":
            r = 0.1415 * h * self.slim
            label = lathe(((r, 0.12 * h), (r, 0.42 * h)), sides=24)
            return surfaces(**{self.made_of: body}, paper_label=[label])
        return surfaces(**{self.made_of: body})


@dataclass(frozen=True)
class Carton(IndoorShape):
    """A cardboard box, closed and taped or open with its flaps out."""

    width: float
    depth: float
    height: float
    open: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        s = choose(rng, [0.16, 0.28, 0.4])
        width, depth, height = (s * rng.uniform(0.7, 1.4, 3)).tolist()
        return cls(width, depth, height, chance(rng, 0.3))

    def parts(self) -> dict[str, Surface]:
        w, d, h = self.width / 2, self.depth / 2, self.height
        if not self.open:
            tape = slabs((-0.025, -d - 0.001, h - 0.08, 0.025, d + 0.001, h + 0.001))
            return surfaces(cardboard=[slabs((-w, -d, 0.0, w, d, h))], plastic_tape=[tape])
        t = 0.004
        walls = slabs(
            (-w + t / 2, -d + t / 2, 0.0002, w - t / 2, d - t / 2, t),
            (-w + 0.0003, -d + t / 2, 0.0001, -w + t, d - t / 2, h - 0.0002),
            (w - t, -d + t / 2, 0.0001, w - 0.0003, d - t / 2, h - 0.0002),
            (-w, -d, 0.0, w, -d + t, h),
            (-w, d - t, 0.0, w, d, h),
        )
        flaps = []
        for side in (-1.0, 1.0):
            ring = np.array([(side * (w + 0.0005), h), (side * (w + 0.4 * d), h + 0.25 * d)])
            low = [(ring[0, 0], y, ring[0, 1] + dz) for y in (-d, d) for dz in (-t, 0.0)]
            high = [(ring[1, 0], y, ring[1, 1] + dz) for y in (-d, d) for dz in (-t, 0.0)]
            corners = np.array([low[0], low[1], low[3], low[2], high[0], high[1], high[3], high[2]])
            flaps.append(hexahedra(corners[None]))
        return surfaces(cardboard=[walls, *flaps])


@dataclass(frozen=True)
class Package(IndoorShape):
    """A printed package: a cereal box, a tin, a game, a folder."""

    width: float
    depth: float
    height: float
    tin: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        if chance(rng, 0.3):
            r = uniform(rng, 0.035, 0.06)
            return cls(2 * r, 2 * r, uniform(rng, 0.08, 0.2), True)
        return cls(uniform(rng, 0.1, 0.3), uniform(rng, 0.04, 0.16), uniform(rng, 0.06, 0.3), False)

    def parts(self) -> dict[str, Surface]:
        w, d, h = self.width / 2, self.depth / 2, self.height
        if self.tin:
            return surfaces(
                print=[lathe(((w, 0.004), (w, h - 0.004)), sides=24)],
                chrome=[
                    lathe(((w + 0.001, 0.0), (w + 0.001, 0.004)), sides=24),
                    lathe(((w + 0.001, h - 0.004), (w + 0.001, h)), sides=24),
                ],
            )
        return {"picture package": fronted((-w, -d, 0.0, w, d, h))}


@dataclass(frozen=True)
class Basket(IndoorShape):
    """A basket or crate of bars with gaps between them: a lattice."""

    width: float
    depth: float
    height: float
    made_of: str
    bars: int
    """Along the width."""
    wire: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        wire = chance(rng, 0.5)
        return cls(
            uniform(rng, 0.25, 0.5), uniform(rng, 0.2, 0.36), uniform(rng, 0.15, 0.35),
            "chrome" if wire and chance(rng, 0.5) else choose(rng, ["wood", "plastic"]), integer(rng, 5, 12), wire,
        )  # fmt: skip

    def parts(self) -> dict[str, Surface]:
        w, d, h = self.width / 2, self.depth / 2, self.height
        bodies: list[Part] = []
        if self.wire:
            across = max(3, round(self.bars * d / w))
            levels = np.linspace(0.004, h, 5).tolist()
            bodies += [
                slabs(
                    *((x - 0.002, s * d - 0.002, 0.0, x + 0.002, s * d + 0.002, h) for s in (-1, 1)),
                    (x - 0.002, -d, 0.0, x + 0.002, d, 0.004),
                )
                for x in np.linspace(-w, w, self.bars).tolist()
            ]
            bodies += [
                slabs(*((s * w - 0.002, y - 0.002, 0.0, s * w + 0.002, y + 0.002, h) for s in (-1, 1)))
                for y in np.linspace(-d, d, across + 2)[1:-1].tolist()
            ]
            bodies += [_ring(w, d, z, 0.0025) for z in levels]
            return surfaces(**{self.made_of: bodies})
        posts = slabs(
            *(
                (x - 0.014, y - 0.014, 0.0, x + 0.014, y + 0.014, h)
                for x in (-w + 0.016, w - 0.016)
                for y in (-d + 0.016, d - 0.016)
            )
        )
        slats = max(2, round(h / 0.07))
        for k in range(slats):
            z = (k + 0.1) * h / slats
            top = z + 0.62 * h / slats
            bodies.append(
                slabs(
                    (-w, -d - 0.006, z, w, -d, top),
                    (-w, d, z, w, d + 0.006, top),
                    (-w - 0.006, -d - 0.003, z, -w, d + 0.003, top - 0.002),
                    (w, -d - 0.003, z, w + 0.006, d + 0.003, top - 0.002),
                )
            )
        bodies.append(slabs((-w, -d, 0.005, w, d, 0.012)))
        return surfaces(**{self.made_of: [posts, *bodies]})


def _ring(w: float, d: float, z: float, r: float) -> Part:
    return slabs(
        (-w - r, -d - r, z - r, w + r, -d + r, z + r),
        (-w - r, d - r, z - r, w + r, d + r, z + r),
        (-w - 1.2 * r, -d, z - 0.9 * r, -w + 1.2 * r, d, z + 0.9 * r),
        (w - 1.2 * r, -d, z - 0.9 * r, w + 1.2 * r, d, z + 0.9 * r),
    )


@dataclass(frozen=True)
class Screen(IndoorShape):
    """A monitor or television on a foot, showing something or dark, facing +y."""

    width: float
    lit: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 0.45, 0.75), chance(rng, 0.55))

    @classmethod
    def television(cls, rng: np.random.Generator) -> Self:
        """A large one."""
        return cls(uniform(rng, 0.9, 1.4), chance(rng, 0.4))

    def parts(self) -> dict[str, Surface]:
        w, h = self.width / 2, 0.57 * self.width
        foot = 0.1 if self.width < 0.8 else 0.05
        body = slabs(
            (-w, -0.025, foot, w, 0.018, foot + h),
            (-0.03, -0.03, 0.0, 0.03, 0.0, foot + 0.1),
            (-0.3 * w - 0.05, -0.1, 0.0, 0.3 * w + 0.05, 0.1, 0.012),
        )
        face = fronted((-w + 0.012, 0.0175, foot + 0.014, w - 0.012, 0.019, foot + h - 0.012))
        return {**surfaces(plastic_black=[body]), "screen lit" if self.lit else "glass black": face}


@dataclass(frozen=True)
class Keyboard(IndoorShape):
    """A keyboard of separate keys, and a mouse beside it; the user is at +y."""

    rows: int
    columns: int
    pitch: float
    """From key to key."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(integer(rng, 5, 6), integer(rng, 13, 20), uniform(rng, 0.018, 0.021))

    def parts(self) -> dict[str, Surface]:
        pitch = self.pitch
        w, d = self.columns * pitch / 2 + 0.008, self.rows * pitch / 2 + 0.008
        keys = []
        for row in range(self.rows):
            y = -d + 0.008 + row * pitch
            column = 0
            while column < self.columns:
                wide = 6 if row == self.rows - 1 and column == 4 else 1
                x = -w + 0.008 + column * pitch
                keys.append(
                    (
                        x + 0.002,
                        y + 0.002,
                        0.014,
                        x + min(wide, self.columns - column) * pitch - 0.002,
                        y + pitch - 0.002,
                        0.021,
                    )
                )
                column += wide
        mouse = cushion((w + 0.06, -0.03, 0.0, w + 0.12, 0.07, 0.035), 2.6)
        return surfaces(plastic=[slabs((-w, -d, 0.0, w, d, 0.015)), mouse], plastic_keys=[slabs(*keys)])


@dataclass(frozen=True)
class Laptop(IndoorShape):
    """An open laptop facing +y."""

    width: float
    angle_deg: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 0.28, 0.38), uniform(rng, 95.0, 125.0))

    def parts(self) -> dict[str, Surface]:
        w, d = self.width / 2, 0.34 * self.width
        keys = [
            (x, y, 0.0165, x + 0.014, y + 0.014, 0.019)
            for y in np.linspace(-d + 0.03, -d + 0.12, 5).tolist()
            for x in np.linspace(-w + 0.02, w - 0.034, 13).tolist()
        ]
        lean = np.radians(self.angle_deg - 90.0)
        lid = slabs((-w, -0.004, 0.0, w, 0.004, 2 * d))
        face = fronted((-w + 0.008, 0.0035, 0.012, w - 0.008, 0.0045, 2 * d - 0.008))
        turn = np.array([(1, 0, 0), (0, np.cos(lean), -np.sin(lean)), (0, np.sin(lean), np.cos(lean))])
        hinge = np.array((0.0, -d, 0.016))
        shown = Surface(face.vertices @ turn.T + hinge, face.triangles, face.uv)
        return {
            **surfaces(
                metal=[slabs((-w, -d, 0.0, w, d, 0.017)), (lid[0] @ turn.T + hinge, lid[1])],
                plastic_black=[slabs(*keys)],
            ),
            "screen lit": shown,
        }


@dataclass(frozen=True)
class Toy(IndoorShape):
    """A ball, a tower of blocks, a soft bear or a wooden train."""

    form: str
    size: float
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(choose(rng, ["ball", "blocks", "bear", "train"]), uniform(rng, 0.1, 0.28), new_seed(rng))

    def parts(self) -> dict[str, Surface]:
        rng, s = np.random.default_rng(self.seed), self.size
        if self.form == "ball":
            return surfaces(print=[cushion((-s / 2, -s / 2, 0.0, s / 2, s / 2, s), 2.0)])
        if self.form == "bear":
            fur = [
                cushion((-0.3 * s, -0.22 * s, 0.0, 0.3 * s, 0.26 * s, 0.62 * s), 2.2),
                cushion((-0.22 * s, -0.16 * s, 0.55 * s, 0.22 * s, 0.24 * s, 0.98 * s), 2.2),
                *(
                    cushion((x - 0.11 * s, 0.1 * s, 0.0, x + 0.11 * s, 0.52 * s, 0.2 * s), 2.4)
                    for x in (-0.2 * s, 0.2 * s)
                ),
                *(
                    cushion((x - 0.08 * s, -0.02 * s, 0.28 * s, x + 0.08 * s, 0.3 * s, 0.48 * s), 2.4)
                    for x in (-0.3 * s, 0.3 * s)
                ),
                *(
                    cushion((x - 0.08 * s, -0.03 * s, 0.88 * s, x + 0.08 * s, 0.05 * s, 1.05 * s), 2.2)
                    for x in (-0.17 * s, 0.17 * s)
                ),
            ]
            eyes = [
                cushion((x - 0.02 * s, 0.2 * s, 0.78 * s, x + 0.02 * s, 0.25 * s, 0.83 * s), 2.0)
                for x in (-0.08 * s, 0.08 * s)
            ]
            return surfaces(
                fabric=fur,
                plastic_black=[
                    *eyes,
                    cushion((-0.03 * s, 0.22 * s, 0.68 * s, 0.03 * s, 0.27 * s, 0.73 * s), 2.0),
                ],
            )
        if self.form == "train":
            wagons, wheels = [], []
            for k in range(3):
                x = (k - 1) * 0.9 * s
                wagons.append(slabs((x - 0.36 * s, -0.18 * s, 0.12 * s, x + 0.36 * s, 0.18 * s, 0.24 * s)))
                wagons.append(
                    slabs(
                        (
                            x - 0.33 * s,
                            -0.16 * s,
                            0.24 * s,
                            x + rng.uniform(0.0, 0.33) * s,
                            0.16 * s,
                            rng.uniform(0.35, 0.6) * s,
                        )
                    )
                )
                for dx in (-0.22 * s, 0.22 * s):
                    v, t = lathe(((0.1 * s, -0.22 * s), (0.1 * s, 0.22 * s)), sides=14)
                    wheels.append((np.stack([v[:, 0] + x + dx, v[:, 2], v[:, 1] + 0.1 * s], -1), t[:, ::-1]))
            return surfaces(lacquer=wagons, plastic=wheels)
        blocks: list[list[Part]] = [[], []]
        z = 0.0
        for k in range(int(rng.integers(3, 8))):
            e = 0.5 * s * rng.uniform(0.6, 1.0)
            blocks[k % 2].append(
                turned(
                    slabs((-e / 2, -e / 2, 0.0, e / 2, e / 2, 0.8 * e)), rng.uniform(-30, 30), (0.0, 0.0, z)
                )
            )
            z += 0.8 * e
        return surfaces(lacquer=blocks[0], plastic=blocks[1])


@dataclass(frozen=True)
class Tool(IndoorShape):
    """A tool lying or standing about: hammer, pliers, drill, toolbox, spray can, tape."""

    form: str
    size: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            choose(rng, ["hammer", "drill", "toolbox", "can", "reel", "screwdriver"]), uniform(rng, 0.8, 1.2)
        )

    def parts(self) -> dict[str, Surface]:
        s = self.size
        if self.form == "hammer":
            return surfaces(
                wood=[rod(((0.0, -0.14 * s, 0.017), (0.0, 0.14 * s, 0.017)), 0.014)],
                metal=[slabs((-0.055 * s, 0.12 * s, 0.0, 0.055 * s, 0.15 * s, 0.034))],
            )
        if self.form == "screwdriver":
            return surfaces(
                plastic=[rod(((0.0, -0.1 * s, 0.014), (0.0, 0.0, 0.014)), 0.014)],
                chrome=[rod(((0.0, -0.01, 0.014), (0.0, 0.13 * s, 0.014)), 0.003, 6)],
            )
        if self.form == "drill":
            v, t = lathe(((0.03, -0.1), (0.035, -0.08), (0.035, 0.06), (0.022, 0.08)), sides=16)
            barrel = (np.stack([v[:, 2] * s, v[:, 0] * s, v[:, 1] * s + 0.19 * s], -1), t)
            bit = rod(((0.08 * s, 0.0, 0.19 * s), (0.2 * s, 0.0, 0.19 * s)), 0.004, 6)
            grip = slabs(
                (-0.035 * s, -0.02 * s, 0.05 * s, 0.01 * s, 0.02 * s, 0.17 * s),
                (-0.07 * s, -0.035 * s, 0.0, 0.05 * s, 0.035 * s, 0.055 * s),
            )
            return surfaces(plastic=[barrel], plastic_black=[grip], chrome=[bit])
        if self.form == "toolbox":
            handle = rod(((-0.1, 0.0, 0.2), (-0.08, 0.0, 0.25), (0.08, 0.0, 0.25), (0.1, 0.0, 0.2)), 0.01, 6)
            return surfaces(
                lacquer=[
                    slabs(
                        (-0.22 * s, -0.1 * s, 0.0, 0.22 * s, 0.1 * s, 0.15),
                        (-0.22 * s, -0.1 * s, 0.153, 0.22 * s, 0.1 * s, 0.2),
                    )
                ],
                chrome=[
                    slabs(
                        (-0.132, 0.1 * s, 0.13, -0.108, 0.1 * s + 0.004, 0.17),
                        (0.108, 0.1 * s, 0.13, 0.132, 0.1 * s + 0.004, 0.17),
                    )
                ],
                plastic_black=[handle],
            )
        if self.form == "reel":
            ring = lathe(
                (
                    (0.09 * s, 0.0),
                    (0.09 * s, 0.006),
                    (0.05 * s, 0.008),
                    (0.05 * s, 0.06),
                    (0.09 * s, 0.062),
                    (0.09 * s, 0.068),
                ),
                sides=24,
            )
            angle = np.linspace(0.0, 14 * np.pi, 160)
            path = np.stack(
                [0.06 * s * np.cos(angle), 0.06 * s * np.sin(angle), 0.012 + 0.044 * angle / angle[-1]], -1
            )
            v, t, _ = tube(path, np.full(len(path), 0.005), 6)
            return surfaces(plastic=[ring], plastic_cable=[(v, t)])
        return surfaces(
            print=[
                lathe(((0.032 * s, 0.0), (0.032 * s, 0.16))),
            ],
            plastic_white=[lathe(((0.03 * s, 0.16), (0.022 * s, 0.175), (0.022 * s, 0.2)))],
        )


@dataclass(frozen=True)
class PottedPlant(IndoorShape):
    """A plant in a pot: a rosette of long leaves, or a bushy one."""

    pot: float
    """Radius of the pot."""
    height: float
    """Of the leaves above the pot."""
    bushy: bool
    leaves: int
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        tall = chance(rng, 0.4)
        pot = uniform(rng, 0.13, 0.2) if tall else uniform(rng, 0.06, 0.1)
        return cls(pot, pot * uniform(rng, 3.0, 6.0), chance(rng, 0.45), integer(rng, 10, 26), new_seed(rng))

    def parts(self) -> dict[str, Surface]:
        rng, r, h = np.random.default_rng(self.seed), self.pot, self.height
        pot = lathe(
            (
                (0.7 * r, 0.0),
                (r, 1.7 * r),
                (1.08 * r, 1.72 * r),
                (1.08 * r, 1.95 * r),
                (0.95 * r, 1.95 * r),
                (0.92 * r, 1.75 * r),
            )
        )
        soil = lathe(((0.93 * r, 1.7 * r), (0.93 * r, 1.78 * r)))
        foot = np.array((0.0, 0.0, 1.75 * r))
        if self.bushy:
            centres = foot + rng.normal(0.0, 0.16, (6, 3)) * (h, h, 0.5 * h) + np.array((0.0, 0.0, 0.6 * h))
            leaves = leaf_cloud(rng, centres, np.full(6, 0.24 * h), 8 * self.leaves, 0.2 * h)
            stems = [rod((tuple(foot.tolist()), tuple(c.tolist())), 0.01 + 0.02 * r, 6) for c in centres]
            return surfaces(ceramic=[pot], soil=[soil], leaf=[leaves], wood_stem=stems)
        direction = around(rng, self.leaves, (45.0, 84.0))
        length = h * rng.uniform(0.75, 1.15, self.leaves)
        paths = arched(
            np.tile(foot, (self.leaves, 1)), direction, length, rng.uniform(0.1, 0.7, self.leaves), 9
        )
        share = np.linspace(0.0, 1.0, 9)[1:-1]
        widths = length[:, None] * (0.012 + 0.07 * np.sin(np.pi * share) ** 0.8)[None]
        leaves = strips(paths, width_directions(direction, rng), widths, 0.16)
        return surfaces(ceramic=[pot], soil=[soil], leaf=[leaves])


@dataclass(frozen=True)
class FruitBowl(IndoorShape):
    """A bowl with fruit in it."""

    radius: float
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 0.11, 0.16), new_seed(rng))

    def parts(self) -> dict[str, Surface]:
        rng, r = np.random.default_rng(self.seed), self.radius
        bowl = lathe(
            ((0.5 * r, 0.0), (0.55 * r, 0.01), (r, 0.55 * r), (0.97 * r, 0.55 * r), (0.5 * r, 0.025))
        )
        groups: list[list[Part]] = [[], []]
        for k in range(7):
            a, e = k * 2 * np.pi / 6, rng.uniform(0.27, 0.33) * r
            x, y, z = (
                (0.52 * r * np.cos(a), 0.52 * r * np.sin(a), 0.35 * r) if k < 6 else (0.0, 0.0, 0.62 * r)
            )
            groups[k % 2].append(cushion((x - e, y - e, z, x + e, y + e, z + 1.9 * e), 2.1))
        return surfaces(ceramic=[bowl], fruit=groups[0], fruit_other=groups[1])
