"""The final pass against averages of sharp pictures and closed forms; ground truth is the same with it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from datagen.blender.build import BuiltWorld, build_world, place
from datagen.blender.camera import render_radiance
from datagen.blender.final_pass import HAZE_HEIGHT, render_final
from datagen.blender.session import CyclesSettings, quiet, start_empty_file
from datagen.dataset.layout import VIEWS, View
from datagen.ground_truth.scene_geometry import build_geometry
from datagen.rendering.frames import RenderOptions, ViewTargets, render_frames
from datagen.rendering.sensor import Sensor, vignette
from scenes import Scene
from scenes.motion.deformations.sway import Sway
from scenes.shapes.solids.basic import Box, Plane
from scenes.spec import FinalPass, Fog, Material, Rain, SceneObject, StereoCamera, Trajectory, World
from scenes.textures.plain import SolidColor

WIDTH, HEIGHT = 96, 64
FOCAL_PX = 96.0
GLOW = tuple(
    Material(SolidColor(color), emission=1.0) for color in ((255, 255, 255), (188, 60, 60), (60, 188, 60))
)
"""Surfaces that give off their own light look the same from everywhere: closed forms hold and nothing is noisy."""
BACKDROP_M, PLATE_M = 20.0, 6.0
RIGHTWARDS = Trajectory(
    (-1.0, 3.0), ((-2.2, 0.0, -PLATE_M), (1.8, 0.0, -PLATE_M)), ((1.0, 0.0, 0.0, 0.0),) * 2
)
"""One metre, so 16 px, a frame."""


def world_of(final: FinalPass, *things: SceneObject, camera_motion: Trajectory | None = None) -> Scene:
    backdrop = SceneObject(
        "backdrop", Plane(), 1, Trajectory.static((0.0, 0.0, -BACKDROP_M)), (90.0, 9.0, 1.0)
    )
    return Scene(
        family="final",
        frames=2,
        camera=StereoCamera(WIDTH, HEIGHT, 32.0, 0.3, camera_motion or Trajectory.static()),
        objects=(backdrop, *things),
        materials=GLOW,
        lights=(),
        world=World(SolidColor((120, 140, 180)), 1.0),
        final=final,
    )


def plate(motion: Trajectory, depth_scale: float = 1.0) -> SceneObject:
    return SceneObject("plate", Plane(), 0, motion, (depth_scale, depth_scale, 1.0))


def built(scene: Scene, folder: Path, samples: int = 32) -> BuiltWorld:
    with quiet(folder / "log"):
        return build_world(build_geometry(scene), start_empty_file(CyclesSettings(samples)))


def final_radiance(scene: Scene, folder: Path, frame: int = 0, exposure: float = 1.0) -> NDArray[np.float32]:
    """Left view."""
    world = built(scene, folder)
    with quiet(folder / "log"):
        return render_final(world, frame, exposure, folder)["left"]


MOVING_EVERYTHING = world_of(
    FinalPass(
        shutter_frames=0.8,
        noise=0.03,
        vignetting=0.2,
        fog=Fog((0.6, 0.6, 0.7), 12.0),
        f_number=0.05,
        rain=Rain(3.0, (0.02, 0.0, -0.2), 0.003, 0.5),
    ),
    plate(RIGHTWARDS),
    SceneObject(
        "swaying",
        Box((0.4, 0.4, 1.0)),
        2,
        Trajectory.static((1.0, -0.5, -7.0), (0.7071067811865476, -0.7071067811865476, 0.0, 0.0)),
        (0.6, 0.6, 1.2),
        Sway(amplitude=1.5, direction_deg=0.0, period_frames=4.0),
    ),
    camera_motion=Trajectory(
        (-1.0, 3.0), ((0.0, 0.0, 0.0), (0.4, 0.2, 0.0)), ((1.0, 0.0, 0.0, 0.0), (0.9998, 0.0, 0.02, 0.0))
    ),
)


def test_ground_truth_and_clean_pictures_are_the_same_bytes_with_a_final_pass(tmp_path: Path) -> None:
    runs: list[list[dict[View, ViewTargets]]] = []
    for passes in (("clean",), ("clean", "final"), ("final",)):
        options = RenderOptions(samples=2, passes=passes, targets=("normals", "optical_flow"))
        runs.append([targets for _, targets in render_frames(MOVING_EVERYTHING, tmp_path, options)])
        assert all(tuple(frame["left"].images) == passes for frame in runs[-1])
    without, both, only_final = runs
    for run in (both, only_final):
        for frame, expected in zip(run, without, strict=True):
            for view in VIEWS:
                for name in ("disparity", "gradient", "gradient_valid", "occlusion", "object_index"):
                    assert np.array_equal(getattr(frame[view], name), getattr(expected[view], name)), name
                for key, values in expected[view].extra.items():
                    assert np.array_equal(frame[view].extra[key], values), key
    for first, second, third in zip(without, both, only_final, strict=True):
        for view in VIEWS:
            assert np.array_equal(first[view].images["clean"], second[view].images["clean"])
            assert np.array_equal(second[view].images["final"], third[view].images["final"])
            assert not np.array_equal(second[view].images["final"], second[view].images["clean"])


@pytest.mark.parametrize("frame", [0, 1])
def test_motion_blur_is_the_mean_of_the_shutter_s_instants(tmp_path: Path, frame: int) -> None:
    """Object, camera and deformation at once, against many sharp pictures of the instants between."""
    scene = replace(MOVING_EVERYTHING, final=FinalPass(shutter_frames=0.8))
    world = built(scene, tmp_path, samples=64)
    with quiet(tmp_path / "log"):
        blurred = render_final(world, frame, 1.0, tmp_path)["left"]
        sharp = []
        for time in frame + (np.arange(16) + 0.5) / 16 * 0.8 - 0.4:
            place(world, "left", time)
            sharp.append(render_radiance(world, "sharp", 1, tmp_path))
    mean, middle = np.mean(sharp, axis=0), sharp[8]
    from_mean, from_middle = (
        np.sqrt(((blurred - mean) ** 2).mean()),
        np.sqrt(((blurred - middle) ** 2).mean()),
    )
    print(
        f"blurred picture: {from_mean:.4f} from the mean of 16 instants, {from_middle:.4f} from the middle one"
    )
    assert from_mean < 0.25 * from_middle
    assert from_middle > 0.02


def test_no_shutter_is_sharp(tmp_path: Path) -> None:
    scene = replace(MOVING_EVERYTHING, final=FinalPass(shutter_frames=0.0))
    world = built(scene, tmp_path)
    with quiet(tmp_path / "log"):
        final = render_final(world, 0, 1.0, tmp_path)["left"]
        place(world, "left", 0.0)
        sharp = render_radiance(world, "sharp", 1, tmp_path)
    assert np.sqrt(((final - sharp) ** 2).mean()) < 0.01


def test_fog_takes_what_distance_says(tmp_path: Path) -> None:
    exposure, color, visibility_m = 0.5, np.array((0.6, 0.5, 0.7)), 15.0
    fog = FinalPass(shutter_frames=0.0, fog=Fog(tuple(color), visibility_m))
    still = plate(Trajectory.static((0.0, 0.0, -PLATE_M)))
    clear = final_radiance(world_of(replace(fog, fog=None), still), tmp_path, exposure=exposure) * exposure
    foggy = final_radiance(world_of(fog, still), tmp_path, exposure=exposure) * exposure
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5 - WIDTH / 2, HEIGHT / 2 - np.arange(HEIGHT) - 0.5)
    length = np.sqrt(x**2 + y**2 + FOCAL_PX**2) / FOCAL_PX
    half = FOCAL_PX / PLATE_M
    on_plate = (np.abs(x) < half - 2) & (np.abs(y) < half - 2)
    on_backdrop = ((np.abs(x) > half + 2) | (np.abs(y) > half + 2)) & (
        np.abs(y) < FOCAL_PX * 9 / BACKDROP_M - 2
    )
    for mask, depth_m in ((on_plate, PLATE_M), (on_backdrop, BACKDROP_M)):
        assert mask.sum() > 200
        left = np.exp(-depth_m * length / visibility_m)[..., None]
        expected = clear * left + color * (1 - left)
        error = np.abs(foggy - expected)[mask]
        print(f"fog at {depth_m} m: error p50 {np.median(error):.4f}, p99 {np.percentile(error, 99):.4f}")
        assert np.percentile(error, 99) < 0.02
    assert HAZE_HEIGHT > 0


def test_the_sky_is_full_of_fog_at_the_horizon_and_clearer_above(tmp_path: Path) -> None:
    # A camera that looks along +y: z is up.
    level = Trajectory.static((0.0, 0.0, 0.0), (0.7071067811865476, 0.7071067811865476, 0.0, 0.0))
    color = np.array((0.8, 0.3, 0.2))
    final = FinalPass(shutter_frames=0.0, fog=Fog(tuple(color), 10.0))
    sky = final_radiance(world_of(final, camera_motion=level), tmp_path)
    clear = final_radiance(world_of(replace(final, fog=None), camera_motion=level), tmp_path)
    middle = WIDTH // 2
    assert np.abs(sky[HEIGHT // 2 + 3 :, middle] - color).max() < 0.01
    rise = (HEIGHT / 2 - 5.5) / FOCAL_PX
    left = np.exp(-HAZE_HEIGHT / (rise / np.hypot(rise, 1.0)))
    assert np.abs(sky[5, middle] - (clear[5, middle] * left + color * (1 - left))).max() < 0.02


def test_defocus_blurs_by_the_lens_equation(tmp_path: Path) -> None:
    """Sharp where the lens is focused; elsewhere an edge is spread over the circle of confusion."""
    focal_m, f_number = 0.032, 0.02
    still = plate(Trajectory.static((0.0, 0.0, -PLATE_M)))
    for focus_m in (PLATE_M, 4.0):
        final = FinalPass(shutter_frames=0.0, f_number=f_number, focus_m=focus_m)
        line = final_radiance(world_of(final, still), tmp_path)[HEIGHT // 2 - 3 : HEIGHT // 2 + 3, :, 1].mean(
            axis=0
        )
        low, high = line[:8].mean(), line[WIDTH // 2 - 3 : WIDTH // 2 + 3].mean()
        share = (line - low) / (high - low)
        # Of a disc's coverage at its edge, the step's standard deviation is a quarter of the diameter.
        slope = np.clip(np.diff(share[20 : WIDTH // 2 - 3]), 0, None)
        at = np.arange(len(slope))
        center = (slope * at).sum() / slope.sum()
        spread = np.sqrt((slope * (at - center) ** 2).sum() / slope.sum())
        pinhole_m = focal_m / f_number * abs(PLATE_M - focus_m) / PLATE_M * focal_m / focus_m
        diameter_px = pinhole_m / 0.032 * WIDTH
        print(f"focus {focus_m} m: circle {diameter_px:.1f} px, edge spread {spread:.2f} px")
        if diameter_px == 0:
            assert spread < 1.0  # The pixel filter alone.
        else:
            assert 0.8 * diameter_px / 4 < spread < 1.35 * diameter_px / 4


def expose(final: FinalPass, view: View = "left", frame: int = 0, level: float = 0.5) -> NDArray[np.float32]:
    return Sensor(world_of(final)).expose(np.full((120, 160, 3), level, np.float32), 1.0, view, frame)


def test_noise_grows_with_the_root_of_light_and_follows_from_scene_frame_and_view() -> None:
    noisy = FinalPass(noise=0.04)
    for level in (0.1, 0.9):
        values = expose(noisy, level=level)
        assert values.std() == pytest.approx(0.04 * np.sqrt(level), rel=0.03)
        assert values.mean() == pytest.approx(level, abs=2e-3)
    assert np.array_equal(expose(noisy), expose(noisy))
    others = [expose(noisy, "right"), expose(noisy, frame=1), expose(replace(noisy, focus_m=3.0))]
    for other in others:
        assert abs(np.corrcoef(other.ravel(), expose(noisy).ravel())[0, 1]) < 0.02


def test_the_right_eye_s_exposure_and_colour_differ_as_asked() -> None:
    final = FinalPass(exposure_difference_ev=-0.5, right_view_color=(1.1, 1.0, 0.8))
    assert np.allclose(expose(final), 0.5)
    assert np.allclose(expose(final, "right"), 0.5 * 2**-0.5 * np.array((1.1, 1.0, 0.8)))


def test_vignetting_takes_its_share_in_the_corners() -> None:
    left = vignette(FinalPass(vignetting=0.4), 101, 201)
    assert left[50, 100] == pytest.approx(1.0)
    assert left[0, 0] == pytest.approx(0.6, abs=0.01)
    assert np.array_equal(left, left[::-1, ::-1])
