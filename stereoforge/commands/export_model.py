"""`stereoforge export-model`: trained networks for programs without torch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from stereoforge.bundled_weights import named_weights
from stereoforge.inputs.flag_values import check_max_disparity, shown
from stereoforge.places import check_writable, keep_apart
from stereoforge.progress import console


@dataclass(frozen=True)
class ExportModel:
    """Write the networks of a run folder as one ONNX file, checked with onnxruntime against torch.

    It takes `left` and `right` (B, 3, H, W) in 0..1, of any size whose sides are multiples of 64, and gives `disparity`
    (B, 1, H, W) and, where the folder has the networks, `confidence` (B, 1, H, W) and `gradient` (B, 2, H, W).
    """

    run_folder: Annotated[tyro.conf.Positional[Path], shown("RUN")]
    """Run folder of the networks. paper: the bundled networks of the paper."""
    out: Annotated[Path, shown("DIR")]
    """Folder for stereoforge.onnx and the model card."""
    max_disparity: Annotated[int | None, shown("PX", "192 for CostVolumeNet")] = None
    """Largest disparity in pixels that the model looks for, whatever the pictures' size. DispNetCorr1D looks as far as
    it was trained to."""
    device: Annotated[str, shown("NAME")] = "auto"
    """What torch computes on to compare: auto (cuda where there is such a GPU, else cpu), cpu, cuda, cuda:1 or mps."""

    def run(self) -> None:
        """Write the ONNX file and compare its results with torch's."""
        check_max_disparity(self.max_disparity)
        run = named_weights(self.run_folder)
        keep_apart("--out", self.out, "RUN", run)
        check_writable("--out", self.out)
        from training.prediction.onnx_export import export_model
        from training.runs.model_card import write_model_card

        exported = export_model(run, self.out, self.device, self.max_disparity)
        write_model_card(run, self.out)
        console.print(
            f"{exported.path}: {', '.join(exported.outputs)}; onnxruntime agrees with torch to "
            f"{exported.largest_difference:.1g}",
        )
