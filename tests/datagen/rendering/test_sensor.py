"""Imperfect cameras of the final pass, against OpenCV's projections, scipy's filters and statistics of the noise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from datagen.rendering.frames import RenderOptions, render_frames
from datagen.rendering.sensor import READ_NOISE, Sensor, misalignment
from scenes import FAMILIES, Scene, sample_scene, scene_from_json, scene_to_json
from scenes.imperfections import ImperfectionRanges, with_imperfections
from scenes.spec import FinalPass, Imperfections, Material, Rig, Trajectory
from scenes.textures import TEXTURES
from tests.datagen.worlds import Plate, plates

WIDTH, HEIGHT = 96, 64
RIG = Rig(WIDTH, HEIGHT, 90.0, 97.0, 50.0, 44.0, 30.0, 0.3)


def world(found: Imperfections, **final: float) -> Scene:
    scene = plates(WIDTH, HEIGHT, Plate((0.0, 0.0), 4.0, (1.0, 1.0)))
    camera = RIG.camera(Trajectory.static())
    # Records hold textures of the package only.
    textured = (Material(TEXTURES["Marble"].sample(np.random.default_rng(0), 128)),)
    return replace(scene, camera=camera, materials=textured, final=FinalPass(**final, imperfections=found))


def waves() -> NDArray[np.float32]:
    """(H, W, 3) smooth radiance, different in each channel."""
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    planes = [np.sin(x / 9 + k) * np.cos(y / 7 - k) + 1.5 for k in range(3)]
    return np.stack(planes, -1).astype(np.float32)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("focal_ratio", [1.0, 1.01])
def test_misalignment_is_where_opencv_projects_to(axis: int, focal_ratio: float) -> None:
    """A camera turned about one of its axes, by OpenCV, whose rotation takes the world into the camera."""
    turn = np.zeros(3)
    turn[axis] = 0.6
    scene = world(Imperfections(rotation_deg=tuple(turn), focal_ratio=focal_ratio, lower_px=0.75))
    matrix = np.array([[90.0, 0, 43.5], [0, 97.0, 29.5], [0, 0, 1]])
    points = np.random.default_rng(0).uniform((-1, -1, 2), (1, 1, 5), (30, 3))
    ideal, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, None)
    real_matrix = matrix * np.array([[focal_ratio, 1, 1], [1, focal_ratio, 1], [1, 1, 1]])
    real, _ = cv2.projectPoints(points, -np.deg2rad(turn), np.zeros(3), real_matrix, None)
    found = cv2.perspectiveTransform(ideal, misalignment(scene.camera, scene.final))
    np.testing.assert_allclose(found[:, 0], real[:, 0] + (0, 0.75), atol=1e-9)


def test_signs() -> None:
    """Turned about the forward axis, from x to y (clockwise), a camera sees what is on its right higher up."""
    camera = world(Imperfections()).camera
    on_the_right = np.array([[[43.5 + 40.0, 29.5]]])
    rolled = misalignment(camera, FinalPass(imperfections=Imperfections(rotation_deg=(0.0, 0.0, 1.0))))
    assert cv2.perspectiveTransform(on_the_right, rolled)[0, 0, 1] < 29.5 - 0.5
    longer = misalignment(camera, FinalPass(imperfections=Imperfections(focal_ratio=1.01)))
    assert cv2.perspectiveTransform(on_the_right, longer)[0, 0, 0] == pytest.approx(43.5 + 40.4)


def test_the_right_view_lies_lower_and_the_left_stays() -> None:
    sensor, radiance = Sensor(world(Imperfections(lower_px=2.0))), waves()
    np.testing.assert_array_equal(sensor.project(radiance, "left"), radiance)
    low = sensor.project(radiance, "right")
    np.testing.assert_allclose(low[2:], radiance[:-2], atol=1e-5)
    half = Sensor(world(Imperfections(lower_px=0.5))).project(radiance, "right")
    expected = (radiance[1:-2] + radiance[2:-1]) / 2
    np.testing.assert_allclose(half[2:-1], expected, atol=0.02)


@pytest.mark.parametrize(("view", "other"), [("left", "right"), ("right", "left")])
def test_one_view_is_blurred(view: str, other: str) -> None:
    sigma = (1.3, 0.0) if view == "left" else (0.0, 1.3)
    sensor, radiance = Sensor(world(Imperfections(blur_px=sigma))), waves()
    np.testing.assert_array_equal(sensor.project(radiance, other), radiance)
    expected = gaussian_filter(radiance, (1.3, 1.3, 0), mode="nearest", radius=(4, 4, 0))
    np.testing.assert_allclose(sensor.project(radiance, view), expected, atol=1e-5)


def test_an_ideal_rig_changes_nothing() -> None:
    sensor, radiance = Sensor(world(Imperfections())), waves()
    picture = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
    for view in ("left", "right"):
        assert sensor.project(radiance, view) is radiance
    assert sensor.store(picture) is picture


def noise_of(found: Imperfections, view: str, level: float, **final: float) -> float:
    light = np.full((200, 200, 3), level, np.float32)
    return float((Sensor(world(found, **final)).expose(light, 1.0, view, 0) - light).std())


def test_gain_raises_the_noise_of_its_view() -> None:
    found = Imperfections(noise=0.01, gain=(1.0, 4.0))
    for view, gain in (("left", 1.0), ("right", 4.0)):
        for level in (0.05, 0.6):
            expected = 0.01 * np.sqrt(gain * level + READ_NOISE * gain**2)
            assert noise_of(found, view, level) == pytest.approx(expected, rel=0.02)
    # Beside the family's own noise, which has no gain.
    both = noise_of(found, "right", 0.6, noise=0.03)
    assert both == pytest.approx(np.hypot(noise_of(found, "right", 0.6), 0.03 * np.sqrt(0.6)), rel=0.02)


def test_jpeg_is_that_of_opencv() -> None:
    picture = (waves() * 90).astype(np.uint8)
    stored = Sensor(world(Imperfections(jpeg_quality=40))).store(picture)
    _, code = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 40])
    np.testing.assert_array_equal(stored, cv2.cvtColor(cv2.imdecode(code, 1), cv2.COLOR_BGR2RGB))
    assert not np.array_equal(stored, picture)


def test_clean_pass_and_ground_truth_are_those_of_the_ideal_rig(tmp_path: Path) -> None:
    found = Imperfections(1.5, (0.1, 0.1, 0.3), 1.002, (0.0, 1.0), 0.01, (1.0, 2.0), 60)
    made = []
    for imperfections in (Imperfections(), found):
        scene = world(imperfections, shutter_frames=0.0)
        scratch = tmp_path / str(len(made))
        scratch.mkdir()
        options = RenderOptions(samples=1, passes=("clean", "final"))
        ((_, targets),) = render_frames(scene, scratch, options)
        made.append(targets)
    ideal, real = made
    for view in ("left", "right"):
        np.testing.assert_array_equal(real[view].images["clean"], ideal[view].images["clean"])
        np.testing.assert_array_equal(real[view].disparity, ideal[view].disparity)
        np.testing.assert_array_equal(real[view].occlusion, ideal[view].occlusion)
        assert not np.array_equal(real[view].images["final"], ideal[view].images["final"])


def test_magnitudes_are_drawn_within_their_ranges_and_recorded() -> None:
    scene = world(Imperfections())
    ranges = ImperfectionRanges(share=1.0, blur_share=0.5, jpeg_share=0.5)
    rng = np.random.default_rng(0)
    drawn = [with_imperfections(rng, scene, ranges) for _ in range(300)]
    found = [one.final.imperfections for one in drawn]
    assert max(abs(one.lower_px) for one in found) == pytest.approx(0.0005 * WIDTH, rel=0.03)
    assert max(np.abs(one.rotation_deg).max() for one in found) == pytest.approx(0.02, rel=0.03)
    assert max(abs(one.focal_ratio - 1) for one in found) == pytest.approx(0.0005, rel=0.03)
    assert 1 <= min(one.gain[0] for one in found) < 1.1 < 3.7 < max(one.gain[0] for one in found) <= 4
    assert all(min(one.blur_px) == 0 for one in found)
    assert 0.4 < np.mean([max(one.blur_px) > 0 for one in found]) < 0.6
    qualities = [one.jpeg_quality for one in found if one.jpeg_quality]
    assert (min(qualities), max(qualities)) == (70, 97)
    assert max(abs(one.final.exposure_difference_ev) for one in drawn) == pytest.approx(0.15, rel=0.03)
    assert all(one.final.imperfections.noise <= 0.012 for one in drawn)


def test_a_share_of_the_scenes_has_them_and_nothing_else_depends_on_them() -> None:
    config = FAMILIES["flying_things"].config(width=96, height=54)
    ideal = replace(config, imperfections=ImperfectionRanges(share=0.0))
    count = 0
    for seed in range(6):
        real, perfect = (
            sample_scene(np.random.default_rng(seed), "flying_things", one) for one in (config, ideal)
        )
        assert scene_from_json(scene_to_json(real)) == real
        count += real != perfect
        assert replace(real, final=perfect.final) == perfect
        assert "imperfections" not in scene_to_json(perfect)
    assert 2 <= count <= 6


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"share": 1.5}, r"share must be in 0\.\.1"),
        ({"blur": -1.0}, "blur must not be negative"),
        ({"noise": (0.2, 0.1)}, "noise must not be negative"),
        ({"gain": (0.0, 1.0)}, "gain must be above 0"),
        ({"jpeg_quality": (0, 50)}, r"jpeg_quality must be in 1\.\.100"),
        ({"exposure_ev": float("nan")}, "exposure_ev must not be negative"),
    ],
)
def test_ranges_that_cannot_be(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ImperfectionRanges(**wrong)
