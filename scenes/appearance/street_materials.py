"""Materials of streets, for metric shapes: a texture, its scale in metres, and how it reflects light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenes.appearance.materials import Shares, plain, tiled
from scenes.appearance.painting import Srgb, sample_palette, shade
from scenes.random_draws import chance, choose, integer, log_uniform, new_seed, uniform
from scenes.spec import Material, Texture
from scenes.textures.collages import BlurredShapes, DeadLeaves, Facade, GlyphRows
from scenes.textures.foliage import Bark, Foliage, Grass
from scenes.textures.houses import Plaster, RoofTiles, WindowPanes
from scenes.textures.layers import Layered
from scenes.textures.natural import Hair
from scenes.textures.noise import WoodPlanks
from scenes.textures.plain import NearTextureless
from scenes.textures.streets import Asphalt, Paving, RoadMarkingPaint, RoadSign
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


def wall(rng: np.random.Generator, plastered: float, shares: Shares) -> Material:
    """Brick, plaster, or smooth paint; `plastered` is the share of all but brick."""
    if chance(rng, plastered):
        if chance(rng, 0.5 * shares.plain):
            return smooth_wall(rng)
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


def smooth_wall(rng: np.random.Generator) -> Material:
    """A wall of one colour: painted, rendered, or of smooth concrete."""
    hue = choose(rng, [75.0, 85.0, 60.0, 40.0, 150.0, 240.0])
    color = shade(uniform(rng, 0.5, 0.93), uniform(rng, 0.0, 0.06), hue)
    return tiled(
        NearTextureless(128, new_seed(rng), color, uniform(rng, 0.005, 0.03), 0.004), uniform(rng, 3.0, 6.0)
    )


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
        return replace(material, emission=uniform(rng, 0.15, 0.3), specular=0.4, roughness=0.15)
    return replace(material, specular=uniform(rng, 0.5, 0.9), roughness=uniform(rng, 0.02, 0.12))


def shop_window(rng: np.random.Generator, lit: float) -> Material:
    """Posters and goods right behind glass; glowing where `lit` is above 0."""
    goods = replace(shop_goods(rng, lit), emission=uniform(rng, 0.2, 0.45) if lit else 0.0)
    return replace(goods, specular=0.6, roughness=0.05)


def shop_goods(rng: np.random.Generator, lit: float) -> Material:
    """What is on show, of many colours, in the light of the shop's own lamps."""
    kinds: list[type[Texture]] = [DeadLeaves, BlurredShapes, Layered]
    goods = tiled(choose(rng, kinds).sample(rng, 128), uniform(rng, 1.2, 3.0))
    return replace(goods, emission=uniform(rng, 0.25, 0.6) if lit else uniform(rng, 0.05, 0.2))


def shop_room(rng: np.random.Generator, lit: float) -> Material:
    """The walls of a shop: light paint, paper, boards."""
    color = shade(uniform(rng, 0.5, 0.95), uniform(rng, 0.0, 0.06), uniform(rng, 30.0, 250.0))
    paint = NearTextureless(64, new_seed(rng), color, 0.05, 0.02)
    room = wood(rng) if chance(rng, 0.3) else tiled(paint, 2.0)
    return replace(room, emission=uniform(rng, 0.15, 0.5) if lit else uniform(rng, 0.04, 0.15))


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


def black_plastic() -> Material:
    """Bumpers, grilles and the housings of traffic lights."""
    return plain((26, 26, 28), roughness=0.6, specular=0.3)


def lamp(color: Srgb, lit: float) -> Material:
    """The glass of a lamp: shiny, with the emission `lit`."""
    return replace(plain(color, roughness=0.15, specular=0.6), emission=lit)


def foliage(rng: np.random.Generator) -> Material:
    """The leaves of street trees, hedges and shrubs."""
    return tiled(Foliage.sample(rng, 256), uniform(rng, 1.4, 2.2))


def bark(rng: np.random.Generator) -> Material:
    """The stems of street trees."""
    return tiled(Bark.sample(rng, 128), 0.8)


def metal(rng: np.random.Generator, shares: Shares) -> Material:
    """Painted or bare metal: posts, bins, railings."""
    if chance(rng, shares.metallic):
        bare = shade(uniform(rng, 0.55, 0.75), 0.006, 250.0)
        dull = NearTextureless(64, new_seed(rng), bare, 0.08, 0.05)
        return replace(tiled(dull, 0.5), roughness=uniform(rng, 0.3, 0.55), metallic=1.0)
    color = shade(uniform(rng, 0.2, 0.75), uniform(rng, 0.0, 0.05), choose(rng, [150.0, 250.0, 90.0]))
    return tiled(NearTextureless(64, new_seed(rng), color, 0.06, 0.04), 0.8)


def fence(rng: np.random.Generator, kind: str, shares: Shares) -> Material:
    """For a style of `scenes.shapes.street.boundaries.Fence`."""
    if kind == "wall":
        return smooth_wall(rng) if chance(rng, shares.plain) else wall(rng, 0.3, shares)
    return wood(rng) if kind in ("boards", "picket") and chance(rng, 0.6) else metal(rng, shares)


def wood(rng: np.random.Generator) -> Material:
    """Planks of benches and fences."""
    base = uniform(rng, 0.45, 0.75)
    palette = (shade(base, 0.06, 65.0), shade(base - 0.15, 0.06, 60.0))
    return tiled(replace(WoodPlanks.sample(rng, 128), palette=palette, planks=4), 0.9)


def cloth(rng: np.random.Generator, shares: Shares) -> Material:
    """Clothes: mostly muted; plain, mottled, striped or checked."""
    kind = rng.random()
    if kind < 0.75:
        color = shade(uniform(rng, 0.2, 0.85), log_uniform(rng, 0.01, 0.12), uniform(rng, 0.0, 360.0))
        if chance(rng, shares.plain):
            return plain(color)
        return tiled(NearTextureless(64, new_seed(rng), color, 0.1, 0.08), 0.35)
    if kind < 0.88:
        return tiled(replace(Stripes.sample(rng, 64), palette=sample_palette(rng, 4)), 0.25)
    return tiled(replace(Plaid.sample(rng, 64), palette=sample_palette(rng, 4)), 0.25)


def skin(rng: np.random.Generator) -> Material:
    """Human skin."""
    lightness = uniform(rng, 0.42, 0.83)
    return plain(shade(lightness, 0.06, 55.0), roughness=0.7, specular=0.2)


def features() -> Material:
    """Eyes, brows and mouths."""
    return plain(shade(0.27, 0.04, 30.0))


def leather(rng: np.random.Generator) -> Material:
    """Shoes, bags and hats."""
    color = shade(uniform(rng, 0.15, 0.6), log_uniform(rng, 0.005, 0.1), uniform(rng, 20.0, 300.0))
    return plain(color, roughness=uniform(rng, 0.4, 0.8), specular=0.3)


def hair(rng: np.random.Generator) -> Material:
    """Human hair in strands of dark and light."""
    middle, chroma, hue = choose(
        rng,
        [(0.2, 0.02, 60.0), (0.32, 0.05, 60.0), (0.65, 0.08, 80.0), (0.75, 0.01, 90.0), (0.42, 0.1, 42.0)],
    )
    palette = tuple(shade(max(0.1, middle + step), chroma, hue) for step in (-0.1, -0.04, 0.03, 0.1))
    return tiled(replace(Hair.of(rng, 64, palette, palette[0]), pattern="none"), 0.12)


def sign_face(rng: np.random.Generator, corners: int) -> Material:
    """The face of a traffic sign with a number of corners, 0 for a disc."""
    face = RoadSign.sample(rng, 128)
    while face.corners != corners:
        face = RoadSign.sample(rng, 128)
    return tiled(face, 1.0)
