"""People: a body of blended limbs in clothes, with hair, sometimes a staff; and statues of them."""

from __future__ import annotations

import numpy as np

from scenes.landscapes.characters import (
    Character,
    CharacterBuilder,
    CharacterPart,
    Gait,
    assemble_character,
    sample_gait,
)
from scenes.random_draws import chance, choose, new_seed, uniform
from scenes.shapes.nature.soft_bodies import Eyeballs, SoftBody, Staff

_HEM = 0.045
"""Height of a robe's hem over the ground."""


def sample_person(rng: np.random.Generator, cells: int) -> Character:
    """A random person of height 1, in a robe or in tunic, trousers and boots; some have a staff or a hood.

    `cells` is how finely the body is meshed (`SoftBody.cells`).
    """
    body, gait = CharacterBuilder(), sample_gait(rng)
    robed = chance(rng, 0.6)
    girth = uniform(rng, 0.085, 0.115)
    root = body.bone(
        "cloth",
        -1,
        (0.0, 0.0, 0.5),
        (0.0, 0.0, 0.75),
        (girth, girth * uniform(rng, 1.0, 1.25)),
        (1.0, 0.0, 0.0),
        0.6 * gait.sway_deg,
    )
    feet = [_person_leg(body, gait, root, side, phase, robed) for side, phase in ((1.0, 0.0), (-1.0, 0.5))]
    if robed:
        body.flesh("cloth", (0.0, 0.0, 0.52), (-0.01, 0.0, _HEM), 0.9 * girth, uniform(rng, 0.13, 0.2))
    hands = [_person_arm(rng, body, gait, root, side, girth) for side in (1.0, -1.0)]
    head = body.bone(
        "skin",
        root,
        (0.0, 0.0, 0.8),
        (0.012, 0.0, 0.93),
        (0.04, 0.062),
        (0.0, 0.2, 0.98),
        gait.head_deg,
        uniform(rng, 0, 1),
    )
    body.flesh("skin", (0.03, 0.0, 0.905), (0.068, 0.0, 0.9), 0.03, 0.012)
    _hair(rng, body)
    return _dressed(rng, body, gait, (head, hands[0]), tuple(feet), cells)


def _person_leg(body: CharacterBuilder, gait: Gait, root: int, side: float, phase: float, robed: bool) -> int:
    hip, knee, ankle = (0.0, side * 0.055, 0.49), (0.02, side * 0.06, 0.27), (0.0, side * 0.065, 0.05)
    swing = gait.leg_deg * (0.6 if robed else 1.0)
    thigh = body.joint(root, hip, knee, 0.05, swing_deg=swing, phase=phase)
    shin = body.joint(thigh, knee, ankle, 0.04, swing_deg=0.5 * swing, phase=phase + 0.3)
    if not robed:
        body.flesh("legs", hip, knee, 0.06, 0.048)
        body.flesh("legs", knee, (0.0, side * 0.065, 0.12), 0.046, 0.04)
    body.flesh("leather", (0.0, side * 0.065, 0.13), ankle, 0.044, 0.036)
    body.flesh("leather", ankle, (0.085, side * 0.075, 0.032), 0.038, 0.03)
    return shin


def _person_arm(
    rng: np.random.Generator, body: CharacterBuilder, gait: Gait, root: int, side: float, girth: float
) -> int:
    """Returns the joint of the forearm, which carries what the hand holds."""
    shoulder, bend = (0.0, side * (girth + 0.03), 0.765), uniform(rng, 0.0, 0.14)
    elbow = (0.0, side * (girth + 0.1), 0.6)
    hand = (0.06 + bend, side * (girth + 0.11), 0.46 + 0.6 * bend)
    phase = 0.25 - 0.25 * side
    sleeve = uniform(rng, 0.035, 0.06)
    upper = body.bone(
        "cloth", root, shoulder, elbow, (0.05, 0.042), (0.2, 0.98, 0.0), 0.6 * gait.arm_deg, phase + 0.5
    )
    fore = body.bone(
        "cloth", upper, elbow, hand, (0.04, sleeve), (0.0, 1.0, 0.0), 0.5 * gait.arm_deg, phase + 0.6
    )
    x, y, z = hand
    body.flesh("skin", (x + 0.01, y, z - 0.01), (x + 0.045, y, z - 0.03), 0.027, 0.022)
    return fore


def _hair(rng: np.random.Generator, body: CharacterBuilder) -> None:
    """Hair to the nape or to the waist, a hood, a beard, or a bald head."""
    style = choose(rng, ("short", "long", "hood", "bald"), (0.3, 0.3, 0.3, 0.1))
    if style == "bald":
        return
    group = "cloth" if style == "hood" else "hair"
    body.flesh(group, (-0.012, 0.0, 0.955), (-0.03, 0.0, 0.915), 0.062, 0.062)
    if style == "hood":
        for side in (-1.0, 1.0):
            body.flesh(group, (0.0, side * 0.05, 0.95), (0.0, side * 0.06, 0.82), 0.026, 0.035)
        body.flesh(group, (-0.04, 0.0, 0.92), (-0.03, 0.0, 0.78), 0.06, 0.08)
    if style == "long":
        body.flesh(group, (-0.05, 0.0, 0.92), (-0.1, 0.0, uniform(rng, 0.6, 0.78)), 0.055, 0.035)
    if chance(rng, 0.35):
        body.flesh("hair", (0.055, 0.0, 0.88), (0.07, 0.0, uniform(rng, 0.7, 0.82)), 0.03, 0.015)


def _dressed(
    rng: np.random.Generator,
    body: CharacterBuilder,
    gait: Gait,
    carriers: tuple[int, int],
    feet: tuple[int, ...],
    cells: int,
) -> Character:
    """The person's meshes, one for each material.

    `carriers` are the joints of the head and of the hand that may hold a staff.
    """
    head, hand = carriers
    folds = uniform(rng, 0.003, 0.008)
    fineness = {"cloth": 1.0, "legs": 0.6, "skin": 0.7, "hair": 0.5, "leather": 0.5}
    parts = []
    for group, share in fineness.items():
        if group not in body.limbs:
            continue
        shape = SoftBody(
            limbs=tuple(body.limbs[group]),
            blend=0.006,
            folds=folds if group == "cloth" else 0.0,
            tufts=0,
            tuft_length=0.0,
            comb=(0.0, 0.0, 0.0),
            cells=round(cells * share),
            seed=new_seed(rng),
            floor=_HEM if group == "cloth" else None,
        )
        parts.append(CharacterPart(shape, "cloth" if group == "legs" else group))
    eyes = Eyeballs(((0.058, -0.024, 0.935), (0.058, 0.024, 0.935)), (1.0, 0.0, 0.0), 0.013)
    parts.append(CharacterPart(eyes, "eye", head))
    if chance(rng, 0.4):
        x, y, _ = body.joints[hand].end
        staff = Staff(
            (x + 0.04, y, 0.0), uniform(rng, 0.85, 1.25), 0.012, uniform(rng, 0.0, 0.05), new_seed(rng)
        )
        parts.append(CharacterPart(staff, "wood", hand))
    return assemble_character(tuple(parts), body, gait, feet, 0.5, 0.0)


def statue(rng: np.random.Generator, character: Character) -> SoftBody:
    """A statue of a character: all its flesh as one body."""
    limbs = [
        limb for part in character.parts if isinstance(part.shape, SoftBody) for limb in part.shape.limbs
    ]
    return SoftBody(tuple(limbs), 0.006, 0.003, 0, 0.0, (0.0, 0.0, 0.0), 60, new_seed(rng), 0.0)
