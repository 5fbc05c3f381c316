"""The networks of a run folder as one ONNX file, which needs neither torch nor this package."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.onnx import OnnxExporterError

from stereoforge_kit.files import temporary_folder, write_bytes
from training.devices import parse_device
from training.errors import TrainingError
from training.networks import ConfNet, GradNet, Regressor
from training.networks.inference import head_inputs
from training.prediction.predictor import StereoPredictor

FILE_NAME = "stereoforge.onnx"
"""Name of the file that is written."""
OPSET = 17
"""Version of ONNX's operators."""
TOLERANCE = 1e-3
"""Largest difference to torch's outputs, relative to their largest value."""


@dataclass(frozen=True)
class ExportedModel:
    """An ONNX file, and how far its outputs were from torch's."""

    path: Path
    """The file."""
    outputs: tuple[str, ...]
    """Names of its outputs."""
    largest_difference: float
    """Largest difference to torch's outputs, relative to their largest value."""


class ExportedNetworks(nn.Module):
    """All networks of a run folder as one module."""

    def __init__(self, regressor: Regressor, confnet: ConfNet | None, gradnet: GradNet | None) -> None:
        super().__init__()
        self.regressor, self.confnet, self.gradnet = regressor, confnet, gradnet

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs, in their order."""
        names = {
            "disparity": True,
            "confidence": self.confnet is not None,
            "gradient": self.gradnet is not None,
        }
        return tuple(name for name, there in names.items() if there)

    def forward(self, left: Tensor, right: Tensor) -> tuple[Tensor, ...]:
        """Predict all maps of the left view.

        Args:
            left, right: (B, 3, H, W) in 0..1, H and W multiples of the regressor's stride.

        Returns:
            Disparity (B, 1, H, W) px, then confidence (B, 1, H, W) and gradient (B, 2, H, W) as [dx, dy], of the
            networks that there are.
        """
        seen = head_inputs(self.regressor, self.confnet, self.gradnet, left, right)
        answers = [seen.regression.disparity]
        if self.confnet is not None:
            answers.append(self.confnet.confidence(*seen.confnet))
        if self.gradnet is not None:
            answers.append(self.gradnet(*seen.gradnet))
        return tuple(answers)


def export_model(
    run: Path, out: Path, device: str = "cpu", max_disparity: int | None = None
) -> ExportedModel:
    """Write `stereoforge.onnx` with the regressor of a run folder, and its ConfNet and GradNet if it has them.

    The model takes images of any size that is a multiple of the regressor's stride. Before the file is kept,
    onnxruntime runs it on two sizes, and the outputs are compared with torch's.

    Args:
        run: Run folder.
        out: Folder for the file.
        device: What torch computes the outputs on that are compared, as `training.devices.parse_device` takes it.
        max_disparity: Largest disparity in pixels that the model looks for, at every image size; None leaves it to the
            regressor.

    Raises:
        TrainingError: no regressor, no such device, damaged weights, a network that ONNX cannot express, or outputs
            that differ.
    """
    chosen = parse_device(device)
    regressor, confnet, gradnet = StereoPredictor(run, max_disparity=max_disparity).networks
    networks = ExportedNetworks(regressor.exportable(), confnet, gradnet).eval()
    with temporary_folder() as folder:
        written = folder / FILE_NAME
        try:
            _write(networks, written)
        except OnnxExporterError as error:
            raise TrainingError(f"{run}: torch cannot write it as ONNX: {_first_sentence(error)}") from error
        difference = max(_compare(networks, written, size, chosen) for size in ((64, 128), (128, 192)))
        if not difference <= TOLERANCE:
            raise TrainingError(f"{run}: onnxruntime's outputs differ from torch's by {difference:.2g}")
        path = out / FILE_NAME
        write_bytes(path, written.read_bytes())
    return ExportedModel(path, networks.outputs, difference)


def _first_sentence(error: Exception) -> str:
    """The first sentence of torch's message, which continues with the whole graph."""
    return re.split(r"[.\n]\s", str(error).strip(), maxsplit=1)[0]


def _write(networks: ExportedNetworks, path: Path) -> None:
    names = ("left", "right", *networks.outputs)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # tracing's remarks about checks of shapes, which hold for any size
        torch.onnx.export(
            networks,
            (torch.rand(1, 3, 64, 128), torch.rand(1, 3, 64, 128)),
            str(path),
            input_names=list(names[:2]),
            output_names=list(names[2:]),
            dynamic_axes={name: {0: "batch", 2: "height", 3: "width"} for name in names},
            opset_version=OPSET,
            dynamo=False,
        )


def _compare(networks: ExportedNetworks, path: Path, size: tuple[int, int], device: torch.device) -> float:
    import onnxruntime

    generator = torch.Generator().manual_seed(0)
    left, right = torch.rand(2, 1, 3, *size, generator=generator)
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    answers = session.run(None, {"left": left.numpy(), "right": right.numpy()})
    # TensorFloat-32, cuDNN's default for convolutions, has three digits.
    with torch.no_grad(), torch.backends.cudnn.flags(allow_tf32=False):
        expected = [maps.cpu() for maps in networks.to(device)(left.to(device), right.to(device))]
    return max(
        float((torch.from_numpy(answer) - truth).abs().max() / truth.abs().max().clamp(min=1))
        for answer, truth in zip(answers, expected, strict=True)
    )
