"""All numbers of all training runs, in one place.

`full` is the published training of DispNetCorr1D, ConfNet and GradNet. For these networks `small` (about 2.7 million
parameters, a 11 MB file) and `tiny` (minutes on a laptop's CPU) differ from it where short runs on few pairs need it
(ours):

- BatchNorm, with fixed statistics towards the end of a regressor's run;
- a one-sided correlation, and predictions in units of 16 px;
- a larger learning rate with warm-up and cosine decay, and gradient clipping;
- one stage of loss weights instead of seven;
- milder colour changes, and flips;
- heads that work at half resolution;
- heads that take cost features too (`training.networks.cost_features`), since a small regressor's matching features
  hold too little of them;
- in `small`, sheared crops for the heads and larger dilations in GradNet (docs/ablations.md).

CostVolumeNet (ours) has presets of the same names.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, Literal, get_args

from training.data.augmentation import AugmentationConfig
from training.data.sampling import CROP_MULTIPLE
from training.errors import TrainingError
from training.losses import STATIC_WEIGHTS
from training.networks import CostVolumeConfig, DispNetConfig, HeadConfig
from training.networks.regressor_free import REGRESSOR_FREE_CHANNELS
from training.networks.regressors.costvolume import CostVolumeObjective
from training.networks.regressors.dispnet import MultiscaleObjective
from training.networks.regressors.registry import find_regressor, regressor_for
from training.preset_kinds import (
    ConfNetPreset,
    FineTuningPreset,
    GradNetPreset,
    JointPreset,
    OptimizerConfig,
    Preset,
    RegressorFreeConfNetPreset,
    RegressorFreeGradNetPreset,
    RegressorPreset,
)

Task = Literal["regressor", "regressor_f", "confnet", "gradnet", "confnet_free", "gradnet_free", "joint"]
"""Names of the tasks, on the command line and in the names of files."""
TASKS: tuple[Task, ...] = get_args(Task)
"""All of them."""


def _every(interval: int, end: int) -> tuple[int, ...]:
    return tuple(range(interval, end, interval))


SMALL_AUGMENTATION = AugmentationConfig(
    log_zoom=(-0.1, 0.3),
    log_squeeze=(-0.1, 0.1),
    horizontal_flip=0.5,
    log_brightness=0.2,
    log_gamma=0.2,
    log_contrast=0.2,
    log_color=0.1,
    noise=0.02,
)
"""About half of the released ranges, since a small network in a short run fits narrower data better (ours)."""

SLANTED_AUGMENTATION = replace(SMALL_AUGMENTATION, shear=0.6)
"""For heads: some crops are sheared, since roads are slanted and flying things are not. A run of 200 steps (`tiny`) is
too short to learn from it (docs/ablations.md)."""

HEAD_AUGMENTATION = replace(SLANTED_AUGMENTATION, log_zoom=(-0.3, 0.4))
"""For the heads of a regressor: they judge at a picture's own size, whatever size the regressor sees it at."""

SMALL_OPTIMIZER = OptimizerConfig(
    learning_rate=1e-3, schedule="cosine", warmup_steps=500, epsilon=1e-8, weight_decay=1e-4, clip_norm=1.0
)
"""Adam of the short runs (ours)."""

FULL_DISPNET = RegressorPreset(
    steps=1_200_000,
    batch_size=4,
    crop_width=768,
    crop_height=384,
    optimizer=OptimizerConfig(halve_at=(200_000, 350_000, 500_000, 650_000, 800_000), weight_decay=4e-4),
    network=DispNetConfig(),
    objective=MultiscaleObjective(stage_ends=tuple(stage / 12 for stage in range(1, 7))),
    validation_interval=10_000,
)
"""The published training. The lengths of the stages are not published; 100,000 steps each is what a public retraining
used (ours)."""

SMALL_DISPNET = RegressorPreset(
    steps=20_000,
    batch_size=4,
    crop_width=320,
    crop_height=128,
    optimizer=SMALL_OPTIMIZER,
    augmentation=SMALL_AUGMENTATION,
    network=DispNetConfig(width=0.25, one_sided=True, normalization="batch", prediction_scale=16.0),
    objective=MultiscaleObjective(stages=(STATIC_WEIGHTS,)),
    validation_interval=500,
    fixed_statistics=0.3,
)
"""For hours on few pairs (ours)."""
TINY_DISPNET = replace(
    SMALL_DISPNET,
    steps=800,
    optimizer=replace(SMALL_OPTIMIZER, learning_rate=2e-3, warmup_steps=40),
    validation_interval=200,
    validation_samples=16,
)
"""At twice the learning rate of `small`, so short a run has errors lower by 8 to 9 % (docs/ablations.md)."""

RIG_AUGMENTATION = AugmentationConfig(
    log_zoom=(-0.1, 0.75),
    log_squeeze=(-0.15, 0.15),
    horizontal_flip=0.5,
    shear=0.3,
    log_brightness=0.3,
    log_gamma=0.3,
    log_contrast=0.3,
    log_color=0.2,
    noise=0.03,
    antialias=True,
    vertical_misalignment=1.0,
    roll_deg=0.2,
    log_view_brightness=0.15,
    log_view_color=0.08,
    one_sided_blur=1.0,
    erasing=0.3,
    erased_size=(30.0, 80.0),
    jpeg=0.2,
)
"""Wide zoom, since CostVolumeNet sees pictures enlarged by up to 2 (`CostVolumeNet.enlarged_size`), and what tells the
two cameras of a real rig apart."""

SMALL_COSTVOLUME = RegressorPreset(
    steps=12_000,
    batch_size=2,
    crop_width=448,
    crop_height=256,
    optimizer=replace(SMALL_OPTIMIZER, warmup_steps=300),
    augmentation=RIG_AUGMENTATION,
    network=CostVolumeConfig(),
    objective=CostVolumeObjective(),
    validation_interval=500,
    fixed_statistics=0.2,
)
"""For hours on few pairs (ours)."""
TINY_COSTVOLUME = replace(
    SMALL_COSTVOLUME,
    steps=600,
    crop_width=320,
    crop_height=160,
    augmentation=replace(SMALL_AUGMENTATION, log_zoom=(0.1, 0.75)),
    optimizer=replace(SMALL_COSTVOLUME.optimizer, learning_rate=2e-3, warmup_steps=40),
    validation_interval=200,
    validation_samples=16,
)
"""For minutes (ours)."""
FULL_COSTVOLUME = replace(
    SMALL_COSTVOLUME,
    steps=200_000,
    batch_size=16,
    crop_width=640,
    crop_height=320,
    optimizer=OptimizerConfig(
        learning_rate=1e-3,
        schedule="cosine",
        warmup_steps=2000,
        epsilon=1e-8,
        weight_decay=1e-5,
        clip_norm=1.0,
    ),
    network=CostVolumeConfig(
        stem=32,
        encoder=(64, 96, 128, 192),
        descriptor_groups=8,
        aggregation=(16, 32, 64, 64),
        look_groups=4,
        look_channels=64,
        full_channels=24,
    ),
    validation_interval=5000,
)
"""For a day of a GPU. The sizes are about those of LightStereo (Guo et al., 2024); nobody has trained it (ours)."""

FULL_FINE_TUNING = FineTuningPreset(
    steps=100_000,
    batch_size=4,
    crop_width=768,
    crop_height=384,
    optimizer=OptimizerConfig(learning_rate=1e-5, weight_decay=4e-4),
    augmentation=AugmentationConfig(log_zoom=(0.0, 0.0), log_squeeze=(0.0, 0.0)),
    validation_interval=5000,
)
"""The paper's fine-tuning; its length and learning rate are not published (ours)."""
SMALL_FINE_TUNING = FineTuningPreset(
    steps=3000,
    batch_size=4,
    crop_width=320,
    crop_height=128,
    optimizer=replace(SMALL_OPTIMIZER, learning_rate=1e-4, warmup_steps=100),
    augmentation=replace(SMALL_AUGMENTATION, log_zoom=(0.0, 0.0), log_squeeze=(0.0, 0.0)),
    validation_interval=500,
    fixed_statistics=1.0,
)
"""`regressor_f` for about an hour (ours)."""
TINY_FINE_TUNING = replace(
    SMALL_FINE_TUNING,
    steps=200,
    optimizer=replace(SMALL_OPTIMIZER, learning_rate=1e-4, warmup_steps=20),
    validation_interval=100,
    validation_samples=16,
)
"""`regressor_f` for minutes (ours)."""

FULL_CONFNET = ConfNetPreset(
    steps=320_000,
    batch_size=4,
    crop_width=768,
    crop_height=384,
    optimizer=OptimizerConfig(
        learning_rate=1e-3, halve_at=_every(40_000, 320_000), weight_decay=5e-4, epsilon=1e-8
    ),
    validation_interval=10_000,
)
"""The paper's training of ConfNet."""
SMALL_CONFNET = ConfNetPreset(
    steps=5000,
    batch_size=4,
    crop_width=320,
    crop_height=128,
    optimizer=replace(SMALL_OPTIMIZER, warmup_steps=100),
    augmentation=HEAD_AUGMENTATION,
    network=HeadConfig(
        width=32,
        hidden=64,
        dropout=0.2,
        normalization="batch",
        half_resolution=True,
        cost_features=True,
    ),
    validation_interval=500,
)
"""ConfNet on a small regressor (ours)."""
TINY_CONFNET = replace(
    SMALL_CONFNET,
    steps=200,
    enlarged_share=0.0,
    augmentation=SMALL_AUGMENTATION,
    optimizer=replace(SMALL_OPTIMIZER, warmup_steps=20),
    validation_interval=100,
    validation_samples=16,
)
"""ConfNet for minutes, which crops seen enlarged would double (ours)."""

FULL_GRADNET = GradNetPreset(
    steps=200_000,
    batch_size=4,
    crop_width=768,
    crop_height=384,
    optimizer=OptimizerConfig(
        learning_rate=1e-4, halve_at=_every(20_000, 200_000), weight_decay=4e-4, epsilon=1e-8
    ),
    validation_interval=10_000,
)
"""The paper's training of GradNet."""
WIDE_DILATIONS = (1, 2, 4, 8)
"""At half resolution they reach 30 pixels in every direction. Gradients on other worlds gain from that, confidences do
not (docs/ablations.md)."""
SMALL_GRADNET = GradNetPreset(
    steps=5000,
    batch_size=4,
    crop_width=320,
    crop_height=128,
    optimizer=replace(SMALL_OPTIMIZER, warmup_steps=100),
    augmentation=HEAD_AUGMENTATION,
    network=replace(SMALL_CONFNET.network, dropout=0.0, dilations=WIDE_DILATIONS),
    validation_interval=500,
)
"""GradNet on a small regressor (ours)."""
TINY_GRADNET = replace(
    SMALL_GRADNET,
    steps=200,
    enlarged_share=0.0,
    augmentation=SMALL_AUGMENTATION,
    optimizer=replace(SMALL_OPTIMIZER, warmup_steps=20),
    network=replace(SMALL_GRADNET.network, dilations=(1, 1, 1, 1)),
    validation_interval=100,
    validation_samples=16,
)
"""So short a run learns more from a pixel's neighbours than from its wider surroundings (docs/ablations.md)."""

SMALL_REGRESSOR_FREE_CONFNET = RegressorFreeConfNetPreset(
    steps=SMALL_CONFNET.steps,
    batch_size=4,
    crop_width=320,
    crop_height=128,
    optimizer=SMALL_CONFNET.optimizer,
    augmentation=SLANTED_AUGMENTATION,
    network=replace(
        SMALL_CONFNET.network, feature_channels=REGRESSOR_FREE_CHANNELS, dilations=WIDE_DILATIONS
    ),
    validation_interval=500,
)
"""`confnet_free`: `small`, on semi-global matching (ours)."""
TINY_REGRESSOR_FREE_CONFNET = replace(
    SMALL_REGRESSOR_FREE_CONFNET,
    steps=200,
    augmentation=SMALL_AUGMENTATION,
    optimizer=TINY_CONFNET.optimizer,
    validation_interval=100,
    validation_samples=16,
)
"""`confnet_free` for minutes (ours)."""
SMALL_REGRESSOR_FREE_GRADNET = RegressorFreeGradNetPreset(
    steps=SMALL_GRADNET.steps,
    batch_size=4,
    crop_width=320,
    crop_height=128,
    optimizer=SMALL_GRADNET.optimizer,
    augmentation=SLANTED_AUGMENTATION,
    network=replace(SMALL_GRADNET.network, feature_channels=REGRESSOR_FREE_CHANNELS),
    validation_interval=500,
)
"""`gradnet_free`: `small`, on semi-global matching (ours)."""
TINY_REGRESSOR_FREE_GRADNET = replace(
    SMALL_REGRESSOR_FREE_GRADNET,
    steps=200,
    augmentation=SMALL_AUGMENTATION,
    optimizer=TINY_GRADNET.optimizer,
    validation_interval=100,
    validation_samples=16,
)
"""`gradnet_free` for minutes (ours)."""

SMALL_JOINT = JointPreset(
    steps=2000,
    batch_size=4,
    crop_width=320,
    crop_height=128,
    optimizer=replace(SMALL_OPTIMIZER, learning_rate=3e-4, warmup_steps=50),
    augmentation=replace(
        SMALL_AUGMENTATION, log_brightness=0.0, log_gamma=0.0, log_contrast=0.0, log_color=0.0, noise=0.0
    ),
    validation_interval=250,
)
"""Both heads through the refinement (ours)."""
TINY_JOINT = replace(
    SMALL_JOINT,
    steps=200,
    batch_size=2,
    crop_width=256,
    optimizer=replace(SMALL_JOINT.optimizer, warmup_steps=20),
    validation_interval=50,
    validation_samples=16,
)
"""Both heads through the refinement, for minutes (ours)."""

PRESETS: dict[Task, dict[str, Preset]] = {
    "regressor_f": {"tiny": TINY_FINE_TUNING, "small": SMALL_FINE_TUNING, "full": FULL_FINE_TUNING},
    "confnet": {"tiny": TINY_CONFNET, "small": SMALL_CONFNET, "full": FULL_CONFNET},
    "gradnet": {"tiny": TINY_GRADNET, "small": SMALL_GRADNET, "full": FULL_GRADNET},
    "confnet_free": {"tiny": TINY_REGRESSOR_FREE_CONFNET, "small": SMALL_REGRESSOR_FREE_CONFNET},
    "gradnet_free": {"tiny": TINY_REGRESSOR_FREE_GRADNET, "small": SMALL_REGRESSOR_FREE_GRADNET},
    "joint": {"tiny": TINY_JOINT, "small": SMALL_JOINT},
}
"""The presets of each task that trains one kind of network, by their names."""
REGRESSOR_PRESETS: dict[str, dict[str, Preset]] = {
    "dispnet": {"tiny": TINY_DISPNET, "small": SMALL_DISPNET, "full": FULL_DISPNET},
    "costvolume": {"tiny": TINY_COSTVOLUME, "small": SMALL_COSTVOLUME, "full": FULL_COSTVOLUME},
}
"""The presets of the task `regressor`, by the names of the networks and their own."""
DEFAULT_NETWORK = "costvolume"
"""The regressor that is trained where nobody names one."""


def find_preset(task: str, name: str, network: str = DEFAULT_NETWORK) -> Preset:
    """Find the preset of a task by its name.

    Args:
        task: Name of the task.
        name: Name of the preset.
        network: Name of the regressor, for the task `regressor`.

    Raises:
        TrainingError: no such task, network or preset; lists those that there are.
    """
    for known in TASKS:
        if known == task:
            presets = _presets_of(network) if task == "regressor" else PRESETS[known]
            if name not in presets:
                raise TrainingError(f"{task} has no preset {name!r}; there are {', '.join(presets)}")
            return presets[name]
    raise TrainingError(f"there is no task {task!r}; there are {', '.join(TASKS)}")


def _presets_of(network: str) -> Mapping[str, Preset]:
    find_regressor(network)
    if network not in REGRESSOR_PRESETS:
        raise TrainingError(
            f"there is no preset for the network {network!r}; pass a RegressorPreset of your own"
        )
    return REGRESSOR_PRESETS[network]


def change_preset(preset: Preset, changes: Mapping[str, Any]) -> Preset:
    """Change some fields of a preset.

    Args:
        preset: The preset.
        changes: New values by the names of fields; `learning_rate` is the optimizer's.

    Raises:
        TrainingError: a field that the preset does not have, or a crop size that does not suit the network.
    """
    changes = dict(changes)
    if "learning_rate" in changes:
        changes["optimizer"] = replace(preset.optimizer, learning_rate=changes.pop("learning_rate"))
    known = [field.name for field in fields(preset)]
    for name in changes:
        if name not in known:
            raise TrainingError(
                f"{name} does not apply here: a {type(preset).__name__} has {', '.join(known)}"
            )
    changed = replace(preset, **changes)
    size = changed.crop_width, changed.crop_height
    unit = CROP_MULTIPLE
    if isinstance(changed, RegressorPreset):
        unit = regressor_for(changed.network).stride
    if any(length % unit for length in size) or min(size) < unit:
        raise TrainingError(
            f"crops must be multiples of {unit} each way, not {changed.crop_width}x{changed.crop_height}"
        )
    return changed
