"""Small worlds with known answers: plates facing a camera at the origin that looks along -z."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.shapes.solids.basic import Plane
from scenes.spec import Material, Scene, SceneObject, StereoCamera, SunLight, Texture, Trajectory, World
from scenes.textures.plain import SolidColor

FOCAL_MM = 32.0
"""On a 32 mm sensor the focal length is the image width in pixels."""
BASELINE_M = 1.0


@dataclass(frozen=True)
class Speckle(Texture):
    """Smooth random colours, fine enough to match and coarse enough to warp."""

    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:  # noqa: ARG003
        return cls(int(rng.integers(2**31)))

    def image(self) -> NDArray[np.uint8]:
        cells = np.random.default_rng(self.seed).integers(30, 226, (32, 32, 3))
        return np.kron(cells, np.ones((8, 8, 1))).astype(np.uint8)


@dataclass(frozen=True)
class Plate:
    """A rectangle: |x - center x| <= half width and so on, at a depth, turned about the vertical axis."""

    center: tuple[float, float]
    depth_m: float
    half: tuple[float, float]
    yaw_deg: float = 0.0

    def as_object(self, index: int) -> SceneObject:
        x, y, z, w = (float(value) for value in Rotation.from_euler("y", self.yaw_deg, True).as_quat())
        motion = Trajectory.static((*self.center, -self.depth_m), (w, x, y, z))
        return SceneObject(f"plate_{index}", Plane(), index, motion, (*self.half, 1.0))


def plates(width: int, height: int, *items: Plate) -> Scene:
    return Scene(
        family="plates",
        frames=1,
        camera=StereoCamera(width, height, FOCAL_MM, BASELINE_M, Trajectory.static()),
        objects=tuple(item.as_object(index) for index, item in enumerate(items)),
        materials=tuple(Material(Speckle(index), repeats=2.0) for index in range(len(items))),
        lights=(SunLight((0.2, -0.3, -1.0), (1.0, 1.0, 1.0), 2.0, 1.0),),
        world=World(SolidColor((200, 200, 200)), 1.0),
    )
