"""What people wear and carry: robes, tunics, armour, cloaks, belts, hoods, hats, staffs, swords, shields, lamps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenes.landscapes.characters import CharacterPart
from scenes.landscapes.skeleton import GROUND, Skeleton
from scenes.motion.trajectories import vector
from scenes.random_draws import chance, choose, new_seed, uniform
from scenes.shapes.nature.gear import Blade, Turned, ball, cone_hat, dome
from scenes.shapes.nature.soft_bodies import Staff

HEM = 0.045
"""Height of a robe's hem over the ground."""
BELT = 0.565
"""Height of a belt."""
_STRAND_GAP = 0.03
"""Distance of the strands of a cloak at its hem; each is 0.044 thick."""


@dataclass(frozen=True)
class Outfit:
    """What a person wears."""

    robed: bool
    """A robe to the feet; else tunic, trousers and boots."""
    armoured: bool
    cloak: bool
    belt: bool
    head: str
    """bare, hood, straw hat, brimmed hat or helmet."""
    folds: float
    """Depth of the folds, in body units."""
    sleeve: float
    """Length of the forearm's sleeve, 0..1."""
    cuff: float
    """Radius of its end."""
    skirt: float
    """Height of the hem of a tunic."""
    boots: float
    """Height of the boots' upper end."""


def sample_outfit(rng: np.random.Generator) -> Outfit:
    """Draw clothes at random."""
    armoured = chance(rng, 0.2)
    robed = not armoured and chance(rng, 0.45)
    heads = ("bare", "hood", "straw hat", "brimmed hat", "helmet")
    return Outfit(
        robed=robed,
        armoured=armoured,
        cloak=chance(rng, 0.3),
        belt=chance(rng, 0.7),
        head=choose(rng, heads, (0.3, 0.0, 0.1, 0.1, 0.5) if armoured else (0.46, 0.24, 0.14, 0.12, 0.04)),
        folds=uniform(rng, 0.004, 0.009),
        sleeve=uniform(rng, 0.2, 1.0),
        cuff=uniform(rng, 0.036, 0.062) if robed else uniform(rng, 0.03, 0.042),
        skirt=uniform(rng, 0.3, 0.46),
        boots=uniform(rng, 0.09, 0.2),
    )


def dress(
    rng: np.random.Generator,
    body: Skeleton,
    outfit: Outfit,
    girth: float,
    joints: tuple[int, int, tuple[int, int]],
    *,
    low: bool,
) -> None:
    """Add what is worn about the body, as flesh: skirts that follow the legs, belts, cloaks, hoods, plates.

    `joints` are the pelvis, the trunk and both shins.
    """
    pelvis, trunk, shins = joints
    thighs = tuple(body.joints[shin].parent for shin in shins)
    if outfit.robed:
        _robe(rng, body, girth, pelvis, thighs, shins)
    else:
        hem = max(outfit.skirt, 0.4) if low else outfit.skirt
        for thigh, side in zip(thighs, (1.0, -1.0), strict=True):
            body.flesh("cloth", thigh, (0.0, side * 0.04, 0.5), (0.0, side * 0.058, hem), 0.075, 0.08)
        body.flesh("cloth", pelvis, (0.0, 0.0, 0.54), (0.0, 0.0, 0.47), girth, 0.95 * girth)
    if outfit.belt:
        _ring(body, "belt", trunk, BELT, 1.04 * girth, 0.013)
    if outfit.armoured:
        chest = 1.14 * girth
        body.flesh("plate", trunk, (0.004, 0.0, 0.6), (0.004, 0.0, 0.72), 1.06 * girth, chest)
    if outfit.cloak:
        _cloak(rng, body, girth, trunk, low=low)


def _robe(
    rng: np.random.Generator,
    body: Skeleton,
    girth: float,
    pelvis: int,
    thighs: tuple[int, ...],
    shins: tuple[int, int],
) -> None:
    """A skirt about both legs, and what hangs between them."""
    wide = uniform(rng, 0.078, 0.105)
    for thigh, shin, side in zip(thighs, shins, (1.0, -1.0), strict=True):
        knee = (0.0, side * 0.055, 0.275)
        body.flesh("cloth", thigh, (0.0, side * 0.045, BELT - 0.05), knee, 0.078, 0.082)
        body.flesh("cloth", shin, knee, (-0.008, side * 0.06, HEM), 0.082, wide)
    ends = [np.array([body.posed(joint, point) for joint in pair]).mean(axis=0) for pair, point in (
        (thighs, (0.0, 0.0, 0.275)), (shins, (0.0, 0.0, HEM)),
    )]  # fmt: skip
    hip = np.array(body.posed(pelvis, (0.0, 0.0, 0.53)))
    middle, foot = ends
    for start, end, one, two in ((hip, middle, girth, girth), (middle, foot, girth, 1.1 * wide)):
        body.flesh("cloth", GROUND, vector(start), vector(end), one, two)


def _ring(body: Skeleton, group: str, carrier: int, height: float, radius: float, thick: float) -> None:
    """A ring of flesh about the trunk."""
    angle = np.linspace(0.0, 2 * np.pi, 13)
    points = [(float(radius * np.cos(t)), float(radius * np.sin(t)), height) for t in angle]
    for start, end in pairwise(points):
        body.flesh(group, carrier, start, end, thick, thick)


def _cloak(rng: np.random.Generator, body: Skeleton, girth: float, trunk: int, *, low: bool) -> None:
    """A sheet from the shoulders down the back, in folds, a collar about the neck."""
    length, flare = uniform(rng, 0.28, 0.62), uniform(rng, 1.0, 1.6)
    end = max(0.76 - length, 0.4 if low else 0.12)
    # Strands so near to each other at the hem that they blend into one sheet.
    strands = math.ceil(2 * flare * (girth + 0.03) / _STRAND_GAP) + 1
    for across in np.linspace(-1.0, 1.0, strands):
        start = (-0.02 - 0.05 * (1 - across**2), float(across) * (girth + 0.035), 0.785)
        deep = -(girth + 0.03) - 0.045 * (1 - across**2) - 0.012 * float(np.cos(7.0 * across))
        stop = (deep * (1.0 - 0.35 * across**2), float(across) * flare * (girth + 0.03), end)
        body.flesh("cloak", trunk, start, stop, 0.02, 0.022)
    for side in (-1.0, 1.0):
        body.flesh("cloak", trunk, (-0.03, side * 0.05, 0.812), (0.035, side * 0.05, 0.79), 0.022, 0.018)


def carried_parts(
    rng: np.random.Generator,
    body: Skeleton,
    outfit: Outfit,
    joints: tuple[int, int, int, int],
    *,
    holds: bool,
) -> list[CharacterPart]:
    """What follows one joint rigidly: hats, shoulder plates, what the hands hold.

    `joints` are the trunk, the head and both forearms.
    """
    trunk, head, left, right = joints
    parts = [*_headgear(rng, body, outfit, head)]
    if outfit.armoured:
        parts += _shoulder_plates(body, trunk)
        if chance(rng, 0.4):
            parts.append(_shield(rng, body, left))
    if holds and chance(rng, 0.75):
        parts += _in_hand(rng, body, right, sword=outfit.armoured or chance(rng, 0.2))
    return parts


def _headgear(rng: np.random.Generator, body: Skeleton, outfit: Outfit, head: int) -> list[CharacterPart]:
    up = body.aimed(head, (-0.12, 0.0, 1.0))
    if outfit.head == "straw hat":
        wide = uniform(rng, 0.12, 0.19)
        profile, base = cone_hat(wide, uniform(rng, 0.45, 0.7) * wide), body.posed(head, (-0.006, 0.0, 0.965))
        return [CharacterPart(Turned(profile, base, up), "straw", head)]
    if outfit.head == "brimmed hat":
        profile = dome(0.066, uniform(rng, 0.05, 0.1), 0.006, uniform(rng, 0.03, 0.09))
        return [CharacterPart(Turned(profile, body.posed(head, (-0.008, 0.0, 0.965)), up), "felt", head)]
    if outfit.head == "helmet":
        profile = dome(0.07, uniform(rng, 0.07, 0.11), 0.006, uniform(rng, 0.0, 0.02))
        return [CharacterPart(Turned(profile, body.posed(head, (-0.008, 0.0, 0.945)), up), "metal", head)]
    return []


def _shoulder_plates(body: Skeleton, trunk: int) -> list[CharacterPart]:
    plates = []
    for side in (-1.0, 1.0):
        base, axis = body.posed(trunk, (0.0, side * 0.12, 0.772)), body.aimed(trunk, (0.0, side * 0.7, 0.7))
        plates.append(CharacterPart(Turned(dome(0.062, 0.055, 0.006), base, axis, 20), "metal", trunk))
    return plates


def _shield(rng: np.random.Generator, body: Skeleton, arm: int) -> CharacterPart:
    start, end = (np.array(getattr(body.joints[arm], key)) for key in ("start", "end"))
    out = body.aimed(arm, (0.0, 1.0, 0.0))
    middle = vector((start + end) / 2 + 0.045 * np.array(out))
    radius = uniform(rng, 0.12, 0.2)
    return CharacterPart(Turned(dome(radius, 0.3 * radius, 0.012), middle, out, 36), "shield", arm)


def _in_hand(rng: np.random.Generator, body: Skeleton, arm: int, *, sword: bool) -> list[CharacterPart]:
    """A sword, a staff that stands on the ground, a spear, or a lamp that hangs down."""
    wrist = np.array(body.joints[arm].end)
    along = wrist - np.array(body.joints[arm].start)
    grip = wrist + 0.035 * along / np.linalg.norm(along)
    if sword:
        aim = body.aimed(arm, (1.0, 0.0, uniform(rng, -0.5, 0.2)))
        blade = Blade(vector(grip), aim, uniform(rng, 0.38, 0.56), uniform(rng, 0.011, 0.017))
        return [CharacterPart(blade, "metal", arm)]
    if chance(rng, 0.3):
        low = grip - (0.0, 0.0, 0.11)
        shell = Turned(dome(0.03, 0.02, 0.004, 0.006), vector(np.add(low, (0.0, 0.0, 0.03))), sides=20)
        handle = Staff(vector(np.add(low, (0.0, 0.0, 0.045))), 0.07, 0.004, 0.0, new_seed(rng))
        glass = CharacterPart(Turned(ball(0.032), vector(low), sides=20), "glass", arm)
        return [glass, CharacterPart(shell, "metal", arm), CharacterPart(handle, "metal", arm)]
    length = uniform(rng, 0.85, 1.3)
    staff = Staff(
        (float(grip[0]), float(grip[1]), max(0.0, float(grip[2]) - 0.75 * length)), length, 0.011,
        uniform(rng, 0.0, 0.03), new_seed(rng),
    )  # fmt: skip
    return [CharacterPart(staff, "wood", arm)]
