"""Things on the pavements: lamps, trees, signs, furniture, people."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenes.appearance import street_materials, vehicle_materials
from scenes.appearance.materials import Shares
from scenes.placement.assembly import Assembly, anchored_object
from scenes.random_draws import chance, choose, integer, uniform
from scenes.shapes.anchored import MetricShape
from scenes.shapes.street.furniture import (
    Bench,
    Bollard,
    BusShelter,
    LampDesign,
    LampLight,
    LampPost,
    LitterBin,
    ShelterPanes,
    SignFace,
    SignPost,
    StreetCabinet,
    TrafficLight,
    TrafficLightLens,
)
from scenes.shapes.street.pedestrians import (
    PersonDesign,
    PersonFeatures,
    PersonHair,
    PersonLegs,
    PersonSkin,
    PersonThings,
    PersonTop,
)
from scenes.shapes.street.roadside_plants import TreeCrown, TreeDesign, TreeStem
from scenes.spec import AreaLight
from scenes.streets.along_course import on_course
from scenes.streets.config import DrivingConfig
from scenes.streets.frontage import Side
from scenes.streets.rig import Drive

_Parts = list[tuple[str, MetricShape, int]]
"""Name, shape and material of each part of a thing."""
_FINE_M = 45.0
"""Trees farther along the street than this have fewer leaves."""
_LAMPS_LIT = 5
"""How many street lamps give light: those nearest to the rig. The others' light would hardly be seen."""


class Pavement:
    """One pavement and which of its places are taken."""

    def __init__(self, side: Side) -> None:
        self.side = side
        self._taken: list[tuple[float, float, float, float]] = []

    def take(self, s_m: float, t_m: float, reach_m: float, travel_m: float = 0.0) -> bool:
        """Take a disc of radius `reach_m` at (s, t) if it is free; False if it is not.

        The disc moves by up to `travel_m` along the street either way. The mouths of side streets stay free.
        """
        if self.side.is_open(s_m, reach_m + travel_m):
            return False
        for s, t, reach, travel in self._taken:
            apart = max(abs(s - s_m) - travel - travel_m, 0.0)
            if math.hypot(apart, t - t_m) < reach + reach_m:
                return False
        self._taken.append((s_m, t_m, reach_m, travel_m))
        return True

    def near_kerb(self, metres: float) -> float:
        """t at a distance from the kerb."""
        return self.side.sign * (self.side.kerb_m + metres)

    def near_wall(self, metres: float) -> float:
        """t at a distance from the pavement's far edge."""
        return self.side.sign * (self.side.edge_m - metres)

    @property
    def width_m(self) -> float:
        """From the kerb to the far edge."""
        return self.side.edge_m - self.side.kerb_m

    def name(self, what: str, number: int) -> str:
        """A name for a thing on this pavement, different on both."""
        return f"{what} {self.side.name}{number}"


def add_lamps(
    rng: np.random.Generator,
    scene: Assembly,
    config: DrivingConfig,
    drive: Drive,
    pavements: tuple[Pavement, ...],
    ground_m: float,
    lit: bool,
) -> list[AreaLight]:
    """Rows of lamp posts of one design; returns the light of those nearest to the rig when they are lit."""
    design = LampDesign.sample(rng)
    post = scene.material(street_materials.metal(rng, config.shares))
    glow = uniform(rng, 12.0, 30.0) if lit else 0.0
    glass = scene.material(street_materials.lamp((255, 226, 190) if lit else (225, 226, 220), glow))
    parts: _Parts = [("post", LampPost(design), post), ("light", LampLight(design), glass)]
    spacing = uniform(rng, *config.lamp_spacing_m)
    rows = pavements if chance(rng, 0.6) else (choose(rng, pavements),)
    sources: list[tuple[float, AreaLight]] = []
    for pavement in rows:
        s, number = drive.course.start_m + uniform(rng, 2.0, spacing), 0
        while s < drive.course.end_m - 2.0:
            t = pavement.near_kerb(0.5)
            if not pavement.take(s, t, 0.4):
                s += 2.0
                continue
            # The arm's x axis points over the street.
            turn = -90.0 if pavement.side.sign > 0 else 90.0
            scene.add(
                *on_course(
                    pavement.name("lamp", number), parts, drive.course, s, t, turn_deg=turn, z_m=ground_m
                )
            )
            sources.append(
                (abs(s - 15.0), _light_of(rng, design, drive, s, t - pavement.side.sign * design.reach))
            )
            s += spacing
            number += 1
    nearest = sorted(sources, key=lambda item: item[0])[:_LAMPS_LIT]
    return [light for _, light in nearest] if lit else []


def _light_of(
    rng: np.random.Generator, design: LampDesign, drive: Drive, s_m: float, t_m: float
) -> AreaLight:
    height = design.heads[0][1] - 0.25
    below, above = drive.course.place(s_m, t_m), drive.course.place(s_m, t_m, height)
    warm = uniform(rng, 0.0, 1.0)
    return AreaLight(
        position_m=above,
        target_m=below,
        color=(1.0 + 0.25 * warm, 0.95, 0.85 - 0.4 * warm),
        power_w=uniform(rng, 0.7, 1.5) * math.pi * height**2,
        size_m=0.5,
    )


def add_trees(
    rng: np.random.Generator,
    scene: Assembly,
    config: DrivingConfig,
    drive: Drive,
    pavement: Pavement,
    ground_m: float,
) -> None:
    """A row of trees on the pavement, some in front gardens, in parks several rows."""
    leaves, bark = scene.material(street_materials.foliage(rng)), scene.material(street_materials.bark(rng))
    kinds = [_tree_parts(TreeDesign.sample(rng), leaves, bark) for _ in range(2)]
    park = not pavement.side.district.houses
    depth = pavement.side.front_m - pavement.side.edge_m
    # Distances from the pavement's far edge; negative ones are on the pavement.
    rows = (
        [0.9 - pavement.width_m]
        if pavement.width_m > 2.4 and chance(rng, pavement.side.district.trees)
        else []
    )
    rows += [3.5, 9.0, 15.0] if park else [min(depth / 2, 3.0)] if depth > 4.0 and chance(rng, 0.6) else []
    for row, behind in enumerate(rows):
        spacing = uniform(rng, *config.tree_spacing_m) * (1.0 if behind < 0 or park else 1.6)
        s, number = drive.course.start_m + uniform(rng, 1.0, spacing), 0
        while s < drive.course.end_m - 2.0:
            at = s + (uniform(rng, -0.25, 0.25) * spacing if behind > 0 else 0.0)
            t = pavement.near_wall(-behind)
            near, far = choose(rng, kinds)
            name, turn = pavement.name(f"tree {row}", number), uniform(rng, 0.0, 360.0)
            if pavement.take(at, t, 0.7):
                parts = far if at > _FINE_M else near
                scene.add(*on_course(name, parts, drive.course, at, t, turn_deg=turn, z_m=ground_m))
            s += spacing
            number += 1


def _tree_parts(design: TreeDesign, leaves: int, bark: int) -> tuple[_Parts, _Parts]:
    """The parts of a tree seen from near and from afar."""
    stem: _Parts = [("stem", TreeStem(design), bark)]
    if design.form == "bare":
        return stem, stem
    near, far = TreeCrown(design, 75), TreeCrown(design, 22)
    return [*stem, ("crown", near, leaves)], [*stem, ("crown", far, leaves)]


@dataclass(frozen=True)
class _Piece:
    """A kind of furniture: its parts and where on a pavement it belongs."""

    name: str
    share: float
    parts: _Parts
    reach_m: float
    """Radius of the room it needs."""
    from_kerb_m: float = 0.0
    """Distance from the kerb; 0 for a piece that stands at the wall."""
    from_wall_m: float = 0.0
    turn_deg: float = 0.0
    row_m: float = 0.0
    """Distance between several in a row; 0 for a single one."""


def add_furniture(
    rng: np.random.Generator,
    scene: Assembly,
    config: DrivingConfig,
    drive: Drive,
    pavement: Pavement,
    ground_m: float,
) -> None:
    """Signs, bollards, bins, benches, cabinets and shelters at random places of a pavement."""
    course = drive.course
    pieces = _sample_pieces(rng, scene, config, pavement)
    length = course.end_m - course.start_m
    for number in range(rng.poisson(uniform(rng, *config.furniture_per_100m) * length / 100)):
        piece = choose(rng, pieces, [piece.share for piece in pieces])
        s = uniform(rng, course.start_m, course.end_m - 12.0)
        turn = piece.turn_deg + uniform(rng, -6.0, 6.0)
        t = (
            pavement.near_kerb(piece.from_kerb_m)
            if piece.from_kerb_m
            else pavement.near_wall(piece.from_wall_m)
        )
        for k in range(integer(rng, 3, 8) if piece.row_m else 1):
            at = s + k * piece.row_m
            name = pavement.name(piece.name, number) + (f".{k}" if piece.row_m else "")
            if pavement.take(at, t, piece.reach_m):
                scene.add(*on_course(name, piece.parts, course, at, t, turn_deg=turn, z_m=ground_m))


def _sample_pieces(
    rng: np.random.Generator, scene: Assembly, config: DrivingConfig, pavement: Pavement
) -> list[_Piece]:
    grey, wooden = (
        scene.material(street_materials.metal(rng, config.shares)),
        scene.material(street_materials.wood(rng)),
    )
    facing = pavement.side.turn_deg() + 180.0
    pieces = [
        _Piece("bollard", 0.2, [("", Bollard.sample(rng), grey)], 0.2, from_kerb_m=0.4, row_m=1.5),
        _Piece("bin", 0.2, [("", LitterBin.sample(rng), grey)], 0.5, from_kerb_m=0.7, turn_deg=facing),
        _Piece("bench", 0.1, [("", Bench.sample(rng), wooden)], 1.2, from_wall_m=0.45, turn_deg=facing),
        _Piece(
            "cabinet", 0.1, [("", StreetCabinet.sample(rng), grey)], 0.8, from_wall_m=0.4, turn_deg=facing
        ),
    ]
    for _ in range(3):
        post = SignPost.sample(rng)
        face = scene.material(street_materials.sign_face(rng, post.corners))
        parts: _Parts = [("post", post, grey), ("face", SignFace(post), face)]
        pieces.append(_Piece("sign", 0.12, parts, 0.4, from_kerb_m=0.5, turn_deg=180.0))
    if pavement.width_m > 2.6:
        shelter = BusShelter.sample(rng)
        frame: _Parts = [("", shelter, grey)]
        if chance(rng, config.transparent_share):
            frame.append(("panes", ShelterPanes(shelter), scene.material(vehicle_materials.clear_glass(rng))))
        pieces.append(_Piece("shelter", 0.05, frame, 2.4, from_wall_m=0.5, turn_deg=facing))
    return pieces


def add_traffic_lights(
    rng: np.random.Generator,
    scene: Assembly,
    drive: Drive,
    pavements: tuple[Pavement, ...],
    crossings: tuple[float, ...],
    ground_m: float,
) -> None:
    """Lights before a crossing, for both directions, at some of the crossings."""
    if not crossings or chance(rng, 0.5):
        return
    light = TrafficLight.sample(rng)
    post = scene.material(street_materials.black_plastic())
    green = chance(rng, 0.5)
    lens = scene.material(street_materials.lamp((40, 230, 120) if green else (250, 30, 24), 2.5))
    parts: _Parts = [
        ("post", light, post),
        ("lens", TrafficLightLens(light, green), lens),
    ]
    for number, crossing in enumerate(crossings):
        for pavement in pavements:
            # On the side of the traffic that has to stop, facing it.
            ahead = (pavement.side.sign > 0) == drive.keep_left
            s = crossing + (-2.6 if ahead else 2.6)
            t = pavement.near_kerb(0.45)
            if not pavement.take(s, t, 0.3):
                continue
            # Its arm is along y: over the street when the light is turned towards its traffic.
            turn = 180.0 if ahead else 0.0
            over = 1.0 if (turn == 0.0) == (pavement.side.sign < 0) else -1.0
            if over < 0 and light.reach:
                continue
            scene.add(
                *on_course(
                    pavement.name("traffic light", number),
                    parts,
                    drive.course,
                    s,
                    t,
                    turn_deg=turn,
                    z_m=ground_m,
                )
            )


def add_people(
    rng: np.random.Generator,
    scene: Assembly,
    config: DrivingConfig,
    drive: Drive,
    pavement: Pavement,
    ground_m: float,
) -> None:
    """People standing and walking along a pavement, each on a track of their own."""
    course = drive.course
    wardrobe = _Wardrobe(rng, scene, config.shares)
    length = course.end_m - course.start_m
    for number in range(rng.poisson(uniform(rng, *config.pedestrians_per_100m) * length / 100)):
        s = uniform(rng, course.start_m + 1.0, course.end_m - 5.0)
        low = pavement.side.kerb_m + 0.9
        t = pavement.side.sign * uniform(rng, low, max(pavement.side.edge_m - 0.5, low + 0.05))
        walk = 0.0 if chance(rng, 0.2) else uniform(rng, 0.06, 0.16) * choose(rng, [1.0, -1.0])
        turn = (0.0 if walk > 0 else 180.0) if walk else uniform(rng, 0.0, 360.0)
        parts = wardrobe.dressed(rng)
        travel = abs(walk) * (drive.frames + 1) / 2
        inside = course.start_m + 1.0 < s - travel and s + travel < course.end_m - 1.0
        if not inside or not pavement.take(s, t, 0.35, travel):
            continue
        count = 2 + math.floor(2 * travel / 4.0) if walk else 1
        times = np.linspace(-1.0, float(drive.frames), count).tolist() if walk else [0.0]
        steps = np.linspace(-travel, travel, count).tolist() if walk else [0.0]
        track = [s + step * math.copysign(1.0, walk) for step in steps]
        places = [course.place(at, t, ground_m) for at in track]
        turns = [course.facing(at, turn) for at in track]
        name = pavement.name("person", number)
        scene.add(
            *(
                anchored_object(f"{name} {part}", shape, material, places, turns, times)
                for part, shape, material in parts
            )
        )


class _Wardrobe:
    """A few bodies and clothes that the people of a pavement share."""

    def __init__(self, rng: np.random.Generator, scene: Assembly, shares: Shares) -> None:
        # Shapes keep their meshes, so people of one design share the shapes too.
        self.bodies = [
            (PersonTop(d), PersonLegs(d), PersonSkin(d), PersonFeatures(d), PersonHair(d), PersonThings(d))
            for d in (PersonDesign.sample(rng) for _ in range(3))
        ]
        self.clothes = [scene.material(street_materials.cloth(rng, shares)) for _ in range(7)]
        self.things = [scene.material(street_materials.leather(rng)) for _ in range(3)]
        self.skins = [scene.material(street_materials.skin(rng)) for _ in range(3)]
        self.hairs = [scene.material(street_materials.hair(rng)) for _ in range(3)]
        self.features = scene.material(street_materials.features())

    def dressed(self, rng: np.random.Generator) -> _Parts:
        top, legs, skin, features, hair, things = choose(rng, self.bodies)
        above, below = rng.choice(len(self.clothes), 2, replace=False)
        return [
            ("top", top, self.clothes[int(above)]),
            ("legs", legs, self.clothes[int(below)]),
            ("skin", skin, choose(rng, self.skins)),
            ("features", features, self.features),
            ("hair", hair, choose(rng, self.hairs)),
            ("things", things, choose(rng, self.things)),
        ]
