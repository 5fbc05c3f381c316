"""Things flying in front of a cluttered landscape, after FlyingThings3D (Mayer et al. 2016).

Static objects stand on a large textured ground; in front of them other objects fly on smooth paths. A moving
stereo camera sees them all. Every length scales with the nearest allowed depth, so the images
of a rig with a small baseline look like those of one with a large baseline.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.appearance.lights import sample_area_light, sample_sun
from scenes.appearance.materials import SurfaceShares, sample_material
from scenes.family import Family, FamilyConfig, crowd_share
from scenes.motion.trajectories import exposure_times, quaternion, shifted, vector, wander
from scenes.placement.assembly import Assembly
from scenes.placement.ground import ground_object
from scenes.placement.view import View
from scenes.random_draws import Count, Range, chance, choose, integer, log_uniform, new_seed, uniform
from scenes.shapes import SHAPES
from scenes.shapes.solids.organic import Terrain
from scenes.spec import (
    AreaLight,
    FinalPass,
    Light,
    Material,
    Scene,
    SceneObject,
    Shape,
    SunLight,
    Trajectory,
    World,
)
from scenes.textures.sky import Sky
from scenes.user_assets.pool import Asset, AssetPool, UserTexture
from stereoforge_kit.errors import InputError

_SHAPE_FILL = 1.8
"""Mean projected area of the shapes, in squares of their half extents; measured over 300 draws."""
_REACH = 1.35
"""Distance from a shape's centre to its farthest point, in half extents, which one in ten exceeds."""


@dataclass(frozen=True)
class FlyingThingsConfig(FamilyConfig):
    """Values are drawn uniformly from the ranges, once for each scene or once for each object, as the fields say.

    Raises ValueError for ranges from which no scene can be sampled.
    """

    depths_for_range = True

    flying_objects: Count = (5, 20)
    """Objects in flight per scene."""
    background_objects: Count = (60, 200)
    """Static objects on the ground per scene."""
    background_materials: Count = (8, 16)
    """Different materials the background objects of a scene share; every flying object has its own."""
    focal_mm: Range = (18.0, 60.0)
    """Focal length on a sensor 32 mm wide (35 as published)."""
    baseline_m: Range = (0.05, 1.0)
    """Distance between the cameras (1 as published); everything scales with it."""
    disparity_share: Range = (0.002, 0.167)
    """Disparity of the farthest and the nearest surface, as a share of the image width: 2 to 160 px at 960."""
    background_disparity_share: Range = (0.005, 0.04)
    """Where the background objects stand, as a share of the image width."""
    flying_cover: Range = (0.32, 0.58)
    """Share of the image the flying objects would cover if they were placed independently."""
    flying_speed: Range = (0.0, 0.03)
    """Speed of a flying object, as a share of its depth per frame (0.03 is about 30 px per frame at 960)."""
    flying_turn_deg: Range = (0.0, 8.0)
    """How fast a flying object turns, degrees per frame."""
    camera_speed: Range = (0.0, 0.03)
    """Speed of the camera, as a share of the nearest depth per frame."""
    camera_turn_deg: Range = (0.0, 0.6)
    """How fast the camera turns, degrees per frame."""
    pitch_deg: Range = (-2.0, 12.0)
    """How far the camera looks down."""
    roll_deg: Range = (-4.0, 4.0)
    """Roll of the camera."""
    plain_share: float = 0.2
    """How many materials are of one colour."""
    glossy_share: float = 0.12
    """How many materials are lacquered or polished, so that they mirror what is around."""
    metallic_share: float = 0.1
    """How many materials are metal."""
    transparent_share: float = 0.05
    """How many materials are glass. Ground truth is of the glass."""
    lattice_share: float = 0.1
    """How many objects are lattices, wire frames, perforated plates and the like: many matches are equally good."""
    rows: Count = (0, 2)
    """Rows of equal things on the ground per scene, like posts and columns, at any distance."""
    suns: Count = (1, 2)
    area_lights: Count = (0, 4)
    sky_strength: Range = (0.7, 1.8)
    """Brightness of the sky's light."""
    shutter_frames: Range = (0.2, 0.7)
    """How long the final pass's shutter is open."""
    defocus: Range = (0.0, 0.008)
    """Diameter of the final pass's blur of the horizon, as a share of the image width."""

    user_share: float = 0.5
    """Share of the flying objects, of their textures and of the skies that are user assets, where there are any."""
    assets: AssetPool = field(default_factory=AssetPool)
    """The user assets of the split; `with_assets` fills them in."""
    complexity: float = 1.0
    """0 few things of plain shapes, 1 as many and as complicated as the other ranges say."""

    @property
    def surfaces(self) -> SurfaceShares:
        """The shares of kinds of surfaces among the materials."""
        return SurfaceShares(self.plain_share, self.glossy_share, self.metallic_share, self.transparent_share)

    def with_assets(self, assets: AssetPool) -> FlyingThingsConfig:
        share = self.user_share if assets.share is None else assets.share
        return replace(self, assets=assets, user_share=share)

    def within_disparities(self, least_px: float, greatest_px: float) -> FlyingThingsConfig:
        """This config for a range of disparities, pixels; the background keeps its share of the logarithmic range.

        Raises ValueError for a least disparity that is not above 0.
        """
        if least_px <= 0:
            raise InputError(f"flying_things need a least disparity above 0, got {least_px:g}")
        low, high = self.disparity_share
        least, greatest = least_px / self.width, greatest_px / self.width
        stretch = math.log(greatest / least) / math.log(high / low)
        near, far = (least * (share / low) ** stretch for share in self.background_disparity_share)
        return replace(self, disparity_share=(least, greatest), background_disparity_share=(near, far))

    def draw_user_asset(self, rng: np.random.Generator, among: tuple[Asset, ...]) -> Asset | None:
        """One of the user's files, or None for a procedural one; draws from `rng` only if there are any files."""
        return choose(rng, among) if among and chance(rng, self.user_share) else None

    def at_complexity(self, complexity: float) -> FlyingThingsConfig:
        return replace(self, complexity=complexity * self.complexity)

    def count(self, rng: np.random.Generator, limits: Count) -> int:
        """Draw how many there are of something: fewer at a low complexity (`crowd_share`), but at least one of any."""
        drawn = integer(rng, *limits)
        return max(min(drawn, 1), round(drawn * crowd_share(self.complexity)))

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.complexity <= 1:
            raise InputError(f"flying_things: complexity must be from 0 to 1, got {self.complexity}")
        _ = self.surfaces
        for name in ("focal_mm", "baseline_m", "disparity_share", "background_disparity_share"):
            if getattr(self, name)[0] <= 0:
                raise InputError(f"flying_things: {name} must be above 0, got {getattr(self, name)}")


@dataclass(frozen=True)
class _Rig(View):
    """The view, and the depths between which things are placed in it."""

    config: FlyingThingsConfig

    def depth(self, disparity_share: float) -> float:
        """Depth in metres at which the disparity is this share of the image width."""
        return self.camera.disparity_metres / (disparity_share * self.camera.width)

    @property
    def nearest_m(self) -> float:
        """Least depth allowed."""
        return self.depth(self.config.disparity_share[1])

    @property
    def farthest_m(self) -> float:
        """Depth of the farthest ground."""
        return self.depth(self.config.disparity_share[0])


@dataclass(frozen=True)
class _Land:
    """Rolling ground (`scenes.placement.ground.Ground`)."""

    shape: Terrain
    half_m: float
    """Half its side."""
    level_m: float
    """World z of the ground below the world's origin."""

    def height_m(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """World z of the ground at (N, 2) world points."""
        height: NDArray[np.float64] = self.level_m + self.half_m * self.shape.height(points_m / self.half_m)
        return height

    def mesh_origin_m(self) -> float:
        """World z of the origin of the mesh."""
        return self.level_m - self.shape.middle_height() * self.half_m


def sample_flying_things(rng: np.random.Generator, config: FlyingThingsConfig) -> Scene:
    """Draw one scene."""
    rig = _sample_rig(rng, config)
    land = _sample_land(rng, rig)
    scene = Assembly()
    scene.add(_ground(rng, rig, land, scene))
    background = _background(rng, rig, land, scene)
    rows = _rows(rng, rig, land, scene)
    flyers = _flyers(rng, rig, land, scene)
    scene.add(*background, *rows, *flyers)
    return Scene(
        family="flying_things",
        frames=config.frames,
        camera=rig.camera,
        objects=scene.objects,
        materials=tuple(scene.materials),
        lights=_lights(rng, rig),
        world=_world(rng, config),
        exposure_key=uniform(rng, 0.18, 0.32),
        notes={"flying_objects": float(len(flyers)), "background_objects": float(len(background))},
        final=_final(rng, rig),
    )


def _sample_rig(rng: np.random.Generator, config: FlyingThingsConfig) -> _Rig:
    focal_mm, baseline_m = uniform(rng, *config.focal_mm), uniform(rng, *config.baseline_m)
    pitch, roll = uniform(rng, *config.pitch_deg), uniform(rng, *config.roll_deg)
    # At a pitch of -90 degrees a camera looks straight down at -z; raised by 90 it looks along +y.
    attitude = Rotation.from_euler("XZ", (90.0 - pitch, roll), degrees=True)
    still = config.camera(focal_mm, baseline_m, Trajectory.static())
    nearest_m = still.disparity_metres / (config.disparity_share[1] * config.width)
    motion = wander(
        rng,
        config.frames,
        np.zeros(3),
        attitude,
        speed_m=uniform(rng, *config.camera_speed) * nearest_m,
        turn_deg=uniform(rng, *config.camera_turn_deg),
        reach_m=0.25 * nearest_m,
        reach_deg=4.0,
    )
    return _Rig(replace(still, motion=motion), config.frames, config)


def _final(rng: np.random.Generator, rig: _Rig) -> FinalPass:
    """The published final pass: motion blur, and a lens focused among the things in flight."""
    camera = rig.camera
    focus_m = log_uniform(rng, 1.5, 6.0) * rig.nearest_m
    # A lens of diameter D focused at s spreads the horizon over D * focal_px / s.
    blur_px = uniform(rng, *rig.config.defocus) * camera.width
    diameter_m = blur_px * focus_m / camera.focal_px
    f_number = camera.focal_mm / 1000 / diameter_m if diameter_m > 0 else 0.0
    return FinalPass(uniform(rng, *rig.config.shutter_frames), f_number, focus_m)


def _sample_land(rng: np.random.Generator, rig: _Rig) -> _Land:
    """Gently rolling land, so low that the image's lower edge shows none of it nearer than allowed."""
    half_m = rig.farthest_m
    terrain = Terrain(
        relief=uniform(rng, 0.0005, 0.006),
        frequency=uniform(rng, 4.0, 9.0),
        slope=uniform(rng, 0.8, 1.6),
        depth=0.01,
        cells=64,
        concentration=2.0,
        seed=new_seed(rng),
    )
    # A ray through the image's lower edge drops by this much for every metre of depth.
    drop = -float(rig.pose[2, :3] @ (0.0, -rig.half_view[1], -1.0))
    angle = np.linspace(0.0, 2 * np.pi, 24)
    circle = np.stack([np.cos(angle), np.sin(angle)], -1)
    around = np.concatenate([circle * share for share in (0.3, 0.6, 1.0, 1.5)]) * rig.nearest_m / half_m
    hump_m = float(terrain.height(around).max()) * half_m
    below_m = rig.nearest_m * (max(drop, 0.1) * uniform(rng, 1.3, 3.5) + 0.3) + hump_m
    return _Land(terrain, half_m, -below_m)


def _ground(rng: np.random.Generator, rig: _Rig, land: _Land, scene: Assembly) -> SceneObject:
    # Its texture is sharp where the ground is at a few times the nearest depth.
    unit_px = land.half_m * rig.camera.focal_px / (3 * rig.nearest_m)
    return ground_object(land, scene.material(sample_material(rng, unit_px, 512, rig.config.surfaces)))


_BACKGROUND_SHAPES: dict[str, float] = {"Box": 0.3, "DeformedCylinder": 0.2, "Cylinder": 0.08}
"""Shares of these kinds among the background's shapes; the rest is of any kind."""
_PLAIN_SHAPES: dict[str, float] = {"Box": 0.4, "Cylinder": 0.3, "Superquadric": 0.3}
"""Kinds of all flying objects at complexity 0; their share falls to none at complexity 1."""


_LATTICES = ("Lattice", "WireFrame", "HoledPlate", "Spring")
"""Kinds that repeat themselves."""
_ROW_SHAPES = ("Box", "Column", "Cylinder", "DeformedCylinder", "Lathe", "Pole", "Superquadric")
"""Kinds of things that stand in rows."""


def _sample_shape(rng: np.random.Generator, favoured: dict[str, float], lattice_share: float) -> Shape:
    """A random shape: of the `favoured` kinds with their shares, a lattice with its own, else of any by popularity."""
    lattices = dict.fromkeys(_LATTICES, lattice_share / len(_LATTICES))
    drawn = rng.random()
    for name, share in (*lattices.items(), *favoured.items()):
        drawn -= share
        if drawn < 0:
            return SHAPES[name].sample(rng)
    kinds = [SHAPES[name] for name in sorted(SHAPES)]
    return choose(rng, kinds, [kind.popularity for kind in kinds]).sample(rng)


def _background(rng: np.random.Generator, rig: _Rig, land: _Land, scene: Assembly) -> list[SceneObject]:
    """Objects standing or lying on the ground in view, near ones small, far ones up to skyline size."""
    kinds = rig.config.count(rng, rig.config.background_materials)
    surfaces, unit_px = rig.config.surfaces, 0.08 * rig.camera.width
    materials = [scene.material(sample_material(rng, unit_px, shares=surfaces)) for _ in range(kinds)]
    count = rig.config.count(rng, rig.config.background_objects)
    depths_m = [rig.depth(uniform(rng, *rig.config.background_disparity_share)) for _ in range(count)]
    spots = np.array([rig.point(uniform(rng, -1.25, 1.25), 0.0, depth_m) for depth_m in depths_m])
    spots = spots.reshape(-1, 3)
    spots[:, 2] = land.height_m(spots[:, :2])
    things = []
    for index, (depth_m, spot) in enumerate(zip(depths_m, spots, strict=True)):
        size_m = depth_m * rig.half_view[0] * log_uniform(rng, 0.05, 0.3)
        sunk = np.array((0.0, 0.0, size_m * uniform(rng, 0.2, 0.7)))
        upright = Rotation.from_euler("Z", uniform(rng, 0.0, 360.0), degrees=True)
        turn = upright if chance(rng, 0.6) else Rotation.random(random_state=rng)
        things.append(
            SceneObject(
                name=f"background {index}",
                shape=_sample_shape(rng, _BACKGROUND_SHAPES, rig.config.lattice_share),
                material=choose(rng, materials),
                motion=Trajectory.static(vector(spot + sunk), quaternion(turn)),
                scale_m=vector(size_m * rng.uniform(0.75, 1.25, 3)),
            )
        )
    return things


def _rows(rng: np.random.Generator, rig: _Rig, land: _Land, scene: Assembly) -> list[SceneObject]:
    """Rows of equal things on the ground, across the view or slanting, as far as the background or nearer."""
    things = []
    for number in range(rig.config.count(rng, rig.config.rows)):
        shape = SHAPES[choose(rng, list(_ROW_SHAPES))].sample(rng)
        low, high = rig.config.background_disparity_share
        depth_m = rig.depth(
            log_uniform(rng, low, max(low, min(4 * high, 0.5 * rig.config.disparity_share[1])))
        )
        size_m = depth_m * rig.half_view[0] * log_uniform(rng, 0.02, 0.09)
        material = scene.material(
            sample_material(rng, size_m / depth_m * rig.camera.focal_px, shares=rig.config.surfaces)
        )
        scale = size_m * np.array((1.0, 1.0, uniform(rng, 1.0, 3.5)))
        gap_m, slant = 2 * size_m * log_uniform(rng, 1.15, 3.0), uniform(rng, 0.0, 0.8)
        count = min(integer(rng, 6, 24), 2 + int(2.4 * rig.half_view[0] * depth_m / gap_m))
        turn = quaternion(Rotation.from_euler("Z", uniform(rng, 0.0, 360.0), degrees=True))
        first = rig.point(uniform(rng, -1.0, 0.3), 0.0, depth_m)
        right, ahead = rig.pose[:3, 0], -rig.pose[:3, 2]
        step = gap_m * (right + slant * ahead) / math.hypot(1.0, slant)
        spots = first + np.arange(count)[:, None] * step
        spots[:, 2] = land.height_m(spots[:, :2]) + 0.9 * scale[2] * float(shape.mesh().vertices[:, 2].max())
        things += [
            SceneObject(
                f"row {number} {k}", shape, material, Trajectory.static(vector(spot), turn), vector(scale)
            )
            for k, spot in enumerate(spots)
        ]
    return things


def _flyers(rng: np.random.Generator, rig: _Rig, land: _Land, scene: Assembly) -> list[SceneObject]:
    count = rig.config.count(rng, rig.config.flying_objects)
    # `count` objects of this cover each leave 1 - flying_cover of the image free, if placed independently.
    each = 1 - (1 - uniform(rng, *rig.config.flying_cover)) ** (1 / max(count, 1))
    flyers = []
    for index in range(count):
        cover = min(each * math.exp(rng.normal(-0.1, 0.5)), 0.12)
        size_px = math.sqrt(cover * rig.camera.width * rig.camera.height / _SHAPE_FILL)
        material = _flyer_material(rng, rig.config, size_px)
        flyers.append(_flyer(rng, rig, f"flying {index}", material, size_px, land.level_m, scene))
    return flyers


def _flyer_material(rng: np.random.Generator, config: FlyingThingsConfig, size_px: float) -> Material:
    material = sample_material(rng, size_px, shares=config.surfaces)
    own = config.draw_user_asset(rng, config.assets.textures)
    return material if own is None else replace(material, color=UserTexture(own.sha256))


def _world(rng: np.random.Generator, config: FlyingThingsConfig) -> World:
    sky = Sky.sample(rng, 1024)
    own = config.draw_user_asset(rng, config.assets.environments)
    world = World(sky, uniform(rng, *config.sky_strength))
    return world if own is None else config.assets.world(world, own)


def _flyer(
    rng: np.random.Generator,
    rig: _Rig,
    name: str,
    material: Material,
    size_px: float,
    floor_m: float,
    scene: Assembly,
) -> SceneObject:
    """One flying object whose half extent spans `size_px`, wholly behind the nearest allowed depth.

    One of the user's that keeps its size is where that spans `size_px`, or as near to there as things in flight are.
    """
    config = rig.config
    materials: tuple[Material, ...] = (material,)
    favoured = {name: share * (1 - config.complexity) for name, share in _PLAIN_SHAPES.items()}
    shape = _sample_shape(rng, favoured, config.lattice_share * config.complexity)
    kept_m = None
    if own := config.draw_user_asset(rng, config.assets.meshes):
        shape = mesh = config.assets.mesh(own)
        materials = (mesh.materials() if mesh.own_materials else ()) or materials
        kept_m = mesh.half_size() if config.assets.keep_size else None
    stretch = rng.uniform(0.8, 1.25, 3)
    near_share = config.disparity_share[1]
    farthest_share = min(0.15 * near_share, near_share)
    depth_m = rig.depth(uniform(rng, farthest_share, near_share))
    relative = size_px / rig.camera.focal_px
    if kept_m is not None:
        stretch = np.ones(3)
        depth_m = float(np.clip(kept_m / relative, rig.nearest_m, rig.depth(farthest_share)))
        relative = kept_m / depth_m
    # The front of a ball of radius relative * depth about the centre stays behind the nearest depth.
    depth_m = max(depth_m, rig.nearest_m / max(1 - _REACH * relative, 0.2))
    size_m = relative * depth_m if kept_m is None else kept_m
    place = rig.point(uniform(rng, -0.95, 0.95), uniform(rng, -0.95, 0.95), depth_m)
    place[2] = max(place[2], floor_m + 0.7 * size_m)
    motion = wander(
        rng,
        config.frames,
        place,
        Rotation.random(random_state=rng),
        speed_m=uniform(rng, *config.flying_speed) * depth_m,
        turn_deg=uniform(rng, *config.flying_turn_deg),
        reach_m=0.25 * depth_m,
        reach_deg=60.0,
    )
    scale = size_m * stretch
    reach_m = float(np.linalg.norm(shape.mesh().vertices * scale, axis=1).max())
    first, *more = (scene.material(one) for one in materials)
    return SceneObject(
        name, shape, first, _kept_away(motion, reach_m, rig), vector(scale), more_materials=tuple(more)
    )


def _kept_away(motion: Trajectory, reach_m: float, rig: _Rig) -> Trajectory:
    """The motion, moved away from the camera so far that the object stays behind the nearest depth."""
    forward = -rig.pose[:3, 2]
    shortfall = -math.inf
    for time in exposure_times(rig.config.frames):
        camera = rig.camera.pose("left", time)
        depth_m = float((motion.pose(time)[:3, 3] - camera[:3, 3]) @ -camera[:3, 2])
        shortfall = max(shortfall, (rig.nearest_m + reach_m - depth_m) / float(forward @ -camera[:3, 2]))
    return motion if shortfall <= 0 else shifted(motion, forward * shortfall * 1.001)


def _lights(rng: np.random.Generator, rig: _Rig) -> tuple[Light, ...]:
    """Suns from mostly behind the camera, and coloured area lights beside and above the flying objects."""
    suns: list[SunLight] = [sample_sun(rng, rig.pose) for _ in range(integer(rng, *rig.config.suns))]
    lamps: list[AreaLight] = []
    for _ in range(integer(rng, *rig.config.area_lights)):
        target = rig.point(
            uniform(rng, -0.7, 0.7), uniform(rng, -0.5, 0.5), rig.nearest_m * uniform(rng, 1.5, 4.0)
        )
        lamps.append(sample_area_light(rng, rig.pose, target, rig.nearest_m))
    return (*suns, *lamps)


FAMILY = Family(name="flying_things", config=FlyingThingsConfig, sample=sample_flying_things)
