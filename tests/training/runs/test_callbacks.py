"""Which weights of a run are kept, and by which figures."""

from types import SimpleNamespace
from typing import Any

import pytest
import pytorch_lightning as pl
import torch
from torch import Tensor

from training.data.batch import StereoBatch
from training.metrics import end_point_error
from training.presets import find_preset
from training.runs.callbacks import BestWeights
from training.tasks import RegressorTask

NAN, INFINITY = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("figures", "kept"),
    [
        ((3.0, 2.0, 2.5, 1.0, 1.0), [1, 2, 4]),
        ((None, None, None), [1, 2, 3]),
        ((NAN, NAN, INFINITY), [1, 2, 3]),
        ((INFINITY, NAN, 5.0, 6.0), [1, 2, 3]),
        ((2.0, NAN, 3.0, 1.0), [1, 4]),
        ((2.0, INFINITY, -INFINITY), [1]),
    ],
)
def test_the_latest_weights_until_a_figure_is_finite_then_the_best(
    figures: tuple[float | None, ...], kept: list[int]
) -> None:
    saved: list[int] = []
    task: Any = SimpleNamespace(monitor="validation/epe")
    callback = BestWeights(lambda step, _: saved.append(step))
    for step, figure in enumerate(figures, start=1):
        measured = {} if figure is None else {"validation/epe": torch.tensor(figure)}
        trainer: Any = SimpleNamespace(global_step=step, is_global_zero=True, callback_metrics=measured)
        resumed = BestWeights(lambda step, _: saved.append(step))
        resumed.load_state_dict(callback.state_dict())
        callback = resumed
        callback.on_train_epoch_end(trainer, task)
    assert saved == kept


class _Answers(RegressorTask):
    """A task whose network's error on each frame is known beforehand."""

    def __init__(self) -> None:
        preset: Any = find_preset("regressor", "tiny", "dispnet")
        network: Any = torch.nn.Identity()
        super().__init__(preset, network, steps=1, seed=0)

    def validate_frame(self, batch: StereoBatch) -> tuple[dict[str, float], dict[str, Tensor]]:
        answer = batch.left[:, :1]
        return {"epe": end_point_error(answer, batch.disparity)}, {"disparity": answer}


@pytest.mark.parametrize(
    ("answers", "truths", "epe"),
    [
        ((1.0, 2.0), (0.0, 0.0), 1.5),
        ((1.0, 2.0, 3.0), (0.0, NAN, 0.0), 2.0),  # a frame without truth says nothing
        ((1.0, 2.0), (NAN, NAN), NAN),
        ((1.0, NAN), (0.0, 0.0), NAN),  # a network without an answer does
    ],
)
def test_validation_figures_are_means_over_the_frames_with_truth(
    answers: tuple[float, ...], truths: tuple[float, ...], epe: float
) -> None:
    frames = [
        StereoBatch(
            left=torch.full((3, 2, 2), answer),
            right=torch.zeros(3, 2, 2),
            disparity=torch.full((1, 2, 2), truth),
            gradient=torch.zeros(2, 2, 2),
        )
        for answer, truth in zip(answers, truths, strict=True)
    ]
    trainer = pl.Trainer(
        accelerator="cpu", logger=False, enable_progress_bar=False, enable_checkpointing=False
    )
    (figures,) = trainer.validate(_Answers(), torch.utils.data.DataLoader(frames), verbose=False)
    assert figures["validation/epe"] == pytest.approx(epe, nan_ok=True)
