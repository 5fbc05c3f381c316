"""What stands and walks on the pavements: lamps, trees, signs, furniture, people."""

from __future__ import annotations

import math

import numpy as np

from scenes.drawing import chance, choose, uniform
from scenes.metric import MetricShape, standing
from scenes.shapes.pedestrians import PersonDesign, PersonHair, PersonLegs, PersonSkin, PersonTop
from scenes.shapes.street_furniture import (
    Bench,
    Bollard,
    BusShelter,
    LampDesign,
    LampLight,
    LampPost,
    LitterBin,
    SignFace,
    SignPost,
    StreetCabinet,
    TrafficLight,
    TrafficLightLens,
)
from scenes.shapes.street_plants import TreeCrown, TreeDesign, TreeStem
from scenes.spec import AreaLight
from scenes.streets import finishes
from scenes.streets.assembly import Assembly, by_the_street
from scenes.streets.config import DrivingConfig
from scenes.streets.frontage import Side
from scenes.streets.rig import Drive

_LAMPS_LIT = 5
"""Street lamps that shine: those nearest to the rig; the others' light would hardly be seen."""


class Pavement:
    """The free places of one pavement: nothing is put where something stands."""

    def __init__(self, side: Side) -> None:
        self.side = side
        self._taken: list[tuple[float, float, float, float]] = []

    def free(self, s_m: float, t_m: float, reach_m: float, travel_m: float = 0.0) -> bool:
        """Whether a disc is free, and the way it moves to and fro along the street; if so both are taken."""
        for s, t, reach, travel in self._taken:
            apart = max(abs(s - s_m) - travel - travel_m, 0.0)
            if math.hypot(apart, t - t_m) < reach + reach_m:
                return False
        self._taken.append((s_m, t_m, reach_m, travel_m))
        return True

    def near_kerb(self, metres: float) -> float:
        return self.side.sign * (self.side.kerb_m + metres)

    def near_wall(self, metres: float) -> float:
        return self.side.sign * (self.side.edge_m - metres)

    @property
    def width_m(self) -> float:
        return self.side.edge_m - self.side.kerb_m

    def name(self, what: str, number: int) -> str:
        return f"{what} {'LR'[self.side.sign < 0]}{number}"


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
    post = scene.material(finishes.metal_paint(rng))
    glow = uniform(rng, 12.0, 30.0) if lit else 0.0
    glass = scene.material(finishes.lamp((255, 226, 190) if lit else (225, 226, 220), glow))
    spacing = uniform(rng, *config.lamp_spacing_m)
    rows = pavements if chance(rng, 0.6) else (choose(rng, pavements),)
    sources: list[tuple[float, AreaLight]] = []
    for pavement in rows:
        s, number = drive.course.start_m + uniform(rng, 2.0, spacing), 0
        while s < drive.course.end_m - 2.0:
            t = pavement.near_kerb(0.5)
            pavement.free(s, t, 0.4)
            # The arm's x axis points over the street.
            turn = -90.0 if pavement.side.sign > 0 else 90.0
            parts: list[tuple[str, MetricShape, int]] = [
                ("post", LampPost(design), post),
                ("light", LampLight(design), glass),
            ]
            scene.add(
                *by_the_street(
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
    """A row of trees of two or three individuals of a kind, and in parks more behind it."""
    designs = [TreeDesign.sample(rng) for _ in range(2)]
    leaves, bark = scene.material(finishes.foliage(rng)), scene.material(finishes.bark(rng))
    crowns = [TreeCrown(design, 70) for design in designs]
    park = not pavement.side.district.houses
    rows = (
        [("near_kerb", 0.9)] if pavement.width_m > 2.4 and chance(rng, pavement.side.district.trees) else []
    )
    rows += [("behind", 3.5), ("behind", 9.0), ("behind", 15.0)] if park else []
    depth = pavement.side.front_m - pavement.side.edge_m
    rows += [("behind", min(depth / 2, 3.0))] if depth > 4.0 and not park and chance(rng, 0.6) else []
    for row, (where, metres) in enumerate(rows):
        spacing = uniform(rng, *config.tree_spacing_m) * (1.6 if where == "behind" and not park else 1.0)
        s, number = drive.course.start_m + uniform(rng, 1.0, spacing), 0
        while s < drive.course.end_m - 2.0:
            at = s + (uniform(rng, -0.25, 0.25) * spacing if where == "behind" else 0.0)
            t = pavement.near_kerb(metres) if where == "near_kerb" else pavement.near_wall(-metres)
            if pavement.free(at, t, 0.7):
                _add_tree(
                    rng,
                    scene,
                    drive,
                    pavement.name(f"tree {row}", number),
                    designs,
                    crowns,
                    leaves,
                    bark,
                    at,
                    t,
                    ground_m,
                )
            s += spacing
            number += 1


def _add_tree(
    rng: np.random.Generator,
    scene: Assembly,
    drive: Drive,
    name: str,
    designs: list[TreeDesign],
    crowns: list[TreeCrown],
    leaves: int,
    bark: int,
    s_m: float,
    t_m: float,
    ground_m: float,
) -> None:
    which = int(rng.integers(len(designs)))
    parts: list[tuple[str, MetricShape, int]] = [("stem", TreeStem(designs[which]), bark)]
    if designs[which].form != "bare":
        parts.append(("crown", crowns[which], leaves))
    scene.add(
        *by_the_street(name, parts, drive.course, s_m, t_m, turn_deg=uniform(rng, 0.0, 360.0), z_m=ground_m)
    )


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
    grey, wooden = scene.material(finishes.metal_paint(rng)), scene.material(finishes.wood(rng))
    signs = [SignPost.sample(rng) for _ in range(3)]
    faces = [scene.material(finishes.sign_face(rng, sign.corners)) for sign in signs]
    bollard, litter, bench, cabinet = (
        kind.sample(rng) for kind in (Bollard, LitterBin, Bench, StreetCabinet)
    )
    length = course.end_m - course.start_m
    count = rng.poisson(uniform(rng, *config.furniture_per_100m) * length / 100)
    away = pavement.side.turn_deg()
    for number in range(count):
        kind = choose(
            rng, ["sign", "bollards", "bin", "bench", "cabinet", "shelter"], [0.35, 0.2, 0.2, 0.1, 0.1, 0.05]
        )
        s = uniform(rng, course.start_m, course.end_m - 8.0)
        if kind == "sign":
            which = int(rng.integers(3))
            parts: list[tuple[str, MetricShape, int]] = [
                ("post", signs[which], grey),
                ("face", SignFace(signs[which]), faces[which]),
            ]
            _place(
                scene,
                pavement,
                drive,
                "sign",
                number,
                parts,
                s,
                pavement.near_kerb(0.45),
                180.0 + uniform(rng, -12.0, 12.0),
                ground_m,
                0.4,
            )
        elif kind == "bollards":
            for k in range(int(rng.integers(3, 9))):
                name = 100 * (number + 1) + k
                _place(
                    scene,
                    pavement,
                    drive,
                    "bollard",
                    name,
                    [("", bollard, grey)],
                    s + 1.5 * k,
                    pavement.near_kerb(0.4),
                    0.0,
                    ground_m,
                    0.2,
                )
        elif kind == "bin":
            _place(
                scene,
                pavement,
                drive,
                "bin",
                number,
                [("", litter, grey)],
                s,
                pavement.near_kerb(0.7),
                away,
                ground_m,
                0.5,
            )
        elif kind == "bench":
            _place(
                scene,
                pavement,
                drive,
                "bench",
                number,
                [("", bench, wooden)],
                s,
                pavement.near_wall(0.45),
                away + 180.0,
                ground_m,
                1.2,
            )
        elif kind == "cabinet":
            _place(
                scene,
                pavement,
                drive,
                "cabinet",
                number,
                [("", cabinet, grey)],
                s,
                pavement.near_wall(0.4),
                away + 180.0,
                ground_m,
                0.8,
            )
        elif pavement.width_m > 2.6:
            shelter = BusShelter.sample(rng)
            _place(
                scene,
                pavement,
                drive,
                "shelter",
                number,
                [("", shelter, grey)],
                s,
                pavement.near_wall(0.5),
                away + 180.0,
                ground_m,
                2.4,
            )


def _place(
    scene: Assembly,
    pavement: Pavement,
    drive: Drive,
    what: str,
    number: int,
    parts: list[tuple[str, MetricShape, int]],
    s_m: float,
    t_m: float,
    turn_deg: float,
    ground_m: float,
    reach_m: float,
) -> None:
    if pavement.free(s_m, t_m, reach_m):
        scene.add(
            *by_the_street(
                pavement.name(what, number), parts, drive.course, s_m, t_m, turn_deg=turn_deg, z_m=ground_m
            )
        )


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
    post = scene.material(finishes.black_plastic())
    green = chance(rng, 0.5)
    lens = scene.material(finishes.lamp((40, 230, 120) if green else (250, 30, 24), 2.5))
    parts: list[tuple[str, MetricShape, int]] = [
        ("post", light, post),
        ("lens", TrafficLightLens(light, green), lens),
    ]
    for number, crossing in enumerate(crossings):
        for pavement in pavements:
            # On the side of the traffic that has to stop, facing it.
            ahead = (pavement.side.sign > 0) == drive.keep_left
            s = crossing + (-2.6 if ahead else 2.6)
            t = pavement.near_kerb(0.45)
            pavement.free(s, t, 0.3)
            # Its arm is along y: over the street when the light is turned towards its traffic.
            turn = 180.0 if ahead else 0.0
            over = 1.0 if (turn == 0.0) == (pavement.side.sign < 0) else -1.0
            if over < 0 and light.reach:
                continue
            scene.add(
                *by_the_street(
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
    designs = [PersonDesign.sample(rng) for _ in range(5)]
    clothes = [scene.material(finishes.cloth(rng)) for _ in range(7)]
    skins = [scene.material(finishes.skin(rng)) for _ in range(2)]
    hairs = [scene.material(finishes.hair(rng)) for _ in range(2)]
    length = course.end_m - course.start_m
    for number in range(int(rng.poisson(uniform(rng, *config.pedestrians_per_100m) * length / 100))):
        design = choose(rng, designs)
        s = uniform(rng, course.start_m + 2.0, course.end_m - 6.0)
        t = pavement.side.sign * uniform(
            rng, pavement.side.kerb_m + 1.0, max(pavement.side.edge_m - 0.5, pavement.side.kerb_m + 1.05)
        )
        walk = 0.0 if chance(rng, 0.2) else uniform(rng, 0.06, 0.16) * choose(rng, [1.0, -1.0])
        travel = abs(walk) * (drive.frames + 1) / 2
        parts: list[tuple[str, MetricShape, int]] = [
            ("top", PersonTop(design), choose(rng, clothes)),
            ("legs", PersonLegs(design), choose(rng, clothes)),
            ("skin", PersonSkin(design), choose(rng, skins)),
            ("hair", PersonHair(design), choose(rng, hairs)),
        ]
        turn = (0.0 if walk > 0 else 180.0) if walk else uniform(rng, 0.0, 360.0)
        if not (course.start_m + 1.0 < s - travel and s + travel < course.end_m - 1.0):
            continue
        if not pavement.free(s, t, 0.35, travel):
            continue
        count = 1 if not walk else 2 + math.floor(2 * travel / 4.0)
        times = (0.0,) if count == 1 else tuple(np.linspace(-1.0, float(drive.frames), count).tolist())
        track = (
            [s]
            if count == 1
            else (s + math.copysign(1.0, walk) * np.linspace(-travel, travel, count)).tolist()
        )
        places = [course.place(at, t, ground_m) for at in track]
        turns = [course.facing(at, turn) for at in track]
        name = pavement.name("person", number)
        scene.add(
            *(
                standing(f"{name} {part}", shape, material, places, turns, times)
                for part, shape, material in parts
            )
        )
