"""The command line, and the pipelines that join scenes, datagen, training and refine.

Examples:
    from stereoforge import StereoRefiner

    refiner = StereoRefiner()
    pair = refiner(left, right)  # (H, W, 3) uint8 each
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stereoforge.pipelines.refiner import RefinedPair, StereoRefiner

__all__ = ["RefinedPair", "StereoRefiner"]


def __getattr__(name: str) -> Any:
    """Import what is asked for: the networks take seconds, and `stereoforge --help` needs none of them."""
    if name in __all__:
        import stereoforge.pipelines.refiner

        return getattr(stereoforge.pipelines.refiner, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
