"""Standing things on ground before a camera that looks along it.

The camera stands about over the world's origin and looks along +y. Things stand on the ground, never in the
way of the cameras' path, never between them and the subject of the scene, and none of them fills the view.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.appearance.material_textures import TextureSampler
from scenes.appearance.materials import FINISHES, Finish, texture_repeats
from scenes.motion.deformations.sway import Sway
from scenes.placement.assembly import Assembly, anchored_object
from scenes.placement.boxes import OrientedBox
from scenes.placement.view import View, camera_positions
from scenes.random_draws import Range, log_uniform, uniform
from scenes.shapes.anchored import PartedShape, frame_of
from scenes.spec import Deformation, Material, Scene, SceneObject, Shape, StereoCamera, Trajectory

_LARGEST_COVER = 0.45
"""Share of the image that the bounding box of one thing may cover."""
_TEXEL_PX: Range = (0.8, 1.8)
"""Image pixels that one texture pixel covers where a thing stands."""


class Ground(Protocol):
    """The ground of a scene, as far as placing things on it goes."""

    @property
    def shape(self) -> Shape:
        """The shape that shows it."""
        ...

    @property
    def half_m(self) -> float:
        """Half the side of the square it covers."""
        ...

    def height_m(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N,) world z at (N, 2) world points."""
        ...

    def mesh_origin_m(self) -> float:
        """World z of the origin of its mesh."""
        ...


def ground_object(ground: Ground, material: int) -> SceneObject:
    """The object that shows the ground."""
    motion = Trajectory.static((0.0, 0.0, ground.mesh_origin_m()))
    return SceneObject("ground", ground.shape, material, motion, (ground.half_m,) * 3)


@dataclass(frozen=True)
class Spot:
    """A place on the ground."""

    ground_m: NDArray[np.float64]
    """(3,) world point."""
    depth_m: float
    """Along the cameras' optical axis, half way through the scene."""
    heading_rad: float = 0.0
    """Where the x axis of what stands there points, from the world's x axis towards its y axis."""


class GroundPlacement(Assembly):
    """A scene that is being assembled on ground, before a camera."""

    def __init__(
        self,
        ground: Ground,
        camera: StereoCamera,
        frames: int,
        clearance_m: float,
        water_m: float = -math.inf,
    ) -> None:
        """Nothing that is checked comes nearer than `clearance_m` to either camera, or stands in water.

        `water_m` is the world z of the water's surface.
        """
        super().__init__()
        self.water_m = water_m
        self.ground, self.frames = ground, frames
        self.view = View(camera, frames)
        self.pose = self.view.pose
        """(4, 4) from the left camera to the world, half way through the scene."""
        self.clearance_m = clearance_m
        self._cameras = camera_positions(camera, frames)
        self._kept_free: list[tuple[float, float, float]] = []
        """Image columns (low, high, -1..1) before which nothing may stand, up to a depth in metres."""
        self._occupied: list[tuple[NDArray[np.float64], float]] = []
        """World points (N, 3), and how near to them nothing may come."""

    def new_material(
        self,
        rng: np.random.Generator,
        texture_sampler: TextureSampler,
        unit_m: float,
        depth_m: float,
        *,
        size: int = 256,
        finish: Finish = FINISHES["matte"],
        emission: float = 0.0,
        largest_m: float = math.inf,
    ) -> int:
        """The index of a new material for things that stand at about `depth_m`.

        A unit of their texture coordinates is `unit_m` long; the texture, `size` pixels wide, repeats so that
        its pixels are about as large as the image's, and at least every `largest_m`.
        """
        texture = texture_sampler(rng, size)
        unit_px = unit_m * self.view.camera.focal_px / depth_m
        return self.material(
            Material(
                color=texture,
                repeats=max(texture_repeats(rng, unit_px, size, _TEXEL_PX), unit_m / largest_m, 0.05),
                roughness=uniform(rng, *finish.roughness),
                specular=uniform(rng, *finish.specular),
                metallic=uniform(rng, *finish.metallic),
                transmission=uniform(rng, *finish.transmission),
                emission=emission,
            )
        )

    def spot(self, right: float, depth_m: float, heading_rad: float = 0.0) -> Spot:
        """The ground at an image column (the frame is -1..1) and a depth."""
        across = right * self.view.half_view[0] * depth_m + self.view.camera.baseline_m / 2
        place = self.pose[:3, 3] + across * self.pose[:3, 0] - depth_m * self.pose[:3, 2]
        # Along the ground the depth counts, not the distance along the inclined axis.
        place[2] = float(self.ground.height_m(place[None, :2])[0])
        return Spot(place, depth_m, heading_rad)

    def spot_at(self, plan_m: NDArray[np.float64], heading_rad: float = 0.0) -> Spot:
        """The ground at a world point (2,) of the ground plan."""
        place = np.array((*plan_m, float(self.ground.height_m(plan_m[None])[0])))
        depth = float((self.pose[:3, 3] - place) @ self.pose[:3, 2])
        return Spot(place, depth, heading_rad)

    def is_wet(self, spot: Spot) -> bool:
        """Whether a spot is under water."""
        return bool(spot.ground_m[2] < self.water_m)

    def random_spot(
        self, rng: np.random.Generator, depths_m: tuple[float, float], spread: float = 1.25
    ) -> Spot:
        """A random spot in view: depths log-uniform, columns uniform to `spread` half widths, any heading."""
        return self.spot(
            uniform(rng, -spread, spread), log_uniform(rng, *depths_m), uniform(rng, 0.0, 2 * math.pi)
        )

    def keep_view_free(self, right: float, half_width: float, depth_m: float) -> None:
        """Let nothing stand before what is at an image column (-1..1) and a depth."""
        self._kept_free.append((right - half_width, right + half_width, depth_m))

    def occupy(self, points_m: NDArray[np.float64], radius_m: float) -> None:
        """Let nothing that is checked come nearer than `radius_m` to world points (N, 3) from now on."""
        self._occupied.append((points_m, radius_m))

    def box_of(
        self, shape: Shape, spot: Spot, unit_m: float, sunk_m: float = 0.0, lean: Rotation | None = None
    ) -> OrientedBox:
        """The bounding box, in the world, of a shape that would stand at a spot (see `stand`)."""
        frame, rotation = frame_of(shape), _attitude(spot, lean)
        middle, half = (frame.low + frame.high) / 2, (frame.high - frame.low) / 2
        foot = spot.ground_m - (0.0, 0.0, sunk_m)
        return OrientedBox(foot + rotation.apply(middle * unit_m), half * unit_m, rotation.as_matrix())

    def allows(self, box: OrientedBox) -> bool:
        """Whether a thing in this box leaves the cameras and the view of the subject free."""
        if box.distance(self._cameras) < self.clearance_m:
            return False
        if any(box.distance(points) < radius_m for points, radius_m in self._occupied):
            return False
        local = (box.corners - self.pose[:3, 3]) @ self.pose[:3, :3]
        depth = -local[:, 2]
        if depth.max() <= 0:
            return True
        across, high = self.view.half_view
        near = np.maximum(depth, 0.05)
        x, y = local[:, 0] / (near * across), local[:, 1] / (near * high)
        wide = np.clip(x.max(), -1, 1) - np.clip(x.min(), -1, 1)
        tall = np.clip(y.max(), -1, 1) - np.clip(y.min(), -1, 1)
        if wide * tall / 4 > _LARGEST_COVER:
            return False
        return not any(
            depth.min() < behind and x.max() > low and x.min() < right and y.max() > -0.75
            for low, right, behind in self._kept_free
        )

    def stand(
        self,
        name: str,
        shape: Shape,
        material: int,
        spot: Spot,
        unit_m: float,
        *,
        sunk_m: float = 0.0,
        lean: Rotation | None = None,
        deformation: Deformation | None = None,
        on_lowest: bool = False,
        checked: bool = True,
        wades: bool = False,
    ) -> bool:
        """Stand a shape on the ground by its anchor; False if it may not stand there.

        A unit of its built coordinates is `unit_m` long. `sunk_m` is how deep it stands in the ground, `lean`
        a rotation before its heading is applied. `on_lowest` sinks broad things to the lowest ground under
        them, so that no corner hangs free. What is not `checked` may stand anywhere, what `wades` also in water.
        """
        if on_lowest:
            sunk_m += self._fall_below(shape, spot, unit_m)
        if checked and not wades and self.is_wet(spot):
            return False
        if checked and not self.allows(self.box_of(shape, spot, unit_m, sunk_m, lean)):
            return False
        foot = spot.ground_m - (0.0, 0.0, sunk_m)
        rotation = _attitude(spot, lean)
        self.add(
            anchored_object(name, shape, material, [foot], [rotation], unit_m=unit_m, deformation=deformation)
        )
        return True

    def stand_in_parts(
        self,
        name: str,
        shape: PartedShape,
        materials: dict[str, int],
        spot: Spot,
        unit_m: float,
        *,
        on_lowest: bool = False,
    ) -> bool:
        """Stand the parts of one thing together, each in the material of its name; all of them or none."""
        sunk_m = self._fall_below(shape, spot, unit_m) if on_lowest else 0.01 * unit_m
        if self.is_wet(spot) or not self.allows(self.box_of(shape, spot, unit_m, sunk_m)):
            return False
        for part in (replace(shape, only=part_name) for part_name in shape.part_names()):
            material = materials[part.only]
            self.stand(f"{name} {part.only}", part, material, spot, unit_m, sunk_m=sunk_m, checked=False)
        return True

    def hang(
        self,
        name: str,
        shape: Shape,
        material: int,
        spot: Spot,
        height_m: float,
        unit_m: float,
        *,
        deformation: Deformation | None = None,
    ) -> bool:
        """Hang a shape by its anchor, `height_m` above the ground; turned over if it grows upward."""
        over = Rotation.from_euler("X", math.pi) if frame_of(shape).high[2] > 1e-6 else None
        return self.stand(
            name, shape, material, spot, unit_m, sunk_m=-height_m, lean=over, deformation=deformation
        )

    def _fall_below(self, shape: Shape, spot: Spot, unit_m: float) -> float:
        """How far the lowest ground under a thing's plan is below its spot."""
        frame = frame_of(shape)
        corners = np.array(
            [
                (x, y, 0.0)
                for x in (frame.low[0], 0.0, frame.high[0])
                for y in (frame.low[1], 0.0, frame.high[1])
            ]
        )
        under = spot.ground_m + _attitude(spot).apply(corners * unit_m)
        return float(spot.ground_m[2] - self.ground.height_m(under[:, :2]).min())

    def lay_ground(self, rng: np.random.Generator, texture_sampler: TextureSampler, sharp_m: float) -> None:
        """Add the ground itself; its texture is sharp where it is `sharp_m` away."""
        material = self.new_material(rng, texture_sampler, self.ground.half_m, sharp_m, size=512)
        self.add(ground_object(self.ground, material))

    def scene(self, base: Scene) -> Scene:
        """`base` with all materials and objects placed here."""
        return replace(base, objects=self.objects, materials=tuple(self.materials))


def _attitude(spot: Spot, lean: Rotation | None = None) -> Rotation:
    upright = Rotation.from_euler("Z", spot.heading_rad)
    return upright if lean is None else upright * lean


def sway_of(rng: np.random.Generator, shape: Shape, tip_share: float) -> Sway:
    """A gentle sway of a plant about its anchor; its tip moves by `tip_share` of its height."""
    frame = frame_of(shape)
    root, top, bottom = (
        float((z - frame.centre[2]) * frame.factor) for z in (0.0, frame.high[2], frame.low[2])
    )
    tip = top if top - root > root - bottom else bottom
    return Sway(
        amplitude=tip_share * abs(tip - root),
        direction_deg=uniform(rng, 0.0, 360.0),
        period_frames=uniform(rng, 20.0, 60.0),
        phase=uniform(rng, 0.0, 1.0),
        root=root,
        tip=tip,
    )
