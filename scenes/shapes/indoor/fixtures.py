"""What rooms have on their walls and floors: radiators, pictures, mirrors, pipes, switches, tools on boards, rugs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from scenes.geometry.building import Part
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
