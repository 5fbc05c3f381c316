"""Trained networks on disk: `<run>/<task>.safetensors` with the tensors and `<run>/<task>.json`, their description.

To read them runs no code. Safetensors files hold numbers only, and the JSON becomes typed records. It holds the digest
of the tensors' file, so damaged or mixed-up files are refused.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

import cattrs
import safetensors.torch
import torch
from safetensors import SafetensorError
from torch import Tensor, nn

from stereoforge_kit.files import write_bytes, write_text
from stereoforge_kit.messages import listed, shortened
from training.errors import TrainingError
from training.networks import ConfNet, GradNet, HeadConfig, Regressor
from training.networks.regressors.registry import find_regressor

Network = TypeVar("Network", bound=nn.Module)
"""A regressor, ConfNet or GradNet."""
FORMAT = 2
"""Version of the descriptions, which other versions refuse."""
MAX_DESCRIPTION_BYTES = 1 << 20
"""Larger descriptions are refused unread."""
_CONVERTER = cattrs.Converter(forbid_extra_keys=True)


@dataclass(frozen=True)
class TrainingSummary:
    """How a network was trained."""

    preset: str
    """Name of the preset, with the changes to it."""
    steps: int
    """Optimizer steps of the whole run."""
    seed: int
    """Seed of the run."""
    data: tuple[tuple[str, float], ...]
    """Each data set, as it was named, and how often it was drawn from relative to the others."""
    best_step: int
    """Steps after which these weights were kept."""
    validation: dict[str, float] = field(default_factory=dict)
    """Figures of these weights on the validation frames; empty where there were none."""
    fingerprints: tuple[str, ...] = ()
    """What identifies each data set's frames (`training.data.fingerprint`)."""
    revision: str = ""
    """Version and git revision of the code."""
    started_from: TrainingSummary | None = None
    """How the regressor was trained that a `regressor` or `regressor_f` started from; None for new weights."""


@dataclass(frozen=True)
class StoredNetwork(Generic[Network]):
    """A network read from a run folder."""

    network: Network
    """In evaluation mode, on the CPU."""
    sha256: str
    """SHA-256 of the tensors' file."""
    regressor_sha256: str | None
    """SHA-256 of the regressor that a ConfNet or GradNet was trained on; None for other networks."""
    training: TrainingSummary
    """How it was trained."""


def weights_path(run: Path, task: str) -> Path:
    """The tensors' file of a network."""
    return run / f"{task}.safetensors"


def save_weights(
    run: Path,
    task: str,
    network: Regressor | ConfNet | GradNet,
    training: TrainingSummary,
    regressor_sha256: str | None = None,
) -> None:
    """Write a network and its description; each file is written whole or not at all.

    Args:
        run: Run folder.
        task: Name of the files.
        network: The network.
        training: How it was trained.
        regressor_sha256: SHA-256 of the regressor that a ConfNet or GradNet was trained on.
    """
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in network.state_dict().items()}
    content = safetensors.torch.save(tensors)
    description = {
        "format": FORMAT,
        "task": task,
        "sha256": hashlib.sha256(content).hexdigest(),
        "regressor_sha256": regressor_sha256,
        "network": _described(network),
        "training": asdict(training),
    }
    write_bytes(weights_path(run, task), content)
    write_text(run / f"{task}.json", json.dumps(description, indent=2) + "\n")


def _described(network: Regressor | ConfNet | GradNet) -> dict[str, Any]:
    """A network's options and, of a regressor, its name."""
    name = {"name": network.name} if isinstance(network, Regressor) else {}
    return {**name, **asdict(network.config)}


def load_regressor(run: Path, task: str = "regressor") -> StoredNetwork[Regressor]:
    """Read `regressor` or `regressor_f` of a run folder. Raises TrainingError for missing or damaged files."""
    return _load(run, task, _build_regressor)


def _build_regressor(described: Mapping[str, Any]) -> Regressor:
    options = dict(described)
    regressor = find_regressor(options.pop("name"))
    return regressor(_structure(options, regressor.config_type))


def load_confnet(run: Path, task: str = "confnet") -> StoredNetwork[ConfNet]:
    """Read `confnet` or `confnet_free` of a run folder. Raises TrainingError for missing or damaged files."""
    return _load(run, task, lambda config: ConfNet(_structure(config, HeadConfig)))


def load_gradnet(run: Path, task: str = "gradnet") -> StoredNetwork[GradNet]:
    """Read `gradnet` or `gradnet_free` of a run folder. Raises TrainingError for missing or damaged files."""
    return _load(run, task, lambda config: GradNet(_structure(config, HeadConfig)))


def on_regressor(run: Path, task: str, stored: StoredNetwork[Network], regressor_sha256: str) -> Network:
    """The network of a head that was trained on this regressor.

    Raises:
        TrainingError: it was trained on another one.
    """
    if stored.regressor_sha256 != regressor_sha256:
        raise TrainingError(
            f"{run}: its {task} was trained on another regressor than the folder's; train it again"
        )
    return stored.network


def read_summary(run: Path, task: str) -> TrainingSummary:
    """How the network of a run folder was trained. Raises TrainingError for a missing or damaged description."""
    path = run / f"{task}.json"
    try:
        summary: TrainingSummary = _structure(_read_description(path, task)["training"], TrainingSummary)
    except ValueError as error:
        raise TrainingError(f"{path}: does not describe a trained network ({error})") from error
    return summary


def regressor_title(run: Path, task: str) -> str:
    """The name in words of a run folder's `regressor` or `regressor_f`.

    Raises:
        TrainingError: a missing or damaged description.
    """
    path = run / f"{task}.json"
    try:
        return find_regressor(_read_description(path, task)["network"]["name"]).title
    except (KeyError, TypeError) as error:
        raise TrainingError(f"{path}: does not say which regressor it describes") from error


def copy_weights(source: Path, target: Path, task: str) -> None:
    """Copy a network from one run folder to another. Raises TrainingError for missing or damaged files."""
    loaders = {"regressor": load_regressor, "confnet": load_confnet, "gradnet": load_gradnet}
    loaders[task.split("_")[0]](source, task)
    for path in (weights_path(source, task), source / f"{task}.json"):
        write_bytes(target / path.name, path.read_bytes())


def has_weights(run: Path, task: str) -> bool:
    """Whether a run folder holds the tensors of a network."""
    return weights_path(run, task).exists()


def require_run_folder(run: Path) -> None:
    """Raise TrainingError for a run folder that is missing, or is a file."""
    if run.is_file():
        raise TrainingError(f"{run}: is a file, not a run folder; give the folder it is in, {run.parent}")
    if not run.is_dir():
        raise TrainingError(f"{run}: there is no such run folder")


def _load(run: Path, task: str, build: Callable[[Mapping[str, Any]], Network]) -> StoredNetwork[Network]:
    path, description_path = weights_path(run, task), run / f"{task}.json"
    require_run_folder(run)
    for needed in (path, description_path):
        if not needed.is_file():
            raise TrainingError(f"{needed}: missing, so {run} holds no trained {task}")
    description = _read_description(description_path, task)
    content = path.read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    if digest != description["sha256"]:
        raise TrainingError(f"{path}: damaged, or of another run than {description_path.name} beside it")
    try:
        # On the meta device, the network takes no more memory than the file holds, whatever sizes it describes.
        with torch.device("meta"):
            network = build(description["network"])
        _fill(network, safetensors.torch.load(content))
        training = _structure(description["training"], TrainingSummary)
    except (SafetensorError, RuntimeError, KeyError, ValueError, TypeError, TrainingError) as error:
        raise TrainingError(
            f"{path}: does not hold the {task} that {description_path.name} describes ({shortened(str(error), 150)})"
        ) from error
    network.eval()
    return StoredNetwork(network, digest, description["regressor_sha256"], training)


def _fill(network: nn.Module, tensors: Mapping[str, Tensor]) -> None:
    """Give the network these tensors. Raises RuntimeError or ValueError if names, shapes or types differ."""
    wanted = network.state_dict()
    odd = [name for name, tensor in tensors.items() if name in wanted and tensor.dtype != wanted[name].dtype]
    if odd:
        raise ValueError(
            f"{odd[0]} holds {tensors[odd[0]].dtype} where the network has {wanted[odd[0]].dtype}"
        )
    network.load_state_dict(tensors, assign=True)


def _read_description(path: Path, task: str) -> dict[str, Any]:
    try:
        if path.stat().st_size > MAX_DESCRIPTION_BYTES:
            raise ValueError(f"{path.stat().st_size} bytes are more than any description has")
        description = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise TrainingError(f"{path}: cannot be read as JSON ({error})") from error
    keys = {"format", "task", "sha256", "regressor_sha256", "network", "training"}
    if not isinstance(description, dict) or description.keys() != keys:
        raise TrainingError(f"{path}: does not describe a trained network")
    if description["format"] != FORMAT:
        raise TrainingError(f"{path}: has format {description['format']}, this version reads {FORMAT}")
    if description["task"] != task:
        raise TrainingError(f"{path}: describes a {description['task']}, not a {task}")
    return description


def _structure(values: Any, kind: type[Any]) -> Any:
    try:
        return _CONVERTER.structure(values, kind)
    except (cattrs.BaseValidationError, cattrs.StructureHandlerNotFoundError) as error:
        raise ValueError(listed(cattrs.transform_error(error), most=3, longest=80, separator="; ")) from error
