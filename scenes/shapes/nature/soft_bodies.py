"""Parts of characters: soft bodies, their fur, eyeballs, staffs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, Triangles, Vertices, icosphere, joined, scaled_normals, tube
from scenes.geometry.implicit_surfaces import blended_capsules, surface_net
from scenes.random_draws import chance, integer, log_uniform, new_seed, uniform
from scenes.shapes.anchored import PartedShape, Surface
from scenes.shapes.solids.organic import wave_noise
from scenes.spec import Vector


@dataclass(frozen=True)
class Limb:
    """A tapered capsule of flesh."""

    start: Vector
    end: Vector
    start_radius: float
    end_radius: float


@dataclass(frozen=True)
class SoftBody(PartedShape):
    """Limbs blended into one smooth body, with folds or fur if asked for: creatures, robes, statues."""

    limbs: tuple[Limb, ...]
    blend: float
    """Distance over which limbs blend into each other."""
    folds: float
    """Height of lengthwise creases, as in cloth; 0 for none."""
    tufts: int
    """Locks of fur on the skin; 0 for bare skin."""
    tuft_length: float
    comb: Vector
    """Direction in which the fur is combed; its length runs from 0 (fur stands on end) to about 1."""
    cells: int
    """Grid cells along the longest side: how finely the skin is meshed."""
    seed: int
    floor: float | None = None
    """Height at which the body is cut off level, as a robe is at its hem; None for none."""

    popularity: ClassVar[float] = 0.8
    smooth: ClassVar[bool] = True
    crease_deg: ClassVar[float | None] = None

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        """Random limbs, each growing out of another: coral, cactus, clay sculptures."""
        limbs: list[Limb] = []
        for _ in range(integer(rng, 3, 8)):
            start = limbs[int(rng.integers(len(limbs)))].end if limbs else (0.0, 0.0, 0.0)
            direction = rng.normal(size=3)
            step = direction / np.linalg.norm(direction) * uniform(rng, 0.4, 1.0)
            x, y, z = (float(value) for value in np.array(start) + step)
            limbs.append(Limb(start, (x, y, z), uniform(rng, 0.12, 0.35), uniform(rng, 0.08, 0.35)))
        furry = chance(rng, 0.4)
        return cls(
            limbs=tuple(limbs),
            blend=log_uniform(rng, 0.02, 0.12),
            folds=uniform(rng, 0.01, 0.04) if chance(rng, 0.3) else 0.0,
            tufts=integer(rng, 300, 900) if furry else 0,
            tuft_length=log_uniform(rng, 0.1, 0.35),
            comb=(0.0, 0.0, -uniform(rng, 0.0, 1.0)),
            cells=34,
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        skin = self._skin()
        if self.tufts == 0:
            return {"skin": skin}
        return {"skin": skin, "fur": self._fur(*skin)}

    def _skin(self) -> Part:
        start, end = (np.array([getattr(limb, key) for limb in self.limbs]) for key in ("start", "end"))
        radii = np.array([(limb.start_radius, limb.end_radius) for limb in self.limbs])
        widest = radii.max(axis=1, keepdims=True)
        # Blending swells the body by up to blend * log(limbs).
        margin = self.blend * np.log(len(self.limbs) + 1.0) + 2.5 * self.folds
        low = np.minimum(start - widest, end - widest).min(axis=0) - margin
        high = np.maximum(start + widest, end + widest).max(axis=0) + margin
        cell = float((high - low).max()) / self.cells
        axes = [np.arange(low[k] - 1.5 * cell, high[k] + 2.5 * cell, cell) for k in range(3)]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
        distance = blended_capsules(points, start, end, radii[:, 0], radii[:, 1], self.blend)
        if self.folds > 0:
            # Creases matter where the surface may be.
            near = np.abs(distance) < 3.0 * self.folds + 2.0 * cell
            distance[near] += self._creases(points[near])
        if self.floor is not None:
            distance = np.maximum(distance, self.floor - points[:, 2])
        vertices, triangles = surface_net(distance.reshape([len(axis) for axis in axes]))
        return vertices * cell + [axis[0] for axis in axes], triangles

    def _creases(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Noise that varies quickly around the body and slowly along it, deeper further down."""
        rng = np.random.default_rng([self.seed, 1])
        squeezed = points * (1.0, 1.0, 0.18)
        height = points[:, 2]
        depth = 1.0 - 0.6 * (height - height.min()) / np.ptp(height)
        creases: NDArray[np.float64] = self.folds * depth * wave_noise(rng, squeezed, 12.0, 0.8, 12)
        return creases

    def _fur(self, vertices: Vertices, triangles: Triangles) -> Part:
        """Pointed locks rooted a little under the skin, evenly over its area."""
        rng = np.random.default_rng([self.seed, 2])
        normals = scaled_normals(vertices, triangles)
        area = np.linalg.norm(normals, axis=1)
        chosen = rng.choice(len(triangles), self.tufts, p=area / area.sum())
        one, two = np.sort(rng.random((2, self.tufts)), axis=0)
        shares = np.stack([one, two - one, 1 - two], -1)
        root = np.einsum("nk,nkj->nj", shares, vertices[triangles[chosen]])
        outward = normals[chosen] / area[chosen, None]
        aim = outward + self.comb + rng.normal(0.0, 0.3, root.shape)
        # Combed along the skin, never into it.
        aim += np.maximum(0.45 - np.einsum("ij,ij->i", aim, outward), 0.0)[:, None] * outward
        aim /= np.linalg.norm(aim, axis=1, keepdims=True)
        length = self.tuft_length * rng.uniform(0.6, 1.3, self.tufts)
        return _locks(rng, root - 0.12 * length[:, None] * outward, aim, length)


def _locks(
    rng: np.random.Generator, root: Vertices, aim: Vertices, length: NDArray[np.float64]
) -> tuple[Vertices, Triangles]:
    """Tetrahedra with a small base (M, 3 corners) at each root and the fourth corner at its lock's tip."""
    count = len(root)
    helper = np.eye(3)[np.abs(aim).argmin(axis=1)]
    across = np.cross(aim, helper)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    other = np.cross(aim, across)
    theta = rng.uniform(0, 2 * np.pi, (count, 1)) + np.radians((0.0, 120.0, 240.0))
    ring = np.cos(theta)[..., None] * across[:, None] + np.sin(theta)[..., None] * other[:, None]
    base = root[:, None] + (0.11 * length)[:, None, None] * ring
    vertices = np.concatenate([base, (root + aim * length[:, None])[:, None]], axis=1)
    faces = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)], np.int64)
    triangles = faces[None] + 4 * np.arange(count)[:, None, None]
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3)


@dataclass(frozen=True)
class Eyeballs(PartedShape):
    """Eyeballs that look along a direction; texture coordinates are 0 in the middle of the iris."""

    centres: tuple[Vector, ...]
    gaze: Vector
    radius: float

    popularity: ClassVar[float] = 0.0
    smooth: ClassVar[bool] = True
    crease_deg: ClassVar[float | None] = None

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            centres=((0.0, -uniform(rng, 0.3, 0.5), 0.0), (0.0, uniform(rng, 0.3, 0.5), 0.0)),
            gaze=(1.0, 0.0, 0.0),
            radius=uniform(rng, 0.1, 0.29),
        )

    def parts(self) -> dict[str, Part]:
        ball, triangles = icosphere(3)
        return {"eyes": joined(*((ball * self.radius + centre, triangles) for centre in self.centres))}

    def surface(self) -> Surface:
        """The texture is projected from the front by Lambert's equal-area projection (1772), pupil in the middle."""
        eyes = super().surface()
        ball, _ = icosphere(3)
        gaze = np.array(self.gaze) / np.linalg.norm(self.gaze)
        right = np.cross(gaze, (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        up = np.cross(right, gaze)
        flat = np.sqrt(2 / np.maximum(1 + ball @ gaze, 0.02))[:, None] * (ball @ np.stack([right, up], -1))
        uv = np.tile(np.clip(flat, -2, 2) * self.radius, (len(self.centres), 1))
        return Surface(eyes.vertices, eyes.triangles, uv[eyes.triangles])


def iris_repeats(eyes: Eyeballs) -> float:
    """How often a texture must repeat to span the eyeball once, its corner in the pupil (`Material.repeats`)."""
    return 1.0 / (2 * 2.0 * eyes.radius * eyes.frame.factor)


@dataclass(frozen=True)
class Staff(PartedShape):
    """A crooked stick with a thick end: staffs, spears, clubs."""

    foot: Vector
    length: float
    radius: float
    crook: float
    """How far it strays from straight, relative to its length."""
    seed: int

    popularity: ClassVar[float] = 0.0
    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            foot=(0.0, 0.0, 0.0),
            length=1.0,
            radius=uniform(rng, 0.01, 0.03),
            crook=uniform(rng, 0.0, 0.08),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        share = np.linspace(0.0, 1.0, 20)
        aside = np.stack([np.sin(np.outer(share, rng.uniform(2.0, 7.0, 2))), np.zeros((20, 2))], -1)
        path = np.array(self.foot) + share[:, None] * np.array((0.0, 0.0, self.length))
        path[:, :2] += self.crook * self.length * aside[..., 0] * rng.choice([-1.0, 1.0], 2)
        knob = 1.0 + 1.6 * np.exp(-(((share - 0.95) / 0.04) ** 2)) - 0.3 * (1 - share)
        vertices, triangles, _ = tube(path, self.radius * knob, 8)
        return {"wood": (vertices, triangles)}
