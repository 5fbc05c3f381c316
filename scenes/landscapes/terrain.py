"""What the landscape families share: land, a stereo rig that looks over it at a subject, a final pass."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.appearance.materials import Shares
from scenes.family import FamilyConfig
from scenes.motion.trajectories import KEY_SPACING_FRAMES, vector, wander
from scenes.random_draws import Count, Range, chance, log_uniform, uniform
from scenes.shapes.nature.landforms import Landscape
from scenes.spec import SENSOR_WIDTH_MM, Color, FinalPass, Fog, StereoCamera
from stereoforge_kit.errors import InputError


@dataclass(frozen=True)
class LandscapeConfig(FamilyConfig):
    """Settings that the landscape families share: a camera that looks at a character on open land."""

    focal_mm: Range = (18.0, 60.0)
    """Focal length on a sensor 32 mm wide."""
    focus_disparity_share: Range = (0.026, 0.085)
    """Disparity at the unit of depth, log-uniform, as a share of the image width (0.026 is 25 px at 960); it sets the
    baseline. In most scenes the main character stands at the unit of depth."""
    largest_disparity_share: float = 0.19
    """No surface in view has a larger disparity than about this share of the image width: 182 px at 960."""
    focus_height_share: Range = (0.4, 0.8)
    """Height of the main character, as a share of the image height, where it is neither near nor far."""
    near_share: float = 0.18
    """Share of the scenes that see the main character from close by, cut off by the image's edge, 0..1."""
    far_share: float = 0.18
    """Share of the scenes with characters in the distance, 0..1."""
    several_share: float = 0.22
    """Share of the scenes with a group, 0..1."""
    empty_share: float = 0.1
    """Share of the scenes without characters, 0..1."""
    foreground: Count = (1, 4)
    """Things that are tried for between the camera and the main character, beside its line of sight."""
    water_share: float = 0.3
    """Share of the scenes with a pond or pool, where the place has water, 0..1. Ground truth is of its surface."""
    plain_share: float = 0.35
    """How many of the cloths, hides, caps, boulders and walls that come both ways are of one colour."""
    glossy_share: float = 0.25
    """How many of the surfaces that come both ways are wet, waxed, glazed or polished."""
    metallic_share: float = 0.75
    """How many of the arms and vessels are bare metal; the others are painted."""
    transparent_share: float = 0.65
    """How many of the things of glass, ice and crystal are clear. Ground truth is of their surface."""
    camera_speed: Range = (0.0, 0.015)
    """Speed of the camera, as a share of the character's distance per frame."""
    camera_turn_deg: Range = (0.0, 0.5)
    """How fast the camera turns, degrees per frame."""
    sky_strength: Range = (0.7, 1.6)
    """Brightness of the sky's light."""
    fog_share: float = 0.4
    """Share of the scenes with fog in the final pass, 0..1."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("focal_mm", "focus_disparity_share", "focus_height_share"):
            if getattr(self, name)[0] <= 0:
                raise InputError(f"{name} must be above 0, got {getattr(self, name)}")
        if not self.focus_disparity_share[1] <= self.largest_disparity_share / 2 < 0.5:
            raise InputError(
                f"focus_disparity_share must not exceed half of largest_disparity_share, which must be below 1; got "
                f"{self.focus_disparity_share} and {self.largest_disparity_share}"
            )
        if self.near_share + self.far_share + self.several_share + self.empty_share > 1 + 1e-9:
            raise InputError(
                "near_share, far_share, several_share and empty_share must not exceed 1 together"
            )

    @property
    def shares(self) -> Shares:
        """How many surfaces are plain, glossy, bare metal and clear."""
        return Shares(self.plain_share, self.glossy_share, self.metallic_share, self.transparent_share)


@dataclass(frozen=True)
class Land:
    """The ground of a landscape (`scenes.placement.ground.Ground`); its middle is the world's origin."""

    shape: Landscape
    half_m: float
    """Half the side of the square it covers."""
    water_m: float = -math.inf
    """World z of the water in its basin."""

    @cached_property
    def _heights_m(self) -> NDArray[np.float64]:
        return self.shape.heights() * self.half_m

    def height_m(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """World z of the ground's triangles at (N, 2) world points; the rim's height beyond the rim."""
        line = self.shape.line()
        x, y = np.clip(points_m / self.half_m, -1.0, 1.0).T
        column = np.clip(np.searchsorted(line, x, side="right") - 1, 0, len(line) - 2)
        row = np.clip(np.searchsorted(line, y, side="right") - 1, 0, len(line) - 2)
        u = (x - line[column]) / (line[column + 1] - line[column])
        v = (y - line[row]) / (line[row + 1] - line[row])
        grid = self._heights_m
        a, b = grid[row, column], grid[row, column + 1]
        d, e = grid[row + 1, column], grid[row + 1, column + 1]
        # Each cell is two triangles that share the diagonal from (0, 0) to (1, 1).
        height: NDArray[np.float64] = np.where(
            u >= v, a + u * (b - a) + v * (e - b), a + v * (d - a) + u * (e - d)
        )
        return height

    def mesh_origin_m(self) -> float:
        """World z of the origin of the mesh."""
        return -self.shape.middle_height() * self.half_m


@dataclass(frozen=True)
class Focus:
    """The subject of a scene, and how the camera sees it."""

    depth_m: float
    """Distance along the optical axis."""
    size_m: float
    """Its height."""
    disparity_share: float
    """Its disparity as a share of the image width."""
    camera_height_m: float
    above_deg: float
    """Angle by which the camera looks above the subject's middle."""
    focal_mm: float
    speed_m: float
    """Of the camera, a frame."""
    turn_deg: float
    """Of the camera, a frame."""
    largest_share: float
    """`LandscapeConfig.largest_disparity_share`."""
    aim: float = 0.5
    """Height at which the camera looks, relative to the subject's."""

    @property
    def nearest_m(self) -> float:
        """Depth at which the disparity would be the largest allowed."""
        return self.depth_m * self.disparity_share / self.largest_share


def sample_camera(
    rng: np.random.Generator, config: LandscapeConfig, land: Land, focus: Focus
) -> StereoCamera:
    """A rig over the world's origin that looks along +y at the subject, on a smooth path.

    The baseline gives the subject its disparity. The path stays clear of the ground.
    """
    focal_px = focus.focal_mm / SENSOR_WIDTH_MM * config.width
    baseline_m = focus.disparity_share * config.width * focus.depth_m / focal_px
    reach_m = min(focus.speed_m * KEY_SPACING_FRAMES / 2, 0.12 * focus.depth_m)
    angle = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], -1)
    around = np.concatenate([circle * share for share in (0.0, 0.5, 1.0)]) * (reach_m + baseline_m)
    above_m = max(focus.camera_height_m, reach_m + 0.4 * focus.camera_height_m)
    camera_z_m = max(float(land.height_m(around).max()), land.water_m) + above_m
    target_m = float(land.height_m(np.array([[0.0, focus.depth_m]]))[0]) + focus.aim * focus.size_m
    pitch_deg = math.degrees(math.atan2(camera_z_m - target_m, focus.depth_m)) - focus.above_deg
    motion = wander(
        rng,
        config.frames,
        np.array((-baseline_m / 2, 0.0, camera_z_m)),
        Rotation.from_euler("XZ", (90.0 - pitch_deg, uniform(rng, -2.0, 2.0)), degrees=True),
        speed_m=focus.speed_m,
        turn_deg=focus.turn_deg,
        reach_m=reach_m,
        reach_deg=3.0,
    )
    return config.camera(focus.focal_mm, baseline_m, motion)


def half_height(focal_mm: float, config: FamilyConfig) -> float:
    """Tangent of half the vertical field of view, or of its larger part where a rig's is not in the middle."""
    if config.rig:
        return max(config.rig.cy, config.height - config.rig.cy) / config.rig.fy
    return 16.0 / focal_mm * config.height / config.width


def sample_focus(
    rng: np.random.Generator,
    config: LandscapeConfig,
    focal_mm: float,
    depth_m: float,
    size_m: float,
    camera_height_m: float,
    aim: float = 0.5,
    above: Range = (-0.05, 0.3),
) -> Focus:
    """How a camera sees a subject about mid-image, of a size, at a depth, from about a height.

    A rig of the user's own decides the disparity. The camera is raised where the image's lower edge would otherwise
    show ground nearer than allowed. It looks at the height `aim`, relative to the subject's, or `above` it by a part of
    half the field of view.
    """
    share = log_uniform(rng, *config.focus_disparity_share)
    if config.rig:
        share = config.rig.fx * config.rig.baseline_m / (depth_m * config.width)
    half_high = half_height(focal_mm, config)
    largest = config.largest_disparity_share
    height_m = max(camera_height_m, 1.3 * (half_high + 0.1) * depth_m * share / largest)
    return Focus(
        depth_m=depth_m,
        size_m=size_m,
        disparity_share=share,
        camera_height_m=height_m,
        above_deg=uniform(rng, *above) * math.degrees(half_high),
        focal_mm=focal_mm,
        speed_m=uniform(rng, *config.camera_speed) * depth_m,
        turn_deg=uniform(rng, *config.camera_turn_deg),
        largest_share=largest,
        aim=aim,
    )


def linear(srgb: tuple[int, int, int]) -> Color:
    """An 8-bit sRGB colour as linear light (IEC 61966-2-1, by its approximate exponent)."""
    red, green, blue = (round((value / 255) ** 2.2, 4) for value in srgb)
    return (red, green, blue)


def sample_final(
    rng: np.random.Generator, focus_m: float, haze: Color, fog_share: float, visibility_m: Range
) -> FinalPass:
    """A random final pass, focused on the subject.

    A share `fog_share` of the final passes has fog of the colour `haze`, with a visibility from the given range.
    """
    return FinalPass(
        shutter_frames=uniform(rng, 0.3, 0.6),
        f_number=log_uniform(rng, 1.8, 11.0),
        focus_m=focus_m,
        fog=Fog(haze, log_uniform(rng, *visibility_m)) if chance(rng, fog_share) else None,
        noise=uniform(rng, 0.0, 0.02),
        vignetting=uniform(rng, 0.0, 0.3),
        exposure_difference_ev=float(rng.normal(0.0, 0.08)),
        right_view_color=vector(np.exp(rng.normal(0.0, 0.015, 3))),
    )
