"""Materials of streets, for metric shapes: a texture, its scale in metres, and how it reflects light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenes.appearance.materials import plain, tiled
from scenes.appearance.painting import Srgb, sample_palette, shade
from scenes.random_draws import chance, choose, integer, log_uniform, new_seed, uniform
from scenes.spec import Material, Texture
from scenes.textures.collages import BlurredShapes, DeadLeaves, Facade, GlyphRows
from scenes.textures.foliage import Bark, Foliage, Grass
from scenes.textures.houses import Plaster, RoofTiles, WindowPanes
from scenes.textures.layers import Layered
from scenes.textures.noise import WoodPlanks
from scenes.textures.plain import NearTextureless
from scenes.textures.streets import Asphalt, Paving, RoadMarkingPaint, RoadSign, WheelFace
from scenes.textures.tiles import Bricks, Plaid, Stripes

WINDOW_FRAMES: tuple[Srgb, ...] = (
    (238, 236, 230),
    (238, 236, 230),
    (225, 228, 232),
    (70, 62, 56),
    (50, 74, 66),
    (120, 84, 56),
    (64, 72, 84),
)
"""Colours of window frames: mostly white; dark green, brown, grey."""


def asphalt(rng: np.random.Generator) -> Material:
    """A carriageway."""
    return tiled(Asphalt.sample(rng, 400), uniform(rng, 3.2, 4.4))


def tarmac_patch(rng: np.random.Generator) -> Material:
    """A repaired patch of a carriageway."""
    return tiled(Asphalt.sample(rng, 256), 2.3)


def pavement(rng: np.random.Generator) -> Material:
    """Slabs, blocks or tarmac."""
    if chance(rng, 0.2):
        return tiled(Asphalt.sample(rng, 256), uniform(rng, 2.5, 3.5))
    paving = Paving.sample(rng, 256)
    return tiled(
        paving, paving.rows * (uniform(rng, 0.3, 0.6) if paving.rows < 9 else uniform(rng, 0.12, 0.2))
    )


def grass(rng: np.random.Generator) -> Material:
    """Lawns and open land."""
    return tiled(Grass.sample(rng, 256), uniform(rng, 2.0, 3.5))


def kerb_stone(rng: np.random.Generator) -> Material:
    """Grey kerb stones."""
    grey = shade(uniform(rng, 0.55, 0.75), 0.01, 80.0)
    return tiled(Plaster(128, new_seed(rng), grey, 0.08, 0.0, 0.12), 1.0)


def road_paint(rng: np.random.Generator, yellow: bool = False) -> Material:
    """White or yellow road markings."""
    paint = RoadMarkingPaint.sample(rng, 256)
    return tiled(replace(paint, color=shade(0.8, 0.15, 88.0)) if yellow else paint, 2.2)


def wall(rng: np.random.Generator, plastered: float) -> Material:
    """Brick or plaster; `plastered` is the share of plaster."""
    if chance(rng, plastered):
        return tiled(Plaster.sample(rng, 256), uniform(rng, 2.5, 4.0))
    hue, chroma, base = choose(
        rng, [(32.0, 0.09, 0.48), (38.0, 0.06, 0.42), (70.0, 0.05, 0.68), (25.0, 0.1, 0.4), (80.0, 0.02, 0.6)]
    )
    base += uniform(rng, -0.05, 0.05)
    palette = tuple(
        shade(base + step, chroma * uniform(rng, 0.7, 1.2), hue + uniform(rng, -8, 8))
        for step in (-0.08, -0.02, 0.04, 0.08)
    )
    mortar = shade(uniform(rng, 0.55, 0.75), 0.015, 80.0)
    rows = 28
    bricks = Bricks(
        256,
        new_seed(rng),
        palette,
        mortar,
        rows,
        9,
        0.5 if chance(rng, 0.8) else 0.0,
        uniform(rng, 0.1, 0.16),
        0.08,
    )
    return tiled(bricks, rows * uniform(rng, 0.073, 0.088))


def trim(rng: np.random.Generator) -> Material:
    """Painted window sills, frames and cornices: mostly white."""
    hue = uniform(rng, 20.0, 280.0)
    color = (
        shade(uniform(rng, 0.8, 0.95), 0.015, 90.0)
        if chance(rng, 0.65)
        else shade(uniform(rng, 0.25, 0.6), 0.05, hue)
    )
    return tiled(NearTextureless(64, new_seed(rng), color, 0.04, 0.03), 1.5)


def windows(
    rng: np.random.Generator,
    opening: tuple[float, float],
    sill: float,
    cell_m: float,
    frame: Srgb,
    lit: float,
) -> Material:
    """Windows behind the openings of a wall (`scenes.textures.houses.WindowPanes`), glowing where some are lit.

    `opening` and `sill` are shares of a cell, one bay of one floor, which is `cell_m` of texture coordinates;
    `lit` is the share of the windows with light behind them.
    """
    panes = replace(WindowPanes.sample(rng, 320), opening=opening, sill=sill, frame=frame, lit=lit)
    material = tiled(panes, WindowPanes.CELLS * cell_m)
    if lit:
        return replace(material, emission=0.25, specular=0.3, roughness=0.3)
    return replace(material, specular=uniform(rng, 0.5, 0.9), roughness=uniform(rng, 0.02, 0.12))


def shop_window(rng: np.random.Generator, lit: float) -> Material:
    """Goods behind glass; glowing where `lit` is above 0."""
    kinds: list[type[Texture]] = [DeadLeaves, BlurredShapes, Layered]
    goods = tiled(choose(rng, kinds).sample(rng, 128), uniform(rng, 2.0, 4.0))
    if lit:
        return replace(goods, emission=uniform(rng, 0.3, 0.8), specular=0.3, roughness=0.3)
    return replace(goods, specular=0.6, roughness=0.05)


def shop_board(rng: np.random.Generator) -> Material:
    """A shop's lettered name board."""
    return tiled(
        replace(GlyphRows.sample(rng, 128), lines=3, letters=integer(rng, 4, 6)), uniform(rng, 1.4, 1.9)
    )


def roof(rng: np.random.Generator) -> Material:
    """Roof tiles or slates."""
    tiles = RoofTiles.sample(rng, 256)
    return tiled(tiles, tiles.rows * uniform(rng, 0.2, 0.32))


def skyline(rng: np.random.Generator) -> Material:
    """The facade of a large building far away."""
    color, frame = (
        shade(uniform(rng, 0.5, 0.85), uniform(rng, 0.0, 0.04), uniform(rng, 30.0, 100.0)),
        shade(0.8, 0.01, 90.0),
    )
    dark, light = shade(0.25, 0.02, 240.0), shade(0.55, 0.03, 230.0)
    facade = replace(Facade.sample(rng, 256), palette=(color, frame, dark, light))
    return tiled(facade, facade.floors * 3.2)


def car_paint(rng: np.random.Generator) -> Material:
    """The paint of a vehicle: half of them white, grey or black, the others of any colour."""
    lightness = uniform(rng, 0.18, 0.96)
    vivid = chance(rng, 0.5)
    hue = choose(rng, [28.0, 255.0, 250.0, 140.0, 90.0, 60.0, 200.0]) + uniform(rng, -12.0, 12.0)
    color = shade(
        min(lightness, 0.75) if vivid else lightness, uniform(rng, 0.06, 0.2) if vivid else 0.008, hue
    )
    return plain(
        color,
        roughness=uniform(rng, 0.12, 0.35),
        specular=uniform(rng, 0.5, 0.8),
        metallic=0.3 * (rng.random() < 0.4),
    )


def car_glass(rng: np.random.Generator) -> Material:
    """The dark windows of vehicles."""
    return plain(
        shade(uniform(rng, 0.16, 0.3), 0.02, uniform(rng, 160.0, 260.0)), roughness=0.03, specular=0.9
    )


def black_plastic() -> Material:
    """Bumpers, grilles and the housings of traffic lights."""
    return plain((26, 26, 28), roughness=0.6, specular=0.3)


def lamp(color: Srgb, lit: float) -> Material:
    """The glass of a lamp: shiny, with the emission `lit`."""
    return replace(plain(color, roughness=0.15, specular=0.6), emission=lit)


def wheel(rng: np.random.Generator, radius_m: float, width_m: float) -> Material:
    """The side of a wheel of a radius and a width in metres, unrolled onto its tread."""
    face = WheelFace.sample(rng, 128)
    # The picture is as wide as the wheel with its tread unrolled.
    side_m = 2.02 * (radius_m + 0.5 * width_m)
    return tiled(replace(face, rim=0.97 * 0.66 * 2 * radius_m / side_m), side_m)


def lettering(rng: np.random.Generator, color: Srgb) -> Material:
    """The side of a lorry's box or of a bus: a colour with large words on it."""
    glyphs = replace(GlyphRows.sample(rng, 256), lines=4, letters=integer(rng, 7, 9), grain=0.015)
    ink = shade(0.3, 0.12, uniform(rng, 0.0, 360.0)) if sum(color) > 380 else shade(0.92, 0.02, 90.0)
    return replace(
        tiled(replace(glyphs, palette=(color, ink)), uniform(rng, 2.6, 3.4)), specular=0.4, roughness=0.4
    )


def foliage(rng: np.random.Generator) -> Material:
    """The leaves of street trees, hedges and shrubs."""
    return tiled(Foliage.sample(rng, 256), uniform(rng, 1.4, 2.2))


def bark(rng: np.random.Generator) -> Material:
    """The stems of street trees."""
    return tiled(Bark.sample(rng, 128), 0.8)


def metal_paint(rng: np.random.Generator) -> Material:
    """Painted metal: posts, bins, railings."""
    color = shade(uniform(rng, 0.2, 0.75), uniform(rng, 0.0, 0.05), choose(rng, [150.0, 250.0, 90.0]))
    return tiled(NearTextureless(64, new_seed(rng), color, 0.06, 0.04), 0.8)


def fence(rng: np.random.Generator, kind: str) -> Material:
    """For a style of `scenes.shapes.street.boundaries.Fence`."""
    if kind == "wall":
        return wall(rng, 0.3)
    return wood(rng) if kind in ("boards", "picket") and chance(rng, 0.6) else metal_paint(rng)


def wood(rng: np.random.Generator) -> Material:
    """Planks of benches and fences."""
    base = uniform(rng, 0.45, 0.75)
    palette = (shade(base, 0.06, 65.0), shade(base - 0.15, 0.06, 60.0))
    return tiled(replace(WoodPlanks.sample(rng, 128), palette=palette, planks=4), 0.9)


def cloth(rng: np.random.Generator) -> Material:
    """Clothes: mostly plain and muted, some striped or checked."""
    kind = rng.random()
    if kind < 0.7:
        color = shade(uniform(rng, 0.2, 0.85), log_uniform(rng, 0.01, 0.16), uniform(rng, 0.0, 360.0))
        return tiled(NearTextureless(64, new_seed(rng), color, 0.1, 0.08), 0.35)
    if kind < 0.85:
        return tiled(replace(Stripes.sample(rng, 64), palette=sample_palette(rng, 4)), 0.25)
    return tiled(replace(Plaid.sample(rng, 64), palette=sample_palette(rng, 4)), 0.25)


def skin(rng: np.random.Generator) -> Material:
    """Human skin."""
    lightness = uniform(rng, 0.42, 0.83)
    return plain(shade(lightness, 0.06, 55.0), roughness=0.7, specular=0.2)


def hair(rng: np.random.Generator) -> Material:
    """Human hair, or a cap."""
    return plain(
        choose(
            rng,
            [
                shade(0.2, 0.02, 60.0),
                shade(0.32, 0.05, 60.0),
                shade(0.65, 0.08, 80.0),
                shade(0.75, 0.01, 90.0),
                shade(0.45, 0.12, 40.0),
            ],
        )
    )


def sign_face(rng: np.random.Generator, corners: int) -> Material:
    """The face of a traffic sign with a number of corners, 0 for a disc."""
    face = RoadSign.sample(rng, 128)
    while face.corners != corners:
        face = RoadSign.sample(rng, 128)
    return tiled(face, 1.0)
