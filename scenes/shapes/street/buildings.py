"""Houses, part by part: walls with window openings, the windows in them, trim, roof.

A building's parts share one design and one origin: the left end of its front at the ground, seen from the
street. x runs along the front, y into the building, z up, metres.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, Triangles, Vertices, box_uv, joined
from scenes.geometry.polyhedra import boxes, hexahedra, turned
from scenes.random_draws import chance, choose, integer, uniform
from scenes.shapes.anchored import MetricShape, Surface

_Box = tuple[tuple[float, float, float], tuple[float, float, float]]

WALL_M = 0.36
"""Thickness of the walls."""
NOMINAL_BAY_M = 3.0
"""Length of one bay or floor of a wall in the texture coordinates of its windows."""


@dataclass(frozen=True)
class HouseDesign:
    """Measures of a building, metres."""

    bays: int
    floors: int
    """With the ground floor."""
    bay: float
    floor: float
    """Height of an upper floor."""
    ground_floor: float
    depth: float
    opening: tuple[float, float]
    """Width and height of the upper windows, as shares of a bay and a floor."""
    sill: float
    """Height of the upper windows' lower edge above their floor, as a share of the floor."""
    reveal: float
    """How far the windows stand back behind the wall."""
    recess: float
    """How far the wall between windows above each other stands back behind the piers."""
    shop: bool
    """Wide openings on the ground floor."""
    door_bay: int
    transom: bool
    """Whether windows have a cross bar."""
    balconies: int
    """Every how many bays a balcony; 0 for none."""
    cornice: float
    """How far the cornice stands out."""
    roof: str
    """flat, gable (ridge along the street) or hip."""
    roof_pitch_deg: float
    chimneys: int
    sides: bool
    """Whether the side walls have windows too, as those of a detached house have."""

    @property
    def width(self) -> float:
        """Length of the front, metres."""
        return self.bays * self.bay

    @property
    def eaves(self) -> float:
        """Height of the walls."""
        return self.ground_floor + (self.floors - 1) * self.floor + 0.25

    @property
    def ridge(self) -> float:
        """Height of the roof's top."""
        if self.roof == "flat":
            return self.eaves + 0.9
        return self.eaves + float(np.tan(np.radians(self.roof_pitch_deg))) * (self.depth / 2 + 0.3)

    @classmethod
    def sample(cls, rng: np.random.Generator, kind: str = "terrace") -> Self:
        """A city block, terraced house, detached house, office or hall."""
        bays, floors = {
            "city": (integer(rng, 4, 8), integer(rng, 4, 6)),
            "terrace": (integer(rng, 2, 4), integer(rng, 2, 3)),
            "detached": (integer(rng, 2, 4), integer(rng, 1, 2)),
            "office": (integer(rng, 6, 10), integer(rng, 5, 8)),
            "hall": (integer(rng, 4, 7), integer(rng, 1, 2)),
        }[kind]
        ribbon = kind in ("office", "hall")
        opening = (
            (uniform(rng, 0.6, 0.9), uniform(rng, 0.5, 0.7))
            if ribbon
            else (uniform(rng, 0.3, 0.56), uniform(rng, 0.48, 0.66))
        )
        flat = {"city": 0.35, "terrace": 0.1, "detached": 0.05, "office": 1.0, "hall": 0.8}[kind]
        roof = "flat" if chance(rng, flat) else "hip" if chance(rng, 0.3) else "gable"
        shop = chance(rng, {"city": 0.6, "terrace": 0.25, "detached": 0.0, "office": 0.5, "hall": 0.5}[kind])
        return cls(
            bays=bays,
            floors=floors,
            bay=uniform(rng, 2.3, 3.4) if not ribbon else uniform(rng, 2.8, 4.2),
            floor=uniform(rng, 2.7, 3.5) if kind == "city" else uniform(rng, 2.5, 3.0),
            ground_floor=uniform(rng, 3.4, 4.3) if shop else uniform(rng, 2.8, 3.3),
            depth=uniform(rng, 8.0, 11.0),
            opening=opening,
            sill=uniform(rng, 0.22, 0.32),
            reveal=uniform(rng, 0.08, 0.24),
            recess=choose(rng, [0.02, 0.02, 0.03, 0.1]),
            shop=shop,
            door_bay=integer(rng, 0, bays - 1),
            transom=chance(rng, 0.7),
            balconies=integer(rng, 1, 3) if kind in ("city", "office") and chance(rng, 0.35) else 0,
            cornice=uniform(rng, 0.08, 0.35),
            roof=roof,
            roof_pitch_deg=uniform(rng, 28.0, 48.0),
            chimneys=integer(rng, 0, 2) if roof != "flat" else 0,
            sides=kind == "detached" or kind == "office",
        )


@dataclass(frozen=True)
class _Opening:
    """One window or door of a wall: low and high x and z."""

    left: float
    right: float
    bottom: float
    top: float


def storeys(design: HouseDesign, front: bool) -> list[tuple[float, float, list[_Opening]]]:
    """Each storey's floor, ceiling and openings, along a wall of `design.width`."""
    storeys = []
    wide, high = design.opening
    for floor in range(design.floors):
        bottom = 0.0 if floor == 0 else design.ground_floor + (floor - 1) * design.floor
        height = design.ground_floor if floor == 0 else design.floor
        openings = []
        for bay in range(design.bays):
            middle = (bay + 0.5) * design.bay
            half = wide * design.bay / 2
            low, top = bottom + design.sill * height, bottom + (design.sill + high) * height
            if floor == 0 and front:
                top = bottom + height - 0.75 if design.shop else top
                if bay == design.door_bay:
                    half, low, top = max(0.55, 0.6 * half), 0.12, max(2.25, top)
                elif design.shop:
                    half, low = 0.42 * design.bay, 0.45
            openings.append(_Opening(middle - half, middle + half, low, top))
        storeys.append((bottom, bottom + height, openings))
    return storeys


def _wall(design: HouseDesign, front: bool) -> list[_Box]:
    """One wall from piers, and between them what is above and below the openings."""
    items: list[_Box] = []
    for floor, (bottom, ceiling, openings) in enumerate(storeys(design, front)):
        low = -0.3 if floor == 0 else bottom - 0.002 * floor
        # Storeys overlap by a little and stand a hair apart in depth, so that no faces coincide.
        out = 0.004 * (floor % 2)
        edges = [0.0, *[edge for o in openings for edge in (o.left, o.right)], design.width]
        for left, right in zip(edges[::2], edges[1::2], strict=True):
            items.append(((left, out, low), (right, WALL_M, ceiling + 0.01)))
        back = out + design.recess
        for opening in openings:
            x = (opening.left - 0.05, opening.right + 0.05)
            items.append(((x[0], back, low + 0.003), (x[1], WALL_M - 0.01, opening.bottom)))
            items.append(((x[0], back, opening.top), (x[1], WALL_M - 0.01, ceiling + 0.007)))
    return items


def _box_part(items: list[_Box]) -> Part:
    return boxes(np.array([low for low, _ in items]), np.array([high for _, high in items]))


def _side_design(design: HouseDesign) -> HouseDesign:
    """The design of a side wall: as many bays as fit into the depth."""
    bays = max(1, round(design.depth / design.bay))
    return replace(design, bays=bays, bay=design.depth / bays)


def _on_all_sides(design: HouseDesign, front: list[_Box], side: list[_Box]) -> list[Part]:
    """The front's boxes and, turned about the corners, those of both sides."""
    parts = [_box_part(front)]
    if side:
        part = _box_part(side)
        parts.append(turned(part, -90.0, (0.0, design.depth, 0.0)))
        parts.append(turned(part, 90.0, (design.width, 0.0, 0.0)))
    return parts


@dataclass(frozen=True)
class HouseWalls(MetricShape):
    """The walls with their openings, gables, parapet, chimneys."""

    design: HouseDesign

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(HouseDesign.sample(rng))

    def surface(self) -> Surface:
        design = self.design
        width, depth, eaves = design.width, design.depth, design.eaves
        side = _wall(_side_design(design), front=False) if design.sides else []
        parts = _on_all_sides(design, _wall(design, front=True), side)
        plain: list[_Box] = [((0.012, depth - WALL_M, -0.3), (width - 0.012, depth - 0.006, eaves))]
        if not design.sides:
            plain.append(((0.007, 0.04, -0.3), (WALL_M, depth - 0.02, eaves - 0.005)))
            plain.append(((width - WALL_M, 0.04, -0.3), (width - 0.007, depth - 0.02, eaves - 0.005)))
        plain.append(((0.02, 0.05, eaves - 0.4), (width - 0.02, depth - 0.05, eaves - 0.02)))
        if design.roof == "flat":
            plain.append(((0.015, 0.015, eaves - 0.3), (width - 0.015, 0.28, eaves + 0.8)))
            plain.append(((0.016, 0.1, eaves - 0.3), (0.28, depth - 0.1, eaves + 0.79)))
            plain.append(((width - 0.28, 0.1, eaves - 0.3), (width - 0.016, depth - 0.1, eaves + 0.79)))
        for chimney in range(design.chimneys):
            x = (0.2 + 0.6 * chimney) * width
            plain.append(((x, 0.56 * depth, eaves), (x + 0.75, 0.56 * depth + 0.6, design.ridge + 0.7)))
        parts.append(_box_part(plain))
        if design.roof == "gable":
            parts.append(self._gables())
        return Surface(*joined(*parts))

    def _gables(self) -> Part:
        design = self.design
        high = design.eaves + float(np.tan(np.radians(design.roof_pitch_deg))) * (design.depth / 2 - 0.1)
        profile = [(0.1, design.eaves - 0.1), (design.depth - 0.1, design.eaves - 0.1)]
        profile += [(design.depth / 2 + 0.02, high - 0.06), (design.depth / 2 - 0.02, high - 0.06)]
        ends = (0.03, design.width - 0.03 - WALL_M)
        return hexahedra(
            np.array([[(x + out, y, z) for out in (0.0, WALL_M) for y, z in profile] for x in ends])
        )


@dataclass(frozen=True)
class HouseWindows(MetricShape):
    """The windows of the ground floor or of all others: one body behind the openings of the walls.

    Texture coordinates count bays and floors, each as `NOMINAL_BAY_M`, so that a picture of windows meets the
    openings.
    """

    design: HouseDesign
    ground: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(HouseDesign.sample(rng, "city"), chance(rng, 0.5))

    def surface(self) -> Surface:
        design = self.design
        level = design.ground_floor
        inset = design.reveal if design.sides else 0.2
        low = np.array((inset, design.reveal, -0.2 if self.ground else level))
        high = np.array(
            (design.width - inset, design.depth - 0.3, level if self.ground else design.eaves - 0.1)
        )
        vertices, triangles = boxes(low, high)
        uv = box_uv(vertices, triangles)
        side = np.ptp(vertices[triangles][:, :, 0], axis=1) < 1e-9
        bay = np.where(side, _side_design(design).bay, design.bay)[:, None]
        uv[..., 0] *= NOMINAL_BAY_M / bay
        up = uv[..., 1] / level if self.ground else (uv[..., 1] - level) / design.floor + 1.0
        uv[..., 1] = NOMINAL_BAY_M * up
        return Surface(vertices, triangles, uv)


@dataclass(frozen=True)
class HouseTrim(MetricShape):
    """Sills, window bars, belt courses, cornice, door, balconies."""

    design: HouseDesign

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(HouseDesign.sample(rng))

    def surface(self) -> Surface:
        design = self.design
        front = self._front()
        side = self._windows(_side_design(design), front=False) if design.sides else []
        parts = _on_all_sides(design, front, side)
        return Surface(*joined(*parts))

    def _windows(self, design: HouseDesign, front: bool) -> list[_Box]:
        items: list[_Box] = []
        plane = design.reveal - 0.035
        for floor, (_, _, openings) in enumerate(storeys(design, front)):
            for bay, o in enumerate(openings):
                door = front and floor == 0 and bay == design.door_bay
                middle, wide = (o.left + o.right) / 2, o.right - o.left
                if door:
                    top = min(o.top, 2.15)
                    items.append(
                        ((o.left + 0.04, plane - 0.02, 0.0), (o.right - 0.04, design.reveal + 0.05, top))
                    )
                    continue
                items.append(
                    (
                        (o.left - 0.08, -0.07, o.bottom - 0.09),
                        (o.right + 0.08, design.reveal + 0.03, o.bottom + 0.012),
                    )
                )
                bars = max(1, round(wide / 0.9))
                for bar in range(1, bars):
                    x = o.left + wide * bar / bars
                    items.append(((x - 0.03, plane, o.bottom), (x + 0.03, design.reveal + 0.03, o.top)))
                if bars == 1 and wide > 0.55:
                    items.append(
                        ((middle - 0.03, plane, o.bottom), (middle + 0.03, design.reveal + 0.03, o.top))
                    )
                if design.transom:
                    z = o.bottom + 0.66 * (o.top - o.bottom)
                    items.append(
                        (
                            (o.left - 0.01, plane + 0.006, z - 0.03),
                            (o.right + 0.01, design.reveal + 0.02, z + 0.03),
                        )
                    )
        return items

    def _front(self) -> list[_Box]:
        design = self.design
        width, out = design.width, design.cornice
        items = self._windows(design, front=True)
        items.append(((-0.04, -out, design.eaves - 0.16), (width + 0.04, 0.2, design.eaves + 0.05)))
        items.append(((-0.02, -0.6 * out, design.eaves - 0.3), (width + 0.02, 0.2, design.eaves - 0.15)))
        level = design.ground_floor
        items.append(((-0.02, -0.06, level - 0.12), (width + 0.02, 0.2, level + 0.1)))
        items.append(((-0.01, -0.05, -0.25), (0.01, 0.1, 0.4)))
        items.append(((width - 0.01, -0.05, -0.25), (width + 0.01, 0.1, 0.4)))
        door = (design.door_bay + 0.5) * design.bay
        items.append(((door - 0.75, -0.28, -0.2), (door + 0.75, 0.3, 0.12)))
        if design.balconies:
            items += self._balconies()
        return items

    def _balconies(self) -> list[_Box]:
        design = self.design
        items: list[_Box] = []
        for floor in range(1, design.floors):
            base = design.ground_floor + (floor - 1) * design.floor
            for bay in range(0, design.bays, design.balconies):
                left, right = bay * design.bay + 0.25, (bay + 1) * design.bay - 0.25
                items.append(((left, -0.95, base - 0.14), (right, 0.2, base)))
                items.append(((left, -0.95, base + 0.9), (right, -0.89, base + 0.97)))
                items += [
                    ((x, -0.9, base + 0.91), (x + 0.05, 0.1, base + 0.96)) for x in (left, right - 0.05)
                ]
                posts = np.linspace(left + 0.02, right - 0.05, 1 + int((right - left) / 0.16))
                items += [((x, -0.93, base - 0.05), (x + 0.025, -0.905, base + 0.92)) for x in posts.tolist()]
        return items


@dataclass(frozen=True)
class HouseRoof(MetricShape):
    """A pitched roof of tiles, or a flat one with a stair head on it.

    Texture coordinates run along the eaves and up the slope.
    """

    design: HouseDesign

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(HouseDesign.sample(rng))

    def surface(self) -> Surface:
        design = self.design
        width, depth, eaves = design.width, design.depth, design.eaves
        if design.roof == "flat":
            hut = (
                (0.3 * width, 0.4 * depth, eaves - 0.1),
                (0.3 * width + 2.4, 0.4 * depth + 3.0, eaves + 2.3),
            )
            slab = ((0.1, 0.1, eaves - 0.2), (width - 0.1, depth - 0.1, eaves + 0.06))
            return Surface(*_box_part([slab, hut]))
        slope = float(np.tan(np.radians(design.roof_pitch_deg)))
        out, side = 0.32, 0.02 if design.roof == "gable" and not design.sides else 0.25
        low, high = eaves + 0.02 - slope * out, eaves + 0.02 + slope * depth / 2
        inset = min(depth / 2, 0.45 * width) if design.roof == "hip" else 0.0
        thick = 0.16
        front, ridge = (-out, low), (depth / 2, high)
        slabs = []
        for near, sign in ((front, 1.0), ((depth + out, low), -1.0)):
            y, z = near
            corners = [
                (-side, y, z),
                (width + side, y, z),
                (width + side - inset - side * (inset > 0), ridge[0] + 0.01 * sign, ridge[1]),
                (-side + inset + side * (inset > 0), ridge[0] + 0.01 * sign, ridge[1]),
            ]
            slabs.append([*corners, *[(x, yy, zz + thick) for x, yy, zz in corners]])
        if inset:
            for x, sign in ((-side, 1.0), (width + side, -1.0)):
                tip = x + sign * (inset + side)
                corners = [
                    (x, -out, low),
                    (x, depth + out, low),
                    (tip, ridge[0] + 0.02, high),
                    (tip, ridge[0] - 0.02, high),
                ]
                slabs.append([*corners, *[(xx, yy, zz + thick) for xx, yy, zz in corners]])
        vertices, triangles = hexahedra(np.array(slabs))
        uv = box_uv(vertices, triangles)
        return Surface(vertices, triangles, _up_the_slope(vertices, triangles, uv))


def _up_the_slope(vertices: Vertices, triangles: Triangles, uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coordinates (level, up) on slanted triangles, `uv` on upright ones."""
    corners = vertices[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    across = np.stack([-normal[:, 1], normal[:, 0], np.zeros(len(normal))], -1)
    length = np.linalg.norm(across, axis=1)
    slanted = length > 0.2
    across = across / np.maximum(length, 1e-9)[:, None]
    up = np.cross(normal, across)
    mapped = np.stack([np.einsum("fci,fi->fc", corners, across), np.einsum("fci,fi->fc", corners, up)], -1)
    return np.where(slanted[:, None, None], mapped, uv)


@dataclass(frozen=True)
class ShopFront(MetricShape):
    """A shop's name board and awnings over a ground floor."""

    width: float
    board: float
    """Height of the board; 0 for awnings alone."""
    awning: float
    """How far the awning reaches over the pavement; 0 for a board alone."""
    height: float
    """Of the board's lower edge above the ground."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            width=uniform(rng, 4.0, 12.0),
            board=uniform(rng, 0.45, 0.7),
            awning=uniform(rng, 0.7, 1.3) if chance(rng, 0.5) else 0.0,
            height=uniform(rng, 2.7, 3.3),
        )

    def surface(self) -> Surface:
        parts = [
            boxes(
                np.array((0.1, -0.12, self.height)),
                np.array((self.width - 0.1, 0.02, self.height + self.board)),
            )
        ]
        if self.awning:
            z, out = self.height + 0.05, self.awning
            slab = [
                (0.2, -0.1, z),
                (self.width - 0.2, -0.1, z),
                (self.width - 0.2, -out, z - 0.4),
                (0.2, -out, z - 0.4),
            ]
            parts.append(hexahedra(np.array([[*slab, *[(x, y, w + 0.04) for x, y, w in slab]]])))
        return Surface(*joined(*parts))


@dataclass(frozen=True)
class CityBlock(MetricShape):
    """A large building seen from afar: a body, a plinth course, a smaller top storey. Origin in its middle."""

    width: float
    depth: float
    height: float
    setback: float
    """How far the top storey stands back."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            width=uniform(rng, 16.0, 44.0),
            depth=uniform(rng, 14.0, 30.0),
            height=uniform(rng, 10.0, 45.0),
            setback=uniform(rng, 1.5, 5.0),
        )

    def surface(self) -> Surface:
        w, d, h, back = self.width / 2, self.depth / 2, self.height, self.setback
        body: _Box = ((-w, -d, -1.0), (w, d, h))
        top: _Box = ((-w + back, -d + back, h - 0.1), (w - back, d - back, h + 3.2))
        rim: _Box = ((-w - 0.2, -d - 0.2, h - 0.5), (w + 0.2, d + 0.2, h + 0.4))
        return Surface(*_box_part([body, top, rim]))
