"""Chairs, stools, armchairs, sofas, beds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from scenes.geometry.building import Part
from scenes.random_draws import chance, choose, integer, uniform
from scenes.shapes.anchored import Surface
from scenes.shapes.indoor.parts import IndoorShape, Top, cushion, lathe, legs, rod, slabs, surfaces


@dataclass(frozen=True)
class Chair(IndoorShape):
    """A chair with four legs; it faces +y, centred on its seat."""

    width: float
    seat_height: float
    height: float
    back: str
    """slats, rungs, panel or cushion."""
    seat: str
    """What the seat is made of."""
    framing: str
    """What the legs are made of: wood or chrome."""
    slats: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            width=uniform(rng, 0.38, 0.48),
            seat_height=uniform(rng, 0.42, 0.48),
            height=uniform(rng, 0.78, 1.02),
            back=choose(rng, ["slats", "rungs", "panel", "cushion"], [0.4, 0.2, 0.2, 0.2]),
            seat=choose(rng, ["wood", "fabric", "plastic"], [0.5, 0.3, 0.2]),
            framing=choose(rng, ["wood", "chrome"], [0.7, 0.3]),
            slats=integer(rng, 3, 8),
        )

    def parts(self) -> dict[str, Surface]:
        w, d, h = self.width / 2, self.width / 2, self.seat_height
        thick = 0.035 if self.framing == "wood" else 0.022
        frame: list[Part] = [*legs(w - 0.02, d - 0.02, h - 0.03, thick)]
        frame += [
            rod(((x, -d + 0.02, h - 0.06), (x, -d - 0.06, self.height)), thick / 2, 8)
            for x in (-w + 0.02, w - 0.02)
        ]
        seat = [cushion((-w, -d, h - 0.035, w, d, h + 0.015), 9.0)]
        lean = 0.06 / (self.height - h)
        rest: list[Part] = []

        def at(z: float) -> float:
            return -d + 0.02 - (z - h) * lean

        if self.back in ("slats", "rungs"):
            top = self.height - 0.05
            rest.append(slabs((-w, at(top) - 0.012, top - 0.03, w, at(top) + 0.012, top + 0.04)))
        if self.back == "slats":
            low, top = h + 0.02, self.height - 0.05
            rest += [
                rod(((x, at(low), low), (x, at(top), top)), 0.009, 6)
                for x in np.linspace(-w + 0.05, w - 0.05, self.slats).tolist()
            ]
        elif self.back == "rungs":
            rest += [
                slabs((-w, at(z) - 0.01, z - 0.025, w, at(z) + 0.01, z + 0.025))
                for z in np.linspace(h + 0.14, self.height - 0.14, max(2, self.slats // 2)).tolist()
            ]
        else:
            low, deep = h + (0.16 if self.back == "panel" else 0.1), 0.012 if self.back == "panel" else 0.035
            middle = at((low + self.height) / 2)
            seat.append(cushion((-w, middle - deep, low, w, middle + deep, self.height), 8.0))
        return _merged({f"{self.framing} legs": frame, f"{self.seat} seat": seat, "wood back": rest})


def _merged(parts: dict[str, list[Part]]) -> dict[str, Surface]:
    return surfaces(**{name.replace(" ", "_"): bodies for name, bodies in parts.items()})


@dataclass(frozen=True)
class Stool(IndoorShape):
    """A round stool on three or four legs or on a column."""

    height: float
    radius: float
    legs: int
    """0 for a column on a foot."""
    seat: str

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            height=choose(rng, [uniform(rng, 0.42, 0.5), uniform(rng, 0.62, 0.76)]),
            radius=uniform(rng, 0.15, 0.2),
            legs=choose(rng, [0, 3, 4]),
            seat=choose(rng, ["wood", "leather", "plastic"]),
        )

    def parts(self) -> dict[str, Surface]:
        h, r = self.height, self.radius
        seat = lathe(((r, h - 0.04), (r, h - 0.008), (r - 0.012, h)))
        if self.legs == 0:
            column = lathe(((r * 0.95, 0.0), (r * 0.9, 0.015), (0.025, 0.04), (0.025, h - 0.03)))
            return _merged({f"{self.seat} seat": [seat], "chrome": [column]})
        angle = np.arange(self.legs) * 2 * np.pi / self.legs + 0.4
        out, top = r * 1.05, r * 0.7
        bars: list[Part] = []
        feet = []
        for a in angle.tolist():
            foot = (out * np.cos(a), out * np.sin(a), 0.0)
            feet.append((foot[0] * 0.86, foot[1] * 0.86, 0.4 * h))
            bars.append(rod((foot, (top * np.cos(a), top * np.sin(a), h - 0.03)), 0.014, 8))
        bars += [rod((one, two), 0.008, 6) for one, two in zip(feet, [*feet[1:], feet[0]], strict=True)]
        return _merged({f"{self.seat} seat": [seat], choose_frame(self.seat): bars})


def choose_frame(seat: str) -> str:
    """What carries a seat of a kind."""
    return "wood" if seat == "wood" else "chrome"


@dataclass(frozen=True)
class OfficeChair(IndoorShape):
    """A swivel chair on five castors, facing +y."""

    seat_height: float
    height: float
    arms: bool
    cover: str

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            seat_height=uniform(rng, 0.44, 0.54),
            height=uniform(rng, 0.9, 1.2),
            arms=chance(rng, 0.6),
            cover=choose(rng, ["fabric", "leather"]),
        )

    def parts(self) -> dict[str, Surface]:
        h = self.seat_height
        base: list[Part] = [lathe(((0.028, 0.09), (0.028, h - 0.08)), sides=12)]
        wheels: list[Part] = []
        for a in (np.arange(5) * 2 * np.pi / 5 + 0.3).tolist():
            x, y = 0.29 * np.cos(a), 0.29 * np.sin(a)
            base.append(rod(((0.0, 0.0, 0.11), (x, y, 0.075)), 0.018, 6))
            wheels.append(lathe(((0.026, 0.0), (0.03, 0.02), (0.03, 0.045), (0.014, 0.06)), (x, y, 0.0), 10))
        if self.arms:
            wheels.append(slabs((-0.27, -0.03, h - 0.05, 0.27, 0.03, h - 0.02)))
            for x in (-0.27, 0.27):
                wheels.append(slabs((x - 0.03, -0.12, h + 0.2, x + 0.03, 0.14, h + 0.23)))
                wheels.append(slabs((x - 0.015, -0.03, h - 0.02, x + 0.015, 0.03, h + 0.2)))
        wheels.append(rod(((0.0, -0.1, h - 0.04), (0.0, -0.27, h + 0.02), (0.0, -0.27, h + 0.25)), 0.02, 6))
        cover = [
            cushion((-0.25, -0.24, h - 0.04, 0.25, 0.25, h + 0.05), 5.0),
            cushion((-0.23, -0.3, h + 0.14, 0.23, -0.22, self.height), 5.0),
        ]
        return _merged({"metal": base, "plastic": wheels, self.cover: cover})


@dataclass(frozen=True)
class Sofa(IndoorShape):
    """An armchair or a sofa with its back at y = 0, facing +y, with loose cushions."""

    seats: int
    width: float
    depth: float
    height: float
    arm: float
    """Width of the arms."""
    cover: str
    pillows: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        seats = choose(rng, [1, 2, 3])
        return cls(
            seats=seats,
            width=seats * uniform(rng, 0.58, 0.7) + 0.36,
            depth=uniform(rng, 0.8, 0.98),
            height=uniform(rng, 0.72, 0.95),
            arm=uniform(rng, 0.12, 0.22),
            cover=choose(rng, ["fabric", "leather"], [0.7, 0.3]),
            pillows=integer(rng, 0, seats + 1),
        )

    def parts(self) -> dict[str, Surface]:
        w, d, foot = self.width / 2, self.depth, 0.1
        inner = w - self.arm
        cover: list[Part] = [
            cushion((-w, 0.0, foot, w, 0.2, self.height - 0.06), 12.0),
            cushion((-w, 0.02, foot, -inner, d, 0.6), 10.0),
            cushion((inner, 0.02, foot, w, d, 0.6), 10.0),
            slabs((-inner, 0.1, foot, inner, d - 0.03, 0.3)),
        ]
        step = 2 * inner / self.seats
        for k in range(self.seats):
            x = -inner + k * step
            cover.append(cushion((x + 0.004, 0.17, 0.28, x + step - 0.004, d, 0.46), 6.0))
            cover.append(cushion((x + 0.01, 0.14, 0.43, x + step - 0.01, 0.34, self.height), 5.0))
        pillows: list[Part] = []
        for k in range(self.pillows):
            x = -inner + 0.02 + (k + 0.5) * (2 * inner - 0.04) / max(self.pillows, 1)
            pillows.append(cushion((x - 0.2, 0.33, 0.45, x + 0.2, 0.47, 0.82), 3.2))
        return _merged(
            {
                self.cover: cover,
                "fabric pillows": pillows,
                "wood feet": [
                    slabs(
                        *(
                            (x - 0.03, y - 0.03, 0.0, x + 0.03, y + 0.03, foot + 0.02)
                            for x in (-w + 0.08, w - 0.08)
                            for y in (0.08, d - 0.08)
                        )
                    )
                ],
            }
        )

    def tops(self) -> tuple[Top, ...]:
        inner = self.width / 2 - self.arm - 0.05
        if self.pillows:
            return ()
        return (Top((-inner, 0.4), (inner, self.depth - 0.08), 0.455, 0.4),)


@dataclass(frozen=True)
class Bed(IndoorShape):
    """A bed with its head at y = 0."""

    width: float
    length: float
    head: float
    """Height of the headboard."""
    bars: bool
    """Whether the headboard is a lattice."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            width=choose(rng, [0.9, 1.2, 1.4, 1.6]) + 0.06,
            length=uniform(rng, 2.0, 2.15),
            head=uniform(rng, 0.75, 1.15),
            bars=chance(rng, 0.35),
        )

    def parts(self) -> dict[str, Surface]:
        w, d = self.width / 2, self.length
        frame = [
            slabs(
                *((x - 0.035, 0.0, 0.0, x + 0.035, 0.07, self.head) for x in (-w, w)),
                *((x - 0.035, d - 0.07, 0.0, x + 0.035, d, 0.42) for x in (-w, w)),
                (-w, 0.0, 0.2, w, d, 0.33),
                (-w, 0.01, self.head - 0.09, w, 0.06, self.head - 0.02),
            )
        ]
        if self.bars:
            frame += [
                rod(((x, 0.035, 0.3), (x, 0.035, self.head - 0.05)), 0.011, 6)
                for x in np.linspace(-w + 0.1, w - 0.1, round(self.width / 0.11)).tolist()
            ]
        else:
            frame.append(slabs((-w, 0.015, 0.3, w, 0.055, self.head - 0.04)))
        mattress = cushion((-w + 0.03, 0.08, 0.3, w - 0.03, d - 0.03, 0.52), 14.0)
        duvet = cushion((-w - 0.02, 0.62, 0.4, w + 0.02, d - 0.01, 0.6), 9.0)
        count = 1 if self.width < 1.2 else 2
        step = self.width / count
        pillows = [
            cushion((-w + k * step + 0.06, 0.12, 0.5, -w + (k + 1) * step - 0.06, 0.56, 0.65), 3.5)
            for k in range(count)
        ]
        return _merged({"wood": frame, "linen": [mattress, *pillows], "fabric duvet": [duvet]})
