"""The Scene record: everything that is in a world, as plain data.

A `Scene` is what a family samples and what `datagen` renders. It knows nothing of Blender: shapes and
textures are small records of parameters that build their own numpy arrays, so the same record gives the
same geometry and the same pixels on any machine. `scenes.serialization` turns it into JSON and back.

Frames of reference
-------------------
World: right-handed, z up, metres. Camera: x right, y up, looking along -z (Blender's and OpenGL's
convention). The rig's pose is the left camera's; the right camera is `baseline_m` along the rig's own x axis.
Time is in frames; frame k of a scene is the instant t = k, k = 0 .. frames - 1.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from scenes.geometry.mesh import Mesh
from stereoforge_kit.errors import InputError

Vector = tuple[float, float, float]
Color = tuple[float, float, float]
"""Linear RGB, 0..1 for reflectances, unbounded for light."""
Quaternion = tuple[float, float, float, float]
"""(w, x, y, z), unit length."""

NAME_ON_DISK = "name_on_disk"
"""Key in a field's metadata: what the field is called in files, where that is not its own name."""
OMIT_DEFAULT = {"omit_default": True}
"""Metadata of a field that is written only where it differs from its default."""
SENSOR_WIDTH_MM = 32.0
"""Width of the sensor that focal lengths in millimetres refer to."""

IDENTITY_ROTATION: Quaternion = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Shape(ABC):
    """Parameters of one solid. Each subclass in `scenes.shapes` builds one kind of mesh."""

    popularity: ClassVar[float] = 1.0
    """How often samplers of any kind of shape draw this one, relative to the others; 0 for never."""

    @classmethod
    @abstractmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        """Draw the parameters of a random instance."""

    @abstractmethod
    def mesh(self) -> Mesh:
        """Build the mesh: centred on the origin, its longest axis spanning -1..1."""


@dataclass(frozen=True)
class Texture(ABC):
    """Parameters of one image texture. Each subclass in `scenes.textures` paints one kind of image."""

    popularity: ClassVar[float] = 1.0
    """How often samplers of any kind of texture draw this one, relative to the others; 0 for never."""

    @classmethod
    @abstractmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        """Draw the parameters of a random texture of `size` x `size` pixels."""

    @abstractmethod
    def image(self) -> NDArray[np.uint8]:
        """Paint the texture: (H, W, 3) uint8 sRGB, row 0 at the top."""


@dataclass(frozen=True)
class Deformation(ABC):
    """A non-rigid motion of one mesh. Each subclass in `scenes.motion.deformations` is one kind of motion."""

    @abstractmethod
    def deformed(self, vertices: NDArray[np.float64], time_frames: float) -> NDArray[np.float64]:
        """Vertices (V, 3) of the shape's mesh at rest to where they are at an instant, in mesh coordinates.

        A pure function, smooth in time. Vertex k is the same point of the surface at all times.
        """


GLOSSY = 0.35
"""Largest roughness of a material whose highlights show what is around it."""


@dataclass(frozen=True)
class Material:
    """How a surface reflects light: a base-colour texture and the scalars of a principled BSDF."""

    color: Texture
    repeats: float = 1.0
    """How often the texture repeats over one unit of the mesh's texture coordinates."""
    roughness: float = 1.0
    """0 a mirror, 1 chalk. Diffuse only at 1, without specular, metallic, transmission and emission."""
    specular: float = 0.0
    """Strength of the dielectric highlight, 0..1 (0.5 is common plastic)."""
    metallic: float = 0.0
    """0 a dielectric, 1 a metal."""
    transmission: float = 0.0
    """Share of the light refracted through the surface. Ground truth is of the surface itself nonetheless."""
    emission: float = 0.0
    """Emitted radiance, multiplied by the base colour."""
    thin: bool = field(default=False, metadata=OMIT_DEFAULT)
    """A sheet that light passes straight through, its share being `transmission`: window panes."""
    finish: Texture | None = field(default=None, metadata=OMIT_DEFAULT)
    """A picture of numbers over the same texture coordinates, as in glTF: green is the roughness and blue the metallic
    share. `roughness` and `metallic` are then what is usual on the surface."""
    coat: float = field(default=0.0, metadata=OMIT_DEFAULT)
    """Share of the surface that a smooth clear coat covers, whatever is below it: car paint."""

    @property
    def is_reflective(self) -> bool:
        """Whether it shows what is around or behind it: a metal, glass, a clear coat, or a gloss."""
        gloss = self.specular > 0 and self.roughness <= GLOSSY
        return self.metallic > 0 or self.transmission > 0 or self.coat > 0 or gloss


@lru_cache(maxsize=512)
def _rotation_spline(times_frames: tuple[float, ...], rotations: tuple[Quaternion, ...]) -> RotationSpline:
    """Kept, because it is slow to set up and all parts of one thing turn alike."""
    return RotationSpline(times_frames, Rotation.from_quat([(x, y, z, w) for w, x, y, z in rotations]))


@lru_cache(maxsize=512)
def _turn_at(
    times_frames: tuple[float, ...], rotations: tuple[Quaternion, ...], time_frames: float
) -> NDArray[np.float64]:
    """(3, 3) attitude at an instant."""
    matrix: NDArray[np.float64] = _rotation_spline(times_frames, rotations)(time_frames).as_matrix()
    matrix.flags.writeable = False
    return matrix


@dataclass(frozen=True)
class Trajectory:
    """A smooth rigid motion through key poses: cubic splines of positions, a rotation spline of attitudes.

    Raises ValueError for no key pose, for unequal numbers of times, positions and rotations, and for times
    that do not increase.
    """

    times_frames: tuple[float, ...]
    positions_m: tuple[Vector, ...]
    rotations: tuple[Quaternion, ...]

    def __post_init__(self) -> None:
        count = len(self.times_frames)
        if count == 0 or len(self.positions_m) != count or len(self.rotations) != count:
            raise InputError(
                f"a trajectory needs as many positions and rotations as times, and at least one; got "
                f"{count} times, {len(self.positions_m)} positions, {len(self.rotations)} rotations"
            )
        if any(b <= a for a, b in zip(self.times_frames, self.times_frames[1:], strict=False)):
            raise InputError("a trajectory's times must increase")

    @classmethod
    def static(cls, position_m: Vector = (0.0, 0.0, 0.0), rotation: Quaternion = IDENTITY_ROTATION) -> Self:
        """The trajectory of what does not move."""
        return cls(times_frames=(0.0,), positions_m=(position_m,), rotations=(rotation,))

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.times_frames, self.positions_m)

    def _position(self, time_frames: float) -> NDArray[np.float64]:
        """(3,) between the first and the last key."""
        if len(self.times_frames) > 2:
            return np.asarray(self._spline(time_frames))
        # Through two keys the spline is a line: the same bits, without setting up hundreds of splines a street.
        (start, end), (first, last) = self.times_frames, np.array(self.positions_m)
        position: NDArray[np.float64] = first + (last - first) / (end - start) * (time_frames - start)
        return position

    @cached_property
    def _resting(self) -> NDArray[np.float64]:
        """The only pose of a static object; kept, because most objects are static and are asked many times."""
        pose = np.eye(4)
        w, x, y, z = self.rotations[0]
        pose[:3, :3] = Rotation.from_quat((x, y, z, w)).as_matrix()
        pose[:3, 3] = self.positions_m[0]
        return pose

    def pose(self, time_frames: float) -> NDArray[np.float64]:
        """The (4, 4) local-to-world matrix at an instant. Outside the key times the first or last pose is held."""
        if len(self.times_frames) == 1:
            return self._resting.copy()
        pose = np.eye(4)
        time = float(np.clip(time_frames, self.times_frames[0], self.times_frames[-1]))
        pose[:3, :3] = _turn_at(self.times_frames, self.rotations, time)
        pose[:3, 3] = self._position(time)
        return pose


@dataclass(frozen=True)
class SceneObject:
    """One object of a scene: a shape, scaled along its own axes, with a material and a motion."""

    name: str
    shape: Shape
    material: int
    """Index into `Scene.materials`."""
    motion: Trajectory
    scale_m: Vector = (1.0, 1.0, 1.0)
    """Half extents: the shape's cube [-1, 1]^3 becomes a box of twice this size."""
    deformation: Deformation | None = None
    """How the mesh deforms over time, before it is scaled and moved; None for a rigid object."""
    more_materials: tuple[int, ...] = field(default=(), metadata=OMIT_DEFAULT)
    """Those of the mesh's slots from 1 on, where it has several (`Mesh.slots`)."""

    @property
    def materials(self) -> tuple[int, ...]:
        """Indices into `Scene.materials`, one for each slot of the mesh."""
        return (self.material, *self.more_materials)

    def pose(self, time_frames: float) -> NDArray[np.float64]:
        """The (4, 4) matrix from mesh coordinates to the world, scale included."""
        return self.motion.pose(time_frames) @ np.diag((*self.scale_m, 1.0))


@dataclass(frozen=True)
class StereoCamera:
    """A rectified pair of pinhole cameras: parallel axes, the same focal lengths, and the same row of the horizon.

    Pixel centres are at + 0.5, so a principal point in the middle is (width / 2, height / 2). Both cameras' are there
    and pixels are square, unless the fields after `sensor_width_mm` say otherwise.

    Raises ValueError for a size, focal length, baseline or sensor width that is not positive.
    """

    width: int
    height: int
    focal_mm: float
    """Along x."""
    baseline_m: float
    motion: Trajectory
    """Path of the left camera."""
    sensor_width_mm: float = SENSOR_WIDTH_MM
    focal_ratio: float = field(default=1.0, metadata=OMIT_DEFAULT)
    """fy / fx."""
    center_left_px: float = field(default=0.0, metadata=OMIT_DEFAULT)
    """How far right of the middle the left view's principal point is."""
    center_right_px: float = field(default=0.0, metadata=OMIT_DEFAULT)
    """How far right of the middle the right view's principal point is."""
    center_down_px: float = field(default=0.0, metadata=OMIT_DEFAULT)
    """How far below the middle both principal points are."""

    def __post_init__(self) -> None:
        for name in ("width", "height", "focal_mm", "baseline_m", "sensor_width_mm", "focal_ratio"):
            if not getattr(self, name) > 0:
                raise InputError(f"a camera's {name} must be positive, got {getattr(self, name)}")

    @property
    def focal_px(self) -> float:
        """Focal length in pixels along x."""
        return self.focal_mm / self.sensor_width_mm * self.width

    @property
    def focal_y_px(self) -> float:
        """Focal length in pixels along y."""
        return self.focal_px * self.focal_ratio

    @property
    def disparity_metres(self) -> float:
        """fx * B: what a pixel's disparity is above that of infinity, times its depth in metres."""
        return self.focal_px * self.baseline_m

    @property
    def disparity_at_infinity(self) -> float:
        """The disparity in px of what is infinitely far: cx_left - cx_right, 0 if both are in the middle."""
        return self.center_left_px - self.center_right_px

    def depth(self, disparity: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
        """Depths in metres along the optical axis of disparities in px; infinite where they are those of infinity."""
        with np.errstate(divide="ignore"):
            return np.float64(self.disparity_metres) / (
                disparity.astype(np.float64) - self.disparity_at_infinity
            )

    def principal_point(self, view: str) -> tuple[float, float]:
        """(x, y) in px where the optical axis of the "left" or "right" view meets the image."""
        center_px = {"left": self.center_left_px, "right": self.center_right_px}[view]
        return self.width / 2 + center_px, self.height / 2 + self.center_down_px

    def pose(self, view: str, time_frames: float) -> NDArray[np.float64]:
        """The (4, 4) camera-to-world matrix of the "left" or "right" view; ValueError for any other name."""
        pose = self.motion.pose(time_frames)
        if view == "right":
            pose[:3, 3] += pose[:3, 0] * self.baseline_m
        elif view != "left":
            raise InputError(f"a view is 'left' or 'right', not {view!r}")
        return pose


@dataclass(frozen=True)
class Rig:
    """A rectified stereo rig as it was calibrated, in pixels whose centres are at + 0.5.

    Raises ValueError for numbers that no rig has.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx_left: float
    cx_right: float
    cy: float
    baseline_m: float

    def __post_init__(self) -> None:
        for name in ("width", "height", "fx", "fy", "baseline_m"):
            if not 0 < getattr(self, name) < np.inf:
                raise InputError(f"a rig's {name} must be positive, got {getattr(self, name)}")
        for name, side in (("cx_left", self.width), ("cx_right", self.width), ("cy", self.height)):
            if not abs(getattr(self, name) - side / 2) <= side:
                raise InputError(
                    f"a rig's {name} must be near its image, got {getattr(self, name)} of {side} px"
                )

    @property
    def focal_mm(self) -> float:
        """Focal length along x on a sensor `SENSOR_WIDTH_MM` wide."""
        return self.fx / self.width * SENSOR_WIDTH_MM

    def camera(self, motion: Trajectory) -> StereoCamera:
        """The rig as a scene's camera on a path."""
        return StereoCamera(
            self.width,
            self.height,
            self.focal_mm,
            self.baseline_m,
            motion,
            focal_ratio=self.fy / self.fx,
            center_left_px=self.cx_left - self.width / 2,
            center_right_px=self.cx_right - self.width / 2,
            center_down_px=self.cy - self.height / 2,
        )


@dataclass(frozen=True)
class SunLight:
    """A light at infinity."""

    direction: Vector
    """Direction in which the light travels (world)."""
    color: Color
    irradiance: float
    """W/m^2 on a surface facing the sun."""
    angle_deg: float
    """Apparent diameter: small gives hard shadows."""


@dataclass(frozen=True)
class AreaLight:
    """A square lamp that shines from a position towards a target (world, metres)."""

    position_m: Vector
    target_m: Vector
    color: Color
    power_w: float
    """Emitted power, watts."""
    size_m: float
    """Side of the square."""
    spread_deg: float = field(default=180.0, metadata=OMIT_DEFAULT)
    """Angle of the cone that it shines into, with the same power: 180 for a bare lamp, less for a head lamp."""
    motion: Trajectory | None = field(default=None, metadata=OMIT_DEFAULT)
    """What carries the lamp: position and target are in the coordinates of the carrier. None for a fixed lamp."""


Light = SunLight | AreaLight


@dataclass(frozen=True)
class World:
    """The environment, at infinity: an equirectangular texture that also lights the scene."""

    environment: Texture
    strength: float = 1.0
    sampled: bool = field(default=True, metadata=OMIT_DEFAULT)
    """Whether surfaces look for its light; in a room, which sees little of it, that is mostly in vain."""


@dataclass(frozen=True)
class Fog:
    """Homogeneous fog: over a distance of `visibility_m` a surface's light falls to 1/e."""

    color: Color
    """Colour of infinitely deep fog in the image, linear RGB, 0..1 (after exposure)."""
    visibility_m: float


@dataclass(frozen=True)
class Rain:
    """Falling drops, which are streaks while the shutter is open. Each has its place, so both views show it there."""

    drops_per_m3: float
    """How many there are of those large enough to be seen."""
    streak_m: Vector
    """How far a drop falls while the shutter is open (world)."""
    diameter_m: float
    """How wide a streak is."""
    opacity: float
    """Share of the light from behind that a streak of at least a pixel's width hides, 0..1."""


@dataclass(frozen=True)
class Imperfections:
    """How a real rig's pictures differ from the ideal rig's, whose ground truth stays.

    The right view's own exposure and colour are in `FinalPass`.
    """

    lower_px: float = 0.0
    """How far everything in the right view lies too low."""
    rotation_deg: Vector = (0.0, 0.0, 0.0)
    """The right camera's rotation about its x, y and z axis (right, down, forward), in this order."""
    focal_ratio: float = 1.0
    """The right camera's focal length relative to the one it should have."""
    blur_px: tuple[float, float] = (0.0, 0.0)
    """Standard deviation of the left and the right view's blur."""
    noise: float = 0.0
    """Standard deviation of photon noise at full white and a gain of 1, 0..1; beside `FinalPass.noise`."""
    gain: tuple[float, float] = (1.0, 1.0)
    """Gain of the left and the right sensor: exposed for less, amplified by as much."""
    jpeg_quality: int = 0
    """Both pictures have been JPEG files of this quality, 1..100; 0 for never."""


@dataclass(frozen=True)
class FinalPass:
    """What the final pass adds to the clean one. Ground truth is the same for both."""

    shutter_frames: float = 0.5
    """Motion blur: how long the shutter is open, centred on the frame's instant; 0 for none."""
    f_number: float = 0.0
    """Defocus: focal length over aperture; 0 for a pinhole."""
    focus_m: float = 10.0
    """Distance of sharpest focus along the optical axis."""
    fog: Fog | None = None
    noise: float = 0.0
    """Standard deviation of sensor noise at full white, 0..1; photon noise, so it grows with the root of light."""
    vignetting: float = 0.0
    """Share of the light lost in the corners, 0..1."""
    exposure_difference_ev: float = 0.0
    """The right view's exposure relative to the left's, in stops."""
    # The record's text seeds the sensor's noise, so another name in files would be another final pass.
    right_view_color: Color = field(default=(1.0, 1.0, 1.0), metadata={NAME_ON_DISK: "right_eye_color"})
    """The right view's colour balance relative to the left's: a gain for each RGB channel."""
    imperfections: Imperfections = field(default_factory=Imperfections, metadata=OMIT_DEFAULT)
    """Residual errors of the rig, and differences between its cameras."""
    rain: Rain | None = field(default=None, metadata=OMIT_DEFAULT)
    """Drops in the air. Ground truth is of what is behind them."""


@dataclass(frozen=True)
class Scene:
    """A world, the stereo rig that looks at it, and the number of frames.

    Raises ValueError for an object whose material index is out of range.
    """

    family: str
    frames: int
    camera: StereoCamera
    objects: tuple[SceneObject, ...]
    materials: tuple[Material, ...]
    lights: tuple[Light, ...]
    world: World
    exposure_key: float = 0.18
    """Mean level of the image after automatic exposure, linear, 0..1 (0.18 is middle grey)."""
    final: FinalPass = field(default_factory=FinalPass)
    notes: dict[str, float] = field(default_factory=dict)
    """Numbers that the sampler records beside the scene. Rendering does not use them."""

    def __post_init__(self) -> None:
        for thing in self.objects:
            for material in thing.materials:
                if not 0 <= material < len(self.materials):
                    raise InputError(
                        f"object {thing.name!r} has material {material} of {len(self.materials)}"
                    )
