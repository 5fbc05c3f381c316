"""Setting things up on land before a camera: what families of landscapes share.

The camera stands over the world's origin and looks along +y. Things stand on the land, never in the way of
the camera's path, never between it and what the scene is about, and none of them fills the view.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.appearance.material_textures import TextureSampler
from scenes.landscapes.characters import Character
from scenes.landscapes.terrain import Land, camera_positions
from scenes.motion.deformations.sway import Sway
from scenes.motion.trajectories import key_times, quaternion, vector
from scenes.random_draws import log_uniform, uniform
from scenes.shapes.anchored import Frame, PartedShape
from scenes.shapes.nature.creatures import Eyeballs, iris_repeats
from scenes.spec import Deformation, Material, Scene, SceneObject, Shape, StereoCamera, Texture, Trajectory

_LARGEST_COVER = 0.45
"""Share of the image that the box about one thing may take."""


@lru_cache(maxsize=256)
def frame_of(shape: Shape) -> Frame:
    """How a shape's mesh lies about its foot; a shape without one stands on its lowest point."""
    if isinstance(shape, PartedShape):
        return shape.frame()
    vertices = shape.mesh().vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    foot = np.array((0.0, 0.0, low[2]))
    return Frame(-foot, 1.0, low - foot, high - foot)


@dataclass(frozen=True)
class Spot:
    """A place on the land."""

    ground_m: NDArray[np.float64]
    """(3,) world point."""
    depth_m: float
    heading_rad: float = 0.0


@dataclass(frozen=True)
class Box:
    """The box about a thing, in the world."""

    corners: NDArray[np.float64]
    """(8, 3)."""
    centre: NDArray[np.float64]
    half: NDArray[np.float64]
    turn: NDArray[np.float64]
    """(3, 3) from the box's axes to the world's."""

    def distance_m(self, points: NDArray[np.float64]) -> float:
        """From the nearest of (N, 3) points to the box; 0 inside."""
        local = np.abs((points - self.centre) @ self.turn)
        return float(np.linalg.norm(np.maximum(local - self.half, 0.0), axis=1).min())


class GroundPlacement:
    """A scene being set up: the land, the camera, and what has been placed so far."""

    def __init__(self, land: Land, camera: StereoCamera, frames: int, clearance_m: float) -> None:
        self.land, self.camera, self.frames = land, camera, frames
        self.objects: list[SceneObject] = []
        self.materials: list[Material] = []
        self.clearance_m = clearance_m
        """How near to either eye anything may come."""
        self.pose = camera.pose("left", (frames - 1) / 2)
        self._eyes = camera_positions(camera, frames)
        self._kept_free: list[tuple[float, float, float]] = []
        """Image columns (low, high, -1..1) before which nothing may stand, up to a depth in metres."""

    @property
    def half_view(self) -> tuple[float, float]:
        """Tangents of half the horizontal and half the vertical field of view."""
        focal_px = self.camera.focal_px
        return self.camera.width / 2 / focal_px, self.camera.height / 2 / focal_px

    def material(self, material: Material) -> int:
        self.materials.append(material)
        return len(self.materials) - 1

    def wear(
        self,
        rng: np.random.Generator,
        stuff: TextureSampler,
        unit_m: float,
        depth_m: float,
        *,
        size: int = 256,
        gloss: float = 0.0,
        emission: float = 0.0,
    ) -> int:
        """A new material for things whose mesh unit is `unit_m` long and which stand at about `depth_m`.

        Its texture's pixels are then about as large as the image's.
        """
        texture: Texture = stuff(rng, size)
        unit_px = unit_m * self.camera.focal_px / depth_m
        repeats = max(unit_px / (size * log_uniform(rng, 0.8, 1.8)), 0.05)
        return self.material(
            Material(
                color=texture,
                repeats=repeats,
                roughness=1.0 if gloss == 0.0 else 0.35,
                specular=gloss,
                emission=emission,
            )
        )

    def spot(self, right: float, depth_m: float, heading_rad: float = 0.0) -> Spot:
        """The ground at an image column (-1..1 is the frame) and a depth."""
        across = right * self.half_view[0] * depth_m + self.camera.baseline_m / 2
        place = self.pose[:3, 3] + across * self.pose[:3, 0] - depth_m * self.pose[:3, 2]
        place = place.copy()
        # Along the ground the depth counts, not the distance along the inclined axis.
        flat = place[None, :2]
        place[2] = float(self.land.height_m(flat)[0])
        return Spot(place, depth_m, heading_rad)

    def scatter(self, rng: np.random.Generator, depths_m: tuple[float, float], spread: float = 1.25) -> Spot:
        """A random spot in view: depths log-uniform, columns uniform to `spread` half widths."""
        return self.spot(
            uniform(rng, -spread, spread), log_uniform(rng, *depths_m), uniform(rng, 0.0, 2 * math.pi)
        )

    def keep_free(self, right: float, half_width: float, depth_m: float) -> None:
        """Let nothing stand before what is at an image column and depth."""
        self._kept_free.append((right - half_width, right + half_width, depth_m))

    def box_of(self, shape: Shape, spot: Spot, scale_m: float, sunk_m: float, lean: Rotation | None) -> Box:
        frame = frame_of(shape)
        rotation = self._turn(spot, lean)
        middle, half = (frame.low + frame.high) / 2, (frame.high - frame.low) / 2
        foot = spot.ground_m - (0.0, 0.0, sunk_m)
        centre = foot + rotation.apply(middle * scale_m)
        signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        corners = centre + rotation.apply(signs * half * scale_m)
        return Box(corners, centre, half * scale_m, rotation.as_matrix())

    @staticmethod
    def _turn(spot: Spot, lean: Rotation | None) -> Rotation:
        upright = Rotation.from_euler("Z", spot.heading_rad)
        return upright if lean is None else upright * lean

    def allows(self, box: Box) -> bool:
        """Whether a thing in this box leaves the cameras and the view of the focus free."""
        if box.distance_m(self._eyes) < self.clearance_m:
            return False
        local = (box.corners - self.pose[:3, 3]) @ self.pose[:3, :3]
        depth = -local[:, 2]
        if depth.max() <= 0:
            return True
        across, high = self.half_view
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
        scale_m: float,
        *,
        sunk_m: float = 0.0,
        lean: Rotation | None = None,
        deformation: Deformation | None = None,
        on_lowest: bool = False,
        checked: bool = True,
    ) -> bool:
        """Stand a shape with its foot on the land, one built unit `scale_m` long; False if it may not.

        `on_lowest` puts broad things as deep as the lowest ground under them, so that no corner hangs free.
        """
        if on_lowest:
            sunk_m += self._fall_below(shape, spot, scale_m)
        if checked and not self.allows(self.box_of(shape, spot, scale_m, sunk_m, lean)):
            return False
        frame = frame_of(shape)
        rotation = self._turn(spot, lean)
        place = spot.ground_m - (0.0, 0.0, sunk_m) + rotation.apply(frame.centre * scale_m)
        scale = scale_m / frame.factor
        motion = Trajectory.static(vector(place), quaternion(rotation))
        self.objects.append(SceneObject(name, shape, material, motion, (scale, scale, scale), deformation))
        return True

    def stand_in_parts(
        self,
        name: str,
        shape: PartedShape,
        materials: dict[str, int],
        spot: Spot,
        scale_m: float,
        *,
        on_lowest: bool = False,
    ) -> bool:
        """Stand the parts of one thing together, each in its own material; all of them or none."""
        sunk_m = self._fall_below(shape, spot, scale_m) if on_lowest else 0.01 * scale_m
        if not self.allows(self.box_of(shape, spot, scale_m, sunk_m, None)):
            return False
        for part in (replace(shape, only=name) for name in shape.part_names()):
            self.stand(
                f"{name} {part.only}",
                part,
                materials[part.only],
                spot,
                scale_m,
                sunk_m=sunk_m,
                checked=False,
            )
        return True

    def hang(
        self,
        name: str,
        shape: Shape,
        material: int,
        spot: Spot,
        height_m: float,
        scale_m: float,
        *,
        deformation: Deformation | None = None,
    ) -> bool:
        """Hang a shape by its foot, `height_m` over the ground; turned over if it grows upward."""
        over = Rotation.from_euler("X", math.pi) if frame_of(shape).high[2] > 1e-6 else None
        return self.stand(
            name, shape, material, spot, scale_m, sunk_m=-height_m, lean=over, deformation=deformation
        )

    def swaying(self, rng: np.random.Generator, shape: Shape, tip_share: float) -> Sway:
        """A gentle sway of a plant about its foot; its tip moves by `tip_share` of its height."""
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

    def _fall_below(self, shape: Shape, spot: Spot, scale_m: float) -> float:
        """How far the lowest ground under a thing's plan is below its spot."""
        frame = frame_of(shape)
        corners = np.array(
            [
                (x, y, 0.0)
                for x in (frame.low[0], 0.0, frame.high[0])
                for y in (frame.low[1], 0.0, frame.high[1])
            ]
        )
        under = spot.ground_m + self._turn(spot, None).apply(corners * scale_m)
        return float(spot.ground_m[2] - self.land.height_m(under[:, :2]).min())

    def character(
        self,
        name: str,
        character: Character,
        stuffs: dict[str, int],
        spot: Spot,
        scale_m: float,
        *,
        checked: bool = True,
    ) -> bool:
        """Put a character on the land, walking where it faces if it walks; False if it may not stand there.

        `stuffs` gives the material of each stuff. Its heading does not change, so that its parts, each a
        mesh with a centre of its own, stay together exactly.
        """
        path = self._walk(character, spot, scale_m)
        reach = np.array((character.reach, character.reach, character.height)) * scale_m
        for place in path:
            centre = place + np.array((0.0, 0.0, reach[2] / 2))
            half = np.array((0.6 * reach[0], 0.6 * reach[1], reach[2] / 2))
            signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
            if checked and not self.allows(Box(centre + signs * half, centre, half, np.eye(3))):
                return False
        rotation = Rotation.from_euler("Z", spot.heading_rad)
        times = tuple(float(time) for time in key_times(self.frames))
        for index, part in enumerate(character.parts):
            frame = part.shape.frame()
            offset = rotation.apply(frame.centre * scale_m)
            motion = Trajectory(
                times, tuple(vector(place + offset) for place in path), (quaternion(rotation),) * len(times)
            )
            scale = scale_m / frame.factor
            self.objects.append(
                SceneObject(
                    f"{name} {part.stuff} {index}",
                    part.shape,
                    self._part_material(part.shape, stuffs[part.stuff]),
                    motion,
                    (scale, scale, scale),
                    character.deformation(part),
                )
            )
        return True

    def _part_material(self, shape: PartedShape, material: int) -> int:
        """Eyes of each size need the picture laid on to that size."""
        if not isinstance(shape, Eyeballs):
            return material
        return self.material(replace(self.materials[material], repeats=iris_repeats(shape)))

    def _walk(self, character: Character, spot: Spot, scale_m: float) -> list[NDArray[np.float64]]:
        """Where a character's foot point is at the key times, on the ground throughout."""
        step = np.array((math.cos(spot.heading_rad), math.sin(spot.heading_rad))) * character.stride * scale_m
        places = []
        for time in key_times(self.frames):
            flat = spot.ground_m[:2] + step * (time - (self.frames - 1) / 2)
            places.append(np.array((*flat, float(self.land.height_m(flat[None])[0]))))
        return places

    def ground(self, rng: np.random.Generator, stuff: TextureSampler, sharp_m: float) -> None:
        """The land itself; its texture is sharp where it is `sharp_m` away."""
        material = self.wear(rng, stuff, self.land.half_m, sharp_m, size=512)
        motion = Trajectory.static((0.0, 0.0, self.land.rest_m()))
        half = self.land.half_m
        self.objects.append(SceneObject("ground", self.land.shape, material, motion, (half, half, half)))

    def scene(self, base: Scene) -> Scene:
        """`base` with everything placed here in it."""
        return replace(base, objects=tuple(self.objects), materials=tuple(self.materials))
