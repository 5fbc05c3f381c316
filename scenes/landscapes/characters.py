"""Characters: bodies in parts, with a skeleton and a motion, and how they are put on the ground.

A character faces +x, its left is +y, and its feet stand at z = 0. Its coordinates are in body units, about one
body height.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.landscapes.skeleton import Skeleton
from scenes.motion.deformations.articulated import Articulated, Joint
from scenes.motion.trajectories import key_times
from scenes.placement.assembly import anchored_object
from scenes.placement.boxes import OrientedBox
from scenes.placement.ground import GroundPlacement, Spot
from scenes.shapes.anchored import PartedShape
from scenes.shapes.nature.soft_bodies import Eyeballs, iris_repeats

SKINNED = -1
"""`CharacterPart.carried_by` of a part that is skinned instead of carried by one joint."""


@dataclass(frozen=True)
class CharacterPart:
    """One mesh of a character."""

    shape: PartedShape
    material: str
    """Name of what it is made of (`scenes.appearance.character_materials`)."""
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


def assemble_character(
    parts: tuple[CharacterPart, ...],
    body: Skeleton,
    feet: tuple[int, ...],
    leg: float,
    fringe: float,
) -> Character:
    """A character from its meshes and the skeleton's joints.

    `leg` is the length of the legs, which sets the stride; `fringe` how far fur stands out, in body units.
    """
    gait = body.gait
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
    """Put a character on the ground, where nothing else will stand; False if it may not stand there.

    `materials` gives the material index of each `CharacterPart.material`; a body unit is `unit_m` long. A
    character that walks does so in the direction of its heading, which does not change: so its parts, each a
    mesh with a centre of its own, stay together exactly.
    """
    path = _walk(placement, character, spot, unit_m)
    reach_m, height_m = character.reach * unit_m, character.height * unit_m
    half = np.array((0.6 * reach_m, 0.6 * reach_m, height_m / 2))
    for place in path if checked else ():
        if place[2] < placement.water_m:
            return False
        centre = place + np.array((0.0, 0.0, height_m / 2))
        if not placement.allows(OrientedBox(centre, half, np.eye(3))):
            return False
    axis = [place + np.array((0.0, 0.0, share * height_m)) for place in path for share in (0.1, 0.4, 0.7)]
    placement.occupy(np.array(axis), 0.16 * height_m)
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
