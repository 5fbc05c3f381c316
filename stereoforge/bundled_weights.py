"""The trained weights that are bundled with StereoForge."""

from __future__ import annotations

from pathlib import Path

BUNDLED_WEIGHTS = Path(__file__).resolve().parent / "weights"
"""A run folder like any other, with a CostVolumeNet, its heads and the regressor-free ones; its model_card.md says how
they were trained."""
PAPER_WEIGHTS = BUNDLED_WEIGHTS / "paper"
"""A run folder with the paper's networks, trained by `make study` on its flying_things worlds."""


def named_weights(run: Path) -> Path:
    """The run folder that `--weights` names: `paper` is the bundled one, unless there is a folder of that name here."""
    return PAPER_WEIGHTS if run == Path("paper") and not run.exists() else run
