"""What tells a real stereo rig's pictures from an ideal one's: how much of it a scene's final pass has.

Ground truth is the ideal rig's. So these are errors of calibration and differences between cameras that a network has
to bear, and they are mild by default.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from scenes.random_draws import Range, chance, choose, integer, log_uniform, uniform
from scenes.spec import Imperfections, Scene
from stereoforge_kit.errors import InputError


@dataclass(frozen=True)
class ImperfectionRanges:
    """Values are drawn for each scene: U(-this, this) where a field holds one number that is no share.

    Raises ValueError for shares outside 0..1 and for ranges that cannot be.
    """

    share: float = 0.7
    """Share of the scenes whose final pass has imperfections at all, 0..1; 0 for ideal rigs."""
    misalignment: float = 0.0005
    """How far the right view lies too low, as a share of the image width (0.0005 is 0.5 px at 960)."""
    rotation_deg: float = 0.02
    """The right camera's residual rotation about each of its axes."""
    focal_share: float = 0.0005
    """The right camera's residual difference of focal length, as a share of it."""
    exposure_ev: float = 0.15
    """The right view's exposure relative to the left's, in stops."""
    color: float = 0.03
    """The right view's colour balance: each channel has 1 + U(-this, this)."""
    blur_share: float = 0.2
    """Share of these scenes in which one view is blurred, 0..1."""
    blur: float = 0.001
    """Standard deviation of that blur at most, as a share of the image width (0.001 is 1 px at 960)."""
    noise: Range = (0.0, 0.012)
    """Standard deviation of photon noise at full white and a gain of 1."""
    gain: Range = (1.0, 4.0)
    """Gain of the sensors, drawn log-uniformly; with it the noise grows."""
    gain_difference: float = 0.2
    """The right sensor's gain relative to the left's is exp U(-this, this)."""
    jpeg_share: float = 0.3
    """Share of these scenes that are stored as JPEG before they are stored as PNG, 0..1."""
    jpeg_quality: tuple[int, int] = (70, 97)
    """Lowest and highest quality, 1..100."""

    def __post_init__(self) -> None:
        for one in fields(self):
            low, high = value if isinstance(value := getattr(self, one.name), tuple) else (0.0, value)
            if not (np.isfinite([low, high]).all() and 0 <= low <= high):
                raise InputError(
                    f"imperfections: {one.name} must not be negative, and (low, high), got {value}"
                )
            if one.name.endswith("share") and high > 1:
                raise InputError(f"imperfections: {one.name} must be in 0..1, got {value}")
        if self.gain[0] <= 0:
            raise InputError(f"imperfections: gain must be above 0, got {self.gain}")
        if not 1 <= self.jpeg_quality[0] <= self.jpeg_quality[1] <= 100:
            raise InputError(f"imperfections: jpeg_quality must be in 1..100, got {self.jpeg_quality}")


def with_imperfections(rng: np.random.Generator, scene: Scene, ranges: ImperfectionRanges) -> Scene:
    """The scene with imperfections of its rig in its final pass. They are drawn last: nothing else depends on them."""
    if not chance(rng, ranges.share):
        return scene
    final, width = scene.final, scene.camera.width
    gain = log_uniform(rng, *ranges.gain)
    found = Imperfections(
        lower_px=_symmetric(rng, ranges.misalignment * width),
        rotation_deg=(
            _symmetric(rng, ranges.rotation_deg),
            _symmetric(rng, ranges.rotation_deg),
            _symmetric(rng, ranges.rotation_deg),
        ),
        focal_ratio=1.0 + _symmetric(rng, ranges.focal_share),
        blur_px=_blur(rng, ranges, width),
        noise=uniform(rng, *ranges.noise),
        gain=(gain, gain * float(np.exp(_symmetric(rng, ranges.gain_difference)))),
        jpeg_quality=integer(rng, *ranges.jpeg_quality) if chance(rng, ranges.jpeg_share) else 0,
    )
    red, green, blue = (channel * (1.0 + _symmetric(rng, ranges.color)) for channel in final.right_view_color)
    return replace(
        scene,
        final=replace(
            final,
            exposure_difference_ev=final.exposure_difference_ev + _symmetric(rng, ranges.exposure_ev),
            right_view_color=(red, green, blue),
            imperfections=found,
        ),
    )


def _symmetric(rng: np.random.Generator, greatest: float) -> float:
    return uniform(rng, -greatest, greatest)


def _blur(rng: np.random.Generator, ranges: ImperfectionRanges, width: int) -> tuple[float, float]:
    """Standard deviations in px for the left and the right view, of which one at least is 0."""
    if not chance(rng, ranges.blur_share):
        return (0.0, 0.0)
    blur_px = uniform(rng, 0.0, ranges.blur * width)
    return choose(rng, ((blur_px, 0.0), (0.0, blur_px)))
