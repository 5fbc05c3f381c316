"""Invented animals: two-legged, four-legged or crawling, of random proportions, in many poses, furry or bare."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenes.landscapes.characters import Character, CharacterPart, assemble_character
from scenes.landscapes.poses import ArmPose, LegPose
from scenes.landscapes.skeleton import GROUND, Skeleton, sample_gait, turned
from scenes.random_draws import chance, choose, integer, new_seed, uniform
from scenes.shapes.nature.soft_bodies import Eyeballs, Limb, SoftBody
from scenes.spec import Vector


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


_ARMS = (
    ArmPose(8.0, 12.0, 0.0, 10.0, 20.0),
    ArmPose(64.0, 16.0, 0.0, 20.0, 30.0),
    ArmPose(40.0, 10.0, 14.0, 50.0, 95.0),
    ArmPose(20.0, 120.0, 0.0, -50.0, 50.0),
    ArmPose(150.0, 24.0, 0.0, 0.0, 25.0),
    ArmPose(-20.0, 46.0, 0.0, 70.0, 85.0),
    ArmPose(95.0, 30.0, 20.0, 30.0, 110.0),
)
"""Hanging, held out, on the belly, waving, up, on the hip, at the face."""


def _biped(rng: np.random.Generator, coat: Coat) -> Character:
    body = Skeleton(sample_gait(rng, 0.4))
    gait = body.gait
    leg, trunk = uniform(rng, 0.12, 0.34), uniform(rng, 0.24, 0.42)
    girth = uniform(rng, 0.11, 0.2)
    hip, chest = leg + 0.5 * girth, leg + 0.5 * girth + trunk
    belly = girth * uniform(rng, 1.0, 1.3)
    sits = not gait.walks and chance(rng, 0.3)
    lean = turned(
        float(rng.normal(0.0, 6.0)),
        -14.0 if sits else float(rng.normal(4.0, 9.0)),
        float(rng.normal(0.0, 12.0)),
    )
    pelvis = body.joint(GROUND, (0.0, 0.0, hip), (0.0, 0.0, hip - 0.02), belly)
    root = body.bone(
        "body", pelvis, (0.0, 0.0, hip), (0.0, 0.0, chest), (belly, girth * 0.8), (1.0, 0.0, 0.0), gait.sway_deg,
        turn=lean,
    )  # fmt: skip
    head = _head(rng, body, root, (0.02, 0.0, chest + 0.45 * girth), uniform(rng, 0.11, 0.19))
    reach, thick = uniform(rng, 0.26, 0.42), 0.3 * girth
    feet = []
    for side, phase in ((1.0, 0.0), (-1.0, 0.5)):
        pose = _leg_pose(rng, gait.walks, phase)
        if sits:
            pose = LegPose(uniform(rng, 78.0, 96.0), uniform(rng, 10.0, 26.0), uniform(rng, 0.0, 30.0))
        feet.append(_leg(body, pelvis, (0.0, side * 0.62 * girth, hip), side, 0.42 * girth, phase, pose))
        arm = _ARMS[0] if gait.walks else choose(rng, _ARMS)
        _arm(rng, body, root, (0.0, side * 0.75 * girth, chest - 0.02), side, (reach, thick), phase, arm)
    if chance(rng, 0.6):
        _tail(rng, body, root, (-0.7 * belly, 0.0, hip), 0.3 * girth)
    soles = body.limbs["body"] if sits else _soles(body, feet, 0.8 * 0.42 * girth)
    body.stand(soles, feet)
    return _creature(rng, body, coat, [] if sits else feet, head, leg)


def _leg_pose(rng: np.random.Generator, walks: bool, phase: float) -> LegPose:
    if walks:
        return LegPose(3.0, 2.0, 20.0)
    forward = uniform(rng, -4.0, 22.0) * (1.0 if phase == 0.0 else -1.0)
    return LegPose(forward, uniform(rng, 2.0, 10.0), uniform(rng, 4.0, 24.0))


def _soles(body: Skeleton, feet: Sequence[int], radius: float) -> list[Limb]:
    """Balls about the ends of the legs, by which the body stands."""
    return [Limb(body.joints[foot].end, body.joints[foot].end, radius, radius) for foot in feet]


def _arm(
    rng: np.random.Generator,
    body: Skeleton,
    trunk: int,
    shoulder: Vector,
    side: float,
    measures: tuple[float, float],
    phase: float,
    pose: ArmPose,
) -> None:
    """An arm of a length and a thickness, with a mitten of a hand."""
    (reach, thick), (x, y, z) = measures, shoulder
    gait = body.gait
    elbow, hand = (x + 0.02, y, z - 0.48 * reach), (x + 0.03, y, z - 0.92 * reach)
    held = ArmPose(
        pose.forward + float(rng.normal(0.0, 10.0)), max(pose.out + float(rng.normal(0.0, 8.0)), 8.0),
        pose.inward, pose.twist, max(pose.elbow + float(rng.normal(0.0, 10.0)), 5.0),
    )  # fmt: skip
    upper = body.bone(
        "body", trunk, shoulder, elbow, (thick, 0.85 * thick), (0.0, 1.0, 0.0), gait.arm_deg, phase + 0.5,
        held.shoulder(side),
    )  # fmt: skip
    fore = body.bone(
        "body", upper, elbow, hand, (0.85 * thick, 0.9 * thick), (0.0, 1.0, 0.0), 0.6 * gait.arm_deg, phase + 0.6,
        held.elbow_turn(),
    )  # fmt: skip
    for across in (-0.7, 0.0, 0.7):
        tip = (hand[0] + across * thick, hand[1] - 0.2 * side * thick, hand[2] - 1.1 * thick)
        body.flesh("body", fore, hand, tip, 0.55 * thick, 0.42 * thick)


def _quadruped(rng: np.random.Generator, coat: Coat) -> Character:
    body = Skeleton(sample_gait(rng, 0.45))
    gait = body.gait
    leg, length, girth = uniform(rng, 0.2, 0.45), uniform(rng, 0.35, 0.6), uniform(rng, 0.11, 0.19)
    back = leg + 0.6 * girth
    sits = not gait.walks and chance(rng, 0.25)
    pitch = -uniform(rng, 28.0, 42.0) if sits else float(rng.normal(0.0, 4.0))
    root = body.bone(
        "body", GROUND, (-length / 2, 0.0, back), (length / 2, 0.0, back + uniform(rng, -0.03, 0.06)),
        (girth, girth * uniform(rng, 0.9, 1.2)), (1.0, 0.0, 0.0), gait.sway_deg,
        turn=turned(0.0, pitch, 0.0),
    )  # fmt: skip
    reach, rise = uniform(rng, 0.08, 0.3), uniform(rng, 0.12, 0.45)
    nape = (length / 2 + reach, 0.0, back + rise)
    grazes = not gait.walks and not sits and chance(rng, 0.25)
    stoop = uniform(rng, 45.0, 75.0) if grazes else float(rng.normal(0.0, 12.0)) - 0.6 * pitch
    neck = body.bone(
        "body", root, (length / 2, 0.0, back + 0.3 * girth), nape, (0.6 * girth, 0.42 * girth), (0.0, 1.0, 0.0),
        0.4 * gait.head_deg, 0.25, turned(0.0, stoop, float(rng.normal(0.0, 20.0))),
    )  # fmt: skip
    head = _head(rng, body, neck, nape, uniform(rng, 0.09, 0.14), level=-0.7 * stoop)
    feet = []
    for x, side, phase in (
        (length / 2, 1.0, 0.0), (length / 2, -1.0, 0.5), (-length / 2, 1.0, 0.5), (-length / 2, -1.0, 0.0),
    ):  # fmt: skip
        pose = _leg_pose(rng, gait.walks, phase)
        if sits:
            # Fore legs stay upright under the raised chest, hind legs fold under the haunches.
            pose = LegPose(pitch, 3.0, 2.0) if x > 0 else LegPose(72.0 + pitch, 8.0, 112.0)
        hip = (x, side * 0.6 * girth, back - 0.2 * girth)
        feet.append(_leg(body, root, hip, side, 0.38 * girth, phase, pose))
    _tail(rng, body, root, (-length / 2 - 0.7 * girth, 0.0, back + 0.2 * girth), 0.28 * girth)
    body.stand(_soles(body, feet, 0.8 * 0.38 * girth), feet)
    return _creature(rng, body, coat, feet, head, leg)


def _crawler(rng: np.random.Generator, coat: Coat) -> Character:
    """A row of balls on stubby legs, bent this way and that, that wriggles sideways; some rear their heads."""
    body = Skeleton(sample_gait(rng))
    segments, girth = integer(rng, 5, 8), uniform(rng, 0.09, 0.14)
    step = 1.35 * girth
    rears = uniform(rng, 10.0, 38.0) if chance(rng, 0.6) else 0.0
    parent, root, soles = GROUND, 0, []
    for index in range(segments):
        # From the head, which stays, to the tail, which swings most.
        x = (segments / 2 - index) * step
        thick = girth * (1.0 - 0.35 * (index / segments) ** 2) * uniform(rng, 0.92, 1.08)
        pitch = {0: rears, 1: -rears}.get(index, 0.0)
        parent = body.bone(
            "body", parent, (x, 0.0, 1.15 * girth), (x - step, 0.0, 1.15 * girth), (thick, thick * 0.9),
            (0.0, 0.0, 1.0), uniform(rng, 4.0, 11.0), -0.16 * index,
            turned(0.0, -pitch, float(rng.normal(0.0, 14.0))),
        )  # fmt: skip
        root = parent if index == 0 else root
        for side in (-1.0, 1.0):
            hip, sole = (x, side * 0.6 * thick, 0.8 * girth), (x + 0.03, side * 1.05 * thick, 0.25 * girth)
            body.flesh("body", parent, hip, sole, 0.3 * girth, 0.25 * girth)
            soles.append(body.limbs["body"][-1])
    front = (segments / 2 * step + 0.3 * girth, 0.0, 1.15 * girth + 0.45 * girth)
    head = _head(rng, body, root, front, girth * uniform(rng, 0.95, 1.3), level=0.6 * rears)
    body.stand(soles, [])
    return _creature(rng, body, coat, [], head, 0.0)


def _leg(
    body: Skeleton, parent: int, hip: Vector, side: float, radius: float, phase: float, pose: LegPose
) -> int:
    """Thigh, shin and foot; returns the joint whose end is on the ground."""
    (x, y, z), gait = hip, body.gait
    knee, ankle = (x, y + 0.01 * side, 0.52 * z), (x, y + 0.015 * side, 0.8 * radius)
    thigh = body.bone(
        "body",
        parent,
        hip,
        knee,
        (1.25 * radius, radius),
        (0.0, 1.0, 0.0),
        gait.leg_deg,
        phase,
        pose.hip(side),
    )
    # The knee is most bent while the leg comes forward.
    shin = body.bone(
        "body", thigh, knee, ankle, (radius, 0.8 * radius), (0.0, 1.0, 0.0), 0.6 * gait.leg_deg, phase - 0.22,
        pose.knee_turn(),
    )  # fmt: skip
    foot = body.joint(
        shin, ankle, (x + 1.6 * radius, y, 0.7 * radius), radius, turn=turned(pitch_deg=pose.ankle)
    )
    toe = (x + 1.6 * radius, y + 0.02 * side, 0.7 * radius)
    body.flesh("body", foot, ankle, toe, 0.8 * radius, 0.7 * radius)
    return shin


def _tail(rng: np.random.Generator, body: Skeleton, parent: int, start: Vector, radius: float) -> None:
    """A chain that curls up, aside or hangs, wagging more towards its tip."""
    joints, curl = integer(rng, 3, 5), uniform(rng, -0.25, 0.7)
    length, angle = uniform(rng, 0.08, 0.16), uniform(rng, -0.5, 0.4)
    tip_radius, aside = radius * uniform(rng, 0.4, 1.3), float(rng.normal(0.0, 16.0))
    for index in range(joints):
        x, y, z = start
        end_z = max(z + length * math.sin(angle), 0.12)
        end = (x - length * math.cos(angle), y, end_z)
        thick = radius + (tip_radius - radius) * (index + 1) / joints
        parent = body.bone(
            "body", parent, start, end, (thick, thick), (0.0, 0.2, 0.98), 7.0 + 4.0 * index, 0.15 * index,
            turned(yaw_deg=aside),
        )  # fmt: skip
        start, angle = end, angle + curl


def _head(
    rng: np.random.Generator, body: Skeleton, parent: int, neck: Vector, skull: float, level: float = 0.0
) -> int:
    """Skull, snout, ears, eyes, sometimes horns; returns the joint of the head.

    The head is turned anywhere, about a pitch of `level` degrees.
    """
    x, y, z = neck
    middle = (x + 0.35 * skull, y, z + 0.75 * skull)
    yaw = float(np.clip(rng.normal(0.0, 28.0), -60.0, 60.0))
    head = body.bone(
        "body", parent, neck, middle, (0.8 * skull, skull), (0.0, 0.35, 0.94), body.gait.head_deg,
        uniform(rng, 0.0, 1.0), turned(float(rng.normal(0.0, 9.0)), level + float(rng.normal(0.0, 12.0)), yaw),
    )  # fmt: skip
    mx, my, mz = middle
    snout, thick = uniform(rng, 0.5, 1.5) * skull, uniform(rng, 0.35, 0.6) * skull
    low = (mx, my, mz - 0.2 * skull)
    body.flesh("body", head, low, (mx + 0.5 * skull + snout, my, mz - 0.35 * skull), thick, 0.75 * thick)
    _ears(rng, body, head, middle, skull)
    if chance(rng, 0.35):
        for side in (-1.0, 1.0):
            base = (mx + 0.35 * skull, my + side * 0.3 * skull, mz + 0.8 * skull)
            point = (base[0] + 0.2 * skull, base[1] + side * 0.25 * skull, base[2] + 0.8 * skull)
            body.flesh("horn", head, base, point, 0.16 * skull, 0.04 * skull)
    radius = uniform(rng, 0.26, 0.42) * skull
    for side in (-1.0, 1.0):
        # The balls sit half in the skull.
        centre = (mx + 0.8 * skull, my + side * 0.5 * skull, mz + 0.42 * skull)
        body.flesh("eye", head, centre, centre, radius, radius)
    return head


def _ears(rng: np.random.Generator, body: Skeleton, head: int, middle: Vector, skull: float) -> None:
    """Two ears, which rarely stand alike."""
    mx, my, mz = middle
    ear, spread, width = uniform(rng, 0.5, 2.2) * skull, uniform(rng, 0.2, 1.1), uniform(rng, 0.16, 0.34)
    for side in (-1.0, 1.0):
        root = (mx - 0.1 * skull, my + side * 0.65 * skull, mz + 0.6 * skull)
        tip = (
            root[0] - 0.1 * skull, root[1] + side * ear * math.sin(spread), root[2] + ear * math.cos(spread),
        )  # fmt: skip
        turn = turned(float(rng.normal(0.0, 14.0)), float(rng.normal(0.0, 14.0)), 0.0)
        radii = (width * skull, 0.6 * width * skull)
        swing = uniform(rng, 4.0, 14.0)
        body.bone("body", head, root, tip, radii, (1.0, 0.0, 0.0), swing, 0.25 * side, turn)


def _creature(
    rng: np.random.Generator, body: Skeleton, coat: Coat, feet: Sequence[int], head: int, leg: float
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
    gaze = body.aimed(head, (1.0, uniform(rng, -0.25, 0.25), uniform(rng, -0.1, 0.2)))
    balls = Eyeballs(tuple(eye.start for eye in eyes), gaze, eyes[0].start_radius)
    parts = [CharacterPart(skin, "fur"), CharacterPart(balls, "eye", head)]
    if "horn" in body.limbs:
        horns = SoftBody(tuple(body.limbs["horn"]), 0.002, 0.0, 0, 0.0, (0.0, 0.0, 0.0), 30, new_seed(rng))
        parts.append(CharacterPart(horns, "horn", head))
    return assemble_character(tuple(parts), body, tuple(feet), leg, coat.tuft_length if coat.tufts else 0.0)
