"""Materials and lights: the mixture, the ranges, and texture pixels the size of image pixels."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from scenes.appearance.lights import sample_area_light, sample_light_color, sample_sun
from scenes.appearance.materials import (
    FINISHES,
    TEXEL_PX,
    SurfaceShares,
    sample_material,
    sample_plain,
    sample_texture,
)
from scenes.spec import GLOSSY
from scenes.textures import TEXTURES
from scenes.textures.plain import NearTextureless, SolidColor


def test_most_materials_are_diffuse_and_every_other_kind_occurs() -> None:
    rng = np.random.default_rng(0)
    materials = [sample_material(rng, 100.0, 16) for _ in range(1500)]

    def share(matches: list[bool]) -> float:
        return sum(matches) / len(materials)

    bare = [m.specular == m.metallic == m.transmission == m.emission == 0.0 for m in materials]
    assert 0.55 < share(bare) < 0.75
    assert 0.15 < share([m.specular > 0 and m.transmission == 0 for m in materials]) < 0.35
    assert 0.04 < share([m.metallic > 0.5 for m in materials]) < 0.15
    assert 0.01 < share([m.transmission > 0 for m in materials]) < 0.06
    assert 0.01 < share([m.emission > 0 for m in materials]) < 0.06
    assert len(FINISHES) >= 7


@pytest.mark.parametrize(
    "shares", [SurfaceShares(0.5, 0.3, 0.2, 0.1), SurfaceShares(1, 0, 0, 0), SurfaceShares(0, 0, 0, 1)]
)
def test_a_family_says_how_many_surfaces_are_of_which_kind(shares: SurfaceShares) -> None:
    rng = np.random.default_rng(7)
    materials = [sample_material(rng, 100.0, 16, shares) for _ in range(1500)]
    plain = [isinstance(material.color, SolidColor | NearTextureless) for material in materials]
    glossy = [m.specular > 0 and m.roughness <= GLOSSY and not m.transmission for m in materials]
    assert np.mean(plain) == pytest.approx(shares.plain, abs=0.05)
    assert np.mean(glossy) == pytest.approx(shares.glossy, abs=0.04)
    assert np.mean([m.metallic > 0 for m in materials]) == pytest.approx(shares.metallic, abs=0.04)
    assert np.mean([m.transmission > 0 for m in materials]) == pytest.approx(shares.transparent, abs=0.04)
    with pytest.raises(ValueError, match="at most 1 together"):
        SurfaceShares(0, 0.5, 0.4, 0.2)


def test_plain_surfaces_have_hardly_any_pattern() -> None:
    rng = np.random.default_rng(8)
    spread = [np.ptp(sample_plain(rng, 64).image().astype(int), axis=(0, 1)).max() for _ in range(40)]
    assert np.median(spread) < 40
    assert min(spread) == 0


def test_textures_are_drawn_by_popularity() -> None:
    rng = np.random.default_rng(1)
    drawn = Counter(type(sample_texture(rng, 16)).__name__ for _ in range(4000))
    total = sum(kind.popularity for kind in TEXTURES.values())
    for name, kind in TEXTURES.items():
        assert drawn[name] / 4000 == pytest.approx(kind.popularity / total, abs=0.03)


@pytest.mark.parametrize("unit_px", [20.0, 300.0])
@pytest.mark.parametrize("size", [64, 512])
def test_texture_pixels_are_about_the_size_of_image_pixels(unit_px: float, size: int) -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        texel_px = unit_px / (sample_material(rng, unit_px, size).repeats * size)
        assert TEXEL_PX[0] - 1e-9 <= texel_px <= TEXEL_PX[1] + 1e-9


def test_suns_shine_downwards_and_mostly_from_behind_the_camera() -> None:
    rng = np.random.default_rng(3)
    view = np.eye(4)
    view[:3, :3] = [(1, 0, 0), (0, 0, -1), (0, 1, 0)]  # looks along +y
    suns = [sample_sun(rng, view) for _ in range(500)]
    directions = np.array([sun.direction for sun in suns])
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    elevation = np.degrees(np.arcsin(-directions[:, 2]))
    assert elevation.min() > 14.9
    assert elevation.max() < 70.1
    assert 0.6 < np.mean(directions[:, 1] > 0) < 0.95


def test_lamps_are_behind_the_camera_and_give_the_irradiance_they_are_made_for() -> None:
    rng = np.random.default_rng(4)
    view = np.eye(4)
    view[:3, :3] = [(1, 0, 0), (0, 0, -1), (0, 1, 0)]
    target = np.array([0.5, 12.0, 0.3])
    for _ in range(50):
        lamp = sample_area_light(rng, view, target, 6.0)
        assert lamp.position_m[1] < 0
        squared = ((np.array(lamp.position_m) - target) ** 2).sum()
        assert 0.5 <= lamp.power_w / (np.pi * squared) <= 4.0


def test_light_colours_have_unit_luminance() -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        assert np.dot(sample_light_color(rng, 0.8), (0.2126, 0.7152, 0.0722)) == pytest.approx(1.0)
