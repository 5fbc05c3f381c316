"""The run folder before a run starts: that it is free, whole and of the same run."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stereoforge_kit.files import alone, write_text
from training.errors import TrainingError
from training.runs.checkpoints import checkpoint_step
from training.runs.hardware import process_rank
from training.runs.weights import has_weights

CHECKPOINT = "last.ckpt"
"""Name of a run's only checkpoint, in `logs/<task>/`."""
LOCK = ".lock"
"""Name of the file that is locked while a run goes on."""
SETTINGS = "settings.json"
"""Name of the file with all that decides a run's weights."""
LONGEST_SHOWN = 60
"""Characters of a setting that a message about it shows."""


@dataclass(frozen=True)
class Continuation:
    """What a resumed run continues."""

    checkpoint: Path
    """The file."""
    done: int
    """Steps that have been done."""
    steps: int
    """Steps that the run was to have in all."""


def checkpoint_path(out: Path, task: str) -> Path:
    """The run's only checkpoint."""
    return out / "logs" / task / CHECKPOINT


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


def claim_run_folder(out: Path, task: str, resume: bool, settings: Mapping[str, Any]) -> Continuation | None:
    """Check that the run folder is fit for the run and note the run's settings there.

    Returns:
        What the run continues. None starts anew, as does a resumed run without a checkpoint yet.

    Raises:
        TrainingError: the folder holds the network or a checkpoint already, or a resumed run has other settings. It may
            have more steps.
    """
    noted, checkpoint = out / "logs" / task / SETTINGS, checkpoint_path(out, task)
    done = checkpoint_step(checkpoint)
    found = None
    if resume and noted.is_file():
        steps = _check_settings(noted, settings)
        found = None if done is None else Continuation(checkpoint, done, steps)
    else:
        _require_free(out, task, done)
    if process_rank() == 0:
        write_text(noted, json.dumps(settings, indent=2) + "\n")
    return found


def _require_free(out: Path, task: str, done: int | None) -> None:
    """Raise TrainingError where a run that starts anew would replace what another one left."""
    for name in written_networks(task):
        if has_weights(out, name):
            raise TrainingError(
                f"{out}: already holds a {name}; continue it with --resume or choose another folder"
            )
    if done is not None:
        raise TrainingError(
            f"{out}: already holds a checkpoint of step {done} of a {task}; continue it with --resume, or choose "
            f"another folder, or delete {out / 'logs' / task}"
        )


def _check_settings(path: Path, settings: Mapping[str, Any]) -> int:
    """Check that a resumed run is the interrupted one, perhaps with more steps; returns the steps it had."""
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        steps, stored = int(stored["steps"]), _with_named_data(stored)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise TrainingError(f"{path}: cannot be read, so the run cannot be resumed ({error})") from error
    if settings["steps"] < steps:
        raise TrainingError(
            f"{path.parent}: the run was started with {steps} steps; it can be continued with more, not with "
            f"{settings['steps']}"
        )
    wanted = _with_named_data(json.loads(json.dumps({**settings, "steps": steps})))
    for name, before, now in _differences(stored, wanted):
        raise TrainingError(
            f"{path.parent}: the run was started with another {name} ({_brief(before, now)}, not "
            f"{_brief(now, before)}), so it cannot be resumed"
        )
    return steps


def _with_named_data(settings: dict[str, Any]) -> dict[str, Any]:
    """The settings with each data set's fingerprint and weight under names."""
    named = {
        str(i): {"frames": frames, "weight": weight} for i, (frames, weight) in enumerate(settings["data"], 1)
    }
    return {**settings, "data": named}


def _differences(stored: Any, wanted: Any, name: str = "") -> Iterator[tuple[str, Any, Any]]:
    """The innermost settings that differ: name, value in the first and value in the second."""
    if isinstance(stored, dict) and isinstance(wanted, dict):
        for key in {**wanted, **stored}:
            yield from _differences(stored.get(key), wanted.get(key), f"{name}.{key}" if name else key)
    elif isinstance(stored, list) and isinstance(wanted, list) and len(stored) == len(wanted):
        for index, pair in enumerate(zip(stored, wanted, strict=True)):
            yield from _differences(*pair, f"{name}[{index}]")
    elif stored != wanted:
        yield name, stored, wanted


def _brief(value: Any, other: Any) -> str:
    """A value as JSON; of a long one the part where it begins to differ from another."""
    text = json.dumps(value)
    if len(text) <= LONGEST_SHOWN:
        return text
    pairs = zip(text, json.dumps(other), strict=False)
    start = max(next((i for i, (a, b) in enumerate(pairs) if a != b), 0) - LONGEST_SHOWN // 2, 0)
    shown = text[start : start + LONGEST_SHOWN]
    return f"{'... ' * (start > 0)}{shown}{' ...' * (start + LONGEST_SHOWN < len(text))}"
