"""Painting tools of the textures: palettes, periodic noise, colouring, film grain.

Pictures are float32 (3, H, W) in 0..255 (sRGB), fields are float32 (H, W), of unit variance or in 0..1.
Channels come first because numpy multiplies pictures by fields many times faster that way. All are periodic,
because materials repeat their textures.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from scenes.appearance import kernels as kernels
from scenes.random_draws import choose

Field = NDArray[np.float32]
"""(H, W)."""
Picture = NDArray[np.float32]
"""(3, H, W), or (3, 1, 1) for a colour."""
Srgb = tuple[int, int, int]
"""0..255."""
Palette = tuple[Srgb, ...]
"""The colours of a pattern."""

_OKLAB_TO_LMS = np.array(
    [
        (1.0, 0.3963377774, 0.2158037573),
        (1.0, -0.1055613458, -0.0638541728),
        (1.0, -0.0894841775, -1.2914855480),
    ]
)
_LMS_TO_LINEAR = np.array(
    [
        (4.0767416621, -3.3077115913, 0.2309699292),
        (-1.2684380046, 2.6097574011, -0.3413193965),
        (-0.0041960863, -0.7034186147, 1.7076147010),
    ]
)


def oklch_to_srgb(
    lightness: NDArray[np.float64], chroma: NDArray[np.float64], hue: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Perceptual lightness (0..1), chroma (0..0.3) and hue (radians), (N,) each, to (N, 3) sRGB 0..255.

    B. Ottosson, "A perceptual color space for image processing", 2020. Colours outside sRGB are clipped.
    """
    lab = np.stack([lightness, chroma * np.cos(hue), chroma * np.sin(hue)], -1)
    linear = np.clip((lab @ _OKLAB_TO_LMS.T) ** 3 @ _LMS_TO_LINEAR.T, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    colors: NDArray[np.int64] = np.round(encoded * 255).astype(np.int64)
    return colors


def sample_palette(rng: np.random.Generator, count: int) -> Palette:
    """Colours that go together, as photographs have them: dark to light, muted more often than vivid.

    Hues are neighbours, opposites or free; lightness is spread evenly, so that patterns have contrast.
    """
    scheme = choose(rng, ["neighbours", "opposites", "free"], [0.5, 0.3, 0.2])
    base = rng.uniform(0.0, 2 * np.pi)
    if rng.random() < 0.3:  # skin, wood, earth, brick, sand: the commonest hues of things
        base = rng.uniform(0.4, 1.9)
    spread = {"neighbours": 0.35, "opposites": 0.35, "free": np.pi}[scheme]
    hue = base + rng.uniform(-spread, spread, count)
    if scheme == "opposites":
        hue = hue + np.pi * (rng.random(count) < 0.4)
    strength = choose(rng, [0.045, 0.1, 0.18], [0.35, 0.4, 0.25])
    chroma = strength * rng.uniform(0.4, 1.3, count)
    low = rng.uniform(0.15, 0.5)
    high = rng.uniform(max(0.65, low + 0.3), 0.98)
    steps = (np.arange(count) + rng.uniform(0.1, 0.9, count)) / count
    lightness = rng.permutation(low + (high - low) * steps)
    return tuple((int(r), int(g), int(b)) for r, g, b in oklch_to_srgb(lightness, chroma, hue))


def unit_grid(size: int) -> tuple[Field, Field]:
    """x to the right and y down, (size, size) each, 0..1 at pixel centres."""
    line = (np.arange(size, dtype=np.float32) + np.float32(0.5)) / np.float32(size)
    x, y = np.meshgrid(line, line)
    return x, y


def spectral_noise(
    rng: np.random.Generator,
    size: int | tuple[int, int],
    slope: float,
    low_cycles: float = 1.0,
    high_cycles: float = np.inf,
    stretch: tuple[float, float] = (1.0, 1.0),
) -> Field:
    """Periodic Gaussian noise of zero mean and unit variance with amplitude spectrum 1 / f^slope.

    f is in cycles per picture between `low_cycles` and `high_cycles`. `stretch` (along x, along y) elongates
    the pattern. Photographs have a slope of about 1 (Field 1987).
    """
    height, width = (size, size) if isinstance(size, int) else size
    gain = _spectral_gain(height, width, slope, low_cycles, high_cycles, stretch)
    # Uniform draws are several times faster than normal ones, and the sum over all waves is normal anyway.
    spectrum = (rng.random((height, 2 * gain.shape[1]), np.float32) - np.float32(0.5)).view(np.complex64)
    spectrum *= gain
    noise: Field = fft.irfft2(spectrum, s=(height, width), overwrite_x=True)
    noise *= np.float32(1 / max(float(noise.std()), 1e-12))
    return noise


@lru_cache(maxsize=64)
def _spectral_gain(
    height: int, width: int, slope: float, low_cycles: float, high_cycles: float, stretch: tuple[float, float]
) -> Field:
    """Amplitudes (height, width // 2 + 1) of a real picture's spectrum; kept, as many textures ask for the same."""
    fy = fft.fftfreq(height, 1.0 / height).astype(np.float32)[:, None] * np.float32(stretch[1])
    fx = fft.rfftfreq(width, 1.0 / width).astype(np.float32)[None, :] * np.float32(stretch[0])
    squared = fx * fx + fy * fy
    squared[0, 0] = 1.0
    gain = np.exp(np.float32(-slope / 2) * np.log(squared))
    gain[(squared < low_cycles**2 * 0.999) | (squared > high_cycles**2)] = 0.0
    gain[0, 0] = 0.0
    gain.flags.writeable = False
    return gain


def to_unit(noise: Field) -> Field:
    """Noise of unit variance mapped to 0..1, softly clipped at both ends."""
    return 0.5 + 0.5 * np.tanh(np.float32(0.75) * noise)


def paint(color: Srgb) -> Picture:
    """A colour as a (3, 1, 1) picture."""
    return np.array(color, np.float32)[:, None, None]


def colorize(value: Field, palette: Palette) -> Picture:
    """A field in 0..1 (clipped) as a picture: the palette from its first to its last colour, blended linearly."""
    stops = np.linspace(0.0, 1.0, len(palette))
    fine = np.linspace(0.0, 1.0, 512)
    table = np.array([np.interp(fine, stops, [color[c] for color in palette]) for c in range(3)], np.float32)
    index = (np.clip(value, 0, 1) * np.float32(511) + np.float32(0.5)).astype(np.intp)
    return np.take(table, index, axis=1)


def flat_colors(index: NDArray[np.integer[Any]], colors: Palette | NDArray[np.float32]) -> Picture:
    """The picture of (H, W) indices among colours (N, 3)."""
    table = np.ascontiguousarray(np.array(colors, np.float32).T)
    return np.take(table, index, axis=1)


def fraction(value: NDArray[Any]) -> Field:
    """`value % 1`, many times faster."""
    part: Field = kernels.fraction(value)
    return part


def smooth_step(value: Field, edge: float, width: float) -> Field:
    """0 below `edge`, 1 above it, with a cubic ramp of `width` between, so that edges are antialiased."""
    stepped: Field = kernels.smooth_stepped(value, np.float32(edge), np.float32(width))
    return stepped


def mix(below: Picture, above: Picture, cover: Field) -> Picture:
    """`above` painted over `below` with an opacity `cover` (H, W), 0..1."""
    painted: Picture = kernels.blended(below, above, cover)
    return painted


def finish(picture: Picture, rng: np.random.Generator, grain: float) -> NDArray[np.uint8]:
    """Add grain and round to bytes, (H, W, 3).

    `grain` is the standard deviation of the noise relative to the brightness. It has
    the scale of one and two pixels: detail to match where a pattern has none.
    """
    fine = (rng.random(picture.shape[1:], np.float32) - np.float32(0.5)) * np.float32(np.sqrt(12.0))
    pixels: NDArray[np.uint8] = kernels.grained(
        np.ascontiguousarray(picture), fine, np.float32(0.4 * grain), np.float32(0.6 * grain)
    )
    return pixels


def to_bytes(picture: Picture) -> NDArray[np.uint8]:
    """Round a picture to bytes, (H, W, 3)."""
    pixels: NDArray[np.uint8] = kernels.to_bytes(np.ascontiguousarray(picture))
    return pixels


def shade(lightness: float, chroma: float, hue_deg: float) -> Srgb:
    """An sRGB colour by perceptual lightness 0..1, chroma 0..0.3 and hue (30 red, 100 yellow, 140 green)."""
    (rgb,) = oklch_to_srgb(np.array([lightness]), np.array([chroma]), np.radians([hue_deg]))
    return (int(rgb[0]), int(rgb[1]), int(rgb[2]))
