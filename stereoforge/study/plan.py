"""What a study consists of, as a typed record and as one YAML file."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import cattrs
import yaml

from datagen import Recipe
from datagen.recipe.recipe import recipe_from_plain
from refine.registry import default_methods
from scenes import FAMILIES
from stereoforge.errors import UsageError
from stereoforge.pipelines.forest import PLANS
from stereoforge_kit.messages import listed, shortened
from training.presets import find_preset

TRAINING_SPLITS = ("train", "val")
TEST_SPLITS = ("test",)
NETWORKS = ("regressor", "confnet", "gradnet", "regressor_f")
"""What is trained on a domain, in this order; the last on the subject only, where its row is asked for."""
_CONVERTER = cattrs.Converter(forbid_extra_keys=True)


@dataclass(frozen=True)
class DomainPlan:
    """One kind of data: worlds to be rendered, or a data set that is there."""

    source: str | None = None
    """A data set as `datagen.sources.registry` takes it; None renders the family of the domain's name."""
    config: dict[str, Any] = field(default_factory=dict)
    """Fields of the family's config that differ from its defaults, `frames` a scene for example; the size is the
    study's."""
    scenes: dict[str, int] = field(default_factory=lambda: {"train": 100, "val": 5, "test": 25})
    """Scenes of each split; those of the training splits are rendered only where something is trained on them."""
    curriculum_scenes: int = 0
    """How many of the training scenes that are rendered grow from few and simple things to the domain's own."""
    curriculum: float = 0.0
    """Share of its steps over which the regressor sees them in that order, a growing part of all."""
    steps: dict[str, int] = field(default_factory=dict)
    """Training steps of each network; the preset's where none are given."""
    methods: tuple[str, ...] = ()
    """Rows of the subject's tables on this domain; empty for the study's."""


@dataclass(frozen=True)
class StudyPlan:
    """Everything that decides a study's numbers."""

    domains: dict[str, DomainPlan]
    """By name: a family's, or any for a data set that is there."""
    train: tuple[str, ...]
    """Domains to train on. The first is the subject: every method is run with its networks, and its gap to the
    others is what refinement and fine-tuning are to close. The others give the errors in their own domain."""
    test: tuple[str, ...]
    """Domains to test on."""
    size: tuple[int, int] = (384, 192)
    """Width and height of what is rendered, in pixels."""
    seed: int = 0
    """Of the worlds, the training and the confidence intervals."""
    samples: int = 4
    """Paths a pixel."""
    preset: str = "small"
    network: str = "dispnet"
    """The regressor: `dispnet`, the paper's, or `costvolume`."""
    fine_tuning_steps: int = 0
    """Steps of the subject's regressor on the training split of each other test domain that has one; 0 leaves that
    out."""
    tuning_frames: int = 0
    """Validation frames of each training domain on which the methods' parameters are chosen; 0 takes the
    defaults. Of rendered worlds each is of another scene: parameters chosen on several frames of a few scenes are those
    scenes' (the parameters chosen on 8 scenes lowered the end-point error to 0.88 there, to 0.94 on 40 others)."""
    forest: bool = False
    """Whether the random-forest confidence is trained on the subject, as ConfNet's rival."""
    methods: tuple[str, ...] = ()
    """Rows of the subject's tables; empty for all there are."""

    def __post_init__(self) -> None:
        if not self.train or not self.test:
            raise UsageError("a study needs at least one domain to train on and one to test on")
        for name in (*self.train, *self.test):
            if name not in self.domains:
                raise UsageError(f"the study has no domain {name!r}; it has {listed([*self.domains])}")
        for role in (self.train, self.test):
            if len(set(role)) != len(role):
                raise UsageError(f"a domain is named twice in {listed(role)}")
        for name, domain in self.domains.items():
            if domain.source is None and name not in FAMILIES:
                raise UsageError(f"there is no family {name}; there are {', '.join(FAMILIES)}")
            if unknown := domain.steps.keys() - set(NETWORKS):
                raise UsageError(
                    f"{name}: there is no network {min(unknown)}; there are {', '.join(NETWORKS)}"
                )
            if min((*domain.scenes.values(), *domain.steps.values()), default=1) < 1:
                raise UsageError(f"{name}: numbers of scenes and steps must be at least 1")
            if domain.curriculum_scenes < 0 or not 0 <= domain.curriculum <= 1:
                raise UsageError(
                    f"{name}: curriculum_scenes must not be negative, and curriculum a share from 0 to 1; got "
                    f"{domain.curriculum_scenes} and {domain.curriculum:g}"
                )
        if min(self.fine_tuning_steps, self.tuning_frames, self.seed) < 0:
            raise UsageError("fine_tuning_steps, tuning_frames and the seed must not be negative")
        find_preset("regressor", self.preset, self.network)
        if self.forest and self.preset not in PLANS:
            raise UsageError(
                f"there is no forest of the preset {self.preset!r}; there are {', '.join(PLANS)}"
            )
        try:
            for methods in (self.methods, *(domain.methods for domain in self.domains.values())):
                default_methods(methods)
        except ValueError as error:
            raise UsageError(f"methods: {error}") from error

    @property
    def subject(self) -> str:
        """The domain whose networks are tested on all others: the first to train on."""
        return self.train[0]

    def recipe(self, name: str, splits: tuple[str, ...]) -> Recipe:
        """What to render of a domain for training or for testing. Raises DatasetError for a wrong config."""
        scenes = {split: self.domains[name].scenes.get(split, 0) for split in splits}
        ramp = self.domains[name].curriculum_scenes if "train" in splits else 0
        return self._recipe(name, scenes, self.domains[name].config, ramp)

    def tuning_recipe(self, name: str) -> Recipe:
        """What to render of a domain for choosing parameters: one frame of each validation scene."""
        return self._recipe(name, {"val": self.tuning_frames}, {**self.domains[name].config, "frames": 1})

    def _recipe(
        self, name: str, scenes: dict[str, int], config: dict[str, Any], curriculum_scenes: int = 0
    ) -> Recipe:
        width, height = self.size
        world = {"family": name, **_sized(config, width, height)}
        plain = {
            "world": world,
            "scenes": scenes,
            "seed": self.seed,
            "samples": self.samples,
            "curriculum_scenes": curriculum_scenes,
        }
        return recipe_from_plain(plain, f"the domain {name}")

    def plain(self) -> dict[str, Any]:
        """As the YAML file has it."""
        document: dict[str, Any] = _CONVERTER.unstructure(asdict(self))
        return {key: list(value) if isinstance(value, tuple) else value for key, value in document.items()}


def read_plan(path: Path) -> StudyPlan:
    """Raises UsageError for a file that is missing, no YAML, or no plan."""
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise UsageError(f"there is no plan {path}") from error
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise UsageError(f"cannot read the plan {path}: {shortened(str(error), 150)}") from error
    try:
        return _CONVERTER.structure(data, StudyPlan)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error
    except cattrs.BaseValidationError as error:
        reason = "; ".join(cattrs.transform_error(error))
        raise UsageError(f"{path} is not a valid plan: {reason}") from error


def _sized(config: dict[str, Any], width: int, height: int) -> dict[str, Any]:
    if config.keys() & {"width", "height", "family"}:
        raise UsageError("a domain's config must not set family, width or height: the study does")
    return {**config, "width": width, "height": height}
