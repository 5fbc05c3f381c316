"""What rooms have on their walls, floors and ceilings: radiators, pictures, mirrors, curtains, blinds, pipes, rugs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, grid_triangles, slab_triangles
from scenes.geometry.polyhedra import hexahedra, outward
from scenes.random_draws import chance, choose, integer, new_seed, uniform
from scenes.shapes.anchored import Surface
from scenes.shapes.indoor.parts import IndoorShape, fronted, lathe, rod, slabs, surfaces


@dataclass(frozen=True)
class Radiator(IndoorShape):
    """A radiator on the wall: columns of tubes, or a ribbed panel."""

    width: float
    height: float
    columns: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 0.6, 1.5), uniform(rng, 0.45, 0.7), chance(rng, 0.5))

    def parts(self) -> dict[str, Surface]:
        w, low, high = self.width / 2, 0.12, 0.12 + self.height
        steps = np.linspace(-w + 0.02, w - 0.02, round(self.width / 0.05)).tolist()
        if self.columns:
            body = [rod(((x, y, low), (x, y, high)), 0.014, 8) for x in steps for y in (0.05, 0.11)]
            body += [rod(((-w, 0.08, z), (w, 0.08, z)), 0.022, 8) for z in (low, high)]
        else:
            body = [slabs((-w, 0.03, low, w, 0.09, high))]
            body.append(slabs(*((x - 0.012, 0.09, low + 0.03, x + 0.012, 0.1, high - 0.03) for x in steps)))
        pipes = [
            rod(((w + 0.03, 0.06, 0.0), (w + 0.03, 0.06, low + 0.03), (w - 0.01, 0.06, low + 0.03)), 0.009)
        ]
        valve = lathe(((0.018, 0.0), (0.02, 0.05)), (w + 0.03, 0.06, low + 0.02), 10)
        return surfaces(enamel=body, metal=pipes, plastic=[valve])


@dataclass(frozen=True)
class WallPicture(IndoorShape):
    """A framed picture, poster or notice, its anchor in the middle of its back."""

    width: float
    height: float
    framing: float
    """Width of the frame; 0 for none."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 0.25, 1.1),
            uniform(rng, 0.25, 0.8),
            choose(rng, [0.0, uniform(rng, 0.015, 0.06)], [0.3, 0.7]),
        )

    def parts(self) -> dict[str, Surface]:
        w, h, f = self.width / 2, self.height / 2, self.framing
        if f == 0:
            return {"picture": fronted((-w, 0.001, -h, w, 0.006, h))}
        bars = slabs(
            (-w - f, 0.001, -h - f, w + f, 0.025, -h),
            (-w - f, 0.001, h, w + f, 0.025, h + f),
            (-w - f, 0.001, -h, -w, 0.025, h),
            (w, 0.001, -h, w + f, 0.025, h),
        )
        return {"picture": fronted((-w, 0.002, -h, w, 0.012, h)), **surfaces(wood_frame=bars)}


@dataclass(frozen=True)
class WallMirror(IndoorShape):
    """A mirror in a thin frame, round or square, its anchor in the middle of its back."""

    width: float
    height: float
    disc: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        disc = chance(rng, 0.3)
        width = uniform(rng, 0.4, 0.8)
        return cls(width, width if disc else uniform(rng, 0.5, 1.4), disc)

    def parts(self) -> dict[str, Surface]:
        w, h = self.width / 2, self.height / 2
        if self.disc:
            plate, ring = (
                lathe(profile, sides=40)
                for profile in (((w, 0.002), (w, 0.012)), ((w + 0.02, 0.001), (w + 0.02, 0.009)))
            )
            upright = [(np.stack([v[:, 0], v[:, 2], v[:, 1]], -1), t[:, ::-1]) for v, t in (plate, ring)]
            return surfaces(mirror=[upright[0]], metal=[upright[1]])
        bars = slabs(
            (-w - 0.02, 0.001, -h - 0.02, w + 0.02, 0.022, -h),
            (-w - 0.02, 0.001, h, w + 0.02, 0.022, h + 0.02),
            (-w - 0.02, 0.001, -h, -w, 0.022, h),
            (w, 0.001, -h, w + 0.02, 0.022, h),
        )
        return surfaces(mirror=[slabs((-w, 0.002, -h, w, 0.012, h))], wood_frame=[bars])


@dataclass(frozen=True)
class Curtain(IndoorShape):
    """A pair of gathered curtains on a rod, reaching from z = 0 up; the anchor is in the middle of the window."""

    width: float
    """Of the window."""
    height: float
    drawn: float
    """Share of the window that each side's cloth covers."""
    waves: float
    """Folds per metre."""
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 1.0, 2.2),
            uniform(rng, 1.4, 2.4),
            uniform(rng, 0.12, 0.5),
            uniform(rng, 7.0, 13.0),
            new_seed(rng),
        )

    def parts(self) -> dict[str, Surface]:
        rng = np.random.default_rng(self.seed)
        w = self.width / 2 + 0.15
        cloth = [self._cloth(rng, side * w, side * (w - self.drawn * 2 * w)) for side in (-1.0, 1.0)]
        top = self.height + 0.02
        bar = [rod(((-w - 0.1, 0.1, top), (w + 0.1, 0.1, top)), 0.012)]
        bar += [rod(((x, 0.0, top), (x, 0.1, top)), 0.008) for x in (-w - 0.02, w + 0.02)]
        bar += [
            lathe(((0.016, -0.02), (0.024, 0.0), (0.016, 0.02)), (x, 0.1, top), 10)
            for x in (-w - 0.1, w + 0.1)
        ]
        return surfaces(fabric_curtain=cloth, metal=bar)

    def _cloth(self, rng: np.random.Generator, outer: float, inner: float) -> Part:
        low, high = min(outer, inner), max(outer, inner)
        columns, rows = max(12, round((high - low) * self.waves * 6)), 6
        x = np.linspace(low, high, columns)
        phase = np.cumsum(rng.uniform(0.7, 1.3, columns)) * 2 * np.pi / 6
        spread = np.linspace(0.6, 1.0, rows)[:, None]
        y = (
            0.1
            + 0.035 * spread * np.sin(phase)[None, :]
            + 0.01 * spread * rng.normal(size=columns).cumsum() / 6
        )
        y = np.clip(y, 0.03, 0.2)
        z = np.linspace(self.height, 0.0, rows)[:, None]
        front = np.stack(np.broadcast_arrays(x[None, :], y, z), -1).reshape(-1, 3)
        back = front - np.array((0.0, 0.004, 0.0))
        vertices = np.concatenate([front, back])
        return vertices, outward(vertices, slab_triangles(rows, columns))


@dataclass(frozen=True)
class Blind(IndoorShape):
    """A venetian, vertical or roller blind in a window; the anchor is at the middle of the window's foot."""

    width: float
    height: float
    form: str
    """slats, vertical or roller."""
    let_down: float
    """Share of the window it covers, 0..1."""
    tilt_deg: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 0.8, 1.8),
            uniform(rng, 0.9, 1.6),
            choose(rng, ["slats", "vertical", "roller"], [0.55, 0.25, 0.2]),
            uniform(rng, 0.3, 1.0),
            uniform(rng, 10.0, 75.0),
        )

    def parts(self) -> dict[str, Surface]:
        w, h = self.width / 2 - 0.01, self.height
        head = slabs((-w, -0.03, h - 0.045, w, 0.03, h))
        low = h * (1 - self.let_down)
        tilt = np.radians(self.tilt_deg)
        if self.form == "roller":
            return surfaces(
                fabric_blind=[slabs((-w, -0.002, low, w, 0.002, h - 0.03))],
                plastic=[head, slabs((-w, -0.01, low - 0.02, w, 0.01, low))],
            )
        if self.form == "vertical":
            wide = 0.045
            x = np.arange(-w + wide, w - wide, 0.08)
            across = np.stack([np.cos(tilt) * np.ones_like(x), np.sin(tilt) * np.ones_like(x)], -1) * wide
            ends = np.stack([np.stack([x, 0 * x], -1) - across, np.stack([x, 0 * x], -1) + across], 1)
            return surfaces(fabric_blind=[_strips(ends, 0.02, h - 0.045, 2)], plastic=[head])
        z = np.arange(low + 0.03, h - 0.05, 0.03)
        across = np.stack([np.cos(tilt) * np.ones_like(z), np.sin(tilt) * np.ones_like(z)], -1) * 0.0125
        middle = np.stack([0 * z, z], -1)
        ends = np.stack([middle - across, middle + across], 1)
        cords = [rod(((x, 0.0, low), (x, 0.0, h - 0.04)), 0.002, 5) for x in (-0.7 * w, 0.7 * w)]
        foot = slabs((-w, -0.012, low - 0.005, w, 0.012, low + 0.015))
        return surfaces(lacquer_slats=[_strips(ends, -w, w, 0)], plastic=[head, foot, *cords])


def _strips(ends: NDArray[np.float64], low: float, high: float, axis: int) -> Part:
    """Thin slats between two ends of an axis; `ends` (N, 2, 2) are the edges of their sections in the other two."""
    side = ends[:, 1] - ends[:, 0]
    normal = np.stack([-side[:, 1], side[:, 0]], -1)
    normal *= 0.0007 / np.linalg.norm(normal, axis=1, keepdims=True)
    ring = np.stack([ends[:, 0] - normal, ends[:, 1] - normal, ends[:, 1] + normal, ends[:, 0] + normal], 1)
    corners = np.stack([np.insert(ring, axis, at, axis=2) for at in (low, high)], 1)
    return hexahedra(corners.reshape(len(ends), 8, 3))


@dataclass(frozen=True)
class Rug(IndoorShape):
    """A carpet on the floor, centred, with a slightly wavy edge."""

    width: float
    depth: float
    disc: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        disc = chance(rng, 0.2)
        width = uniform(rng, 1.2, 2.6)
        return cls(width, width if disc else uniform(rng, 0.9, 1.9), disc)

    def parts(self) -> dict[str, Surface]:
        w, d = self.width / 2, self.depth / 2
        body = lathe(((w, 0.0), (w, 0.008)), sides=48) if self.disc else slabs((-w, -d, 0.0, w, d, 0.009))
        return surfaces(carpet=[body])


@dataclass(frozen=True)
class Pipes(IndoorShape):
    """Pipes along a wall under the ceiling; the anchor is below their middle, on the wall, at their height."""

    length: float
    count: int
    radius: float
    drop: float
    """How far one of them runs down the wall; 0 for not."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 1.5, 6.0), integer(rng, 1, 4), uniform(rng, 0.012, 0.06), choose(rng, [0.0, 2.0])
        )

    def parts(self) -> dict[str, Surface]:
        half, step = self.length / 2, 2.6 * self.radius + 0.01
        pipes, clips = [], []
        y = self.radius + 0.03
        for k in range(self.count):
            z = -k * step
            pipes.append(rod(((-half, y, z), (half, y, z)), self.radius, 12))
            clips += [
                slabs(
                    (
                        x - 0.012,
                        0.0,
                        z - self.radius - 0.008,
                        x + 0.012,
                        y + 0.3 * self.radius,
                        z + self.radius + 0.008,
                    )
                )
                for x in np.arange(-half + 0.2, half, 1.1).tolist()
            ]
        if self.drop:
            x = 0.35 * half
            y2 = y + 2.05 * self.radius
            pipes.append(rod(((x, y2, 0.0), (x, y2, -self.drop)), 0.8 * self.radius, 12))
        return surfaces(metal_pipe=pipes, metal=clips)


@dataclass(frozen=True)
class WallPlate(IndoorShape):
    """Switches, sockets, a clock or a grille on the wall, the anchor in the middle of its back."""

    form: str
    """switch, clock, grille or duct."""
    size: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        kind = choose(rng, ["switch", "clock", "grille"])
        return cls(
            kind,
            {"switch": uniform(rng, 0.036, 0.045), "clock": uniform(rng, 0.12, 0.2)}.get(
                kind, uniform(rng, 0.12, 0.3)
            ),
        )

    def parts(self) -> dict[str, Surface]:
        s = self.size
        if self.form == "switch":
            return surfaces(
                plastic_white=[
                    slabs((-s, 0.0, -s, s, 0.009, s), (-0.6 * s, 0.009, -0.7 * s, 0.6 * s, 0.014, 0.7 * s))
                ]
            )
        if self.form == "clock":
            face, rim = (
                lathe(((s, 0.0), (s, 0.025)), sides=32),
                lathe(((s + 0.012, 0.0), (s + 0.012, 0.02)), sides=32),
            )
            upright = [(np.stack([v[:, 0], v[:, 2], v[:, 1]], -1), t[:, ::-1]) for v, t in (face, rim)]
            angle = np.arange(12) * np.pi / 6
            marks = [
                slabs(
                    (
                        0.85 * s * np.cos(a) - 0.008,
                        0.025,
                        0.85 * s * np.sin(a) - 0.008,
                        0.85 * s * np.cos(a) + 0.008,
                        0.027,
                        0.85 * s * np.sin(a) + 0.008,
                    )
                )
                for a in angle.tolist()
            ]
            hands = [
                slabs(
                    (-0.006, 0.025, 0.0, 0.006, 0.029, 0.75 * s), (0.0, 0.025, -0.008, 0.5 * s, 0.028, 0.008)
                )
            ]
            return surfaces(plastic_white=[upright[0]], metal=[upright[1]], plastic_black=[*marks, *hands])
        bars = np.arange(-s + 0.02, s - 0.01, 0.022).tolist()
        frame = slabs(
            (-s - 0.02, 0.0, -s - 0.02, s + 0.02, 0.012, -s),
            (-s - 0.02, 0.0, s, s + 0.02, 0.012, s + 0.02),
            (-s - 0.02, 0.0, -s, -s, 0.012, s),
            (s, 0.0, -s, s + 0.02, 0.012, s),
        )
        slits = slabs(*((-s, 0.002, z - 0.006, s, 0.01, z + 0.003) for z in bars))
        return surfaces(enamel=[frame, slits], plastic_black=[slabs((-s, 0.0, -s, s, 0.0015, s))])


@dataclass(frozen=True)
class PegBoard(IndoorShape):
    """A board on the wall with tools hanging in rows; the anchor is in the middle of its back."""

    width: float
    height: float
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 0.9, 1.8), uniform(rng, 0.6, 0.95), new_seed(rng))

    def parts(self) -> dict[str, Surface]:
        rng = np.random.default_rng(self.seed)
        w, h = self.width / 2, self.height / 2
        steel: list[Part] = []
        grips: list[Part] = []
        for row in (0.3 * h, -0.55 * h):
            x = -w + 0.08
            while x < w - 0.1:
                long = rng.uniform(0.14, 0.26)
                kind = int(rng.integers(4))
                top = row + 0.14
                if kind == 0:  # A hammer.
                    grips.append(rod(((x + 0.05, 0.035, top), (x + 0.05, 0.035, top - long)), 0.012))
                    steel.append(slabs((x - 0.01, 0.02, top - 0.01, x + 0.11, 0.055, top + 0.025)))
                    x += 0.17
                elif kind == 1:  # A screwdriver.
                    grips.append(rod(((x, 0.03, top), (x, 0.03, top - 0.09)), 0.013))
                    steel.append(rod(((x, 0.03, top - 0.08), (x, 0.03, top - 0.08 - long / 2)), 0.004, 6))
                    x += 0.06
                elif kind == 2:  # A spanner.
                    steel.append(slabs((x - 0.008, 0.02, top - long, x + 0.008, 0.028, top)))
                    steel += [
                        slabs(
                            (x - 0.02, 0.02, z - 0.015, x - 0.006, 0.028, z + 0.02),
                            (x + 0.006, 0.02, z - 0.015, x + 0.02, 0.028, z + 0.02),
                        )
                        for z in (top, top - long)
                    ]
                    x += 0.065
                else:  # A saw.
                    steel.append(slabs((x, 0.02, top - 0.1, x + 0.24, 0.022, top - 0.02)))
                    grips.append(slabs((x + 0.22, 0.015, top - 0.12, x + 0.32, 0.035, top)))
                    x += 0.38
        return surfaces(pegboard=[slabs((-w, 0.0, -h, w, 0.012, h))], chrome=steel, plastic_grips=grips)


@dataclass(frozen=True)
class Lamp(IndoorShape):
    """A table or floor lamp with a shade, standing on z = 0."""

    height: float
    shade_radius: float
    shade_height: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls.floor(rng) if chance(rng, 0.5) else cls.table(rng)

    @classmethod
    def table(cls, rng: np.random.Generator) -> Self:
        """A lamp for tables and sideboards."""
        return cls(uniform(rng, 0.32, 0.55), uniform(rng, 0.09, 0.16), uniform(rng, 0.12, 0.2))

    @classmethod
    def floor(cls, rng: np.random.Generator) -> Self:
        """A standard lamp."""
        return cls(uniform(rng, 1.35, 1.7), uniform(rng, 0.15, 0.25), uniform(rng, 0.2, 0.32))

    def parts(self) -> dict[str, Surface]:
        r, h, z = self.shade_radius, self.height, self.height - self.shade_height
        foot = lathe(((0.8 * r, 0.0), (0.75 * r, 0.015), (0.012, 0.03), (0.012, z + 0.04), (0.004, z + 0.06)))
        ring = _open_shade(r, z, h)
        bulb = lathe(((0.01, z + 0.04), (0.03, z + 0.07), (0.03, z + 0.09), (0.008, z + 0.12)), sides=12)
        return surfaces(metal=[foot], glow_shade=[ring], glow_bulb=[bulb])


def _open_shade(radius: float, low: float, high: float) -> Part:
    """A conical shade open at both ends: a thin wall all round."""
    profile = np.array(
        [(radius, low), (0.72 * radius, high), (0.72 * radius - 0.004, high), (radius - 0.004, low)]
    )
    theta = np.linspace(0, 2 * np.pi, 28, endpoint=False)
    ring = profile[None, :, :1] * np.stack([np.cos(theta), np.sin(theta)], -1)[:, None, :]
    points = np.concatenate([ring, np.broadcast_to(profile[None, :, 1:], (28, 4, 1))], axis=2)
    vertices = points.reshape(-1, 3)
    return vertices, outward(vertices, grid_triangles(28, 4, wrap_rows=True, wrap_columns=True))


@dataclass(frozen=True)
class CeilingLamp(IndoorShape):
    """A lamp under the ceiling; the anchor is on the ceiling, the lamp below it."""

    form: str
    """pendant, tube, panel or dome."""
    drop: float
    size: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        kind = choose(rng, ["pendant", "tube", "panel", "dome"])
        drop = {"pendant": uniform(rng, 0.5, 0.9), "tube": choose(rng, [0.03, 0.4])}.get(kind, 0.0)
        return cls(
            kind, drop, uniform(rng, 0.16, 0.3) if kind in ("pendant", "dome") else uniform(rng, 0.6, 1.2)
        )

    @property
    def light_below_m(self) -> float:
        """How far below the anchor the light comes from."""
        return self.drop + (0.22 if self.form == "pendant" else 0.1)

    def parts(self) -> dict[str, Surface]:
        s, d = self.size, self.drop
        if self.form == "pendant":
            shade = _open_shade(s, -d - 0.2, -d)
            bulb = lathe(((0.015, -d - 0.02), (0.045, -d - 0.1), (0.03, -d - 0.15)), sides=14)
            cord = [
                rod(((0.0, 0.0, 0.0), (0.0, 0.0, -d - 0.03)), 0.003, 6),
                lathe(((0.05, -0.03), (0.05, 0.0))),
            ]
            # Spokes carry the shade.
            cord += [
                rod(((0.0, 0.0, -d - 0.01), (0.72 * s * x, 0.72 * s * y, -d - 0.005)), 0.003, 5)
                for x, y in ((1, 0), (-0.5, 0.86), (-0.5, -0.86))
            ]
            return surfaces(lacquer_shade=[shade], glow_bulb=[bulb], metal=cord)
        if self.form == "tube":
            half = s / 2 + 0.3
            body = [slabs((-half, -0.06, -d - 0.05, half, 0.06, -d))]
            if d > 0.1:
                body += [
                    rod(((x, 0.0, 0.0), (x, 0.0, -d - 0.02)), 0.003, 5) for x in (-0.7 * half, 0.7 * half)
                ]
            tubes = [
                rod(((-half + 0.03, y, -d - 0.065), (half - 0.03, y, -d - 0.065)), 0.014)
                for y in (-0.03, 0.03)
            ]
            return surfaces(enamel=body, glow_tube=tubes)
        if self.form == "panel":
            half = 0.3
            frame = slabs((-half, -half, -0.03, half, half, 0.0))
            return surfaces(
                enamel=[frame],
                glow_panel=[slabs((-half + 0.02, -half + 0.02, -0.034, half - 0.02, half - 0.02, -0.03))],
            )
        dome = lathe(((s, -0.02), (0.93 * s, -0.06), (0.6 * s, -0.1), (0.02, -0.115)), sides=28)
        return surfaces(glow_dome=[dome], metal=[lathe(((s + 0.01, -0.025), (s + 0.01, 0.0)), sides=28)])


@dataclass(frozen=True)
class Stairs(IndoorShape):
    """A flight of stairs along a wall, from the anchor towards +x; its wall side is at y = 0."""

    steps: int
    rise: float
    tread: float
    width: float
    open: bool
    """Whether there is nothing between the treads."""
    bars: int
    """Balusters a step."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls.up_to(rng, uniform(rng, 2.4, 2.9))

    @classmethod
    def up_to(cls, rng: np.random.Generator, height: float) -> Self:
        """A flight that climbs to a height."""
        steps = round(height / uniform(rng, 0.16, 0.19))
        return cls(
            steps,
            height / steps,
            uniform(rng, 0.24, 0.29),
            uniform(rng, 0.85, 1.1),
            chance(rng, 0.4),
            choose(rng, [1, 2]),
        )

    @property
    def length(self) -> float:
        """In plan."""
        return self.steps * self.tread

    def parts(self) -> dict[str, Surface]:
        w, t, r = self.width, self.tread, self.rise
        treads, body, bars = [], [], []
        for k in range(self.steps):
            x, z = k * t, (k + 1) * r
            treads.append((x - 0.03, 0.01, z - 0.035, x + t + 0.005, w, z))
            if not self.open:
                body.append((x, 0.01, 0.0 if k < 3 else z - r * 2.2, x + t, w - 0.015, z - 0.035))
            for b in range(self.bars):
                at = x + (b + 0.5) * t / self.bars
                bars.append(
                    rod(
                        ((at, w - 0.05, z - 0.01), (at, w - 0.05, z + 0.86 + (b + 0.5) / self.bars * r)),
                        0.009,
                        6,
                    )
                )
        rail = rod(((-0.05, w - 0.05, 0.9), (self.length, w - 0.05, self.steps * r + 0.9)), 0.026, 10)
        post = slabs((-0.07, w - 0.09, 0.0, 0.01, w - 0.01, 1.0))
        stringers: list[Part] = []
        if self.open:
            stringers += [
                rod(((0.0, y, 0.06), (self.length - t, y, self.steps * r - 0.12)), 0.05, 4)
                for y in (0.05, w - 0.08)
            ]
        return surfaces(
            wood_treads=[slabs(*treads)],
            enamel=[slabs(*body)] if body else stringers,
            metal_balusters=bars,
            wood_rail=[rail, post],
        )


@dataclass(frozen=True)
class Railing(IndoorShape):
    """A straight railing of upright bars along x, centred."""

    length: float
    height: float
    gap: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 1.5, 4.0), uniform(rng, 0.9, 1.05), uniform(rng, 0.08, 0.13))

    def parts(self) -> dict[str, Surface]:
        half = self.length / 2
        bars = [
            rod(((x, 0.0, 0.06), (x, 0.0, self.height - 0.02)), 0.008, 6)
            for x in np.linspace(-half + 0.03, half - 0.03, round(self.length / self.gap)).tolist()
        ]
        posts = [
            slabs((x - 0.03, -0.03, 0.0, x + 0.03, 0.03, self.height)) for x in (-half + 0.03, half - 0.03)
        ]
        rails = [rod(((-half, 0.0, z), (half, 0.0, z)), 0.02, 8) for z in (0.07, self.height)]
        return surfaces(metal=[*bars, *posts], wood_rail=rails)
