"""The settings of the indoor family."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from scenes.family import FamilyConfig
from scenes.random_draws import Count, Range
from stereoforge_kit.errors import InputError

ROOM_KINDS = ("living room", "bedroom", "kitchen", "office", "workshop", "corridor", "store room", "stairs")
"""The rooms there are."""


@dataclass(frozen=True)
class IndoorConfig(FamilyConfig):
    """Values are drawn uniformly from the ranges, once for each scene, room or thing, as the fields say.

    Raises ValueError for ranges from which no scene can be sampled.
    """

    crowd: ClassVar[tuple[str, ...]] = ("furniture", "things", "floating_objects")

    room_kinds: tuple[str, ...] = ROOM_KINDS
    """Which rooms there are, all equally often."""
    room_size: Range = (0.85, 1.25)
    """How large rooms are, relative to what is usual for their kind."""
    furniture: Count = (8, 20)
    """Pieces of furniture, lamps, pictures and the like that are tried for beside what every such room has."""
    things: Count = (30, 110)
    """Small things on furniture and on the floor; books count by the row."""
    floating_objects: Count = (0, 7)
    """Objects of any shape that float in the room, as in flying_things."""
    floating_size: Range = (0.03, 0.16)
    """Half extent of a floating object as a share of its depth."""
    floating_speed: Range = (0.0, 0.02)
    """Speed of a floating object as a share of its depth, per frame."""

    focal_mm: Range = (16.0, 40.0)
    """Focal length on a sensor 32 mm wide, log-uniform."""
    baseline_m: Range = (0.07, 0.4)
    """Distance between the cameras, log-uniform; less where `largest_disparity_share` asks for it."""
    largest_disparity_share: float = 0.2
    """No surface in view has a larger disparity than this share of the image width."""
    clearance_m: float = 0.25
    """Nothing but walls and floors comes nearer to a camera than this."""
    person_share: float = 0.4
    """How many cameras are held by a person; of the others, half stand on a tripod and half on a robot."""
    camera_speed_m: Range = (0.0, 0.02)
    """Speed of the camera, metres per frame."""
    camera_turn_deg: Range = (0.0, 0.8)
    """How fast the camera turns, degrees per frame."""

    plain_share: float = 0.88
    """How many of the walls, floors, cloths and fronts that come both ways are of one colour."""
    glossy_share: float = 0.18
    """How many of the surfaces that come both ways are varnished, lacquered, glazed or polished."""
    metallic_share: float = 0.5
    """How many of the parts made of metal are bare."""
    transparent_share: float = 0.7
    """How many of the things made of glass are clear."""
    glazed_share: float = 0.5
    """How many windows have panes; the others stand open. Ground truth is of the panes."""

    lamplight_share: float = 0.3
    """How many rooms are lit by lamps alone."""
    mixed_share: float = 0.3
    """How many rooms have daylight and lamps."""
    dim_share: float = 0.15
    """How many rooms are dim."""
    shutter_frames: Range = (0.2, 0.7)
    """How long the final pass's shutter is open."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("room_size", "floating_size", "focal_mm", "baseline_m"):
            if getattr(self, name)[0] <= 0:
                raise InputError(f"indoor: {name} must be above 0, got {getattr(self, name)}")
        for name in ("largest_disparity_share", "clearance_m"):
            if getattr(self, name) <= 0:
                raise InputError(f"indoor: {name} must be above 0, got {getattr(self, name)}")
        unknown = [kind for kind in self.room_kinds if kind not in ROOM_KINDS]
        if unknown or not self.room_kinds:
            raise InputError(
                f"indoor: room_kinds must be some of {', '.join(ROOM_KINDS)}, got {self.room_kinds}"
            )
