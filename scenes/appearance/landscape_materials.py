"""What the things of landscapes are made of: how they reflect light, and whether they have a pattern at all.

Shares (`scenes.appearance.room_materials.Shares`) say how many of the surfaces that come both ways are plain, glossy,
bare metal or clear.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from scenes.appearance import material_textures as textures
from scenes.appearance.material_textures import TextureSampler
from scenes.appearance.materials import FINISHES, Finish, Shares
from scenes.appearance.palettes import BARK, CLOTH, PLASTER, VIVID, PaletteRange, sample_palette_in
from scenes.random_draws import chance, choose, new_seed, uniform
from scenes.spec import Texture
from scenes.textures.noise import FractalNoise
from scenes.textures.plain import NearTextureless

MATTE, SATIN, GLOSSY = FINISHES["matte"], FINISHES["satin"], FINISHES["glossy"]
WET = Finish(1.0, roughness=(0.12, 0.3), specular=(0.4, 0.6))
"""What a film of water or wax lies on."""
CLEAR = Finish(1.0, roughness=(0.0, 0.08), specular=(0.5, 0.5), transmission=(0.7, 0.95))
"""Glass, ice and crystals."""
STEEL = PaletteRange((40.0, 270.0), (0.002, 0.02), (0.5, 0.85))
BRASS = PaletteRange((70.0, 95.0), (0.06, 0.1), (0.55, 0.8))


@dataclass(frozen=True)
class Surface:
    """What a surface looks like."""

    texture: TextureSampler
    finish: Finish = MATTE


SurfaceSampler = Callable[[np.random.Generator, Shares], Surface]


def plain(colors: PaletteRange, clouds: float = 0.02) -> TextureSampler:
    """One colour of a substance, a little uneven."""

    def sample(rng: np.random.Generator, size: int) -> Texture:
        color = sample_palette_in(rng, colors, 3)[1]
        return NearTextureless(min(size, 128), new_seed(rng), color, clouds * uniform(rng, 0.3, 1.6), 0.006)

    return sample


def plain_or(
    rng: np.random.Generator, shares: Shares, colors: PaletteRange, other: TextureSampler
) -> TextureSampler:
    """One colour in a share of the cases, else the other texture."""
    return plain(colors) if chance(rng, shares.plain) else other


def gloss_or_matte(rng: np.random.Generator, shares: Shares, glossy: Finish = WET) -> Finish:
    """Glossy in a share of the cases."""
    return glossy if chance(rng, shares.glossy) else MATTE


def cloth(rng: np.random.Generator, shares: Shares) -> Surface:
    """Plain or woven, now and then of a sheen like silk's."""
    finish = SATIN if chance(rng, 0.6 * shares.glossy) else MATTE
    return Surface(plain_or(rng, shares, CLOTH, textures.cloth), finish)


def hide(rng: np.random.Generator, shares: Shares) -> Surface:
    """Bare skin of creatures, plain or patterned, dry or wet."""
    return Surface(plain_or(rng, shares, VIVID, textures.hide), gloss_or_matte(rng, shares))


def leather(rng: np.random.Generator, shares: Shares) -> Surface:
    """Boots, belts: plain or scuffed, some polished."""
    return Surface(plain_or(rng, shares, BARK, textures.leather), gloss_or_matte(rng, shares))


def cap(rng: np.random.Generator, shares: Shares) -> Surface:
    """Mushrooms' caps: plain or patterned, dry or slimy."""
    return Surface(plain_or(rng, shares, VIVID, textures.cap), gloss_or_matte(rng, shares))


def plaster(rng: np.random.Generator, shares: Shares) -> Surface:
    """Walls: one coat of paint, or weathered."""
    return Surface(plain_or(rng, shares, PLASTER, textures.plaster))


def metal(rng: np.random.Generator, shares: Shares) -> Surface:
    """Arms and vessels: bare steel or brass, polished or worn; else painted."""
    colors = STEEL if chance(rng, 0.7) else BRASS
    if not chance(rng, shares.metallic):
        return Surface(plain(CLOTH), gloss_or_matte(rng, shares))
    kind = choose(rng, ("brushed metal", "polished metal"), (0.65, 0.35))
    return Surface(_scratched(colors), FINISHES[kind])


def _scratched(colors: PaletteRange) -> TextureSampler:
    def sample(rng: np.random.Generator, size: int) -> Texture:
        palette = sample_palette_in(rng, colors, 3)
        return replace(FractalNoise.sample(rng, size), palette=palette, low_cycles=5.0, ridges=False)

    return sample


def shield(rng: np.random.Generator, shares: Shares) -> Surface:
    """Painted boards or bare metal."""
    return (
        metal(rng, shares)
        if chance(rng, 0.5)
        else Surface(textures.painted_boards, gloss_or_matte(rng, shares))
    )


def glass(rng: np.random.Generator, shares: Shares) -> Surface:
    """Clear, or of one milky colour."""
    if chance(rng, shares.transparent):
        return Surface(plain(PaletteRange((100.0, 250.0), (0.0, 0.05), (0.85, 0.97))), CLEAR)
    return Surface(plain(VIVID), GLOSSY)


def stone(sampler: TextureSampler) -> SurfaceSampler:
    """Rock of a kind, dry, or wet after rain."""
    return lambda rng, shares: Surface(sampler, gloss_or_matte(rng, shares))


def matte(sampler: TextureSampler) -> SurfaceSampler:
    """What has one look only."""
    return lambda rng, shares: Surface(sampler)  # noqa: ARG005


CHARACTER_SURFACES: dict[str, SurfaceSampler] = {
    "fur": matte(textures.fur),
    "hide": hide,
    "skin": matte(textures.skin),
    "lips": matte(plain(PaletteRange((15.0, 35.0), (0.06, 0.11), (0.42, 0.6)))),
    "hair": matte(textures.hair),
    "cloth": cloth,
    "trousers": cloth,
    "cloak": cloth,
    "leather": leather,
    "felt": matte(plain(BARK, 0.06)),
    "straw": matte(textures.straw),
    "metal": metal,
    "shield": shield,
    "glass": glass,
    "wood": matte(textures.timber),
    "horn": matte(textures.horn),
    "eye": lambda rng, shares: Surface(textures.eye, GLOSSY),  # noqa: ARG005
}
"""How to draw what parts of characters are made of (`scenes.landscapes.characters.CharacterPart.material`)."""
