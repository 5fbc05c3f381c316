"""Progress on the terminal, and the best weights on disk, during a run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import pytorch_lightning as pl
from rich.console import Console

from stereoforge_kit.viewing import JobProgress
from training.tasks import StereoTask


class BestWeights(pl.Callback):
    """Has the network saved whenever its validation figure is the best so far.

    Until there is a finite figure, the latest weights are the best. So they are to the end if there are no validation
    frames, or none with ground truth. A figure that is not finite never beats one that is. The best figure is part of
    the checkpoint, so a resumed run continues to compare with it.
    """

    def __init__(self, save: Callable[[int, dict[str, float]], None]) -> None:
        """Keep what saves the network: it is called with the steps done and the validation figures."""
        self._save = save
        self._best = math.inf

    def on_train_epoch_end(self, trainer: pl.Trainer, pl_module: StereoTask) -> None:
        """Compare the figure of the validation that has just ended, and save the network if it is the best."""
        figures = validation_figures(trainer)
        value = figures.get(pl_module.monitor.removeprefix("validation/"))
        if value is None or not math.isfinite(value):
            value = math.inf
        if math.isfinite(self._best) and value >= self._best:
            return
        self._best = value
        if trainer.is_global_zero:
            self._save(trainer.global_step, figures)

    def state_dict(self) -> dict[str, Any]:
        """What a checkpoint stores."""
        return {"best": self._best}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Take up what a checkpoint stored."""
        self._best = state_dict["best"]


class RunProgress(pl.Callback):
    """A bar over the whole run with the time left, and a line for every validation.

    Args:
        title: Of the bar.
        remarks: Sentences to print before the first step.
    """

    def __init__(self, title: str, remarks: Sequence[str] = ()) -> None:
        self._remarks = remarks
        self._console = Console(stderr=True)
        self._progress = JobProgress(self._console, "loss {task.fields[loss]:.3f}", transient=True)
        self._title = title

    def on_train_start(self, trainer: pl.Trainer, pl_module: StereoTask) -> None:  # noqa: ARG002
        """Show the bar, at the steps that a resumed run has done."""
        if not trainer.is_global_zero:
            self._console.quiet = True
        for remark in self._remarks:
            self._console.print(remark, markup=False, highlight=False, soft_wrap=True)
        self._bar = self._progress.add_task(
            self._title, total=trainer.max_steps, completed=trainer.global_step, loss=math.nan
        )
        self._progress.start()

    def on_train_batch_end(
        self,
        trainer: pl.Trainer,
        pl_module: StereoTask,  # noqa: ARG002
        outputs: Any,
        batch: Any,  # noqa: ARG002
        batch_idx: int,  # noqa: ARG002
    ) -> None:
        """Move the bar on, and show the loss."""
        self._progress.update(self._bar, completed=trainer.global_step, loss=float(outputs["loss"]))

    def on_train_epoch_end(self, trainer: pl.Trainer, pl_module: StereoTask) -> None:  # noqa: ARG002
        """Print the figures of a validation."""
        figures = "  ".join(f"{name} {value:.4g}" for name, value in validation_figures(trainer).items())
        if not figures:  # where there are no validation frames
            return
        self._console.print(
            f"{self._title} step {trainer.global_step}  {figures}", highlight=False, soft_wrap=True
        )

    def on_train_end(self, trainer: pl.Trainer, pl_module: StereoTask) -> None:  # noqa: ARG002
        """Remove the bar."""
        self._progress.stop()

    def on_exception(self, trainer: pl.Trainer, pl_module: StereoTask, exception: BaseException) -> None:  # noqa: ARG002
        """Remove the bar."""
        self._progress.stop()


def validation_figures(trainer: pl.Trainer) -> dict[str, float]:
    """The figures of the last validation, by their names without `validation/`."""
    return {
        name.removeprefix("validation/"): float(value)
        for name, value in trainer.callback_metrics.items()
        if name.startswith("validation/")
    }
