"""One name for each device, whichever part of the program is asked."""

import pytest
import torch

from training.devices import parse_device
from training.errors import TrainingError, UnknownDeviceError
from training.runs.hardware import trainer_options


@pytest.fixture
def gpus(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """A machine with two GPUs, as torch tells it."""
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    return monkeypatch


@pytest.fixture
def no_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    monkeypatch.setattr(torch.backends.mps, "is_available", lambda: False)


@pytest.mark.usefixtures("gpus")
def test_names_where_there_are_gpus() -> None:
    assert parse_device("auto") == parse_device("cuda") == torch.device("cuda")
    assert parse_device("cuda:1") == torch.device("cuda:1")
    assert parse_device("cpu") == torch.device("cpu")
    with pytest.raises(TrainingError, match=r"^cannot compute on cuda:2: torch finds cuda:0, cuda:1 here$"):
        parse_device("cuda:2")
    assert trainer_options("cuda:1", "16") == {"accelerator": "cuda", "devices": [1], "precision": "16-mixed"}
    assert trainer_options("auto", "32") == {"accelerator": "cuda", "devices": 1, "precision": "32-true"}


@pytest.mark.usefixtures("no_gpu")
def test_names_where_there_is_none() -> None:
    assert parse_device("auto") == torch.device("cpu")
    assert trainer_options("auto", "bf16") == {"accelerator": "cpu", "devices": 1, "precision": "bf16-mixed"}
    for name in ("cuda", "cuda:0", "mps"):
        with pytest.raises(TrainingError, match=f"^cannot compute on {name}: torch finds no .*GPU here"):
            parse_device(name)


@pytest.mark.parametrize("name", ["gpu", "abacus", "", "cpu:0", "cuda:", "cuda:-1", "CUDA", "xpu"])
def test_other_names_are_wrong_usage(name: str) -> None:
    with pytest.raises(
        UnknownDeviceError, match=f"^there is no device '{name}'; it is called auto, cpu, cuda"
    ):
        parse_device(name)
    assert UnknownDeviceError.exit_code == 2
