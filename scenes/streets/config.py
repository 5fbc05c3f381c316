"""The settings of the driving family."""

from __future__ import annotations

from dataclasses import dataclass

from scenes.appearance.materials import Shares
from scenes.family import FamilyConfig
from scenes.random_draws import Count, Range
from stereoforge_kit.errors import InputError


@dataclass(frozen=True)
class DrivingConfig(FamilyConfig):
    """Values are drawn uniformly from the ranges, once for each scene or once for each thing, as the fields say.

    Raises ValueError for ranges from which no street can be sampled.
    """

    crowd = ("parked_share", "pedestrians_per_100m", "furniture_per_100m")
    sparsity = ("headway_m", "tree_spacing_m", "lamp_spacing_m")

    focal_lengths_mm: tuple[float, ...] = (13.0, 15.0, 20.0, 26.0, 35.0, 50.0)
    """Focal lengths to choose from, on a sensor 32 mm wide."""
    baseline_m: Range = (0.25, 1.2)
    """Distance between the cameras; made smaller where the road would come nearer than allowed."""
    largest_disparity_share: float = 0.2
    """Nothing in view has a larger disparity, as a share of the image width: 192 px at 960."""
    clearance_m: float = 1.0
    """Distance that everything but the road keeps from both cameras at all times."""
    camera_height_m: Range = (1.4, 2.2)
    """Height of the cameras above the road."""
    pitch_deg: Range = (-3.0, 5.0)
    """How far the camera looks down."""
    roll_deg: Range = (-2.0, 2.0)
    """Roll of the camera."""
    yaw_deg: Range = (-6.0, 6.0)
    """Yaw of the camera from the street's direction."""
    slow_m: Range = (0.15, 0.5)
    """Metres per frame of a slow drive."""
    fast_m: Range = (0.7, 1.6)
    """Metres per frame of a fast drive (1.4 is 50 km/h at 10 frames per second)."""
    fast_share: float = 0.5
    """How many scenes are driven fast."""
    backwards_share: float = 0.5
    """How many scenes are driven backwards."""
    left_hand_share: float = 0.4
    """How many scenes have traffic that keeps to the left."""
    straight_share: float = 0.25
    """How many streets are straight."""
    bend_deg: Range = (6.0, 32.0)
    """How much a winding street may turn within 50 m."""
    junction_share: float = 0.35
    """How many streets have a side street in view, or one on either side."""
    view_m: Range = (100.0, 170.0)
    """Length of the street before the camera."""
    lanes: Count = (1, 2)
    """Lanes in each direction."""
    lane_m: Range = (2.9, 3.6)
    """Width of a lane."""
    pavement_m: Range = (1.8, 4.5)
    """Width of each pavement."""
    kerb_m: Range = (0.08, 0.16)
    """Height of the kerbs."""
    headway_m: Range = (7.0, 60.0)
    """Mean gap between the vehicles of a lane, drawn once a lane."""
    parked_share: Range = (0.0, 0.9)
    """How many of the parking places of a side are taken."""
    large_vehicle_share: Range = (0.05, 0.4)
    """How many vehicles are vans, lorries or buses."""
    pedestrians_per_100m: Range = (0.0, 18.0)
    """People on each pavement."""
    tree_spacing_m: Range = (7.0, 18.0)
    """Distance between the trees of a row."""
    lamp_spacing_m: Range = (18.0, 34.0)
    """Distance between the lamp posts of a row."""
    furniture_per_100m: Range = (2.0, 16.0)
    """Signs, bins, bollards, benches, cabinets, shelters on each pavement."""
    largest_cover_share: float = 0.35
    """No vehicle covers a larger share of the view than this."""
    close_wall_share: float = 0.25
    """How many sides have a wall, a fence or a railing close to the lane along a part of the street."""

    night_share: float = 0.15
    """How many scenes are lit by street lamps, head lamps, shops and windows alone."""
    dusk_share: float = 0.12
    """How many scenes are lit by the last of the daylight and by lamps."""
    overcast_share: float = 0.35
    """How many of the scenes by day have no hard shadows; those in which it rains all have none."""
    low_sun_share: float = 0.3
    """How many of the other scenes by day have a sun low above the horizon."""
    rain_share: float = 0.18
    """How many scenes have rain: a wet street, and drops in the final pass."""
    wet_share: float = 0.1
    """How many of the other scenes have a street that is still wet."""
    shutter_frames: Range = (0.2, 0.7)
    """How long the final pass's shutter is open."""

    plain_share: float = 0.4
    """How many of the surfaces that come both ways are of one colour: walls close by, the sides of vans and lorries,
    boards, clothes."""
    glossy_share: float = 0.75
    """How many vehicles have a clear coat that reflects; the others are dull or dirty."""
    metallic_share: float = 0.35
    """How many paints of vehicles are metallic, and how many posts, railings and bins are bare metal."""
    transparent_share: float = 0.7
    """How many windows of cars, shops and shelters are clear glass with something behind; the others are dark or
    papered over. Ground truth is of the panes."""

    @property
    def shares(self) -> Shares:
        """How often surfaces that come both ways are of one kind."""
        return Shares(self.plain_share, self.glossy_share, self.metallic_share, self.transparent_share)

    def __post_init__(self) -> None:
        super().__post_init__()
        positive = ("baseline_m", "camera_height_m", "lane_m", "pavement_m", "kerb_m", "headway_m", "view_m")
        for name in (*positive, "tree_spacing_m", "lamp_spacing_m", "lanes"):
            if getattr(self, name)[0] <= 0:
                raise InputError(f"driving: {name} must be above 0, got {getattr(self, name)}")
        if not self.focal_lengths_mm or min(self.focal_lengths_mm) <= 0:
            raise InputError(f"driving: focal_lengths_mm must be above 0, got {self.focal_lengths_mm}")
        if self.largest_disparity_share <= 0:
            raise InputError("driving: largest_disparity_share must be above 0")
        if self.largest_cover_share <= 0:
            raise InputError("driving: largest_cover_share must be above 0")
        if self.night_share + self.dusk_share > 1:
            raise InputError(
                f"driving: night_share and dusk_share must add up to at most 1, got {self.night_share} and "
                f"{self.dusk_share}"
            )
        if self.shutter_frames[0] < 0:
            raise InputError(f"driving: shutter_frames must not be negative, got {self.shutter_frames}")
