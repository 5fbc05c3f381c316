"""The run folder before a run starts: that it is free, whole and of the same run."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

from stereoforge_kit.files import alone, write_text
from training.errors import TrainingError
from training.runs.hardware import process_rank
from training.runs.weights import has_weights

CHECKPOINT = "last.ckpt"
"""Name of a run's only checkpoint, in `logs/<task>/`."""
LOCK = ".lock"
"""Name of the file that is locked while a run goes on."""
SETTINGS = "settings.json"
"""Name of the file with all that decides a run's weights."""
LONGEST_SHOWN = 100
"""Characters of a setting that a message about it shows."""


def written_networks(task: str) -> tuple[str, ...]:
    """The networks that a task leaves in its run folder: `joint` two, every other task its own."""
    return ("confnet", "gradnet") if task == "joint" else (task,)


def only_writer(out: Path, task: str) -> AbstractContextManager[None]:
    """Keep a second run out of the folder, which would overwrite the first one's checkpoints and weights.

    Raises:
        TrainingError: another process trains the same task there.
    """
    if process_rank() > 0:  # torchrun's other processes write nothing
        return nullcontext()
    busy = TrainingError(
        f"{out}: another process is training its {task} right now; wait for it, or choose another folder"
    )
    return alone(out / "logs" / task / LOCK, busy)


def claim_run_folder(out: Path, task: str, resume: bool, settings: Mapping[str, Any]) -> Path | None:
    """Check that the run folder is fit for the run and note the run's settings there.

    Returns:
        The checkpoint to continue from. None starts anew, as does a resumed run without a checkpoint yet.

    Raises:
        TrainingError: the folder holds the network already, or a resumed run has other settings.
    """
    logs = out / "logs" / task
    noted = logs / SETTINGS
    if resume and noted.is_file():
        _check_settings(noted, settings)
    else:
        for name in written_networks(task):
            if has_weights(out, name):
                raise TrainingError(
                    f"{out}: already holds a {name}; continue it with --resume or choose another folder"
                )
    if process_rank() == 0:
        write_text(noted, json.dumps(settings, indent=2) + "\n")
    checkpoint = logs / CHECKPOINT
    return checkpoint if resume and checkpoint.is_file() else None


def _check_settings(path: Path, settings: Mapping[str, Any]) -> None:
    """A resumed run must be the interrupted one."""
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise TrainingError(f"{path}: cannot be read, so the run cannot be resumed ({error})") from error
    for key, value in json.loads(json.dumps(settings)).items():
        if stored.get(key) != value:
            raise TrainingError(
                f"{path}: the run was started with another {key} ({_brief(stored.get(key))}, not {_brief(value)}), "
                "so it cannot be resumed"
            )


def _brief(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]} ..."
