"""Errors of the processes that prepare crops are those that the process of the run would raise."""

import os
import signal
from collections.abc import Callable

import pytest
from torch.utils.data import DataLoader, Dataset

from datagen import DatasetError
from training.data.worker_errors import plain_worker_errors
from training.errors import TrainingError


class _Failing(Dataset[int]):
    def __init__(self, fail: Callable[[], None]) -> None:
        self._fail = fail

    def __len__(self) -> int:
        return 4

    def __getitem__(self, index: int) -> int:
        self._fail()
        return index


def raising(error: Exception) -> Callable[[], None]:
    def fail() -> None:
        try:
            raise KeyError("what was met first")
        except KeyError as first:
            raise error from first

    return fail


def read(fail: Callable[[], None], workers: int = 1) -> None:
    with plain_worker_errors():
        list(DataLoader(_Failing(fail), num_workers=workers))


@pytest.mark.parametrize("workers", [0, 2])
def test_errors_of_the_data_are_one_sentence(workers: int) -> None:
    for error in (DatasetError("left/0001.png: is truncated: 3 bytes"), TrainingError("crops: too large")):
        with pytest.raises(type(error)) as caught:
            read(raising(error), workers)
        assert str(caught.value) == str(error)


@pytest.mark.parametrize(
    "fail",
    [
        raising(
            RuntimeError(
                "unable to allocate shared memory(shm) for file </torch_71_2_3>: No space left on device (28)"
            )
        ),
        raising(RuntimeError("unable to write to file </torch_12_3>: No space left on device (28)")),
    ],
)
def test_little_shared_memory_is_said_with_what_helps(fail: Callable[[], None]) -> None:
    with pytest.raises(TrainingError, match=r"/dev/shm is too small .* or train with --workers 0$"):
        read(fail)


@pytest.mark.parametrize("number", [signal.SIGBUS, signal.SIGKILL])
def test_a_worker_that_was_ended_is_a_sentence(number: signal.Signals) -> None:
    """A bus error is how a worker meets the end of a small /dev/shm; torch does not always see the signal."""
    with pytest.raises(TrainingError, match=r"/dev/shm.*--workers 0"):
        read(lambda: os.kill(os.getpid(), number))


def test_faults_of_the_program_stay_what_they_are() -> None:
    with pytest.raises(RuntimeError, match="shapes differ"):
        read(raising(RuntimeError("shapes differ")))
    with pytest.raises(RuntimeError, match=r"^a bus error of its own$"):
        read(raising(RuntimeError("a bus error of its own")), workers=0)
