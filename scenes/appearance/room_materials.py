"""Materials of rooms, by what a part is made of: painted walls, wood, cloth, lacquer, glass, chrome.

A part's name says what it is made of (`scenes.shapes.indoor.parts`). Its whole name is looked up first, then
the first word of it. A room has a few materials of each kind, and its things share them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from scenes.appearance.materials import Shares, plain, sample_texture, tiled
from scenes.appearance.painting import Palette, Srgb, sample_palette, shade
from scenes.appearance.palettes import BARK, CLOTH, EARTH, FOLIAGE, HAIR, PaletteRange, sample_palette_in
from scenes.random_draws import chance, choose, log_uniform, new_seed, uniform
from scenes.spec import Material, Texture
from scenes.textures.cells import VoronoiCells
from scenes.textures.collages import DeadLeaves, GlyphRows
from scenes.textures.houses import Plaster
from scenes.textures.interiors import BookSpines, GlazedTiles, Parquet
from scenes.textures.layers import Layered
from scenes.textures.natural import Hair, LeafVeins
from scenes.textures.noise import FractalNoise, Marble, WoodPlanks
from scenes.textures.plain import NearTextureless
from scenes.textures.tiles import Bricks, Checkers, Dots, Plaid, Stripes, Weave

GREYS = PaletteRange((40.0, 270.0), (0.002, 0.02), (0.25, 0.9))


def _wood_palette(rng: np.random.Generator, count: int) -> Palette:
    """Shades of one wood from dark to light, near to each other as in planed wood."""
    middle, step = uniform(rng, 0.35, 0.82), uniform(rng, 0.02, 0.07)
    chroma, hue = uniform(rng, 0.03, 0.09), uniform(rng, 50.0, 78.0)
    shades = np.linspace(middle - step, middle + step, count).tolist()
    return tuple(shade(lightness, chroma, hue) for lightness in shades)


_Pattern = Checkers | DeadLeaves | Dots | Marble | Plaid | Stripes
"""Patterns whose colours may be replaced."""


def _patterned(
    rng: np.random.Generator, kinds: Sequence[type[_Pattern]], size: int, palette: Palette
) -> Texture:
    """A pattern of one of the kinds in given colours."""
    pattern = choose(rng, kinds).sample(rng, size)
    return replace(pattern, palette=palette)


MaterialSampler = Callable[[np.random.Generator, Shares], Material]


@dataclass
class RoomMaterials:
    """The materials of one room so far: up to a few of each kind, drawn when they are first asked for."""

    shares: Shares
    _pools: dict[str, list[Material]] = field(default_factory=dict)

    def pick(self, rng: np.random.Generator, part: str) -> Material:
        """A material for a part of a thing, by its name."""
        kind = part if part in _KINDS else part.split()[0]
        sampler, most = _KINDS[kind]
        pool = self._pools.setdefault(kind, [])
        if len(pool) < most and (not pool or chance(rng, 0.6)):
            pool.append(sampler(rng, self.shares))
            return pool[-1]
        return choose(rng, pool)


def _glossy(rng: np.random.Generator, material: Material) -> Material:
    return replace(material, roughness=log_uniform(rng, 0.04, 0.25), specular=uniform(rng, 0.4, 0.7))


def _finished(rng: np.random.Generator, shares: Shares, material: Material, weight: float = 1.0) -> Material:
    """The material as it is, or glossy; `weight` says how much oftener than most surfaces it is glossy."""
    return _glossy(rng, material) if chance(rng, min(1.0, weight * shares.glossy)) else material


def _single(rng: np.random.Generator, color: Srgb, wear: float = 0.02) -> Material:
    """One colour, or one that is a little uneven."""
    if chance(rng, 0.6):
        return plain(color)
    return tiled(NearTextureless(64, new_seed(rng), color, wear * uniform(rng, 0.3, 1.5), 0.004), 1.2)


def _muted(rng: np.random.Generator, low: float = 0.25, high: float = 0.92) -> Srgb:
    return shade(uniform(rng, low, high), log_uniform(rng, 0.006, 0.13), uniform(rng, 0.0, 360.0))


def wall(rng: np.random.Generator, shares: Shares) -> Material:
    """Painted walls, mostly light; wallpaper, tiles, bricks, boards, concrete."""
    if chance(rng, shares.plain):
        strong = chance(rng, 0.25)
        lightness = uniform(rng, 0.35, 0.75) if strong else uniform(rng, 0.78, 0.96)
        chroma = uniform(rng, 0.03, 0.11) if strong else uniform(rng, 0.0, 0.035)
        return _single(rng, shade(lightness, chroma, uniform(rng, 20.0, 280.0)), 0.012)
    kind = choose(rng, ["paper", "tiles", "bricks", "boards", "concrete"], [0.35, 0.25, 0.12, 0.13, 0.15])
    if kind == "paper":
        palette = sample_palette_in(rng, CLOTH, 4, 40.0)
        if chance(rng, 0.25):
            return tiled(LeafVeins.of(rng, 256, palette[:3], palette[3]), uniform(rng, 0.5, 0.9))
        return tiled(_patterned(rng, [Stripes, Dots, Plaid], 256, palette), uniform(rng, 0.4, 1.2))
    if kind == "tiles":
        return wall_tiles(rng, shares)
    if kind == "bricks":
        palette = sample_palette_in(
            rng, choose(rng, [PaletteRange((25.0, 60.0), (0.05, 0.1), (0.4, 0.65)), GREYS]), 4
        )
        mortar = shade(uniform(rng, 0.6, 0.85), 0.01, 80.0)
        return tiled(Bricks(256, new_seed(rng), palette, mortar, 16, 5, 0.5, 0.14, 0.06), 16 * 0.075)
    if kind == "boards":
        return tiled(
            replace(WoodPlanks.sample(rng, 256), palette=_wood_palette(rng, 2), planks=6, grain=0.03),
            0.9,
        )
    grey = shade(uniform(rng, 0.55, 0.9), uniform(rng, 0.0, 0.02), uniform(rng, 40.0, 110.0))
    return tiled(
        Plaster(256, new_seed(rng), grey, uniform(rng, 0.02, 0.07), 0.0, 0.03), uniform(rng, 2.0, 3.5)
    )


def wall_tiles(rng: np.random.Generator, shares: Shares) -> Material:
    """Glazed tiles: square or running bond, of one shade or a few."""
    lightness = uniform(rng, 0.5, 0.95)
    chroma, hue = uniform(rng, 0.0, 0.08), uniform(rng, 0.0, 360.0)
    palette = tuple(shade(lightness + d * uniform(rng, 0.1, 1.0), chroma, hue) for d in (-0.04, 0.0, 0.03))
    joint = shade(choose(rng, [0.35, 0.7, 0.9]), 0.01, 90.0)
    rows, columns, bond = choose(rng, [(10, 10, 0.0), (8, 8, 0.0), (12, 6, 0.5), (12, 4, 0.0)])
    tiles = GlazedTiles(256, new_seed(rng), palette, joint, rows, columns, bond, uniform(rng, 0.03, 0.06))
    return _finished(rng, shares, tiled(tiles, rows * choose(rng, [0.1, 0.15, 0.2])), 2.5)


def ceiling(rng: np.random.Generator, shares: Shares) -> Material:
    """White paint; suspended tiles or boards."""
    if chance(rng, max(shares.plain, 0.6)):
        return _single(rng, shade(uniform(rng, 0.88, 0.97), 0.008, 90.0), 0.01)
    if chance(rng, 0.6):
        white = tuple(shade(uniform(rng, 0.82, 0.93), 0.006, 90.0) for _ in range(3))
        return tiled(GlazedTiles(256, new_seed(rng), white, shade(0.65, 0.01, 90.0), 4, 4, 0.0, 0.02), 2.4)
    return tiled(
        replace(WoodPlanks.sample(rng, 256), palette=_wood_palette(rng, 2), planks=6, grain=0.03),
        0.9,
    )


def floor(rng: np.random.Generator, shares: Shares) -> Material:
    """Boards, parquet, tiles, carpet, linoleum, concrete, polished stone."""
    kind = choose(
        rng, ["boards", "parquet", "tiles", "checks", "carpet", "lino", "concrete", "stone"],
        [0.16, 0.22, 0.2, 0.05, 0.1, 0.17, 0.06, 0.04],
    )  # fmt: skip
    if kind == "boards":
        wood = replace(WoodPlanks.sample(rng, 400), palette=_wood_palette(rng, 2), planks=6, grain=0.03)
        return _finished(rng, shares, tiled(wood, uniform(rng, 0.8, 1.2)))
    if kind == "parquet":
        parquet = replace(Parquet.sample(rng, 400), palette=_wood_palette(rng, 3))
        return _finished(rng, shares, tiled(parquet, parquet.blocks * uniform(rng, 0.06, 0.12)))
    if kind == "tiles":
        base, hue = uniform(rng, 0.4, 0.9), uniform(rng, 30.0, 260.0)
        palette = tuple(shade(base + d, uniform(rng, 0.0, 0.03), hue) for d in (-0.03, 0.0, 0.03))
        joint = shade(max(0.2, base - uniform(rng, 0.1, 0.4)), 0.01, 90.0)
        rows, columns, bond = choose(rng, [(4, 4, 0.0), (6, 6, 0.0), (6, 3, 0.5)])
        tiles = GlazedTiles(
            320, new_seed(rng), palette, joint, rows, columns, bond, uniform(rng, 0.015, 0.04)
        )
        return _finished(rng, shares, tiled(tiles, rows * choose(rng, [0.2, 0.3, 0.45])), 1.6)
    if kind == "checks":
        checks = replace(
            Checkers.sample(rng, 320),
            palette=sample_palette_in(rng, GREYS, 2),
            squares=8,
            wear=0.03,
            grain=0.01,
        )
        return _finished(rng, shares, tiled(checks, 8 * uniform(rng, 0.2, 0.4)), 1.6)
    if kind == "carpet":
        if chance(rng, shares.plain):
            return tiled(NearTextureless(128, new_seed(rng), _muted(rng, 0.3, 0.75), 0.04, 0.1), 0.5)
        return tiled(
            replace(Weave.sample(rng, 256), palette=sample_palette_in(rng, CLOTH, 2)), uniform(rng, 0.2, 0.5)
        )
    if kind == "lino":
        if chance(rng, shares.plain):
            return _finished(rng, shares, _single(rng, _muted(rng, 0.35, 0.85)))
        specks = replace(DeadLeaves.sample(rng, 256), palette=sample_palette_in(rng, GREYS, 4))
        return _finished(rng, shares, tiled(specks, uniform(rng, 0.5, 1.0)))
    if kind == "concrete":
        grey = shade(uniform(rng, 0.45, 0.75), 0.01, 80.0)
        return _finished(rng, shares, tiled(Plaster(256, new_seed(rng), grey, 0.08, 0.0, 0.08), 2.5))
    return stone(rng, shares)


def stone(rng: np.random.Generator, shares: Shares) -> Material:
    """Marble, granite, terrazzo; or a plain worktop."""
    if chance(rng, 0.5 * shares.plain):
        return _finished(rng, shares, _single(rng, _muted(rng, 0.3, 0.9)), 1.5)
    palette = sample_palette_in(rng, GREYS, 4)
    if chance(rng, 0.33):
        cells = replace(VoronoiCells.sample(rng, 256), palette=palette[1:], joint=palette[0])
        return _finished(rng, shares, tiled(cells, uniform(rng, 0.3, 0.6)), 2.0)
    pattern = _patterned(rng, [Marble, DeadLeaves], 256, palette)
    return _finished(rng, shares, tiled(pattern, uniform(rng, 0.5, 1.2)), 2.0)


def wood(rng: np.random.Generator, shares: Shares) -> Material:
    """Furniture of wood, matte or varnished: boards glued so that their joints hardly show."""
    texture = replace(
        WoodPlanks.sample(rng, 256),
        palette=_wood_palette(rng, 2),
        planks=choose(rng, [1, 2, 3]),
        grain=0.025,
        joint=uniform(rng, 0.0, 0.1),
    )
    return _finished(rng, shares, tiled(texture, uniform(rng, 0.4, 0.8)))


def lacquer(rng: np.random.Generator, shares: Shares) -> Material:
    """Painted furniture: half of it white or grey."""
    color = shade(uniform(rng, 0.75, 0.96), 0.008, 90.0) if chance(rng, 0.5) else _muted(rng)
    return _finished(rng, shares, plain(color), 1.6)


def vivid(rng: np.random.Generator, shares: Shares) -> Material:
    """Plastic of any colour."""
    color = shade(uniform(rng, 0.2, 0.85), uniform(rng, 0.0, 0.2), uniform(rng, 0.0, 360.0))
    return _finished(rng, shares, plain(color), 1.5)


def ceramic(rng: np.random.Generator, shares: Shares) -> Material:
    """Glazed: white, of one colour, or banded."""
    if chance(rng, shares.plain):
        color = shade(uniform(rng, 0.8, 0.96), 0.01, 90.0) if chance(rng, 0.5) else _muted(rng, 0.3, 0.85)
        return _finished(rng, shares, plain(color), 2.2)
    pattern = _patterned(rng, [Stripes, Dots], 128, sample_palette(rng, 3))
    return _finished(rng, shares, tiled(pattern, 0.15), 2.2)


def fabric(rng: np.random.Generator, shares: Shares) -> Material:
    """Upholstery, curtains and blankets: plain, woven, striped, checked, printed."""
    if chance(rng, shares.plain):
        return tiled(NearTextureless(128, new_seed(rng), _muted(rng), 0.05, 0.03), 0.6)
    palette = sample_palette_in(rng, CLOTH, 4, 60.0)
    if chance(rng, 0.25):
        return tiled(replace(Weave.sample(rng, 128), palette=palette[1:3]), uniform(rng, 0.08, 0.2))
    return tiled(_patterned(rng, [Stripes, Plaid, Dots], 200, palette), uniform(rng, 0.2, 0.6))


def carpet(rng: np.random.Generator, shares: Shares) -> Material:
    """Rugs: patterned more often than other cloth."""
    if chance(rng, 0.5 * shares.plain):
        return tiled(NearTextureless(128, new_seed(rng), _muted(rng, 0.3, 0.8), 0.06, 0.1), 0.5)
    palette = sample_palette_in(rng, CLOTH, 4, 90.0)
    if chance(rng, 0.2):
        return tiled(Hair.of(rng, 256, palette, palette[0]), uniform(rng, 0.4, 0.8))
    if chance(rng, 0.25):
        return tiled(Layered.sample(rng, 256), uniform(rng, 0.6, 1.4))
    return tiled(_patterned(rng, [Stripes, Plaid, Checkers], 256, palette), uniform(rng, 0.5, 1.2))


def leather(rng: np.random.Generator, shares: Shares) -> Material:
    """Leather: brown, black, white."""
    colors = choose(rng, [BARK, GREYS, EARTH])
    texture = replace(
        FractalNoise.sample(rng, 128), palette=sample_palette_in(rng, colors, 3), slope=0.8, ridges=False
    )
    return (
        replace(tiled(texture, 0.5), roughness=uniform(rng, 0.25, 0.5), specular=0.4)
        if chance(rng, 1.5 * shares.glossy)
        else tiled(texture, 0.5)
    )


def metal(rng: np.random.Generator, shares: Shares) -> Material:
    """Steel, brass, copper; or painted metal."""
    if chance(rng, shares.metallic):
        color = choose(
            rng,
            [
                shade(0.75, 0.005, 250.0),
                shade(0.6, 0.01, 250.0),
                shade(0.75, 0.09, 85.0),
                shade(0.65, 0.1, 50.0),
            ],
        )
        return plain(color, roughness=uniform(rng, 0.15, 0.45), metallic=1.0)
    return _finished(rng, shares, plain(_muted(rng, 0.15, 0.8)))


def chrome(rng: np.random.Generator, shares: Shares) -> Material:
    """Polished or brushed steel; painted where a room has no bare metal."""
    if not chance(rng, 0.4 + 0.6 * shares.metallic):
        return plain(shade(uniform(rng, 0.2, 0.8), 0.005, 250.0))
    return plain(
        shade(uniform(rng, 0.7, 0.88), 0.005, 250.0), roughness=log_uniform(rng, 0.04, 0.3), metallic=1.0
    )


def glass(rng: np.random.Generator, shares: Shares) -> Material:
    """Clear, green or brown glass; or opaque coloured glass."""
    tint = choose(
        rng, [shade(0.96, 0.01, 160.0), shade(0.7, 0.08, 150.0), shade(0.55, 0.08, 70.0)], [0.6, 0.25, 0.15]
    )
    clear = plain(tint, roughness=uniform(rng, 0.0, 0.06), specular=0.5)
    if chance(rng, shares.transparent):
        return replace(clear, transmission=uniform(rng, 0.75, 0.95))
    return plain(_muted(rng, 0.2, 0.8), roughness=uniform(rng, 0.05, 0.3), specular=0.6)


def _black_glass(rng: np.random.Generator, shares: Shares) -> Material:  # noqa: ARG001
    return plain((14, 14, 16), roughness=uniform(rng, 0.03, 0.12), specular=0.6)


def pane(rng: np.random.Generator, shares: Shares) -> Material:  # noqa: ARG001
    """A window pane: a sheet of glass that shows what is behind it and reflects the room."""
    return replace(plain((235, 240, 238), roughness=0.0, specular=0.6), transmission=1.0, thin=True)


def _mirror(rng: np.random.Generator, shares: Shares) -> Material:  # noqa: ARG001
    return plain((225, 228, 228), roughness=uniform(rng, 0.0, 0.03), metallic=1.0)


def _picture(rng: np.random.Generator, shares: Shares) -> Material:
    return _finished(rng, shares, Material(sample_texture(rng, 200)), 0.6)


def _printed(rng: np.random.Generator, shares: Shares) -> Material:
    kinds: list[type[Texture]] = [GlyphRows, Stripes, Layered, Dots]
    texture = choose(rng, kinds).sample(rng, 128)
    return _finished(rng, shares, tiled(texture, uniform(rng, 0.1, 0.25)))


def _screen(rng: np.random.Generator, shares: Shares) -> Material:  # noqa: ARG001
    kinds: list[type[Texture]] = [GlyphRows, Layered]
    texture = choose(rng, kinds).sample(rng, 200)
    return replace(Material(texture), emission=uniform(rng, 0.3, 1.2), specular=0.4, roughness=0.2)


def _spines(rng: np.random.Generator, shares: Shares) -> Material:
    return _finished(rng, shares, Material(BookSpines.sample(rng, 256)), 0.5)


def _paper(rng: np.random.Generator, shares: Shares) -> Material:  # noqa: ARG001
    return plain(shade(uniform(rng, 0.82, 0.95), 0.015, 85.0))


def _cardboard(rng: np.random.Generator, shares: Shares) -> Material:
    base = shade(uniform(rng, 0.55, 0.7), 0.06, 70.0)
    if chance(rng, max(shares.plain, 0.85)):
        return _single(rng, base)
    ink = shade(uniform(rng, 0.2, 0.45), 0.05, uniform(rng, 0.0, 360.0))
    return tiled(replace(GlyphRows.sample(rng, 128), palette=(base, ink)), uniform(rng, 0.3, 0.6))


def _leaf(rng: np.random.Generator, shares: Shares) -> Material:
    palette = sample_palette_in(rng, FOLIAGE, 4)
    return _finished(rng, shares, tiled(LeafVeins.of(rng, 128, palette[:3], palette[3]), 0.12), 0.6)


def _soil(rng: np.random.Generator, shares: Shares) -> Material:  # noqa: ARG001
    return tiled(replace(FractalNoise.sample(rng, 64), palette=sample_palette_in(rng, EARTH, 3)), 0.1)


def _linen(rng: np.random.Generator, shares: Shares) -> Material:  # noqa: ARG001
    return tiled(
        NearTextureless(64, new_seed(rng), shade(uniform(rng, 0.82, 0.96), 0.012, 90.0), 0.03, 0.01), 0.8
    )


def _enamel(rng: np.random.Generator, shares: Shares) -> Material:
    return _finished(rng, shares, plain(shade(uniform(rng, 0.8, 0.95), 0.008, 90.0)), 1.8)


def _trim(rng: np.random.Generator, shares: Shares) -> Material:
    if chance(rng, 0.3):
        return wood(rng, shares)
    return _finished(rng, shares, plain(shade(uniform(rng, 0.8, 0.96), 0.008, 90.0)))


def _pegboard(rng: np.random.Generator, shares: Shares) -> Material:  # noqa: ARG001
    base = _wood_palette(rng, 2) if chance(rng, 0.5) else sample_palette_in(rng, GREYS, 2)
    return tiled(
        replace(
            Dots.sample(rng, 128),
            palette=(base[1], shade(0.15, 0.01, 80.0)),
            columns=8,
            radius=0.12,
            ring=0.0,
            staggered=False,
        ),
        0.2,
    )


def _glow(rng: np.random.Generator, shares: Shares) -> Material:  # noqa: ARG001
    warm = shade(uniform(rng, 0.9, 0.97), uniform(rng, 0.0, 0.06), 80.0)
    return replace(plain(warm), emission=uniform(rng, 1.5, 4.0))


def _shade_cloth(rng: np.random.Generator, shares: Shares) -> Material:  # noqa: ARG001
    warm = shade(uniform(rng, 0.8, 0.94), uniform(rng, 0.02, 0.08), uniform(rng, 50.0, 95.0))
    return replace(plain(warm), emission=uniform(rng, 0.4, 1.1))


def _fruit(rng: np.random.Generator, shares: Shares) -> Material:
    color = choose(
        rng,
        [
            shade(0.55, 0.18, 30.0),
            shade(0.72, 0.15, 60.0),
            shade(0.82, 0.15, 100.0),
            shade(0.65, 0.15, 130.0),
        ],
    )
    return _finished(rng, shares, plain(color), 1.2)


def _white(rng: np.random.Generator, shares: Shares) -> Material:
    return _finished(rng, shares, plain(shade(uniform(rng, 0.85, 0.96), 0.006, 90.0)))


def _black(rng: np.random.Generator, shares: Shares) -> Material:
    return _finished(rng, shares, plain(shade(uniform(rng, 0.14, 0.25), 0.005, 250.0)))


def _fur(rng: np.random.Generator, shares: Shares) -> Material:  # noqa: ARG001
    palette = sample_palette_in(rng, HAIR, 4)
    return tiled(Hair.of(rng, 128, palette, palette[0]), 0.3)


_KINDS: dict[str, tuple[MaterialSampler, int]] = {
    "wall": (wall, 2),
    "ceiling": (ceiling, 1),
    "floor": (floor, 1),
    "trim": (_trim, 1),
    "tiles": (wall_tiles, 1),
    "pane": (pane, 1),
    "wood": (wood, 3),
    "lacquer": (lacquer, 4),
    "plastic": (vivid, 6),
    "plastic white": (_white, 1),
    "plastic black": (_black, 2),
    "ceramic": (ceramic, 5),
    "enamel": (_enamel, 1),
    "fabric": (fabric, 5),
    "fabric curtain": (fabric, 2),
    "fabric blind": (fabric, 1),
    "linen": (_linen, 1),
    "leather": (leather, 2),
    "carpet": (carpet, 2),
    "metal": (metal, 3),
    "chrome": (chrome, 2),
    "stone": (stone, 1),
    "glass": (glass, 3),
    "glass black": (_black_glass, 1),
    "mirror": (_mirror, 1),
    "picture": (_picture, 8),
    "print": (_printed, 4),
    "screen": (_screen, 3),
    "spines": (_spines, 2),
    "paper": (_paper, 2),
    "cardboard": (_cardboard, 3),
    "leaf": (_leaf, 2),
    "soil": (_soil, 1),
    "wax": (_white, 2),
    "pegboard": (_pegboard, 1),
    "fruit": (_fruit, 4),
    "fur": (_fur, 2),
    "glow": (_glow, 1),
    "glow shade": (_shade_cloth, 2),
}
"""What parts are made of, and how many materials of each kind a room has at most."""
