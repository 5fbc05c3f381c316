"""How training crops and validation frames are taken from data sets."""

from __future__ import annotations

from dataclasses import dataclass, field

from training.data.augmentation import AugmentationConfig

CROP_MULTIPLE = 64
"""Crops of a multiple of this many pixels each way suit every network."""


@dataclass(frozen=True, kw_only=True)
class SamplingConfig:
    """Batches of augmented crops, and the frames that a network is validated on."""

    batch_size: int
    """Crops per step (and per process)."""
    crop_width: int
    """Width of the crops in pixels, a multiple of the regressor's stride."""
    crop_height: int
    """Height of the crops in pixels, a multiple of the regressor's stride."""
    augmentation: AugmentationConfig = field(default_factory=AugmentationConfig)
    """Random changes of the crops."""
    curriculum: float = 0.0
    """Share of the run over which the crops come from a growing first part of every data set, in its own order, so that
    a set that was rendered from simple to complex is seen that way; 0 draws from all frames from the beginning
    (ours)."""
    validation_interval: int = 1000
    """Steps between validations, each of which writes a checkpoint."""
    validation_samples: int = 50
    """Number of validation frames, evenly spread over the split."""
