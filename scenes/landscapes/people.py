"""People: a body of blended limbs in any of many poses, with a face, hands and hair; statues of them.

What they wear and carry is in `scenes.landscapes.clothes`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenes.landscapes.characters import Character, CharacterPart, assemble_character
from scenes.landscapes.clothes import HEM, Outfit, carried_parts, dress, sample_outfit
from scenes.landscapes.poses import LegPose, Pose, sample_pose
from scenes.landscapes.skeleton import GROUND, Skeleton, sample_gait, turned
from scenes.motion.trajectories import vector
from scenes.random_draws import chance, choose, new_seed, uniform
from scenes.shapes.nature.soft_bodies import Eyeballs, Limb, SoftBody
from scenes.spec import Vector

HIP, CHEST, NECK = 0.52, 0.75, 0.81
"""Heights of joints of a person of height 1."""


@dataclass(frozen=True)
class _Bones:
    """Joints by what they are."""

    pelvis: int
    trunk: int
    head: int
    fore_arms: tuple[int, int]
    """Left, right."""
    shins: tuple[int, int]


def sample_person(rng: np.random.Generator, cells: int) -> Character:
    """A random person of height 1, in a pose: robe or tunic or armour, hair or hat, now and then a staff or sword.

    `cells` is how finely the clothes are meshed (`SoftBody.cells`); everything else follows.
    """
    body = Skeleton(sample_gait(rng, 0.4))
    pose = sample_pose(rng, walks=body.gait.walks)
    outfit = sample_outfit(rng)
    girth = uniform(rng, 0.082, 0.112)
    bones = _body(rng, body, pose, outfit, girth)
    dress(rng, body, outfit, girth, (bones.pelvis, bones.trunk, bones.shins), low=pose.low)
    _face(rng, body, bones.head)
    _hair(rng, body, bones.head, outfit)
    knee = (
        body.joints[body.joints[bones.shins[0]].parent].end,
        body.joints[body.joints[bones.shins[1]].parent].end,
    )
    soles = [*body.limbs["leather"], *(Limb(end, end, 0.05, 0.05) for end in knee)]
    if pose.low:
        hip = body.joints[bones.pelvis].start
        soles.append(Limb(hip, hip, 0.8 * girth, 0.8 * girth))
    body.stand(soles, bones.shins)
    parts = _meshes(rng, body, outfit, cells, low=pose.low)
    parts += carried_parts(rng, body, outfit, (bones.trunk, bones.head, *bones.fore_arms), holds=pose.holds)
    eyes = tuple(body.posed(bones.head, (0.0545, side * 0.0255, 0.927)) for side in (-1.0, 1.0))
    gaze = body.aimed(bones.head, (1.0, uniform(rng, -0.3, 0.3), uniform(rng, -0.15, 0.1)))
    parts.append(CharacterPart(Eyeballs(eyes, gaze, 0.0115), "eye", bones.head))
    rigid = {"head": bones.head, "left hand": bones.fore_arms[0], "right hand": bones.fore_arms[1]}
    for name, joint in rigid.items():
        parts.append(
            CharacterPart(
                _soft(rng, body, name, round((0.6 if name == "head" else 0.42) * cells), 0.005), "skin", joint
            )
        )
    return assemble_character(tuple(parts), body, () if pose.low else bones.shins, HIP, 0.0)


def _body(rng: np.random.Generator, body: Skeleton, pose: Pose, outfit: Outfit, girth: float) -> _Bones:
    gait = body.gait
    pelvis = body.joint(GROUND, (0.0, 0.0, HIP), (0.0, 0.0, HIP - 0.03), girth)
    chest = girth * uniform(rng, 0.95, 1.2)
    trunk = body.bone(
        "cloth", pelvis, (0.0, 0.0, HIP), (0.0, 0.0, CHEST - 0.04), (0.92 * girth, chest), (1.0, 0.0, 0.0),
        0.6 * gait.sway_deg, turn=turned(*pose.trunk),
    )  # fmt: skip
    across = girth + 0.012
    body.flesh("cloth", trunk, (0.0, -across, 0.768), (0.0, across, 0.768), 0.046, 0.046)
    head = body.joint(
        trunk, (0.0, 0.0, NECK), (0.012, 0.0, 0.93), 0.05, (0.0, 0.2, 0.98), gait.head_deg, uniform(rng, 0.0, 1.0),
        turned(*pose.head),
    )  # fmt: skip
    shins, fore_arms = [], []
    for index, (side, phase) in enumerate(((1.0, 0.0), (-1.0, 0.5))):
        shins.append(_leg(body, pelvis, pose.legs[index], side, phase, outfit))
        fore_arms.append(_arm(rng, body, pose, trunk, across, side, phase, outfit))
    left, right = fore_arms
    return _Bones(pelvis, trunk, head, (left, right), (shins[0], shins[1]))


def _leg(body: Skeleton, pelvis: int, pose: LegPose, side: float, phase: float, outfit: Outfit) -> int:
    hip, knee, ankle = (0.0, side * 0.052, HIP - 0.02), (0.01, side * 0.056, 0.275), (0.0, side * 0.06, 0.05)
    swing = body.gait.leg_deg * (0.7 if outfit.robed else 1.0)
    thigh = body.joint(pelvis, hip, knee, 0.05, swing_deg=swing, phase=phase, turn=pose.hip(side))
    # The knee is most bent while the leg comes forward.
    shin = body.joint(
        thigh, knee, ankle, 0.04, swing_deg=0.75 * swing, phase=phase - 0.22, turn=pose.knee_turn()
    )
    foot = body.joint(
        shin, ankle, (0.085, side * 0.07, 0.03), 0.034, swing_deg=0.4 * swing, phase=phase + 0.25,
        turn=turned(yaw_deg=8.0 * side, pitch_deg=pose.ankle),
    )  # fmt: skip
    if not outfit.robed:
        body.flesh("legs", thigh, hip, knee, 0.062, 0.046)
        body.flesh("legs", shin, knee, (0.0, side * 0.06, 0.12), 0.045, 0.038)
        body.flesh("legs", shin, (-0.012, side * 0.057, 0.21), (-0.006, side * 0.058, 0.17), 0.042, 0.038)
    body.flesh("leather", shin, (0.0, side * 0.06, outfit.boots), ankle, 0.043, 0.034)
    body.flesh("leather", foot, (-0.012, side * 0.058, 0.034), (0.075, side * 0.07, 0.028), 0.034, 0.027)
    return shin


def _arm(
    rng: np.random.Generator,
    body: Skeleton,
    pose: Pose,
    trunk: int,
    across: float,
    side: float,
    phase: float,
    outfit: Outfit,
) -> int:
    """Returns the joint of the forearm, which carries the hand and what it holds."""
    held = pose.arms[0 if side > 0 else 1]
    y = side * (across + 0.022)
    shoulder, elbow, wrist = (0.0, y, 0.77), (0.0, y, 0.615), (0.0, y, 0.475)
    swing = 0.8 * body.gait.arm_deg
    # Arms swing against the legs; only those that hang swing far.
    swing *= 1.0 if abs(held.forward) < 30 and held.out < 30 else 0.35
    upper = body.joint(
        trunk, shoulder, elbow, 0.045, swing_deg=swing, phase=phase + 0.5, turn=held.shoulder(side)
    )
    fore = body.joint(
        upper, elbow, wrist, 0.04, swing_deg=0.5 * swing, phase=phase + 0.55, turn=held.elbow_turn()
    )
    body.flesh("cloth", upper, shoulder, elbow, 0.047, 0.04)
    cuff = (0.0, y, 0.475 + 0.06 * (1.0 - outfit.sleeve))
    body.flesh("cloth", fore, elbow, cuff, 0.038, outfit.cuff)
    hand = "left hand" if side > 0 else "right hand"
    body.flesh(hand, fore, (0.0, y, 0.53), (0.0, y, 0.475), 0.024, 0.02)
    _hand(rng, body, hand, fore, (0.0, y, 0.47), side, grips=side < 0 and pose.holds)
    return fore


def _hand(
    rng: np.random.Generator,
    body: Skeleton,
    group: str,
    carrier: int,
    wrist: Vector,
    side: float,
    *,
    grips: bool,
) -> None:
    """A palm, four fingers and a thumb, open, half closed or in a fist."""
    (x, y, z), curl = wrist, 0.95 if grips else uniform(rng, 0.05, 0.75)
    body.flesh(group, carrier, (x - 0.008, y, z - 0.014), (x + 0.008, y, z - 0.034), 0.02, 0.022)
    for index in range(4):
        across = -0.021 + 0.014 * index
        root = (x + across, y, z - 0.046)
        bend = curl * np.pi * 0.55
        middle = (x + 1.1 * across, y - side * 0.022 * np.sin(bend), z - 0.046 - 0.024 * np.cos(bend))
        tip = (
            middle[0],
            middle[1] - side * 0.02 * np.sin(1.6 * bend),
            middle[2] - 0.022 * np.cos(1.6 * bend),
        )
        for start, end in ((root, middle), (middle, tip)):
            body.flesh(group, carrier, start, vector(np.array(end)), 0.0085, 0.0075)
    body.flesh(
        group, carrier, (x + 0.016, y, z - 0.012), (x + 0.03, y - 0.014 * side, z - 0.038), 0.011, 0.009
    )


def _face(rng: np.random.Generator, body: Skeleton, head: int) -> None:
    """Skull, jaw, brow, cheeks, nose, chin, ears and lips."""
    jaw, nose = uniform(rng, 0.036, 0.045), uniform(rng, 0.008, 0.013)
    features = [
        ((-0.02, 0.0, 0.94), (0.012, 0.0, 0.942), 0.056, 0.053),
        ((0.012, 0.0, 0.9), (0.026, 0.0, 0.886), jaw, 0.86 * jaw),
        ((-0.004, 0.0, 0.79), (0.0, 0.0, 0.9), 0.036, 0.036),
        ((0.054, 0.0, 0.867), (0.058, 0.0, 0.868), 0.013, 0.012),
        ((0.061, 0.0, 0.93), (0.073, 0.0, 0.903), 0.6 * nose, nose),
    ]
    for side in (-1.0, 1.0):
        features += [
            ((0.057, side * 0.012, 0.941), (0.049, side * 0.036, 0.942), 0.0085, 0.008),
            ((0.046, side * 0.03, 0.905), (0.04, side * 0.034, 0.9), 0.017, 0.016),
            ((-0.006, side * 0.057, 0.925), (0.0, side * 0.057, 0.905), 0.012, 0.008),
            ((0.052, side * 0.026, 0.918), (0.054, side * 0.022, 0.9165), 0.009, 0.008),
        ]
    for start, end, one, two in features:
        body.flesh("head", head, start, end, one, two)
    body.flesh("lips", head, (0.063, -0.013, 0.8835), (0.063, 0.013, 0.8835), 0.0062, 0.0062)
    body.flesh("lips", head, (0.061, -0.009, 0.878), (0.061, 0.009, 0.878), 0.0062, 0.0062)


def _hair(rng: np.random.Generator, body: Skeleton, head: int, outfit: Outfit) -> None:
    """Hair short, to the nape or to the waist, in a bun, or none; a beard."""
    if outfit.head == "hood":
        body.flesh("hood", head, (-0.018, 0.0, 0.95), (-0.034, 0.0, 0.91), 0.066, 0.064)
        for side in (-1.0, 1.0):
            body.flesh(
                "hood", head, (-0.006, side * 0.052, 0.955), (-0.004, side * 0.062, 0.84), 0.024, 0.034
            )
        body.flesh("hood", head, (-0.045, 0.0, 0.92), (-0.03, 0.0, 0.81), 0.058, 0.075)
    style = choose(rng, ("short", "nape", "long", "bun", "bald"), (0.25, 0.2, 0.25, 0.2, 0.1))
    low = 0.92 if outfit.head != "bare" else 0.95
    if style != "bald":
        body.flesh("hair", head, (-0.014, 0.0, low + 0.006), (-0.032, 0.0, 0.925), 0.0595, 0.056)
        for side in (-1.0, 1.0):
            body.flesh("hair", head, (0.012, side * 0.028, 0.962), (-0.02, side * 0.042, 0.925), 0.034, 0.028)
    if style in ("nape", "long"):
        end = 0.85 if style == "nape" else uniform(rng, 0.62, 0.76)
        for side in (-1.0, 0.0, 1.0):
            at, tip = (-0.03, side * 0.04, 0.93), (-0.075 - 0.02 * (0.85 - end) / 0.2, side * 0.05, end)
            body.flesh("hair", head, at, tip, 0.034, 0.022)
    if style == "bun":
        body.flesh("hair", head, (-0.07, 0.0, 0.965), (-0.085, 0.0, 0.96), 0.026, 0.024)
    if chance(rng, 0.3):
        beard_end = uniform(rng, 0.76, 0.84)
        body.flesh("hair", head, (0.05, 0.0, 0.868), (0.06, 0.0, beard_end), 0.024, 0.01)
        for side in (-1.0, 1.0):
            body.flesh("hair", head, (0.066, side * 0.008, 0.893), (0.058, side * 0.024, 0.882), 0.006, 0.005)


_FINENESS = {"cloth": 1.0, "legs": 0.62, "leather": 0.56, "cloak": 0.8, "belt": 0.55, "plate": 0.6, "hair": 0.6,
             "hood": 0.6, "lips": 0.2}  # fmt: skip
"""How finely the groups of limbs are meshed, relative to the clothes."""
_MADE_OF = {"legs": "trousers", "belt": "leather", "hood": "cloak", "plate": "metal"}
"""Materials of the groups that are not called by them."""


def _meshes(
    rng: np.random.Generator, body: Skeleton, outfit: Outfit, cells: int, *, low: bool
) -> list[CharacterPart]:
    """The person's skinned meshes, one for each group of limbs."""
    parts = []
    for group, share in _FINENESS.items():
        if group in body.limbs:
            floor = (0.012 if low else HEM) if group == "cloth" and outfit.robed else None
            folds = {"cloth": outfit.folds, "cloak": outfit.folds, "legs": 0.4 * outfit.folds, "hair": 0.003}
            shape = _soft(rng, body, group, round(cells * share), 0.006, folds.get(group, 0.0), floor)
            parts.append(CharacterPart(shape, _MADE_OF.get(group, group)))
    return parts


def _soft(
    rng: np.random.Generator,
    body: Skeleton,
    group: str,
    cells: int,
    blend: float,
    folds: float = 0.0,
    floor: float | None = None,
) -> SoftBody:
    limbs = tuple(body.limbs[group])
    return SoftBody(limbs, blend, folds, 0, 0.0, (0.0, 0.0, 0.0), cells, new_seed(rng), floor)


def statue(rng: np.random.Generator, character: Character) -> SoftBody:
    """A statue of a character: all its flesh as one body."""
    bodies = [part.shape for part in character.parts if isinstance(part.shape, SoftBody)]
    limbs = tuple(limb for body in bodies for limb in body.limbs)
    floors = [body.floor for body in bodies if body.floor is not None]
    floor = 0.0 if floors else None
    return SoftBody(limbs, 0.005, 0.003, 0, 0.0, (0.0, 0.0, 0.0), 64, new_seed(rng), floor)
