"""Textures of the materials of landscapes and characters, in the colours of those materials.

Each function here is a `TextureSampler`, or returns one for a range of colours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from scenes.appearance.painting import Palette
from scenes.appearance.palettes import (
    BARK,
    CLOTH,
    DRY_GRASS,
    EARTH,
    FOLIAGE,
    HAIR,
    MOSS,
    PLASTER,
    RED_ROCK,
    ROCK,
    SAND,
    SKIN,
    SNOW,
    TILES,
    VIVID,
    PaletteRange,
    sample_palette_in,
)
from scenes.random_draws import choose, integer, new_seed, uniform
from scenes.spec import Texture
from scenes.textures.cells import Cobblestones, VoronoiCells
from scenes.textures.collages import DeadLeaves
from scenes.textures.natural import Hair, Iris, LeafVeins, Litter, RoughBark, Strata
from scenes.textures.noise import FractalNoise, Labyrinth, WoodPlanks
from scenes.textures.plain import Gradient, NearTextureless
from scenes.textures.structured import HewnRock, SandRipples, WovenCloth
from scenes.textures.tiles import Bricks, Dots, Stripes, Weave

TextureSampler = Callable[[np.random.Generator, int], Texture]
"""Draws a texture of `size` x `size` pixels: called with a generator and the size."""
_Pattern = Dots | Gradient | Labyrinth | Stripes | Weave
"""Patterns whose colours may be replaced."""


def leaves(colors: PaletteRange = FOLIAGE) -> TextureSampler:
    """Leaves: veined, or blotched where they are too small to show veins."""

    def sample(rng: np.random.Generator, size: int) -> Texture:
        palette = sample_palette_in(rng, colors, 4)
        if rng.random() < 0.6:
            return LeafVeins.of(rng, size, palette[:3], palette[3])
        return _noise(rng, size, palette)

    return sample


def ground(colors: PaletteRange, under: PaletteRange = EARTH) -> TextureSampler:
    """Grass, litter, moss or snow over soil of the colours `under`."""

    def sample(rng: np.random.Generator, size: int) -> Texture:
        palette = (sample_palette_in(rng, under, 2)[0], *sample_palette_in(rng, colors, 4))
        return Litter.of(rng, size, palette) if rng.random() < 0.65 else _noise(rng, size, palette)

    return sample


def grains(colors: PaletteRange) -> TextureSampler:
    """Sand, snow, dust: ripples of the wind, or soft clouds and grit of one colour."""

    def sample(rng: np.random.Generator, size: int) -> Texture:
        if rng.random() < 0.6:
            return SandRipples.of(rng, size, sample_palette_in(rng, colors, 4))
        noise = FractalNoise.sample(rng, size)
        return replace(
            noise, palette=sample_palette_in(rng, colors, 4), slope=uniform(rng, 0.5, 1.0), ridges=False
        )

    return sample


def rock(colors: PaletteRange = ROCK, dust: PaletteRange = MOSS) -> TextureSampler:
    """Layered, jointed or massive rock with moss, sand or snow in its hollows; `dust` are the colours of those."""

    def sample(rng: np.random.Generator, size: int) -> Texture:
        if rng.random() < 0.45:
            palette = (*sample_palette_in(rng, colors, 4), sample_palette_in(rng, dust, 1)[0])
            return HewnRock.of(rng, size, palette)
        return Strata.of(rng, size, sample_palette_in(rng, colors, 4), sample_palette_in(rng, dust, 1)[0])

    return sample


def masonry(colors: PaletteRange) -> TextureSampler:
    """Dressed stone: blocks, rubble or plain weathered stone."""

    def sample(rng: np.random.Generator, size: int) -> Texture:
        palette = sample_palette_in(rng, colors, 4)
        kind = rng.random()
        if kind < 0.35:
            return replace(Bricks.sample(rng, size), palette=palette[1:], mortar=palette[0])
        if kind < 0.5:
            return replace(Cobblestones.sample(rng, size), palette=palette)
        return rock(colors)(rng, size)

    return sample


def paving(rng: np.random.Generator, size: int) -> Texture:
    """Cobbles, flagstones or trodden earth."""
    palette = sample_palette_in(rng, choose(rng, (ROCK, EARTH, SAND)), 4)
    kind = rng.random()
    if kind < 0.5:
        return replace(Cobblestones.sample(rng, size), palette=palette, cells=integer(rng, 10, 24))
    if kind < 0.75:
        return replace(VoronoiCells.sample(rng, size), palette=palette[1:], joint=palette[0])
    return _noise(rng, size, palette)


def plaster(rng: np.random.Generator, size: int) -> Texture:
    """Painted or weathered walls."""
    palette = sample_palette_in(rng, PLASTER, 4)
    return _noise(rng, size, palette) if rng.random() < 0.6 else Strata.of(rng, size, palette, palette[0])


def roofing(rng: np.random.Generator, size: int) -> Texture:
    """Tiles, or thatch."""
    palette = sample_palette_in(rng, TILES, 4)
    if rng.random() < 0.7:
        return replace(Bricks.sample(rng, size), palette=palette[1:], mortar=palette[0])
    return Hair.of(rng, size, sample_palette_in(rng, DRY_GRASS, 4), palette[0])


def bark(rng: np.random.Generator, size: int) -> Texture:
    """Ridged bark with lichen."""
    return RoughBark.of(rng, size, sample_palette_in(rng, BARK, 4), sample_palette_in(rng, MOSS, 2)[1])


def culm(rng: np.random.Generator, size: int) -> Texture:
    """The green or yellow stems of bamboo."""
    palette = sample_palette_in(rng, replace(FOLIAGE, hue_deg=(90.0, 130.0)), 4)
    return RoughBark.of(rng, size, palette, sample_palette_in(rng, DRY_GRASS, 2)[1])


def timber(rng: np.random.Generator, size: int) -> Texture:
    """Planks."""
    return replace(WoodPlanks.sample(rng, size), palette=sample_palette_in(rng, BARK, 2))


def fur(rng: np.random.Generator, size: int) -> Texture:
    """Fur: half of it in the colours of real animals, half in vivid ones."""
    colors = choose(rng, (HAIR, VIVID))
    palette, marking = (
        sample_palette_in(rng, colors, 4),
        sample_palette_in(rng, choose(rng, (HAIR, VIVID)), 2)[1],
    )
    if rng.random() < 0.7:
        return Hair.of(rng, size, palette, marking)
    return replace(Labyrinth.sample(rng, size), palette=(*palette[1:3], marking))


def hide(rng: np.random.Generator, size: int) -> Texture:
    """Bare skin of creatures: scales, spots, blotches."""
    palette = sample_palette_in(rng, choose(rng, (VIVID, VIVID, EARTH)), 4)
    kind = integer(rng, 0, 3)
    if kind == 0:
        return replace(Labyrinth.sample(rng, size), palette=palette[:3])
    if kind == 1:
        return replace(VoronoiCells.sample(rng, size), palette=palette[1:], joint=palette[0])
    if kind == 2:
        return replace(DeadLeaves.sample(rng, size), palette=palette, corners=0)
    return _noise(rng, size, palette)


def skin(rng: np.random.Generator, size: int) -> Texture:
    """Human skin: of one colour, a little blotched, with pores."""
    color = sample_palette_in(rng, SKIN, 3)[1]
    return NearTextureless(size, new_seed(rng), color, uniform(rng, 0.03, 0.07), uniform(rng, 0.02, 0.05))


def hair(rng: np.random.Generator, size: int) -> Texture:
    """Human hair."""
    palette = sample_palette_in(rng, HAIR, 3)
    return replace(Hair.of(rng, size, palette, palette[0]), pattern="none")


def leather(rng: np.random.Generator, size: int) -> Texture:
    """Brown leather."""
    return _noise(rng, size, sample_palette_in(rng, BARK, 3), low_cycles=8.0)


def cloth(rng: np.random.Generator, size: int) -> Texture:
    """Cloth of one hue: woven of fine threads, striped, worn; now and then spotted or dyed in clouds."""
    palette = sample_palette_in(rng, CLOTH, 3, hue_spread_deg=40.0)
    kind = rng.random()
    if kind < 0.8:
        one, two, faded = (palette[int(k)] for k in rng.permutation(3))
        return WovenCloth.of(rng, size, (one, two, faded))
    if kind < 0.9:
        return _noise(rng, size, palette, low_cycles=4.0)
    dots = Dots.sample(rng, size)
    return _recolored(replace(dots, columns=2 * integer(rng, 7, 14), grain=0.03), palette)


def straw(rng: np.random.Generator, size: int) -> Texture:
    """Plaited straw."""
    palette = sample_palette_in(rng, DRY_GRASS, 2)
    return replace(Weave.sample(rng, size), palette=palette, strands=2 * integer(rng, 14, 24), gap=0.15)


def painted_boards(rng: np.random.Generator, size: int) -> Texture:
    """Boards in stripes of paint."""
    stripes = Stripes.sample(rng, size)
    return _recolored(stripes, sample_palette_in(rng, VIVID, 3, hue_spread_deg=120.0))


def cap(rng: np.random.Generator, size: int) -> Texture:
    """The skin of mushrooms."""
    palette = sample_palette_in(rng, choose(rng, (VIVID, VIVID, EARTH)), 3, hue_spread_deg=40.0)
    kind = choose(rng, (Dots, Labyrinth, Gradient, None), (0.3, 0.25, 0.2, 0.25))
    if kind is None:
        return _noise(rng, size, palette)
    return _recolored(kind.sample(rng, size), palette)


def eye(rng: np.random.Generator, size: int) -> Texture:
    """The iris, pupil and white of an eye (`scenes.textures.natural.Iris`)."""
    return Iris.sample(rng, size)


def horn(rng: np.random.Generator, size: int) -> Texture:
    """Pale ridged horn; also the stems of mushrooms."""
    return RoughBark.of(rng, size, sample_palette_in(rng, PLASTER, 3), sample_palette_in(rng, EARTH, 1)[0])


SNOWY = rock(ROCK, SNOW)
"""Rock with snow in its hollows."""
DESERT_ROCK = rock(RED_ROCK, SAND)
"""Red rock with sand in its hollows."""


def _noise(rng: np.random.Generator, size: int, palette: Palette, low_cycles: float = 3.0) -> Texture:
    noise = FractalNoise.sample(rng, size)
    return replace(noise, palette=palette, low_cycles=low_cycles * uniform(rng, 0.7, 1.5))


def _recolored(texture: _Pattern, palette: Palette) -> Texture:
    """The same pattern in other colours, as many as it had."""
    colors = tuple(palette[k % len(palette)] for k in range(len(texture.palette)))
    return replace(texture, palette=colors)
