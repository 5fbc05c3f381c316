"""Materials: which texture a surface has, at which scale, and how it reflects light."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from scenes.appearance.painting import Srgb
from scenes.random_draws import Range, chance, choose, log_uniform, uniform
from scenes.spec import Material, Texture
from scenes.textures import TEXTURES
from scenes.textures.plain import NearTextureless, SolidColor
from stereoforge_kit.errors import InputError

FinishKind = Literal["dull", "glossy", "metallic", "transparent"]


@dataclass(frozen=True)
class Shares:
    """How often surfaces that come both ways are of one kind, 0..1 each."""

    plain: float
    """Of one colour instead of patterned: walls, floors, cloth, fronts."""
    glossy: float
    """Varnished, lacquered, glazed or polished instead of matte."""
    metallic: float
    """Bare metal instead of painted."""
    transparent: float
    """Clear glass instead of coloured, opaque one."""


@dataclass(frozen=True)
class Finish:
    """A kind of surface: ranges of the principled BSDF's scalars."""

    share: float
    """How many of all materials are of this kind, where a family does not say otherwise."""
    kind: FinishKind = "dull"
    """Which of the `SurfaceShares` it counts for."""
    roughness: Range = (1.0, 1.0)
    specular: Range = (0.0, 0.0)
    metallic: Range = (0.0, 0.0)
    transmission: Range = (0.0, 0.0)
    emission: Range = (0.0, 0.0)


FINISHES: dict[str, Finish] = {
    "matte": Finish(share=0.60),
    "satin": Finish(share=0.15, roughness=(0.35, 0.7), specular=(0.3, 0.5)),
    "glossy": Finish(share=0.10, kind="glossy", roughness=(0.05, 0.25), specular=(0.5, 0.8)),
    "brushed metal": Finish(share=0.06, kind="metallic", roughness=(0.3, 0.55), metallic=(0.8, 1.0)),
    "polished metal": Finish(share=0.03, kind="metallic", roughness=(0.05, 0.2), metallic=(1.0, 1.0)),
    "glass": Finish(
        share=0.03, kind="transparent", roughness=(0.0, 0.15), specular=(0.5, 0.5), transmission=(0.5, 0.9)
    ),
    "glowing": Finish(share=0.03, emission=(0.2, 1.5)),
}
"""Kinds of surfaces by name: mostly diffuse ones, which are cheap to render, and fewer of all others."""


@dataclass(frozen=True)
class SurfaceShares:
    """How many of all materials, 0 to 1, are of one colour, and how many reflect in which way. The rest is dull.

    Raises InputError if the shares of reflecting ones are more than 1 together.
    """

    plain: float = 0.0
    glossy: float = 0.10
    metallic: float = 0.09
    transparent: float = 0.03

    def __post_init__(self) -> None:
        if self.glossy + self.metallic + self.transparent > 1:
            raise InputError(
                f"the shares of glossy, metallic and transparent surfaces must be at most 1 together, got "
                f"{self.glossy:g}, {self.metallic:g} and {self.transparent:g}"
            )

    def of(self, finish: Finish) -> float:
        """The share of all materials that have a finish."""
        reflecting = {"glossy": self.glossy, "metallic": self.metallic, "transparent": self.transparent}
        kind = reflecting.get(finish.kind, 1 - sum(reflecting.values()))
        return (
            kind * finish.share / sum(other.share for other in FINISHES.values() if other.kind == finish.kind)
        )


USUAL_SHARES = SurfaceShares()
"""Those of `FINISHES`."""

TEXEL_PX: Range = (0.9, 2.2)
"""Image pixels that one texture pixel covers where the surface is seen: below 1, detail aliases; far above 1,
it blurs."""


def sample_texture(rng: np.random.Generator, size: int) -> Texture:
    """A random texture of any kind, by the kinds' popularity."""
    kinds = [TEXTURES[name] for name in sorted(TEXTURES)]
    return choose(rng, kinds, [kind.popularity for kind in kinds]).sample(rng, size)


def tiled(texture: Texture, tile_m: float) -> Material:
    """A matte material whose texture spans `tile_m` units of texture coordinates, metres on metric shapes."""
    return Material(texture, repeats=1.0 / tile_m)


def plain(color: Srgb, *, roughness: float = 1.0, specular: float = 0.0, metallic: float = 0.0) -> Material:
    """A material of one colour; the scalars are those of `Material`."""
    return Material(SolidColor(color), roughness=roughness, specular=specular, metallic=metallic)


def texture_repeats(rng: np.random.Generator, unit_px: float, size: int, texel_px: Range) -> float:
    """How often a texture of `size` pixels must repeat over a unit of texture coordinates (`Material.repeats`).

    The unit spans `unit_px` image pixels; one texture pixel then covers a number of them from `texel_px`.
    """
    return unit_px / (size * log_uniform(rng, *texel_px))


def sample_plain(rng: np.random.Generator, size: int) -> Texture:
    """One colour, of paint or plastic: all even, or with clouds and a grain that are hardly seen."""
    faint = NearTextureless.sample(rng, size)
    if chance(rng, 0.5):
        return SolidColor(faint.color)
    return replace(faint, clouds=uniform(rng, 0.01, 0.05), grain=uniform(rng, 0.001, 0.006))


def sample_material(
    rng: np.random.Generator, unit_px: float, texture_size: int = 256, shares: SurfaceShares = USUAL_SHARES
) -> Material:
    """A random material for a surface on which one unit of texture coordinates spans `unit_px` pixels.

    The texture, `texture_size` pixels wide, is repeated so that its pixels and the image's are of about the
    same size (`TEXEL_PX`).
    """
    finish = choose(rng, list(FINISHES.values()), [shares.of(finish) for finish in FINISHES.values()])
    repeats = texture_repeats(rng, unit_px, texture_size, TEXEL_PX)
    is_plain = shares.plain > 0 and chance(rng, shares.plain)
    texture = (sample_plain if is_plain else sample_texture)(rng, texture_size)
    return Material(
        color=texture,
        repeats=repeats,
        roughness=uniform(rng, *finish.roughness),
        specular=uniform(rng, *finish.specular),
        metallic=uniform(rng, *finish.metallic),
        transmission=uniform(rng, *finish.transmission),
        emission=uniform(rng, *finish.emission),
    )
