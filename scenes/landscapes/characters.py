"""Characters: skeletons of random proportions, their bodies and fur, and how they move.

A character faces +x, its left is +y, and its feet stand at z = 0. Its coordinates are in body units, about one
body height.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.motion.deformations.articulated import Articulated, Joint
from scenes.motion.trajectories import key_times
from scenes.placement.assembly import anchored_object
from scenes.placement.boxes import OrientedBox
from scenes.placement.ground import GroundPlacement, Spot
from scenes.random_draws import chance, choose, integer, new_seed, uniform
from scenes.shapes.anchored import PartedShape
from scenes.shapes.nature.soft_bodies import Eyeballs, Limb, SoftBody, iris_repeats
from scenes.spec import Vector

SKINNED = -1
"""`CharacterPart.carried_by` of a part that is skinned instead of carried by one joint."""


@dataclass(frozen=True)
class CharacterPart:
    """One mesh of a character."""

    shape: PartedShape
    material: str
    """Name of what it is made of: fur, skin, cloth, hair, horn, eye, leather or wood."""
    carried_by: int = SKINNED
    """Index of the joint it follows rigidly, or `SKINNED`."""


@dataclass(frozen=True)
class Character:
    """A body in parts, with its skeleton and its motion."""

    parts: tuple[CharacterPart, ...]
    joints: tuple[Joint, ...]
    feet: tuple[int, ...]
    period_frames: float
    stride: float
    """How far it walks in a frame, in body units; 0 for a character that stays where it is."""
    height: float
    """Height of the highest point at rest, in body units."""
    reach: float
    """Largest horizontal distance of any of its points from its anchor over time, in body units."""

    def deformation(self, part: CharacterPart) -> Articulated:
        """The motion of one of its parts, in that part's mesh coordinates."""
        frame = part.shape.frame
        x, y, z = (float(value) for value in frame.centre)
        return Articulated(
            joints=self.joints,
            period_frames=self.period_frames,
            centre=(x, y, z),
            unit=1.0 / frame.factor,
            feet=self.feet,
            carried_by=part.carried_by,
        )


class CharacterBuilder:
    """A character under construction: its joints, and its flesh by groups that each become one mesh."""

    def __init__(self) -> None:
        self.joints: list[Joint] = []
        self.limbs: dict[str, list[Limb]] = {}

    def joint(
        self,
        parent: int,
        start: Vector,
        end: Vector,
        radius: float,
        axis: Vector = (0.0, 1.0, 0.0),
        swing_deg: float = 0.0,
        phase: float = 0.0,
        cycles: int = 1,
    ) -> int:
        """Add a joint (`Joint`); returns its index. `parent` is -1 for the root; lengths are body units."""
        self.joints.append(Joint(parent, start, end, radius, axis, swing_deg, cycles, phase))
        return len(self.joints) - 1

    def flesh(self, group: str, start: Vector, end: Vector, radius: float, end_radius: float) -> None:
        """Add a capsule of flesh to the group of limbs that becomes one mesh."""
        self.limbs.setdefault(group, []).append(Limb(start, end, radius, end_radius))

    def bone(
        self,
        group: str,
        parent: int,
        start: Vector,
        end: Vector,
        radii: tuple[float, float],
        axis: Vector = (0.0, 1.0, 0.0),
        swing_deg: float = 0.0,
        phase: float = 0.0,
        cycles: int = 1,
    ) -> int:
        """Add a joint with its flesh, of the given radii at both ends; returns its index."""
        self.flesh(group, start, end, *radii)
        return self.joint(parent, start, end, sum(radii) / 2, axis, swing_deg, phase, cycles)


@dataclass(frozen=True)
class Gait:
    """How a character moves: amplitudes of its joints in degrees, and the period."""

    walks: bool
    leg_deg: float
    arm_deg: float
    head_deg: float
    sway_deg: float
    period_frames: float


def sample_gait(rng: np.random.Generator) -> Gait:
    """Draw a random gait; half of them walk."""
    walks = chance(rng, 0.5)
    return Gait(
        walks=walks,
        leg_deg=uniform(rng, 16.0, 28.0) if walks else uniform(rng, 0.0, 3.0),
        arm_deg=uniform(rng, 12.0, 45.0),
        head_deg=uniform(rng, 4.0, 20.0),
        sway_deg=uniform(rng, 1.0, 4.0),
        period_frames=uniform(rng, 14.0, 36.0),
    )


@dataclass(frozen=True)
class Coat:
    """The skin of a creature."""

    tufts: int
    """Locks of fur; 0 for bare skin."""
    tuft_length: float
    """In body units."""
    cells: int
    """Grid cells along the body's longest side: how finely it is meshed."""


def sample_creature(rng: np.random.Generator, coat: Coat) -> Character:
    """A random invented animal: two-legged, four-legged or crawling."""
    plan = choose(rng, (_biped, _quadruped, _crawler), (0.5, 0.35, 0.15))
    return plan(rng, coat)


def _biped(rng: np.random.Generator, coat: Coat) -> Character:
    body, gait = CharacterBuilder(), sample_gait(rng)
    leg, trunk = uniform(rng, 0.12, 0.34), uniform(rng, 0.24, 0.42)
    girth = uniform(rng, 0.11, 0.2)
    hip, chest = leg + 0.5 * girth, leg + 0.5 * girth + trunk
    belly = girth * uniform(rng, 1.0, 1.3)
    root = body.bone(
        "body", -1, (0.0, 0.0, hip), (0.0, 0.0, chest), (belly, girth * 0.8), (1.0, 0.0, 0.0), gait.sway_deg
    )
    skull = uniform(rng, 0.11, 0.19)
    head = _head(rng, body, gait, root, (0.02, 0.0, chest + 0.45 * girth), skull)
    feet = []
    for side, phase in ((1.0, 0.0), (-1.0, 0.5)):
        feet.append(_leg(body, gait, root, (0.0, side * 0.62 * girth, hip), side, 0.42 * girth, phase))
        shoulder = (0.0, side * girth * 0.75, chest - 0.02)
        arm, thick = uniform(rng, 0.26, 0.42), 0.3 * girth
        elbow = (0.05, side * (girth * 0.75 + 0.42 * arm), chest - 0.4 * arm)
        upper = body.bone(
            "body", root, shoulder, elbow, (thick, 0.8 * thick), (0.3, 0.95, 0.0), gait.arm_deg, phase + 0.5
        )
        hand = (0.16, side * (girth * 0.75 + 0.55 * arm), chest - 0.8 * arm)
        body.bone(
            "body",
            upper,
            elbow,
            hand,
            (0.8 * thick, 1.0 * thick),
            (0.0, 1.0, 0.0),
            0.8 * gait.arm_deg,
            phase + 0.6,
        )
    if chance(rng, 0.6):
        _tail(rng, body, root, (-0.7 * belly, 0.0, hip), 0.3 * girth)
    return _creature(rng, body, gait, coat, feet, head, leg)


def _quadruped(rng: np.random.Generator, coat: Coat) -> Character:
    body, gait = CharacterBuilder(), sample_gait(rng)
    leg, length, girth = uniform(rng, 0.2, 0.45), uniform(rng, 0.35, 0.6), uniform(rng, 0.11, 0.19)
    back = leg + 0.6 * girth
    root = body.bone(
        "body",
        -1,
        (-length / 2, 0.0, back),
        (length / 2, 0.0, back + uniform(rng, -0.03, 0.06)),
        (girth, girth * uniform(rng, 0.9, 1.2)),
        (1.0, 0.0, 0.0),
        gait.sway_deg,
    )
    reach, rise = uniform(rng, 0.08, 0.3), uniform(rng, 0.12, 0.45)
    nape = (length / 2 + reach, 0.0, back + rise)
    neck = body.bone(
        "body",
        root,
        (length / 2, 0.0, back + 0.3 * girth),
        nape,
        (0.6 * girth, 0.42 * girth),
        (0.0, 1.0, 0.0),
        0.4 * gait.head_deg,
        0.25,
    )
    head = _head(rng, body, gait, neck, nape, uniform(rng, 0.09, 0.14))
    feet = []
    for x, side, phase in (
        (length / 2, 1.0, 0.0),
        (length / 2, -1.0, 0.5),
        (-length / 2, 1.0, 0.5),
        (-length / 2, -1.0, 0.0),
    ):
        feet.append(
            _leg(body, gait, root, (x, side * 0.6 * girth, back - 0.2 * girth), side, 0.38 * girth, phase)
        )
    _tail(rng, body, root, (-length / 2 - 0.7 * girth, 0.0, back + 0.2 * girth), 0.28 * girth)
    return _creature(rng, body, gait, coat, feet, head, leg)


def _crawler(rng: np.random.Generator, coat: Coat) -> Character:
    """A row of balls on stubby legs that wriggles sideways."""
    body, gait = CharacterBuilder(), sample_gait(rng)
    segments, girth = integer(rng, 5, 8), uniform(rng, 0.09, 0.14)
    step = 1.35 * girth
    root, parent = -1, -1
    for index in range(segments):
        # From the head, which stays, to the tail, which swings most.
        x = (segments / 2 - index) * step
        thick = girth * (1.0 - 0.35 * (index / segments) ** 2) * uniform(rng, 0.92, 1.08)
        parent = body.bone(
            "body",
            parent,
            (x, 0.0, 1.15 * girth),
            (x - step, 0.0, 1.15 * girth),
            (thick, thick * 0.9),
            (0.0, 0.0, 1.0),
            uniform(rng, 4.0, 11.0),
            -0.16 * index,
        )
        root = parent if index == 0 else root
        for side in (-1.0, 1.0):
            hip, sole = (x, side * 0.6 * thick, 0.8 * girth), (x + 0.03, side * 1.05 * thick, 0.25 * girth)
            body.flesh("body", hip, sole, 0.3 * girth, 0.25 * girth)
    front = (segments / 2 * step + 0.3 * girth, 0.0, 1.15 * girth + 0.45 * girth)
    head = _head(rng, body, gait, root, front, girth * uniform(rng, 0.95, 1.3))
    return _creature(rng, body, gait, coat, [], head, 0.0)


def _leg(
    body: CharacterBuilder, gait: Gait, parent: int, hip: Vector, side: float, radius: float, phase: float
) -> int:
    """Thigh, shin and foot; returns the joint whose end is on the ground."""
    x, y, z = hip
    knee, ankle = (x + 0.06 * z, y + 0.01 * side, 0.52 * z), (x, y + 0.015 * side, 0.8 * radius)
    thigh = body.bone(
        "body", parent, hip, knee, (1.25 * radius, radius), (0.0, 1.0, 0.0), gait.leg_deg, phase
    )
    shin = body.bone(
        "body", thigh, knee, ankle, (radius, 0.8 * radius), (0.0, 1.0, 0.0), 0.5 * gait.leg_deg, phase + 0.3
    )
    body.flesh("body", ankle, (x + 1.6 * radius, y + 0.02 * side, 0.7 * radius), 0.8 * radius, 0.7 * radius)
    return shin


def _tail(
    rng: np.random.Generator, body: CharacterBuilder, parent: int, start: Vector, radius: float
) -> None:
    """A chain that curls up or hangs, wagging more towards its tip."""
    joints, curl = integer(rng, 3, 5), uniform(rng, -0.25, 0.7)
    length, angle = uniform(rng, 0.08, 0.16), uniform(rng, -0.5, 0.4)
    tip_radius = radius * uniform(rng, 0.4, 1.3)
    for index in range(joints):
        x, y, z = start
        end_z = max(z + length * math.sin(angle), 0.12)
        end = (x - length * math.cos(angle), y, end_z)
        thick = radius + (tip_radius - radius) * (index + 1) / joints
        parent = body.bone(
            "body", parent, start, end, (thick, thick), (0.0, 0.2, 0.98), 7.0 + 4.0 * index, 0.15 * index
        )
        start, angle = end, angle + curl


def _head(
    rng: np.random.Generator, body: CharacterBuilder, gait: Gait, parent: int, neck: Vector, skull: float
) -> int:
    """Skull, snout, ears, eyes, sometimes horns; returns the joint of the head."""
    x, y, z = neck
    middle = (x + 0.35 * skull, y, z + 0.75 * skull)
    head = body.bone(
        "body",
        parent,
        neck,
        middle,
        (0.8 * skull, skull),
        (0.0, 0.35, 0.94),
        gait.head_deg,
        uniform(rng, 0.0, 1.0),
    )
    mx, my, mz = middle
    snout, thick = uniform(rng, 0.5, 1.5) * skull, uniform(rng, 0.35, 0.6) * skull
    body.flesh(
        "body",
        (mx, my, mz - 0.2 * skull),
        (mx + 0.5 * skull + snout, my, mz - 0.35 * skull),
        thick,
        0.75 * thick,
    )
    ear, spread, width = uniform(rng, 0.5, 2.2) * skull, uniform(rng, 0.2, 1.1), uniform(rng, 0.16, 0.34)
    horned = chance(rng, 0.35)
    for side in (-1.0, 1.0):
        root = (mx - 0.1 * skull, my + side * 0.65 * skull, mz + 0.6 * skull)
        tip = (
            root[0] - 0.1 * skull,
            root[1] + side * ear * math.sin(spread),
            root[2] + ear * math.cos(spread),
        )
        body.bone(
            "body",
            head,
            root,
            tip,
            (width * skull, 0.6 * width * skull),
            (1.0, 0.0, 0.0),
            uniform(rng, 4.0, 14.0),
            0.25 * side,
        )
        if horned:
            base = (mx + 0.35 * skull, my + side * 0.3 * skull, mz + 0.8 * skull)
            point = (base[0] + 0.2 * skull, base[1] + side * 0.25 * skull, base[2] + 0.8 * skull)
            body.flesh("horn", base, point, 0.16 * skull, 0.04 * skull)
    radius = uniform(rng, 0.26, 0.42) * skull
    for side in (-1.0, 1.0):
        # The balls sit half in the skull.
        aside = 0.5 * skull
        centre = (mx + 0.8 * skull, my + side * aside, mz + 0.42 * skull)
        body.flesh("eye", centre, centre, radius, radius)
    return head


def _creature(
    rng: np.random.Generator,
    body: CharacterBuilder,
    gait: Gait,
    coat: Coat,
    feet: list[int],
    head: int,
    leg: float,
) -> Character:
    skin = SoftBody(
        limbs=tuple(body.limbs["body"]),
        blend=uniform(rng, 0.008, 0.016),
        folds=0.0,
        tufts=coat.tufts,
        tuft_length=coat.tuft_length,
        comb=(-0.4, 0.0, -0.5),
        cells=coat.cells,
        seed=new_seed(rng),
    )
    eyes = body.limbs["eye"]
    balls = Eyeballs(tuple(eye.start for eye in eyes), (1.0, 0.0, 0.12), eyes[0].start_radius)
    parts = [CharacterPart(skin, "fur"), CharacterPart(balls, "eye", head)]
    if "horn" in body.limbs:
        horns = SoftBody(tuple(body.limbs["horn"]), 0.002, 0.0, 0, 0.0, (0.0, 0.0, 0.0), 30, new_seed(rng))
        parts.append(CharacterPart(horns, "horn", head))
    return assemble_character(
        tuple(parts), body, gait, tuple(feet), leg, coat.tuft_length if coat.tufts else 0.0
    )


def assemble_character(
    parts: tuple[CharacterPart, ...],
    body: CharacterBuilder,
    gait: Gait,
    feet: tuple[int, ...],
    leg: float,
    fringe: float,
) -> Character:
    """A character from its meshes and the builder's joints.

    `leg` is the length of the legs, which sets the stride; `fringe` how far fur stands out, in body units.
    """
    ends = [(limb.end, limb.end_radius) for group in body.limbs.values() for limb in group]
    ends += [(limb.start, limb.start_radius) for group in body.limbs.values() for limb in group]
    # A walker covers four times the reach of a leg's swing in a period.
    stride = 4 * leg * math.sin(math.radians(gait.leg_deg)) / gait.period_frames if gait.walks else 0.0
    return Character(
        parts=parts,
        joints=tuple(body.joints),
        feet=feet,
        period_frames=gait.period_frames,
        stride=stride,
        height=max(end[2] + radius for end, radius in ends) + fringe,
        reach=1.25 * max(math.hypot(*end) + radius for end, radius in ends) + fringe,
    )


def place_character(
    placement: GroundPlacement,
    name: str,
    character: Character,
    materials: dict[str, int],
    spot: Spot,
    unit_m: float,
    *,
    checked: bool = True,
) -> bool:
    """Put a character on the ground; False if it may not stand there.

    `materials` gives the material index of each `CharacterPart.material`; a body unit is `unit_m` long. A
    character that walks does so in the direction of its heading, which does not change: so its parts, each a
    mesh with a centre of its own, stay together exactly.
    """
    path = _walk(placement, character, spot, unit_m)
    reach_m, height_m = character.reach * unit_m, character.height * unit_m
    half = np.array((0.6 * reach_m, 0.6 * reach_m, height_m / 2))
    for place in path if checked else ():
        centre = place + np.array((0.0, 0.0, height_m / 2))
        if not placement.allows(OrientedBox(centre, half, np.eye(3))):
            return False
    rotation = Rotation.from_euler("Z", spot.heading_rad)
    times = tuple(float(time) for time in key_times(placement.frames))
    placement.add(
        *(
            anchored_object(
                f"{name} {part.material} {index}",
                part.shape,
                _part_material(placement, part.shape, materials[part.material]),
                path,
                (rotation,) * len(times),
                times,
                unit_m=unit_m,
                deformation=character.deformation(part),
            )
            for index, part in enumerate(character.parts)
        )
    )
    return True


def _part_material(placement: GroundPlacement, shape: PartedShape, material: int) -> int:
    """Eyeballs of each size need their texture scaled to it."""
    if not isinstance(shape, Eyeballs):
        return material
    return placement.material(replace(placement.materials[material], repeats=iris_repeats(shape)))


def _walk(
    placement: GroundPlacement, character: Character, spot: Spot, unit_m: float
) -> list[NDArray[np.float64]]:
    """(3,) world points of a character's anchor at the key times, on the ground throughout."""
    heading = np.array((math.cos(spot.heading_rad), math.sin(spot.heading_rad)))
    step = heading * character.stride * unit_m
    places = []
    for time in key_times(placement.frames):
        plan = spot.ground_m[:2] + step * (time - (placement.frames - 1) / 2)
        places.append(np.array((*plan, float(placement.ground.height_m(plan[None])[0]))))
    return places
