"""Which weights of a run are kept."""

from types import SimpleNamespace
from typing import Any

import pytest
import torch

from training.callbacks import BestWeights

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
