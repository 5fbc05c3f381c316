"""The trained weights that are bundled with StereoForge."""

from __future__ import annotations

from pathlib import Path

BUNDLED_WEIGHTS = Path(__file__).resolve().parent / "weights"
"""A run folder like any other, trained by `make study` on its flying_things worlds; its model_card.md says how."""
