"""What a resumed run continues, in words: from which step, and what more steps change."""

from __future__ import annotations

from training.preset_kinds import Preset, RegressorPreset
from training.runs.run_folder import Continuation
from training.tasks.base import learning_rate_factor


def describe_continuation(preset: Preset, steps: int, continued: Continuation) -> str:
    """From which step a run goes on and, where it has got more steps, what of its schedules changes.

    Args:
        preset: The run's preset.
        steps: Steps that the run has now.
        continued: What it continues.
    """
    said = f"goes on from step {continued.done} of {steps}"
    if steps == continued.steps:
        return said
    changes = _scaled_schedules(preset, continued.done, continued.steps, steps)
    return (
        f"{said}, {continued.steps} before"
        + "".join(f"; {change}" for change in changes)
        + "; the weights will not be those of a run that had so many steps from the beginning"
    )


def _scaled_schedules(preset: Preset, done: int, before: int, now: int) -> list[str]:
    """The schedules that are scaled to the number of steps, with what they say before and now."""
    rates = [
        preset.optimizer.learning_rate * learning_rate_factor(preset.optimizer, done, steps, preset.steps)
        for steps in (before, now)
    ]
    changes = []
    if rates[0] != rates[1]:
        changes.append(f"the learning rate is {rates[1]:.3g} there instead of {rates[0]:.3g}")
    if isinstance(preset, RegressorPreset) and preset.objective.stage_ends:
        ends = [", ".join(str(round(end * n)) for end in preset.objective.stage_ends) for n in (before, now)]
        changes.append(f"the loss's stages end at {ends[1]} instead of {ends[0]}")
    if preset.fixed_statistics:
        fixed = [n - round(preset.fixed_statistics * n) for n in (before, now)]
        changes.append(f"BatchNorm is fixed from step {fixed[1]} instead of {fixed[0]}")
    if preset.curriculum:
        grown = [round(preset.curriculum * n) for n in (before, now)]
        changes.append(f"the curriculum ends at step {grown[1]} instead of {grown[0]}")
    return changes
